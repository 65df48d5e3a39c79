//! What to compute, and on what.

use std::num::NonZeroUsize;

use linpred::{Formulas, Options, Params, Quality};

use crate::handle::{call, linpred_denoiser};
use crate::status::{Failure, linpred_status};
use crate::versioned::{self, Versioned};

/// How well a pixel must be predicted before no new model is built for it.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum linpred_quality {
    /// LINPRED_QUALITY_BALANCED.
    LINPRED_QUALITY_DEFAULT = 0,
    /// Well by one model.
    LINPRED_QUALITY_FAST = 4,
    /// Well by three.
    LINPRED_QUALITY_BALANCED = 5,
    /// Well by sixteen.
    LINPRED_QUALITY_HIGH = 6,
}

/// Which formulas fit, choose and blend the models.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum linpred_formulas {
    /// linpred's own.
    LINPRED_FORMULAS_ROBUST = 0,
    /// Those of the papers to the letter, to compare with.
    LINPRED_FORMULAS_LITERAL = 1,
}

/// What to compute, and on what. LINPRED_OPTIONS_INIT sets the size and every default; 0 is the default of each
/// member.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct linpred_options {
    /// sizeof(linpred_options).
    pub struct_size: usize,
    /// One of linpred_quality.
    pub quality: i32,
    /// One of linpred_formulas. The literal ones know no quality.
    pub formulas: i32,
    /// How many good models predict a pixel before no new one is built for it, up to 65535; 0 leaves it to the
    /// quality.
    pub coverage: u32,
    /// Threads that compute, on which no bit depends; 0 takes as many as there are processors.
    pub threads: u32,
    /// Bytes of memory that a run may take beside the caller's images; 0 is 2 GiB.
    pub memory_limit: u64,
}

// SAFETY: numbers alone, the size first
unsafe impl Versioned for linpred_options {
    const NAME: &'static str = "linpred_options";
}

/// The options of a denoiser.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    pub(crate) options: Options,
    pub(crate) memory_limit: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            options: Options::default(),
            memory_limit: linpred::job::DEFAULT_MEMORY_LIMIT,
        }
    }
}

impl Settings {
    fn new(given: &linpred_options) -> Result<Self, Failure> {
        let mut params = params(given.quality, given.formulas)?;
        if given.coverage > 0 {
            params.coverage = given.coverage.try_into().map_err(|_| {
                let coverage = given.coverage;
                Failure::argument(format!("coverage is {coverage}, and at most {}", u16::MAX))
            })?;
        }
        let options = Options::new(params);
        let limit = match given.memory_limit {
            0 => linpred::job::DEFAULT_MEMORY_LIMIT,
            bytes => bytes,
        };
        Ok(Self {
            options: match NonZeroUsize::new(given.threads as usize) {
                Some(threads) => options.with_threads(threads),
                None => options,
            },
            memory_limit: limit,
        })
    }
}

fn params(quality: i32, formulas: i32) -> Result<Params, Failure> {
    const DEFAULT: i32 = linpred_quality::LINPRED_QUALITY_DEFAULT as i32;
    const FAST: i32 = linpred_quality::LINPRED_QUALITY_FAST as i32;
    const BALANCED: i32 = linpred_quality::LINPRED_QUALITY_BALANCED as i32;
    const HIGH: i32 = linpred_quality::LINPRED_QUALITY_HIGH as i32;
    const ROBUST: i32 = linpred_formulas::LINPRED_FORMULAS_ROBUST as i32;
    const LITERAL: i32 = linpred_formulas::LINPRED_FORMULAS_LITERAL as i32;
    let quality = match quality {
        DEFAULT => Quality::default(),
        FAST => Quality::Fast,
        BALANCED => Quality::Balanced,
        HIGH => Quality::High,
        other => {
            return Err(Failure::argument(format!(
                "quality is {other}, none of linpred_quality"
            )));
        }
    };
    match formulas {
        ROBUST => Ok(Params::new(quality).with_formulas(Formulas::Robust)),
        LITERAL => Ok(Params::literal()),
        other => Err(Failure::argument(format!(
            "formulas is {other}, none of linpred_formulas"
        ))),
    }
}

/// Sets what to compute; NULL sets the defaults. They hold from the next run on.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; `options` is NULL or can be read over its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_set_options(
    denoiser: *mut linpred_denoiser,
    options: *const linpred_options,
) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            denoiser.settings = match options.is_null() {
                true => Settings::default(),
                false => Settings::new(&versioned::read(options)?)?,
            };
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn qualities_are_those_of_the_library() {
        let given = [0, 4, 5, 6].map(|quality| params(quality, 0).unwrap());
        let own = [
            Quality::Balanced,
            Quality::Fast,
            Quality::Balanced,
            Quality::High,
        ];
        assert_eq!(given, own.map(Params::new));
        assert_eq!(params(6, 1), Ok(Params::literal()));
    }
}
