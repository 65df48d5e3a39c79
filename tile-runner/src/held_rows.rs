//! The rows of the image that are in memory, as the core wants them.

use std::collections::VecDeque;

use crate::row::{FEATURES, InputRow, RowLayout, VarianceKind};

/// Radiances and features beyond this magnitude count as not finite: their squares would leave `f32`.
const LARGEST: f32 = 1e15;

/// Depths from here on are what renderers write where a ray leaves the scene.
const NO_SURFACE: f32 = 1e9;

/// One row of input after its values have been checked.
pub(crate) struct HeldRow {
    /// Radiance, 0 where the pixel is bad.
    pub(crate) colour: [Vec<f32>; 3],
    /// Mean magnitude of the channels.
    pub(crate) luminance: Vec<f32>,
    /// Variance of the mean, summed over the channels, 0 where the pixel is bad.
    pub(crate) variance: Vec<f32>,
    /// 1, or 0 where the colour is not finite.
    pub(crate) good: Vec<f32>,
    /// Features; NaN where missing.
    pub(crate) features: [Vec<f32>; FEATURES],
    /// Variances of the features.
    pub(crate) feature_variances: [Vec<f32>; FEATURES],
    /// Extra layers, 0 where not finite and where the pixel is bad: what a layer holds there is no better.
    pub(crate) layers: Vec<[Vec<f32>; 3]>,
}

impl HeldRow {
    fn new(layout: &RowLayout) -> Self {
        let plane = || vec![0.0; layout.size.width()];
        Self {
            colour: std::array::from_fn(|_| plane()),
            luminance: plane(),
            variance: plane(),
            good: plane(),
            features: std::array::from_fn(|_| plane()),
            feature_variances: std::array::from_fn(|_| plane()),
            layers: (0..layout.layers)
                .map(|_| std::array::from_fn(|_| plane()))
                .collect(),
        }
    }

    fn fill(&mut self, input: &InputRow, kind: VarianceKind) {
        for x in 0..self.good.len() {
            let colour: [f32; 3] = std::array::from_fn(|c| input.colour[c][x]);
            let good = colour.iter().all(|v| v.abs() <= LARGEST);
            self.good[x] = if good { 1.0 } else { 0.0 };
            self.luminance[x] = 0.0;
            self.variance[x] = 0.0;
            for (c, &value) in colour.iter().enumerate() {
                let y = if good { value } else { 0.0 };
                self.colour[c][x] = y;
                self.luminance[x] += y.abs() / 3.0;
                if good && kind != VarianceKind::Estimated {
                    self.variance[x] += checked_variance(input.variance[c][x], y);
                }
            }
        }
        for k in 0..FEATURES {
            for x in 0..self.good.len() {
                let value = input.features[k][x];
                let leaves = k == FEATURES - 1 && value.abs() >= NO_SURFACE;
                let value = if leaves { 0.0 } else { value };
                self.features[k][x] = if value.abs() <= LARGEST {
                    value
                } else {
                    f32::NAN
                };
                let variance = input.feature_variances[k][x];
                self.feature_variances[k][x] = if leaves {
                    0.0
                } else {
                    checked_variance(variance, value)
                };
            }
        }
        for (own, layer) in self.layers.iter_mut().zip(&input.layers) {
            for (own, plane) in own.iter_mut().zip(layer) {
                for ((own, &value), good) in own.iter_mut().zip(plane).zip(&self.good) {
                    let usable = *good > 0.0 && value.abs() <= LARGEST;
                    *own = if usable { value } else { 0.0 };
                }
            }
        }
    }
}

/// A variance that can be used: one that is not finite (a half float that overflowed) counts as the value's square.
fn checked_variance(variance: f32, value: f32) -> f32 {
    if variance.is_finite() {
        variance.clamp(0.0, LARGEST * LARGEST)
    } else {
        (value * value).min(LARGEST * LARGEST)
    }
}

/// Consecutive rows, the oldest first.
pub(crate) struct HeldRows {
    layout: RowLayout,
    first: usize,
    rows: VecDeque<HeldRow>,
    spare: Vec<HeldRow>,
}

impl HeldRows {
    pub(crate) fn new(layout: RowLayout) -> Self {
        Self {
            layout,
            first: 0,
            rows: VecDeque::new(),
            spare: Vec::new(),
        }
    }

    /// The row after the last one held.
    pub(crate) fn next(&self) -> usize {
        self.first + self.rows.len()
    }

    pub(crate) fn push(&mut self, input: &InputRow) {
        let mut row = self
            .spare
            .pop()
            .unwrap_or_else(|| HeldRow::new(&self.layout));
        row.fill(input, self.layout.variance);
        self.rows.push_back(row);
    }

    /// Lets go of the rows before `y`.
    pub(crate) fn drop_before(&mut self, y: usize) {
        while self.first < y {
            let Some(row) = self.rows.pop_front() else {
                return;
            };
            self.spare.push(row);
            self.first += 1;
        }
    }

    /// Row `y`, or the nearest row of the image. The caller has asked for rows that are held.
    pub(crate) fn row(&self, y: isize) -> &HeldRow {
        let y = clamped(y, self.layout.size.height());
        &self.rows[y - self.first]
    }

    pub(crate) fn row_mut(&mut self, y: usize) -> &mut HeldRow {
        &mut self.rows[y - self.first]
    }

    /// Feature `k` at (x, y), from the nearest pixel of the image; a missing one is the mean of those around it, or 0.
    pub(crate) fn feature(&self, k: usize, x: isize, y: isize) -> f32 {
        let width = self.layout.size.width();
        let value = self.row(y).features[k][clamped(x, width)];
        if !value.is_nan() {
            return value;
        }
        let (x, y) = (
            clamped(x, width) as isize,
            clamped(y, self.layout.size.height()) as isize,
        );
        let (mut sum, mut count) = (0.0, 0.0);
        for row in (y - 1..=y + 1).map(|y| self.row(y)) {
            for x in x - 1..=x + 1 {
                let value = row.features[k][clamped(x, width)];
                if !value.is_nan() {
                    sum += value;
                    count += 1.0;
                }
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    }
}

/// `position` mirrored at both ends of 0..length, without repeating the ends.
pub(crate) fn mirrored(position: isize, length: usize) -> usize {
    let last = length as isize - 1;
    let inside = position.abs();
    clamped(
        if inside > last {
            2 * last - inside
        } else {
            inside
        },
        length,
    )
}

/// The nearest of 0..length.
pub(crate) fn clamped(position: isize, length: usize) -> usize {
    position.clamp(0, length as isize - 1) as usize
}
