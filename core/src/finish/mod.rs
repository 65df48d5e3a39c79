//! After the blend: what grain the models have left is smoothed, specks are taken out, and the light that was lost on the way is given back.
//!
//! Each stage makes a row of an image from rows around it, [`RUN`] columns at a time. A row is a plane of `f32` of [`finish_columns`] of the
//! image's width: [`FINISH_PADDING`] columns, the image's, those up to a whole run, and as many again; the kernels fill the runs, and the caller
//! gives every column beyond the image the value of the nearest pixel of the image. So a pixel's bits do not depend on where rows begin.
//!
//! No constant is in a unit of radiance: a power of two as a factor of all radiances is one of the result, exactly.

pub(crate) mod despeckle;
pub(crate) mod restore;
pub(crate) mod smooth;

use crate::block::plane::columns;

/// Columns that are worked on at a time: whole registers of 4, 8 or 16 floats.
pub(crate) const RUN: usize = 64;
/// Those columns of a row.
pub(crate) type Run = [f32; RUN];

/// Columns of a plane before the image's first and after its last run.
pub const FINISH_PADDING: usize = 16;
const _: () = assert!(FINISH_PADDING >= smooth::REACH && FINISH_PADDING >= restore::RESTORE_RADIUS);

/// Columns of a plane for an image that is `width` pixels wide.
pub const fn finish_columns(width: usize) -> usize {
    width
        .div_ceil(RUN)
        .saturating_mul(RUN)
        .saturating_add(2 * FINISH_PADDING)
}

/// Where the runs of a plane of this many columns begin.
#[inline(always)]
pub(crate) fn runs(columns: usize) -> impl Iterator<Item = usize> {
    let end = columns.saturating_sub(2 * FINISH_PADDING) + FINISH_PADDING;
    (FINISH_PADDING..end).step_by(RUN)
}

/// The run that begins at column `first` of a plane.
#[inline(always)]
pub(crate) fn run(plane: &[f32], first: usize) -> &Run {
    columns(plane, first)
}

/// Stores a run, or a part of one, at column `first` of a plane.
#[inline(always)]
pub(crate) fn store<const N: usize>(plane: &mut [f32], first: usize, values: &[f32; N]) {
    let target = plane.get_mut(first..).and_then(<[f32]>::first_chunk_mut);
    debug_assert!(target.is_some(), "{N} columns at {first}");
    if let Some(target) = target {
        *target = *values;
    }
}

/// Whether a run is 0 throughout: where no pixel is noisy, or takes part, there is nothing to do.
#[inline(always)]
pub(crate) fn is_zero(values: &Run) -> bool {
    let mut any = 0;
    for value in values {
        // of both zeros; no branch, so that the compiler makes vectors of it
        any |= value.to_bits() << 1;
    }
    any == 0
}

/// A plane on its way through a stage, a channel of the colour or of a layer: `N` rows of it, and the row that they make.
#[derive(Debug)]
pub struct FinishedPlane<'a, const N: usize> {
    /// The rows, from above to below, that the stage reads; finite.
    pub rows: [&'a [f32]; N],
    /// The row that it fills.
    pub output: &'a mut [f32],
}

/// Mean of three channels.
#[inline(always)]
fn mean_of_channels(channels: [&Run; 3], x: usize) -> f32 {
    (channels[0][x] + channels[1][x] + channels[2][x]) * (1.0 / 3.0)
}
