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
    /// LINPRED_QUALITY_BALANCED, and LINPRED_QUALITY_FAST for maps of samples.
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
    /// Those of Moon et al. 2015 (linear predictions) to the letter, to compare with.
    LINPRED_FORMULAS_LITERAL = 1,
    /// Those of Moon et al. 2014 (weighted local regression) to the letter, likewise; slow.
    LINPRED_FORMULAS_WLR = 2,
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
    /// One of linpred_formulas. Those of the papers know no quality.
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
    /// Those that a map of samples is made with.
    pub(crate) for_sampling: Options,
    pub(crate) memory_limit: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            options: Options::default(),
            for_sampling: Options::for_sampling(),
            memory_limit: linpred::job::DEFAULT_MEMORY_LIMIT,
        }
    }
}

impl Settings {
    fn new(given: &linpred_options) -> Result<Self, Failure> {
        let default = Self::default();
        Ok(Self {
            options: options(given, default.options)?,
            for_sampling: options(given, default.for_sampling)?,
            memory_limit: match given.memory_limit {
                0 => default.memory_limit,
                bytes => bytes,
            },
        })
    }
}

/// Those that are given, and of others the defaults.
fn options(given: &linpred_options, default: Options) -> Result<Options, Failure> {
    let mut options = default;
    options.params = params(given.quality, given.formulas, default.params)?;
    if given.coverage > 0 {
        options.params.coverage = given.coverage.try_into().map_err(|_| {
            let coverage = given.coverage;
            Failure::argument(format!("coverage is {coverage}, and at most {}", u16::MAX))
        })?;
    }
    Ok(match NonZeroUsize::new(given.threads as usize) {
        Some(threads) => options.with_threads(threads),
        None => options,
    })
}

fn params(quality: i32, formulas: i32, default: Params) -> Result<Params, Failure> {
    const DEFAULT: i32 = linpred_quality::LINPRED_QUALITY_DEFAULT as i32;
    const FAST: i32 = linpred_quality::LINPRED_QUALITY_FAST as i32;
    const BALANCED: i32 = linpred_quality::LINPRED_QUALITY_BALANCED as i32;
    const HIGH: i32 = linpred_quality::LINPRED_QUALITY_HIGH as i32;
    const ROBUST: i32 = linpred_formulas::LINPRED_FORMULAS_ROBUST as i32;
    const LITERAL: i32 = linpred_formulas::LINPRED_FORMULAS_LITERAL as i32;
    const WLR: i32 = linpred_formulas::LINPRED_FORMULAS_WLR as i32;
    let robust = match quality {
        DEFAULT => default,
        FAST => Params::new(Quality::Fast),
        BALANCED => Params::new(Quality::Balanced),
        HIGH => Params::new(Quality::High),
        other => {
            return Err(Failure::argument(format!(
                "quality is {other}, none of linpred_quality"
            )));
        }
    };
    match formulas {
        ROBUST => Ok(robust.with_formulas(Formulas::Robust)),
        LITERAL => Ok(Params::literal()),
        WLR => Ok(Params::wlr()),
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
        let settings = |quality, formulas| {
            let given = linpred_options {
                struct_size: size_of::<linpred_options>(),
                quality,
                formulas,
                coverage: 0,
                threads: 0,
                memory_limit: 0,
            };
            let settings = Settings::new(&given).unwrap();
            [settings.options, settings.for_sampling].map(|options| options.params)
        };
        use Quality::{Balanced, Fast, High};
        let own = [
            (0, [Balanced, Fast]),
            (4, [Fast; 2]),
            (5, [Balanced; 2]),
            (6, [High; 2]),
        ];
        for (quality, own) in own {
            assert_eq!(settings(quality, 0), own.map(Params::new), "{quality}");
        }
        assert_eq!(settings(6, 1), [Params::literal(); 2]);
        assert_eq!(settings(6, 2), [Params::wlr(); 2]);
    }
}
