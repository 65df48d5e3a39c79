//! Names of files with a place for the number of a frame.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::error::Error;

/// A file name with a place for the frame number: `shot.####.exr`, `shot.%04d.exr` or `shot.$F4.exr`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FramePattern {
    folder: PathBuf,
    before: String,
    digits: usize,
    after: String,
}

impl FramePattern {
    /// The pattern in a path's last component. `None` if there is none, or if a file of exactly this name exists.
    pub fn parse(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let (start, end, digits) = find_hashes(name)
            .or_else(|| find_printf(name))
            .or_else(|| find_dollar(name))?;
        if path.exists() {
            return None;
        }
        Some(Self {
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            before: name[..start].to_owned(),
            digits,
            after: name[end..].to_owned(),
        })
    }

    /// The path of a frame.
    pub fn path(&self, frame: u32) -> PathBuf {
        let Self {
            before,
            digits,
            after,
            ..
        } = self;
        self.folder.join(format!("{before}{frame:0digits$}{after}"))
    }

    /// The pattern of which a file's own name is one frame: its last digits before the extension are the number. `None` if it has none.
    pub(super) fn around(path: &Path) -> Option<(Self, u32)> {
        let name = path.file_name()?.to_str()?;
        let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
        let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
        let start = stem[..end].rfind(|c: char| !c.is_ascii_digit());
        let start = start.map_or(0, |at| {
            at + stem[at..].chars().next().map_or(1, char::len_utf8)
        });
        let pattern = Self {
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            before: name[..start].to_owned(),
            digits: end - start,
            after: name[end..].to_owned(),
        };
        Some((pattern, name[start..end].parse().ok()?))
    }

    /// The frames whose files exist, in order.
    pub fn existing(&self) -> Result<Vec<u32>, Error> {
        let folder = if self.folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            &self.folder
        };
        let read_error = |source| Error::Read {
            context: format!("cannot list {}", folder.display()),
            source,
        };
        let mut frames = BTreeSet::new();
        for entry in std::fs::read_dir(folder).map_err(read_error)? {
            let name = entry.map_err(read_error)?.file_name();
            frames.extend(name.to_str().and_then(|name| self.frame_of(name)));
        }
        Ok(frames.into_iter().collect())
    }

    pub(super) fn frame_of(&self, name: &str) -> Option<u32> {
        let number = name.strip_prefix(&self.before)?.strip_suffix(&self.after)?;
        let frame: u32 = number
            .bytes()
            .all(|b| b.is_ascii_digit())
            .then(|| number.parse().ok())??;
        // a number that would be written otherwise is another sequence's
        (format!("{frame:0width$}", width = self.digits) == number).then_some(frame)
    }
}

/// `####`: as many digits as there are hashes. The last run counts.
fn find_hashes(name: &str) -> Option<(usize, usize, usize)> {
    let end = name.rfind('#')? + 1;
    let start = name[..end].rfind(|c| c != '#').map_or(0, |at| {
        at + name[at..].chars().next().map_or(1, char::len_utf8)
    });
    Some((start, end, end - start))
}

/// `%04d` or `%d`.
fn find_printf(name: &str) -> Option<(usize, usize, usize)> {
    name.match_indices('%').find_map(|(start, _)| {
        let rest = &name[start + 1..];
        let digits = rest.find(|c: char| !c.is_ascii_digit())?;
        let width = if digits == 0 {
            1
        } else {
            rest[..digits].parse().ok().filter(|width| *width <= 9)?
        };
        rest[digits..]
            .starts_with('d')
            .then_some((start, start + digits + 2, width))
    })
}

/// `$F4` or `$F`.
fn find_dollar(name: &str) -> Option<(usize, usize, usize)> {
    let start = name.find("$F")?;
    let rest = &name[start + 2..];
    match rest.bytes().next().filter(u8::is_ascii_digit) {
        Some(digit) => Some((start, start + 3, usize::from(digit - b'0').max(1))),
        None => Some((start, start + 2, 1)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spelling_of_a_pattern_names_the_same_file() {
        for pattern in ["a/shot.####.exr", "a/shot.%04d.exr", "a/shot.$F4.exr"] {
            let pattern = FramePattern::parse(Path::new(pattern)).unwrap();
            assert_eq!(pattern.path(37), Path::new("a/shot.0037.exr"));
            assert_eq!(pattern.frame_of("shot.0037.exr"), Some(37));
            assert_eq!(pattern.frame_of("shot.12345.exr"), Some(12345));
            assert_eq!(pattern.frame_of("shot.037.exr"), None);
            assert_eq!(pattern.frame_of("shot.+037.exr"), None);
        }
        for pattern in ["s#.exr", "s%d.exr", "s$F.exr"] {
            assert_eq!(
                FramePattern::parse(Path::new(pattern)).unwrap().path(5),
                Path::new("s5.exr")
            );
        }
        for plain in ["shot.exr", "100%.exr", "a$b.exr", "%x.exr"] {
            assert_eq!(FramePattern::parse(Path::new(plain)), None, "{plain}");
        }
    }
}
