//! Rows that are put aside, to be read again from top to bottom.

use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use tempfile::{SpooledTempFile, spooled_tempfile, spooled_tempfile_in};

use crate::error::Error;

/// Where an image is put aside between the steps: some 40 bytes for each pixel.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Scratch {
    /// In memory.
    Memory,
    /// In a file in this directory, which has no name where the system allows that: nothing is left behind, however the process ends.
    Directory(PathBuf),
}

/// Rows of so many planes of 4 bytes each, without a name.
#[derive(Debug)]
pub(super) struct RowFile {
    file: SpooledTempFile,
    /// Where it is, for errors.
    place: String,
    row_bytes: u64,
}

impl RowFile {
    /// Rows of `planes` planes of `width` values.
    pub(super) fn new(scratch: &Scratch, width: usize, planes: usize) -> Self {
        let (file, place) = match scratch {
            Scratch::Memory => (spooled_tempfile(usize::MAX), "memory".to_owned()),
            // it is created with the first row
            Scratch::Directory(directory) => (
                spooled_tempfile_in(0, directory),
                format!("a temporary file in {}", directory.display()),
            ),
        };
        let row_bytes = (size_of::<f32>() * planes) as u64 * width as u64;
        Self {
            file,
            place,
            row_bytes,
        }
    }

    /// Puts another row below the last; its planes make up a row.
    pub(super) fn push<T: bytemuck::NoUninit>(&mut self, planes: &[&[T]]) -> Result<(), Error> {
        for plane in planes {
            let bytes = bytemuck::cast_slice(plane);
            self.file.write_all(bytes).map_err(|source| Error::Write {
                context: format!("cannot write to {}", self.place),
                source,
            })?;
        }
        Ok(())
    }

    /// Reads row `y`, all planes of it, which `row` has room for.
    pub(super) fn read<T: bytemuck::Pod>(&mut self, y: usize, row: &mut [T]) -> Result<(), Error> {
        let start = SeekFrom::Start(y as u64 * self.row_bytes);
        let file = &mut self.file;
        file.seek(start)
            .and_then(|_| file.read_exact(bytemuck::cast_slice_mut(row)))
            .map_err(|source| Error::Read {
                context: format!("cannot read back from {}", self.place),
                source,
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_in_any_order_from_memory_and_from_a_file() {
        let directory = tempfile::tempdir().unwrap();
        for scratch in [
            Scratch::Memory,
            Scratch::Directory(directory.path().to_owned()),
        ] {
            let mut rows = RowFile::new(&scratch, 3, 2);
            for y in 0..5 {
                let y = y as f32;
                rows.push(&[&[y, y, y], &[y, 1.0, 2.0]]).unwrap();
            }
            let mut row = [0.0_f32; 6];
            for y in [4, 0, 2] {
                rows.read(y, &mut row).unwrap();
                let y = y as f32;
                assert_eq!(row, [y, y, y, y, 1.0, 2.0]);
            }
            assert!(rows.read(5, &mut row).is_err());
        }
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_directory_that_is_not_there_is_told_by_name() {
        let scratch = Scratch::Directory("/no/such/place".into());
        let error = RowFile::new(&scratch, 1, 1)
            .push(&[&[0.0_f32]])
            .unwrap_err();
        assert!(error.to_string().contains("/no/such/place"), "{error}");
    }
}
