//! The rows of the image that are in memory, as the core wants them.

use std::ops::Range;

use linpred_core::{FEATURES, Feature, MAX_FEATURES};

use crate::geometry::plane_bytes;
use crate::row::{InputRow, RowLayout, VarianceKind};
use crate::stream::borders::{clamped, copy_clamped, copy_mirrored, mirrored};
use crate::stream::row_ring::RowRing;

/// Radiances and features beyond this magnitude count as not finite: their squares would leave `f32`.
pub(crate) const LARGEST: f32 = 1e15;

/// Depths from here on, and positions, are what renderers write where a ray leaves the scene.
pub(crate) const NO_SURFACE: f32 = 1e9;

/// What cells, and the stages after them, read of a row.
pub(crate) struct ColourRow {
    /// Radiance, 0 where the pixel is bad.
    pub(crate) colour: [Vec<f32>; 3],
    /// 1, or 0 where the pixel is bad: its colour is not finite, or it is a firefly.
    pub(crate) good: Vec<f32>,
    /// Which pixels are fireflies.
    pub(crate) firefly: Vec<bool>,
    /// Variance of the mean, summed over the channels, 0 where the pixel is bad. NaN where none is known, until it is estimated.
    pub(crate) variance: Vec<f32>,
    /// Which pixels of an image with variances have none that is known.
    pub(crate) estimated: Vec<bool>,
    /// Which pixels are black where nothing is to be seen: they have no noise, whatever is around them.
    pub(crate) empty: Vec<bool>,
    /// What follows the colour in triples (see [`RowLayout::followers`]), 0 where not finite and where the pixel is bad: what it holds there is no better.
    pub(crate) followers: Vec<[Vec<f32>; 3]>,
    /// How many frames each pixel is made of; empty for an image that is denoised alone.
    pub(crate) frames: Vec<f32>,
    /// Of such a row what its own frame has: the mean of the channels, and the sum of their variances, NaN where not known.
    pub(crate) light: [Vec<f32>; 2],
}

/// What else weights and filtered features are made of; cells do not read it, so it leaves earlier.
pub(crate) struct GuideRow {
    /// Mean magnitude of the channels, 0 where the pixel is bad.
    pub(crate) luminance: Vec<f32>,
    /// Features; NaN where missing, empty if the image has none.
    pub(crate) features: [Vec<f32>; MAX_FEATURES],
    /// Whether some pixel misses the feature.
    missing: [bool; MAX_FEATURES],
    /// Variances of the features; empty if the image has no such feature.
    pub(crate) feature_variances: [Vec<f32>; MAX_FEATURES],
    /// Columns outside which the feature has no variance.
    noisy: [Range<usize>; MAX_FEATURES],
}

impl ColourRow {
    /// Bytes of `rows` rows.
    pub(crate) fn bytes(layout: &RowLayout, rows: usize) -> u64 {
        let flags = 3 * (layout.size.width() as u64).saturating_mul(rows as u64);
        let frames = 3 * usize::from(layout.frames);
        plane_bytes(layout.size, rows, 5 + 3 * layout.followers() + frames).saturating_add(flags)
    }

    fn new(layout: &RowLayout) -> Self {
        let plane = || vec![0.0; layout.size.width()];
        Self {
            colour: std::array::from_fn(|_| plane()),
            good: plane(),
            firefly: vec![false; layout.size.width()],
            variance: plane(),
            estimated: vec![false; layout.size.width()],
            empty: vec![false; layout.size.width()],
            followers: (0..layout.followers())
                .map(|_| std::array::from_fn(|_| plane()))
                .collect(),
            frames: if layout.frames { plane() } else { Vec::new() },
            light: std::array::from_fn(|_| if layout.frames { plane() } else { Vec::new() }),
        }
    }

    fn fill(&mut self, input: &InputRow, kind: VarianceKind) {
        self.firefly.fill(false);
        for x in 0..self.good.len() {
            let colour: [f32; 3] = std::array::from_fn(|c| input.colour[c][x]);
            let good = colour.iter().all(|v| v.abs() <= LARGEST);
            self.good[x] = if good { 1.0 } else { 0.0 };
            for (plane, value) in self.colour.iter_mut().zip(colour) {
                plane[x] = if good { value } else { 0.0 };
            }
        }
        self.fill_variance(input, kind);
        self.frames.copy_from_slice(&input.frames);
        for (own, plane) in self.light.iter_mut().zip(&input.light) {
            own.copy_from_slice(plane);
        }
        let alpha = Some(&input.alpha).filter(|alpha| !alpha.is_empty());
        let layers = input.layers.iter().flatten();
        let planes = layers.chain(alpha).chain(&input.scalars);
        for (own, plane) in self.followers.iter_mut().flatten().zip(planes) {
            for ((own, &value), good) in own.iter_mut().zip(plane).zip(&self.good) {
                let usable = *good > 0.0 && value.abs() <= LARGEST;
                *own = if usable { value } else { 0.0 };
            }
        }
    }

    fn fill_variance(&mut self, input: &InputRow, kind: VarianceKind) {
        self.variance.fill(0.0);
        if kind != VarianceKind::Estimated {
            let noisy = |c: usize| input.variance[c].iter().zip(&self.colour[c]);
            let channels = noisy(0).zip(noisy(1)).zip(noisy(2)).zip(&self.good);
            for (own, (((red, green), blue), good)) in self.variance.iter_mut().zip(channels) {
                let pixel = [red, green, blue].map(|(variance, value)| [*variance, *value]);
                let sum = sum_of_variances(pixel);
                *own = if *good != 0.0 { sum } else { 0.0 };
            }
        }
        let known = self.variance.iter().map(|variance| variance.is_nan());
        self.estimated
            .iter_mut()
            .zip(known)
            .for_each(|(own, nan)| *own = nan);
    }

    /// Notes which pixels are empty: they are black and without stated noise where alpha and features say that nothing is to be seen.
    fn find_empty(&mut self, layout: &RowLayout, guides: &GuideRow) {
        let placed = layout.has(Feature::Normal) || layout.has(Feature::Depth);
        let tells = placed || (layout.alpha && layout.has(Feature::Albedo));
        if !tells {
            return;
        }
        let alpha = self.followers.get(layout.layers).filter(|_| layout.alpha);
        let known = guides.features.iter().take(FEATURES);
        let present = known.filter(|plane| !plane.is_empty());
        let zero = present
            .chain(&self.colour)
            .chain(alpha.map(|triple| &triple[0]));
        let zero: Vec<&Vec<f32>> = zero.collect();
        for (x, empty) in self.empty.iter_mut().enumerate() {
            let silent = self.variance[x] == 0.0 || self.variance[x].is_nan();
            *empty = silent && self.good[x] > 0.0 && zero.iter().all(|plane| plane[x] == 0.0);
            if *empty {
                (self.variance[x], self.estimated[x]) = (0.0, false);
            }
        }
    }

    /// Makes the pixel in column `x` a bad one.
    pub(crate) fn spoil(&mut self, x: usize) {
        (self.good[x], self.variance[x]) = (0.0, 0.0);
        self.estimated[x] = false;
        let followers = self.followers.iter_mut().flatten();
        for plane in self.colour.iter_mut().chain(followers) {
            plane[x] = 0.0;
        }
    }
}

impl GuideRow {
    /// Bytes of `rows` rows.
    pub(crate) fn bytes(layout: &RowLayout, rows: usize) -> u64 {
        plane_bytes(layout.size, rows, 1 + 2 * layout.feature_channels())
    }

    fn new(layout: &RowLayout) -> Self {
        let width = layout.size.width();
        let feature = |k: usize| vec![0.0; if layout.features[k] { width } else { 0 }];
        Self {
            luminance: vec![0.0; width],
            features: std::array::from_fn(feature),
            missing: [false; MAX_FEATURES],
            noisy: [const { 0..0 }; MAX_FEATURES],
            feature_variances: std::array::from_fn(feature),
        }
    }

    fn fill(&mut self, input: &InputRow, colours: &ColourRow) {
        let [red, green, blue] = &colours.colour;
        let values = red.iter().zip(green).zip(blue);
        for (own, ((red, green), blue)) in self.luminance.iter_mut().zip(values) {
            *own = unordered_sum([red.abs(), green.abs(), blue.abs()]) / 3.0;
        }
        for feature in Feature::ALL {
            let limit = match feature.is_distance() {
                true => NO_SURFACE,
                false => f32::INFINITY,
            };
            for k in feature.range() {
                self.fill_feature(k, input, limit);
            }
        }
        // what a further feature is nobody knows: so large it is a position beyond the scene, and no light or roughness
        for k in FEATURES..MAX_FEATURES {
            self.fill_feature(k, input, NO_SURFACE);
        }
    }

    /// Makes the pixel in column `x` a bad one; its features stay.
    pub(crate) fn spoil(&mut self, x: usize) {
        self.luminance[x] = 0.0;
    }

    /// Feature `k`, which counts as 0 without noise where its magnitude reaches `limit`.
    fn fill_feature(&mut self, k: usize, input: &InputRow, limit: f32) {
        let mut missing = false;
        let sources = input.features[k].iter().zip(&input.feature_variances[k]);
        let targets = self.features[k]
            .iter_mut()
            .zip(&mut self.feature_variances[k]);
        for ((own, own_variance), (&value, &variance)) in targets.zip(sources) {
            let leaves = value.abs() >= limit;
            let value = if leaves { 0.0 } else { value };
            let usable = value.abs() <= LARGEST;
            missing |= !usable;
            *own = if usable { value } else { f32::NAN };
            let checked = checked_variance(variance, value);
            *own_variance = if leaves { 0.0 } else { checked };
        }
        self.missing[k] = missing;
        self.find_noise(k);
    }

    /// Notes anew where feature `k` has a variance; call it after changing those.
    pub(crate) fn find_noise(&mut self, k: usize) {
        let variances = &self.feature_variances[k];
        let first = variances.iter().position(|v| *v > 0.0).unwrap_or(0);
        let last = variances.iter().rposition(|v| *v > 0.0);
        self.noisy[k] = first..last.map_or(first, |last| last + 1);
    }

    /// Whether feature `k` may have a variance in `columns`, or in the nearest ones of the image.
    pub(crate) fn is_noisy(&self, k: usize, columns: &Range<usize>) -> bool {
        let noisy = &self.noisy[k];
        noisy.start < columns.end && columns.start < noisy.end
    }
}

/// A variance that can be used: an infinite one (a half float that overflowed) counts as the value's square, and so does what is not known of a feature.
fn checked_variance(variance: f32, value: f32) -> f32 {
    if variance.is_finite() {
        variance.clamp(0.0, LARGEST * LARGEST)
    } else {
        (value * value).min(LARGEST * LARGEST)
    }
}

/// The sum of the variances of three channels, each with its value; NaN if one of them is not known.
pub(crate) fn sum_of_variances(channels: [[f32; 2]; 3]) -> f32 {
    match channels.iter().any(|[variance, _]| !variance.is_finite()) {
        true => f32::NAN,
        false => unordered_sum(channels.map(|[variance, value]| checked_variance(variance, value))),
    }
}

/// The sum, whose bits do not depend on the order of the three finite numbers: no order of the channels changes a decision.
fn unordered_sum([a, b, c]: [f32; 3]) -> f32 {
    let sorted = |a: f32, b: f32| if a < b { (a, b) } else { (b, a) };
    let (low, high) = sorted(a, b);
    let (middle, high) = sorted(high, c);
    let (low, middle) = sorted(low, middle);
    low + middle + high
}

/// The rows that are held.
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
        colours.fill(input, layout.variance);
        let guides = self.guides.push(|| GuideRow::new(layout));
        guides.fill(input, colours);
        colours.find_empty(layout, guides);
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

    /// Row `y`, to spoil pixels of it.
    pub(crate) fn row_mut(&mut self, y: usize) -> (&mut ColourRow, &mut GuideRow) {
        (self.colours.row_mut(y), self.guides.row_mut(y))
    }

    /// Row `y`, to fill in variances: those of bad pixels are to stay 0.
    pub(crate) fn variances_mut(&mut self, y: usize) -> (&mut GuideRow, &mut ColourRow) {
        (self.guides.row_mut(y), self.colours.row_mut(y))
    }

    /// Feature `k` of row `y` from column `x` on, as [`Self::feature`] has it; zeros if the image has none.
    pub(crate) fn copy_feature(&self, k: usize, x: isize, y: isize, target: &mut [f32]) {
        self.copy_present(k, y, target, |row, target| copy_clamped(row, x, target));
        self.fill_missing(k, y, target, |i| x + i as isize);
    }

    /// The same, but with the image mirrored at its left and right.
    pub(crate) fn copy_feature_mirrored(&self, k: usize, x: isize, y: isize, target: &mut [f32]) {
        let width = self.layout.size.width();
        self.copy_present(k, y, target, |row, target| copy_mirrored(row, x, target));
        self.fill_missing(k, y, target, |i| mirrored(x + i as isize, width) as isize);
    }

    fn copy_present(
        &self,
        k: usize,
        y: isize,
        target: &mut [f32],
        copy: impl Fn(&[f32], &mut [f32]),
    ) {
        if self.layout.features[k] {
            copy(&self.guides(y).features[k], target);
        } else {
            target.fill(0.0);
        }
    }

    /// Fills in what is missing in a copy of row `y` whose i-th value is that of `column(i)`.
    fn fill_missing(
        &self,
        k: usize,
        y: isize,
        target: &mut [f32],
        column: impl Fn(usize) -> isize,
    ) {
        if self.guides(y).missing[k] {
            for (i, value) in target.iter_mut().enumerate() {
                if value.is_nan() {
                    *value = self.feature(k, column(i), y);
                }
            }
        }
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
