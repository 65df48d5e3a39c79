//! The frames that a command asks for.

use std::path::{Path, PathBuf};

use linpred::Error;
use linpred::job::{FramePattern, InputRequest};

/// A frame that a command asks for.
pub(crate) struct Frame {
    /// Its number.
    pub(crate) number: u32,
    /// Its input.
    pub(crate) request: InputRequest,
    /// Its output.
    pub(crate) output: PathBuf,
}

/// Each frame; `None` when the names hold no place for a frame number.
pub(crate) fn find(
    request: &InputRequest,
    output: &Path,
    wanted: Option<Vec<u32>>,
) -> Result<Option<Vec<Frame>>, Error> {
    let outputs = FramePattern::parse(output);
    let Some(inputs) = FramePattern::parse(&request.path) else {
        return match wanted {
            None => Ok(None),
            Some(_) => Err(Error::Usage(format!(
                "--frames: {} has no place for the frame number (####, %04d or $F4)",
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
    let frames = match wanted {
        Some(frames) => frames,
        None => inputs.existing()?,
    };
    if frames.is_empty() {
        return Err(Error::Invalid(format!(
            "{}: no such frames",
            request.path.display()
        )));
    }
    let others = request.other_half.as_deref().and_then(FramePattern::parse);
    let frame = |number| {
        let mut request = request.clone();
        request.path = inputs.path(number);
        if let Some(others) = &others {
            request.other_half = Some(others.path(number));
        }
        Frame {
            number,
            request,
            output: outputs.path(number),
        }
    };
    Ok(Some(frames.into_iter().map(frame).collect()))
}
