//! The rows of the image that are in memory, as the core wants them.

use crate::row::{FEATURES, InputRow, RowLayout, VarianceKind};
use crate::row_ring::RowRing;

/// Radiances and features beyond this magnitude count as not finite: their squares would leave `f32`.
const LARGEST: f32 = 1e15;

/// Depths from here on are what renderers write where a ray leaves the scene.
const NO_SURFACE: f32 = 1e9;

/// What cells read of a row.
pub(crate) struct ColourRow {
    /// Radiance, 0 where the pixel is bad.
    pub(crate) colour: [Vec<f32>; 3],
    /// 1, or 0 where the colour is not finite.
    pub(crate) good: Vec<f32>,
    /// Extra layers, 0 where not finite and where the pixel is bad: what a layer holds there is no better.
    pub(crate) layers: Vec<[Vec<f32>; 3]>,
}

/// What else weights and filtered features are made of; cells do not read it, so it leaves earlier.
pub(crate) struct GuideRow {
    /// Variance of the mean, summed over the channels, 0 where the pixel is bad.
    pub(crate) variance: Vec<f32>,
    /// Features; NaN where missing, empty if the image has none.
    pub(crate) features: [Vec<f32>; FEATURES],
    /// Variances of the features; empty if the image has no such feature.
    pub(crate) feature_variances: [Vec<f32>; FEATURES],
}

impl ColourRow {
    /// Planes of a row.
    pub(crate) fn planes(layout: &RowLayout) -> usize {
        4 + 3 * layout.layers
    }

    fn new(layout: &RowLayout) -> Self {
        let plane = || vec![0.0; layout.size.width()];
        Self {
            colour: std::array::from_fn(|_| plane()),
            good: plane(),
            layers: (0..layout.layers)
                .map(|_| std::array::from_fn(|_| plane()))
                .collect(),
        }
    }

    fn fill(&mut self, input: &InputRow) {
        for x in 0..self.good.len() {
            let colour: [f32; 3] = std::array::from_fn(|c| input.colour[c][x]);
            let good = colour.iter().all(|v| v.abs() <= LARGEST);
            self.good[x] = if good { 1.0 } else { 0.0 };
            for (plane, value) in self.colour.iter_mut().zip(colour) {
                plane[x] = if good { value } else { 0.0 };
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

    /// Mean magnitude of the channels.
    pub(crate) fn luminance(&self, x: usize) -> f32 {
        self.colour
            .iter()
            .fold(0.0, |sum, plane| sum + plane[x].abs() / 3.0)
    }
}

impl GuideRow {
    /// Planes of a row.
    pub(crate) fn planes(layout: &RowLayout) -> usize {
        1 + 2 * layout.features.iter().filter(|present| **present).count()
    }

    fn new(layout: &RowLayout) -> Self {
        let width = layout.size.width();
        let feature = |k: usize| vec![0.0; if layout.features[k] { width } else { 0 }];
        Self {
            variance: vec![0.0; width],
            features: std::array::from_fn(feature),
            feature_variances: std::array::from_fn(feature),
        }
    }

    fn fill(&mut self, input: &InputRow, colours: &ColourRow, kind: VarianceKind) {
        self.variance.fill(0.0);
        if kind != VarianceKind::Estimated {
            for (variances, values) in input.variance.iter().zip(&colours.colour) {
                for (x, sum) in self.variance.iter_mut().enumerate() {
                    if colours.good[x] != 0.0 {
                        *sum += checked_variance(variances[x], values[x]);
                    }
                }
            }
        }
        for k in 0..FEATURES {
            for x in 0..self.features[k].len() {
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

/// The rows of the moving band.
pub(crate) struct HeldRows {
    layout: RowLayout,
    colours: RowRing<ColourRow>,
    guides: RowRing<GuideRow>,
}

impl HeldRows {
    pub(crate) fn new(layout: RowLayout) -> Self {
        Self {
            layout,
            colours: RowRing::new(),
            guides: RowRing::new(),
        }
    }

    /// The row after the last one held.
    pub(crate) fn next(&self) -> usize {
        self.colours.next()
    }

    /// The first row whose features are held.
    pub(crate) fn first(&self) -> usize {
        self.guides.first()
    }

    pub(crate) fn push(&mut self, input: &InputRow) {
        let layout = &self.layout;
        let colours = self.colours.push(|| ColourRow::new(layout));
        colours.fill(input);
        let guides = self.guides.push(|| GuideRow::new(layout));
        guides.fill(input, colours, layout.variance);
    }

    /// Lets go of the colours before row `colours` and of the rest before row `guides`.
    pub(crate) fn drop_before(&mut self, colours: usize, guides: usize) {
        self.colours.drop_before(colours);
        self.guides.drop_before(guides);
    }

    /// The colours of row `y`, or of the nearest row of the image. The caller has asked for rows that are held.
    pub(crate) fn colours(&self, y: isize) -> &ColourRow {
        self.colours.row(clamped(y, self.layout.size.height()))
    }

    /// The rest of row `y`, or of the nearest row of the image. The caller has asked for rows that are held.
    pub(crate) fn guides(&self, y: isize) -> &GuideRow {
        self.guides.row(clamped(y, self.layout.size.height()))
    }

    /// Row `y`, to fill in variances: those of bad pixels are to stay 0.
    pub(crate) fn variances_mut(&mut self, y: usize) -> (&mut GuideRow, &ColourRow) {
        (self.guides.row_mut(y), self.colours.row(y))
    }

    /// Feature `k` at (x, y), from the nearest pixel of the image; a missing one is the mean of those around it, or 0.
    pub(crate) fn feature(&self, k: usize, x: isize, y: isize) -> f32 {
        if !self.layout.features[k] {
            return 0.0;
        }
        let width = self.layout.size.width();
        let value = self.guides(y).features[k][clamped(x, width)];
        if !value.is_nan() {
            return value;
        }
        let (x, y) = (
            clamped(x, width) as isize,
            clamped(y, self.layout.size.height()) as isize,
        );
        let (mut sum, mut count) = (0.0, 0.0);
        for row in (y - 1..=y + 1).map(|y| self.guides(y)) {
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
