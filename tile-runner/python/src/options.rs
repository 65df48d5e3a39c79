//! What to compute, from the package's words.

use std::num::NonZeroUsize;

use linpred::{Options, Params, Quality, threads_to_use};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// How to compute.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Computing {
    quality: String,
    formulas: String,
    coverage: Option<i64>,
    threads: Option<i64>,
}

impl Computing {
    /// The same as the command line makes of these words.
    pub(crate) fn options(&self) -> PyResult<Options> {
        let refused = |words: String| Err(PyValueError::new_err(words));
        let quality = match self.quality.as_str() {
            "fast" => Quality::Fast,
            "balanced" => Quality::Balanced,
            "high" => Quality::High,
            other => {
                return refused(format!("quality {other:?}: it is fast, balanced or high"));
            }
        };
        let mut params = match self.formulas.as_str() {
            "robust" => Params::new(quality),
            "literal" => Params::literal(),
            "wlr" => Params::wlr(),
            other => {
                return refused(format!(
                    "formulas {other:?}: they are robust, literal or wlr"
                ));
            }
        };
        match self
            .coverage
            .map(|coverage| (coverage, u16::try_from(coverage)))
        {
            None => {}
            Some((_, Ok(coverage @ 1..=1024))) => params.coverage = coverage,
            Some((coverage, _)) => {
                return refused(format!("coverage {coverage}: it is 1 to 1024 models"));
            }
        }
        Ok(Options::new(params).with_threads(threads(self.threads)?))
    }
}

/// As many threads as there are processors, or fewer if fewer are asked for.
pub(crate) fn threads(asked: Option<i64>) -> PyResult<NonZeroUsize> {
    let count = |asked| {
        let threads = usize::try_from(asked).ok().and_then(NonZeroUsize::new);
        threads.ok_or_else(|| PyValueError::new_err(format!("threads {asked}: it is 1 or more")))
    };
    Ok(threads_to_use(asked.map(count).transpose()?))
}
