//! What a run did.

use linpred::Report;

use crate::handle::{call, linpred_denoiser};
use crate::status::{Failure, linpred_status};
use crate::versioned::{self, Versioned};

/// What a run did, and what it could leave. LINPRED_REPORT_INIT sets the size.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct linpred_report {
    /// sizeof(linpred_report).
    pub struct_size: usize,
    /// Pixels of the image.
    pub pixels: u64,
    /// Pixels of zero variance, and black ones where the features say that nothing is there, passed through as they
    /// came.
    pub passed_through: u64,
    /// Pixels with a NaN or infinite colour, predicted from their neighbours.
    pub repaired: u64,
    /// Pixels far brighter than all around by no more than a sample, predicted from their neighbours.
    pub fireflies: u64,
    /// Pixels of an image with variances that have none that is known: theirs is estimated from the picture.
    pub estimated: u64,
    /// Cells of 19 x 19 pixels.
    pub cells: u64,
    /// Of those, the ones that hold no noise: nothing is fitted in them.
    pub cells_skipped: u64,
    /// Blocks of features: a normal, an albedo or a depth each.
    pub feature_blocks: u64,
    /// Of those, the ones with no noise in reach: they are not filtered.
    pub feature_blocks_skipped: u64,
    /// Models that were built.
    pub models: u64,
    /// Samples that half precision cannot hold, which became its largest value.
    pub clamped: u64,
    /// Seconds that threads spent on the cells that were not skipped, added up over the threads.
    pub fitting_seconds: f64,
}

// SAFETY: numbers alone, the size first
unsafe impl Versioned for linpred_report {
    const NAME: &'static str = "linpred_report";
}

/// The last run that came to its end.
#[derive(Clone, Copy, Default)]
pub(crate) struct Done(Option<(Report, u64)>);

impl Done {
    /// A run that clamped so many samples.
    pub(crate) fn new(report: Report, clamped: u64) -> Self {
        Self(Some((report, clamped)))
    }

    fn report(&self) -> Result<linpred_report, Failure> {
        let Some((report, clamped)) = self.0 else {
            return Err(Failure::new(
                linpred_status::LINPRED_ERROR_OPERATION,
                "no run of this denoiser has come to its end",
            ));
        };
        let counts = report.counts;
        Ok(linpred_report {
            struct_size: size_of::<linpred_report>(),
            pixels: counts.pixels,
            passed_through: counts.passed_through,
            repaired: counts.repaired,
            fireflies: counts.fireflies,
            estimated: counts.estimated,
            cells: counts.cells,
            cells_skipped: counts.cells_skipped,
            feature_blocks: counts.feature_blocks,
            feature_blocks_skipped: counts.feature_blocks_skipped,
            models: report.models,
            clamped,
            fitting_seconds: report.fitting.as_secs_f64(),
        })
    }
}

/// Fills in what the last run did that came to its end. LINPRED_ERROR_OPERATION if there is none.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; `report` is NULL or can be written over its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_get_report(
    denoiser: *mut linpred_denoiser,
    report: *mut linpred_report,
) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            versioned::write(report, &denoiser.done.report()?)
        })
    }
}
