//! A file that appears under its name only when it is complete.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use same_file::{Handle, is_same_file};

use crate::error::Error;

/// Writes to `<path>.part` and renames it to `<path>` at the end; removes it when dropped before.
///
/// The `.part` is held under the system's file lock, which dies with its process: a `.part` that can be locked was left by a
/// killed job and is replaced, one that cannot is another process's work and an error.
#[derive(Debug)]
pub struct OutputFile {
    path: PathBuf,
    unfinished: PathBuf,
    writer: Option<BufWriter<File>>,
    position: u64,
}

impl OutputFile {
    /// Takes possession of `<path>.part`, empty. [`Error::Write`] if that fails or another process holds it.
    pub fn create(path: &Path) -> Result<Self, Error> {
        if std::fs::metadata(path).is_ok_and(|kind| !kind.is_file()) {
            return Err(Error::Usage(format!(
                "the output {} exists and is not a file",
                path.display()
            )));
        }
        let mut name = path
            .file_name()
            .ok_or_else(|| {
                Error::Usage(format!(
                    "the output {} is not the name of a file",
                    path.display()
                ))
            })?
            .to_owned();
        name.push(".part");
        let unfinished = path.with_file_name(name);
        let file = claim(&unfinished).map_err(|source| Error::Write {
            context: format!("cannot write {}", path.display()),
            source,
        })?;
        Ok(Self {
            path: path.to_owned(),
            unfinished,
            writer: Some(BufWriter::new(file)),
            position: 0,
        })
    }

    /// The name that the file will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes written so far.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Appends bytes.
    pub fn append(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let result = self.writer().write_all(bytes);
        self.position += bytes.len() as u64;
        result.map_err(|source| self.error(source))
    }

    /// Overwrites bytes that were written before.
    pub fn patch(&mut self, at: u64, bytes: &[u8]) -> Result<(), Error> {
        let end = self.position;
        let writer = self.writer();
        let result = writer
            .seek(SeekFrom::Start(at))
            .and_then(|_| writer.write_all(bytes))
            .and_then(|()| writer.seek(SeekFrom::Start(end)).map(drop));
        result.map_err(|source| self.error(source))
    }

    /// Completes the file and gives it its name.
    pub fn finish(mut self) -> Result<(), Error> {
        self.writer().flush().map_err(|source| self.error(source))?;
        std::fs::rename(&self.unfinished, &self.path).map_err(|source| self.error(source))?;
        // only now may the lock go: nobody may take the .part for abandoned before it has its name
        self.writer = None;
        Ok(())
    }

    /// The error that a failed write is reported as.
    pub fn error(&self, source: std::io::Error) -> Error {
        Error::Write {
            context: format!("cannot write {}", self.path.display()),
            source,
        }
    }

    fn writer(&mut self) -> &mut BufWriter<File> {
        self.writer
            .as_mut()
            .expect("taken only by finish, which consumes the file")
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let count = self.writer().write(bytes)?;
        self.position += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.writer().flush()
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if let Some(writer) = self.writer.take() {
            // Removed while its lock is held. The buffer's rest is thrown away, not flushed to a disk that may be full.
            let (file, _rest) = writer.into_parts();
            let _ = std::fs::remove_file(&self.unfinished);
            drop(file);
        }
    }
}

/// Opens, locks and empties the file at `path`.
fn claim(path: &Path) -> std::io::Result<File> {
    let busy = || std::io::Error::new(ErrorKind::ResourceBusy, "another process is writing it");
    // its holder may rename or remove it between our opening and our locking it: then what we hold is not at `path` any more
    for _ in 0..16 {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            // a file system without locks cannot tell us of others: go on as one would without them
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(error),
            Err(TryLockError::WouldBlock) => return Err(busy()),
        }
        let held = Handle::from_file(file.try_clone()?)?;
        if Handle::from_path(path).is_ok_and(|at_path| at_path == held) {
            file.set_len(0)?;
            return Ok(file);
        }
    }
    Err(busy())
}

/// Refuses an `output` that is one of the inputs, by whatever name, or whose unfinished file would be.
pub fn check_output(output: &Path, inputs: &[&Path]) -> Result<(), Error> {
    let mut unfinished = output.as_os_str().to_owned();
    unfinished.push(".part");
    for input in inputs {
        let same = |path: &Path| is_same_file(path, input).unwrap_or(false);
        if same(output) || same(Path::new(&unfinished)) {
            return Err(Error::Usage(format!(
                "the output {} is the input {}: the input is read until the end, so it cannot be replaced on the way",
                output.display(),
                input.display()
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_output_may_not_be_the_input_by_another_name() {
        let folder = std::env::temp_dir().join(format!("linpred-same-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (input, link) = (folder.join("in.exr"), folder.join("link.exr"));
        std::fs::write(&input, b"x").unwrap();
        std::fs::hard_link(&input, &link).unwrap();
        assert!(matches!(
            check_output(&link, &[&input]),
            Err(Error::Usage(_))
        ));
        assert!(check_output(&folder.join("out.exr"), &[&input]).is_ok());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
