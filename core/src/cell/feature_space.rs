//! Local feature space of a window by truncated singular value decomposition (WLR section 4; LPR section 7).
//!
//! Each feature is mapped to a unit in which its range in the window is 2 long (WLR section 7), with 0 at the centre. With Z the window's mapped features
//! minus their mean and E their standard deviations, Weyl's inequality bounds what noise can do to a singular value:
//! `|s_m(true) - s_m(Z)| <= ||E||`. Directions below `tau = C ||E||` are noise and dropped; the others, `V_k`,
//! turn a pixel's features into its local ones, `z = V_k^T (x - x_c)`. What is known by its name tells something somewhere; a further feature that does not stand out of
//! its own noise has no part in either.
//!
//! A pixel that no fit reads is predicted as if its features were within the range of those that are read: a line is
//! not drawn beyond what it was fitted to.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::cell::window::{Extent, Windows};
use crate::eigen::{Decomposed, decorrelate};
use crate::features::TILE_FEATURES;
use crate::lanes::{Aligned, Lanes, Matrix, Vector, add_products, lanes_stay_innermost};
use crate::params::{Formulas, Params};
use crate::tile::WINDOW_AREA;

/// A feature that moves less than this part of its magnitude in the window is constant.
const CONSTANT: f32 = 1e-5;

/// Singular values below this part of the largest are rounding of the features, not features.
const ROUNDING: f32 = 1e-4;

/// A further feature that moves by less than this times its noise in a window is nothing but noise, and left out there: mapped to its range, six channels of white noise would
/// raise the threshold for all the others (measured on three renders, the most of the gain that they cost: a third without this, 24 % by 1, 4.2 by 2, 1.7 by 2.5, .3 by 3,
/// nothing by 6, which leaves out fine patterns as well).
const TELLING: f32 = 3.0;

/// Directions that correlate by less are independent enough: the fit spans them either way.
const CORRELATION: f32 = 0.05;

/// The same where each direction has a bandwidth of its own (WLR section 5.2).
const CORRELATION_OF_BANDWIDTHS: f32 = 1e-6;

/// Terms of the largest model: an intercept and 15 local features.
pub const MAX_TERMS: usize = 16;

/// The kept directions of each window's features, in the unit of [`to_range`].
#[repr(C, align(64))]
pub(crate) struct Basis<const D: usize, const L: usize> {
    /// By feature, then by direction, strongest first; 0 beyond the rank.
    pub(crate) axes: Matrix<D, L>,
    /// Directions kept.
    pub(crate) rank: [usize; L],
    /// Variance left in each feature, mean over the window's valid pixels, in the unit of [`to_range`].
    pub(crate) noise: Vector<D, L>,
}

impl<const D: usize, const L: usize> Basis<D, L> {
    pub(crate) const NONE: Self = Self {
        axes: [[[0.0; L]; D]; D],
        rank: [0; L],
        noise: [[0.0; L]; D],
    };

    /// The largest rank of any window.
    #[inline(always)]
    pub(crate) fn largest_rank(&self) -> usize {
        self.rank.iter().fold(0, |a, b| a.max(*b))
    }
}

/// Replaces the windows' features by those in the unit of their range, and finds the directions to keep.
///
/// `variances` are the sums of the features' over the windows; C and how exact the directions are the parameters say. A window without a valid pixel has
/// rank 0.
#[inline(always)]
pub(crate) fn find_basis<const D: usize, const L: usize>(
    windows: &mut Windows<D, L>,
    extent: &Extent<D, L>,
    variances: &Vector<D, L>,
    params: &Params,
    basis: &mut Basis<D, L>,
) {
    const {
        assert!(
            D < MAX_TERMS,
            "a term for each feature, and one for the intercept"
        )
    };
    let scale = scales(extent);
    let mut gramian = to_range(windows, extent, &scale);
    let mut noise = [0.0; L];
    for j in 0..D {
        for l in 0..L {
            let sum = variances[j][l] * scale[j][l] * scale[j][l];
            let telling = j < TILE_FEATURES || gramian[j][j][l] > TELLING * sum;
            if !telling {
                leave_out(&mut gramian, j, l);
            }
            let sum = if telling { sum } else { 0.0 };
            noise[l] += sum;
            // 0 / 0 in a window without pixels.
            let mean = sum / extent.pixels[l];
            basis.noise[j][l] = if extent.pixels[l] > 0.0 { mean } else { 0.0 };
        }
        lanes_stay_innermost();
    }
    let found = decorrelate(
        &mut gramian,
        match params.formulas {
            Formulas::Robust | Formulas::Literal => CORRELATION,
            Formulas::Wlr => CORRELATION_OF_BANDWIDTHS,
        },
    );
    basis.axes = [[[0.0; L]; D]; D];
    for l in 0..L {
        let threshold = params.truncation * params.truncation * noise[l];
        basis.rank[l] = 0;
        if found.finite[l] {
            keep_strongest(&found, threshold, l, basis);
        }
    }
}

/// Makes feature `j` of lane `l` one that does not move.
#[inline(always)]
fn leave_out<const D: usize, const L: usize>(gramian: &mut Matrix<D, L>, j: usize, l: usize) {
    // the upper triangle is all that is read
    for row in gramian.iter_mut().take(j) {
        row[j][l] = 0.0;
    }
    for entry in &mut gramian[j] {
        entry[l] = 0.0;
    }
}

/// 2 / (high - low) of each feature, 0 for a constant one.
#[inline(always)]
fn scales<const D: usize, const L: usize>(extent: &Extent<D, L>) -> Vector<D, L> {
    let mut scale = [[0.0; L]; D];
    for j in 0..D {
        for l in 0..L {
            let (low, high) = (extent.low[j][l], extent.high[j][l]);
            let range = high - low;
            let floor = CONSTANT * (high.abs() + low.abs());
            let moves = range > floor && range > f32::MIN_POSITIVE && range.is_finite();
            scale[j][l] = if moves { 2.0 / range } else { 0.0 };
        }
        lanes_stay_innermost();
    }
    scale
}

/// Maps the features, and sums the upper triangle of Z^T Z over the valid pixels: its eigenvalues are the squared
/// singular values, its eigenvectors are V.
#[inline(always)]
fn to_range<const D: usize, const L: usize>(
    windows: &mut Windows<D, L>,
    extent: &Extent<D, L>,
    scale: &Vector<D, L>,
) -> Matrix<D, L> {
    let mut sums = RangeSums {
        products: Aligned([[[0.0; L]; D]; D]),
        totals: Aligned([[0.0; L]; D]),
    };
    // Where every pixel is valid each lies within the range, by definition of that.
    if extent.pixels == [WINDOW_AREA as f32; L] {
        sums.take_in::<true>(windows, extent, scale);
    } else {
        sums.take_in::<false>(windows, extent, scale);
    }
    sums.centred(&extent.pixels)
}

/// Sums over the mapped features of the valid pixels.
struct RangeSums<const D: usize, const L: usize> {
    products: Aligned<Matrix<D, L>>,
    totals: Aligned<Vector<D, L>>,
}

impl<const D: usize, const L: usize> RangeSums<D, L> {
    /// Maps the windows and takes them in; `WHOLE` if every pixel is valid, which changes no bit.
    #[inline(always)]
    fn take_in<const WHOLE: bool>(
        &mut self,
        windows: &mut Windows<D, L>,
        extent: &Extent<D, L>,
        scale: &Vector<D, L>,
    ) {
        let [first, ..] = &windows.features;
        let mut origin = *first;
        for j in 0..D {
            for l in 0..L {
                origin[j][l] = within(origin[j][l], extent.low[j][l], extent.high[j][l]);
            }
            lanes_stay_innermost();
        }
        let features = windows.features.chunks_exact_mut(BATCH);
        for (features, samples) in features.zip(windows.samples.chunks_exact(BATCH)) {
            let (Some(features), Some(samples)) = (
                features.first_chunk_mut::<BATCH>(),
                samples.first_chunk::<BATCH>(),
            ) else {
                debug_assert!(false, "a batch is {BATCH} pixels");
                break;
            };
            let mut rows = Aligned([[[0.0; L]; D]; BATCH]);
            for p in 0..BATCH {
                for j in 0..D {
                    for l in 0..L {
                        let value = features[p][j][l];
                        let inside = if WHOLE {
                            value
                        } else {
                            within(value, extent.low[j][l], extent.high[j][l])
                        };
                        let mapped = (inside - origin[j][l]) * scale[j][l];
                        features[p][j][l] = mapped;
                        let valid = WHOLE || samples[p].weight[l] > 0.0;
                        rows.0[p][j][l] = if valid { mapped } else { 0.0 };
                    }
                    lanes_stay_innermost();
                }
            }
            self.add(&rows.0);
        }
    }

    #[inline(always)]
    fn add(&mut self, rows: &[Vector<D, L>; BATCH]) {
        for j in 0..D {
            let products = &mut self.products.0[j];
            add_products::<f32, D, BATCH, L>(products, j..D, |p| &rows[p][j], |p| &rows[p]);
            let mut total = self.totals.0[j];
            for row in rows {
                for l in 0..L {
                    total[l] += row[j][l];
                }
                lanes_stay_innermost();
            }
            self.totals.0[j] = total;
        }
    }

    /// The products with the means taken off.
    #[inline(always)]
    fn centred(self, pixels: &Lanes<L>) -> Matrix<D, L> {
        let mut products = self.products.0;
        for j in 0..D {
            for k in j..D {
                for l in 0..L {
                    // 0 / 0 in a window without pixels, which has no sums either.
                    let mean = self.totals.0[j][l] / pixels[l];
                    let mean = if pixels[l] > 0.0 { mean } else { 0.0 };
                    products[j][k][l] -= mean * self.totals.0[k][l];
                }
                lanes_stay_innermost();
            }
        }
        products
    }
}

/// Pixels that are mapped at a time: a row of sums stays in registers over them.
const BATCH: usize = 19;
const _: () = assert!(WINDOW_AREA.is_multiple_of(BATCH));

/// `value`, or the nearest of low..=high; 0 if there is no such range.
#[inline(always)]
fn within(value: f32, low: f32, high: f32) -> f32 {
    let above = if value > low { value } else { low };
    let inside = if above < high { above } else { high };
    if low <= high { inside } else { 0.0 }
}

/// Directions of lane `l` whose eigenvalue is above the threshold, strongest first.
#[inline(always)]
fn keep_strongest<const D: usize, const L: usize>(
    found: &Decomposed<D, L>,
    threshold: f32,
    l: usize,
    basis: &mut Basis<D, L>,
) {
    let mut largest = 0.0f32;
    for m in 0..D {
        largest = largest.max(found.values[m][l]);
    }
    let threshold = threshold.max(ROUNDING * ROUNDING * largest);
    for m in 0..D {
        let value = found.values[m][l];
        if value > threshold && value > 0.0 {
            // Its place among those kept; of equal ones the first comes first.
            let mut place = 0;
            for n in 0..D {
                let stronger = found.values[n][l] > value || (found.values[n][l] == value && n < m);
                place += usize::from(stronger);
            }
            for (feature, axis) in basis.axes.iter_mut().zip(&found.vectors[m]) {
                if let Some(entry) = feature.get_mut(place) {
                    entry[l] = axis[l];
                }
            }
            basis.rank[l] += 1;
        }
    }
}

/// Replaces the features of all pixels by local ones, where no fit does.
#[inline(always)]
pub(crate) fn project_all<const T: usize, const D: usize, const L: usize>(
    windows: &mut Windows<D, L>,
    basis: &Basis<D, L>,
) {
    for features in &mut windows.features {
        project::<T, D, L>(features, basis);
        lanes_stay_innermost();
    }
}

/// Replaces a pixel's features by the local ones that `T` terms need.
#[inline(always)]
pub(crate) fn project<const T: usize, const D: usize, const L: usize>(
    features: &mut Vector<D, L>,
    basis: &Basis<D, L>,
) {
    let mut local = Aligned([[0.0; L]; D]);
    add_products::<f32, D, D, L>(
        &mut local.0,
        0..(T - 1).min(D),
        |j| &features[j],
        |j| &basis.axes[j],
    );
    for k in 0..D {
        features[k] = local.0[k];
        lanes_stay_innermost();
    }
}
