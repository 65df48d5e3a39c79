//! Frames of a sequence by the numbers in their names.

use std::collections::{BTreeSet, HashMap};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use same_file::Handle;

use crate::error::Error;
use crate::exr_file::output::check_output;
use crate::job::frame_pattern::FramePattern;
use crate::job::neighbours::{FrameFiles, NeighbourFiles};
use crate::job::request::InputRequest;

/// Most frames of one command; more is a slip of the keyboard.
const FRAME_LIMIT: u64 = 1_000_000;

/// A frame of a sequence.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Its number.
    pub number: u32,
    /// Its input.
    pub request: InputRequest,
    /// Its output.
    pub output: PathBuf,
    /// The frames beside it, if they are to help it.
    pub neighbours: Option<NeighbourFiles>,
}

/// The frames of a sequence that are `wanted`, or all whose files exist; `None` when `request` names a single image. Its other half is taken
/// from a sequence, too, if its name holds a place for the number. With `reach` the frames help each other: each is told of so many before and after it, wanted or not,
/// up to one whose file is missing.
///
/// [`Error::Usage`] if only one of the names has a place for the number, or frames are wanted of a single image; [`Error::Invalid`] if there are no frames.
pub fn frames(
    request: &InputRequest,
    output: &Path,
    wanted: Option<Vec<u32>>,
    reach: Option<NonZeroUsize>,
) -> Result<Option<Vec<Frame>>, Error> {
    let outputs = FramePattern::parse(output);
    let Some(inputs) = FramePattern::parse(&request.path) else {
        return match wanted {
            None => Ok(None),
            Some(_) => Err(Error::Usage(format!(
                "{} has no place for the frame number (####, %04d or $F4), so no frames can be asked for",
                request.path.display()
            ))),
        };
    };
    let outputs = outputs.ok_or_else(|| {
            Error::Usage(format!(
                "{} is a sequence, so the output {} needs a place for the frame number too (####, %04d or $F4)",
                request.path.display(),
                output.display()
            ))
        })?;
    let existing = match (&wanted, reach) {
        (Some(_), None) => Vec::new(),
        _ => inputs.existing()?,
    };
    let frames = wanted.unwrap_or_else(|| existing.clone());
    if frames.is_empty() {
        return Err(Error::Invalid(format!(
            "{}: no such frames",
            request.path.display()
        )));
    }
    let others = request.other_half.as_deref().and_then(FramePattern::parse);
    let shot = Shot {
        inputs,
        others,
        existing: existing.into_iter().collect(),
    };
    let frame = |number| {
        let mut request = request.clone();
        let files = shot.files(number);
        request.path = files.path;
        request.other_half = files.other_half.or(request.other_half);
        Frame {
            number,
            request,
            output: outputs.path(number),
            neighbours: reach.map(|reach| shot.beside(number, reach)),
        }
    };
    let frames: Vec<Frame> = frames.into_iter().map(frame).collect();
    Ok(Some(frames))
}

/// The files of a sequence.
struct Shot {
    inputs: FramePattern,
    others: Option<FramePattern>,
    existing: BTreeSet<u32>,
}

impl Shot {
    fn files(&self, number: u32) -> FrameFiles {
        FrameFiles {
            path: self.inputs.path(number),
            other_half: self.others.as_ref().map(|others| others.path(number)),
        }
    }

    /// The frames beside one. On each side the last may be one that is missing, if the sequence goes on beyond it.
    fn beside(&self, number: u32, reach: NonZeroUsize) -> NeighbourFiles {
        let reach = u32::try_from(reach.get()).unwrap_or(u32::MAX);
        let first = self.existing.first().copied().unwrap_or(number);
        let last = self.existing.last().copied().unwrap_or(number);
        let before = number.saturating_sub(reach).max(first)..number;
        let after = number.saturating_add(1)..=number.saturating_add(reach).min(last);
        NeighbourFiles {
            before: self.up_to_a_gap(before.rev()),
            after: self.up_to_a_gap(after),
        }
    }

    fn up_to_a_gap(&self, numbers: impl Iterator<Item = u32>) -> Vec<FrameFiles> {
        let mut goes_on = true;
        let known = numbers
            .take_while(|number| std::mem::replace(&mut goes_on, self.existing.contains(number)));
        known.map(|number| self.files(number)).collect()
    }
}

/// The files of the frames beside the single image of `request`. `before` and `after` name them, nearest first; or each of them is a pattern, of which
/// those up to `reach` before or after the image are taken. The image's number is what the pattern makes of its name, or else the last digits in it. Their other halves go by the
/// number, too.
///
/// [`Error::Usage`] if an image has no number and needs one, or there are more files than `reach`.
pub fn frames_beside(
    request: &InputRequest,
    before: &[PathBuf],
    after: &[PathBuf],
    reach: NonZeroUsize,
) -> Result<NeighbourFiles, Error> {
    Ok(NeighbourFiles {
        before: one_side(request, before, reach, |files| files.before)?,
        after: one_side(request, after, reach, |files| files.after)?,
    })
}

fn one_side(
    request: &InputRequest,
    given: &[PathBuf],
    reach: NonZeroUsize,
    side: fn(NeighbourFiles) -> Vec<FrameFiles>,
) -> Result<Vec<FrameFiles>, Error> {
    if let [path] = given
        && let Some(inputs) = FramePattern::parse(path)
    {
        let number = number_of(&request.path, &inputs)?;
        let other = request.other_half.as_deref();
        let others = other.map(pattern_of_halves).transpose()?;
        let existing: BTreeSet<u32> = inputs.existing()?.into_iter().collect();
        if existing.is_empty() {
            return Err(Error::Usage(format!(
                "{}: no file has such a name: what should stand beside {} is not there",
                path.display(),
                request.path.display()
            )));
        }
        let shot = Shot {
            inputs,
            others,
            existing,
        };
        return Ok(side(shot.beside(number, reach)));
    }
    if given.len() > reach.get() {
        return Err(Error::Usage(format!(
            "{} frames are given where up to {reach} may help",
            given.len()
        )));
    }
    if let (Some(first), Some(_)) = (given.first(), &request.other_half) {
        return Err(Error::Usage(format!(
            "{} has another half, which is found by its number: name it by a pattern, such as shot.####.exr",
            first.display()
        )));
    }
    let files = given.iter().map(|path| FrameFiles {
        path: path.clone(),
        other_half: None,
    });
    Ok(files.collect())
}

/// The number of an image beside which are the frames of a pattern.
fn number_of(path: &Path, frames: &FramePattern) -> Result<u32, Error> {
    let name = path.file_name().and_then(|name| name.to_str());
    let number = name.and_then(|name| frames.frame_of(name));
    let number = number.or_else(|| Some(FramePattern::around(path)?.1));
    number.ok_or_else(|| {
        Error::Usage(format!(
            "{} has no number in its name, so it is not known which frames are beside it: name them one by one, the nearest first",
            path.display()
        ))
    })
}

/// The pattern of the other halves of all frames, by that of one.
fn pattern_of_halves(path: &Path) -> Result<FramePattern, Error> {
    let pattern = FramePattern::around(path).map(|(pattern, _)| pattern);
    pattern.ok_or_else(|| {
        Error::Usage(format!(
            "{} has no number in its name, so the other halves of the frames beside it are not known",
            path.display()
        ))
    })
}

/// Refuses outputs that are files of which any of the frames is made: others would be made of what was denoised, or of nothing. [`Error::Usage`] then.
pub fn check_outputs(frames: &[Frame]) -> Result<(), Error> {
    let mut written = HashMap::new();
    for output in frames.iter().map(|frame| frame.output.as_path()) {
        let mut unfinished = output.as_os_str().to_owned();
        unfinished.push(".part");
        for path in [output, Path::new(&unfinished)] {
            written.extend(identity(path).map(|identity| (identity, output)));
        }
    }
    // as a rule none of them is there yet
    if written.is_empty() {
        return Ok(());
    }
    for Frame {
        request,
        neighbours,
        ..
    } in frames
    {
        let own = std::iter::once(&request.path).chain(&request.other_half);
        let beside = neighbours
            .iter()
            .flat_map(|of| of.before.iter().chain(&of.after));
        let beside = beside.flat_map(|of| std::iter::once(&of.path).chain(&of.other_half));
        for input in own.chain(beside) {
            let output = identity(input).and_then(|input| written.get(&input));
            if let Some(output) = output {
                check_output(output, &[input])?;
            }
        }
    }
    Ok(())
}

/// A number that a file has under all of its names; others hardly ever have the same.
fn identity(path: &Path) -> Option<u64> {
    let mut hasher = DefaultHasher::new();
    Handle::from_path(path).ok()?.hash(&mut hasher);
    Some(hasher.finish())
}

/// Parses `1-100x2,205`: ranges with an optional step, and single frames, joined by commas. A step may also be written `1-100:2`, as Open Job
/// Description does. [`Error::Usage`] otherwise.
pub fn parse_frames(text: &str) -> Result<Vec<u32>, Error> {
    let usage = || {
        Error::Usage(format!(
            "{text:?}: expected frames such as 7, 1-100 or 1-100x2, joined by commas"
        ))
    };
    let number = |text: &str| text.trim().parse::<u32>().map_err(|_| usage());
    let mut frames = Vec::new();
    for range in text.split(',') {
        let (range, step) = range.split_once(['x', ':']).unwrap_or((range, "1"));
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let (first, last, step) = (number(first)?, number(last)?, number(step)?);
        if step == 0 || last < first {
            return Err(usage());
        }
        if frames.len() as u64 + u64::from((last - first) / step) >= FRAME_LIMIT {
            return Err(Error::Usage(format!(
                "{text:?}: more than {FRAME_LIMIT} frames"
            )));
        }
        frames.extend((first..=last).step_by(step as usize));
    }
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_ranges_with_steps() {
        for text in ["1-10x3,7, 20", "1-10:3,7,20-20"] {
            assert_eq!(parse_frames(text).unwrap(), [1, 4, 7, 10, 7, 20], "{text}");
        }
        for text in ["", "5-1", "1-9x0", "1-9x2:2", "a", "1-", "0-4000000000"] {
            assert!(parse_frames(text).is_err(), "{text}");
        }
    }
}
