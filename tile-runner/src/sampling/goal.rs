//! What a map is to reach.

use std::fmt;

use crate::error::Error;

/// The most samples that a goal may ask for, or a pixel get: beyond, `f32` has no longer every whole number.
pub const MOST_SAMPLES: u32 = 1 << 24;

/// How many samples to spend, or the error to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    pub(super) budget: Option<f64>,
    pub(super) error: Option<f64>,
}

impl Goal {
    /// So many samples more for each pixel, on average. [`Error::Usage`] unless above 0, and [`MOST_SAMPLES`] or less.
    pub fn budget(samples: f64) -> Result<Self, Error> {
        let (budget, error) = (Some(checked_budget(samples)?), None);
        Ok(Self { budget, error })
    }

    /// As few samples as it takes until the predicted error is so small: the mean over the pixels of the estimated squared error over the mean square of the colour and 0.003.
    /// [`Error::Usage`] unless it is a number above 0.
    pub fn error(error: f64) -> Result<Self, Error> {
        if !(error > 0.0 && error.is_finite()) {
            return Err(Error::Usage(format!(
                "a target error of {error}: it is a number above 0, such as 0.005"
            )));
        }
        let (budget, error) = (None, Some(error));
        Ok(Self { budget, error })
    }

    /// The same with no more than so many samples for each pixel, on average. Errors as for [`budget`](Self::budget).
    pub fn at_most(self, samples: f64) -> Result<Self, Error> {
        let budget = Some(checked_budget(samples)?);
        Ok(Self { budget, ..self })
    }
}

impl Goal {
    /// The goal of options that may both be given: no more than the budget then. [`Error::Usage`] if neither is; and the errors of [`budget`](Self::budget) and
    /// [`error`](Self::error).
    pub fn of(budget: Option<f64>, error: Option<f64>) -> Result<Self, Error> {
        match (budget, error) {
            (Some(budget), Some(error)) => Self::error(error)?.at_most(budget),
            (None, Some(error)) => Self::error(error),
            (Some(budget), None) => Self::budget(budget),
            (None, None) => Err(Error::Usage(
                "a map needs a budget, a target error, or both".into(),
            )),
        }
    }
}

impl fmt::Display for Goal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.budget, self.error) {
            (Some(budget), Some(error)) => write!(f, "error {error}, budget {budget}"),
            (Some(budget), None) => write!(f, "budget {budget}"),
            (None, Some(error)) => write!(f, "error {error}"),
            // no constructor leaves both out
            (None, None) => write!(f, "nothing"),
        }
    }
}

fn checked_budget(samples: f64) -> Result<f64, Error> {
    match samples > 0.0 && samples <= f64::from(MOST_SAMPLES) {
        true => Ok(samples),
        false => Err(Error::Usage(format!(
            "a budget of {samples} samples per pixel: it is a number above 0, and {MOST_SAMPLES} or less"
        ))),
    }
}
