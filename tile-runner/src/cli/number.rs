//! Numbers as people write them, and what they are told if they do not.

use std::num::{NonZeroU32, NonZeroUsize};
use std::str::FromStr;

use crate::Error;
use crate::job::MOST_REACH;
use crate::sampling::Goal;

/// Parses a number of threads.
pub(crate) fn parse_threads(text: &str) -> Result<NonZeroUsize, Error> {
    parse(
        text,
        "write 1 or more, or leave it out for one thread on each processor",
    )
}

/// Parses a number of samples per pixel.
pub(crate) fn parse_spp(text: &str) -> Result<NonZeroU32, Error> {
    parse(
        text,
        "write 1 or more, or leave it out for what the file states",
    )
}

/// Parses a number of models that must predict a pixel.
pub(crate) fn parse_coverage(text: &str) -> Result<u16, Error> {
    let advice = "write a number from 1 to 1024, or leave it out for that of --quality";
    let number = parse(text, advice)?;
    match number {
        1..=1024 => Ok(number),
        _ => Err(Error::Usage(advice.into())),
    }
}

/// Parses a number of frames on each side that help.
pub(crate) fn parse_reach(text: &str) -> Result<NonZeroUsize, Error> {
    let advice = format!("write a number of frames from 1 to {MOST_REACH}, or leave it out");
    let reach = parse(text, &advice)?;
    match reach <= MOST_REACH {
        true => Ok(reach),
        false => Err(Error::Usage(advice)),
    }
}

/// Parses samples per pixel, on average.
pub(crate) fn parse_budget(text: &str) -> Result<f64, Error> {
    let samples = parse(text, "write a number above 0, such as 8")?;
    Goal::budget(samples).map(|_| samples)
}

/// Parses a relative error.
pub(crate) fn parse_error(text: &str) -> Result<f64, Error> {
    let error = parse(text, "write a number above 0, such as 0.005")?;
    Goal::error(error).map(|_| error)
}

fn parse<T: FromStr>(text: &str, advice: &str) -> Result<T, Error> {
    text.parse().map_err(|_| Error::Usage(advice.into()))
}
