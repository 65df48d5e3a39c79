//! Bands into an image, without decoding them.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::Error;
use crate::exr_file::attributes::{
    Attributes, INPUT_ATTRIBUTE, NEIGHBOURS_ATTRIBUTE, OPTIONS_ATTRIBUTE, VERSION_ATTRIBUTE,
};
use crate::exr_file::grid::ChunkGrid;
use crate::exr_file::output::check_output;
use crate::exr_file::writer::{ExrWriter, OutputPart};
use crate::exr_file::{ExrFile, Part};
use crate::job::band::{BAND_ATTRIBUTE, WHOLE_ATTRIBUTE};
use crate::job::output_name::check_output_name;

/// Attributes in which the bands of an image differ.
const OWN_ATTRIBUTES: [&str; 3] = ["dataWindow", "chunkCount", BAND_ATTRIBUTE];

/// Puts the bands of an image together, in whatever order they are given.
///
/// [`Error::Usage`] if `output` has the name of another format, [`Error::Invalid`] if one is no band, they are not of one image, rows are missing or doubled; [`Error::Cancelled`] once
/// `stop` is set.
pub fn stitch(bands: &[&Path], output: &Path, stop: &AtomicBool) -> Result<(), Error> {
    check_output_name(output)?;
    check_output(output, bands)?;
    let mut files = bands
        .iter()
        .map(|path| ExrFile::open(path))
        .collect::<Result<Vec<_>, Error>>()?;
    files.sort_by_key(|file| top(&file.parts()[0]));
    let Some(first) = files.first() else {
        return Err(Error::Usage("stitch: no bands".into()));
    };
    let wholes = first
        .parts()
        .iter()
        .map(|part| whole_part(first, part))
        .collect::<Result<Vec<_>, Error>>()?;
    for file in &files {
        check_alike(first, file)?;
        for (part, whole) in file.parts().iter().zip(&wholes) {
            check_rows(&files, file, part, whole)?;
        }
    }
    let parts = first
        .parts()
        .iter()
        .zip(&wholes)
        .map(|(part, whole)| whole.output(part))
        .collect();
    let mut writer = ExrWriter::create(output, first.version(), parts)?;
    for (part, whole) in wholes.iter().enumerate() {
        for file in &files {
            let described = &file.parts()[part];
            let above = (top(described) - whole.top) as usize;
            let before = whole.grid.chunk_row(above) * whole.grid.columns();
            for index in file.chunks_in_file_order(part) {
                if stop.load(Ordering::Relaxed) {
                    return Err(Error::Cancelled);
                }
                writer.copy_chunk((part, before + index), file, (part, index))?;
            }
        }
    }
    writer.finish()
}

/// The first row of a part's data window.
fn top(part: &Part) -> i64 {
    i64::from(part.data_window().position.1)
}

/// A part of the whole image.
struct WholePart {
    top: i64,
    rows: usize,
    grid: ChunkGrid,
    window: Vec<u8>,
}

impl WholePart {
    fn output(&self, part: &Part) -> OutputPart {
        let mut attributes = part.attributes.clone();
        let chunks = self.grid.rows() * self.grid.columns();
        attributes.remove(BAND_ATTRIBUTE);
        attributes.remove(WHOLE_ATTRIBUTE);
        attributes.set("dataWindow", "box2i", self.window.clone());
        if attributes.int("chunkCount").is_some() {
            attributes.set("chunkCount", "int", (chunks as i32).to_le_bytes().to_vec());
        }
        OutputPart {
            attributes,
            shape: part.shape,
            grid: self.grid,
            chunks,
        }
    }
}

/// The part that the first band, which is the topmost, says it is of.
fn whole_part(file: &ExrFile, part: &Part) -> Result<WholePart, Error> {
    let no_band = || {
        Error::Invalid(format!(
            "{}: {}: is no band (it has no attribute {WHOLE_ATTRIBUTE})",
            file.path().display(),
            part.label()
        ))
    };
    let window = part
        .attributes
        .value(WHOLE_ATTRIBUTE, "box2i")
        .ok_or_else(no_band)?
        .to_vec();
    let row = |at: usize| {
        Some(i64::from(i32::from_le_bytes(
            window.get(at..at + 4)?.try_into().ok()?,
        )))
    };
    let (first, last) = row(4).zip(row(12)).ok_or_else(no_band)?;
    let rows = usize::try_from(last - first + 1).map_err(|_| no_band())?;
    if rows < part.header.layer_size.1 || top(part) != first || part.grid.has_levels() {
        return Err(Error::Invalid(format!(
            "{}: {}: the topmost band begins at row {}, the whole image at row {first}",
            file.path().display(),
            part.label(),
            top(part)
        )));
    }
    // as many chunks as the bands have between them: no more than their files could hold
    Ok(WholePart {
        top: first,
        rows,
        grid: part.grid.restricted(0, rows),
        window,
    })
}

/// Bands of one image have the same parts with the same attributes but for those that tell the bands apart.
fn check_alike(first: &ExrFile, file: &ExrFile) -> Result<(), Error> {
    let common = |attributes: &Attributes| {
        let mut attributes = attributes.clone();
        OWN_ATTRIBUTES
            .iter()
            .for_each(|name| attributes.remove(name));
        attributes
    };
    let columns = |part: &Part| (part.data_window().position.0, part.data_window().size.0);
    let differs = |name: &str| {
        let value = |file: &ExrFile| {
            let mut parts = file.parts().iter();
            parts.find_map(|part| part.attributes.string(name).map(str::to_owned))
        };
        value(first) != value(file)
    };
    for (name, what) in [
        (VERSION_ATTRIBUTE, "were made by other versions of linpred"),
        (OPTIONS_ATTRIBUTE, "were made with other settings"),
        (INPUT_ATTRIBUTE, "were made of other inputs"),
        (NEIGHBOURS_ATTRIBUTE, "were helped by other frames"),
    ] {
        if differs(name) {
            return Err(Error::Invalid(format!(
                "{} and {} {what} (attribute {name}): denoise the bands of one image alike",
                first.path().display(),
                file.path().display()
            )));
        }
    }
    let alike = first.version() == file.version()
        && first.parts().len() == file.parts().len()
        && first.parts().iter().zip(file.parts()).all(|(a, b)| {
            columns(a) == columns(b) && common(&a.attributes) == common(&b.attributes)
        });
    match alike {
        true => Ok(()),
        false => Err(Error::Invalid(format!(
            "{} and {} are not bands of one image: their parts or attributes differ",
            first.path().display(),
            file.path().display()
        ))),
    }
}

/// Each band begins where the one above it ends, on a chunk, and the last ends where the whole image does.
fn check_rows(
    files: &[ExrFile],
    file: &ExrFile,
    part: &Part,
    whole: &WholePart,
) -> Result<(), Error> {
    let end = |part: &Part| top(part) + part.header.layer_size.1 as i64;
    let whole_end = whole.top + whole.rows as i64;
    let below = files
        .iter()
        .skip_while(|other| !std::ptr::eq(*other, file))
        .nth(1);
    let next = below.map_or(whole_end, |below| top(&below.parts()[part.index]));
    let problem = if end(part) < next {
        format!("rows {} to {} are in no band", end(part), next - 1)
    } else if end(part) > next {
        format!("rows {next} to {} are in two bands", end(part) - 1)
    } else if !((top(part) - whole.top) as usize).is_multiple_of(whole.grid.chunk_height()) {
        format!("begins inside a chunk, at row {}", top(part))
    } else {
        return Ok(());
    };
    Err(Error::Invalid(format!(
        "{}: {}: {problem}",
        file.path().display(),
        part.label()
    )))
}
