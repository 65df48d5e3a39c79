//! What flows between the layers: one row of an image as planes of `f32`.
//!
//! A [`RowSource`] (an EXR file, a renderer's buffers) delivers [`InputRow`]s from top to bottom; the
//! pipeline turns them into [`OutputRow`]s, from top to bottom, for a [`RowSink`]. Neither end knows the
//! other, and the pipeline knows neither files nor channel names.

use std::ops::Range;

use linpred_core::{Feature, MAX_FEATURES};

use crate::error::Error;
use crate::further::FurtherFeatures;
use crate::geometry::{ImageSize, plane_bytes};

/// Where the variance of the colour comes from once a source has turned it into rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VarianceKind {
    /// [`InputRow::variance`] is an estimate of the variance of the pixel's mean from many samples.
    OfMean,
    /// [`InputRow::variance`] is the squared half difference of two half buffers: unbiased, but one degree of
    /// freedom, so the pipeline smooths it more.
    OfHalves,
    /// [`InputRow::variance`] is not filled: the pipeline estimates it from the colours.
    Estimated,
}

/// What a frame says of where its surfaces are in the frames beside it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Motion {
    /// Whether [`InputRow::backward`] is filled.
    pub backward: bool,
    /// Whether [`InputRow::forward`] is filled.
    pub forward: bool,
    /// Whether [`InputRow::position`] is filled.
    pub position: bool,
}

/// What a source's rows hold; constant for the whole image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct RowLayout {
    /// Size of the image.
    pub size: ImageSize,
    /// What [`InputRow::variance`] means.
    pub variance: VarianceKind,
    /// Which channels of features the image has, all of a normal and of an albedo or none; the others have no planes. Those of [`Feature::ALL`] come first.
    pub features: [bool; MAX_FEATURES],
    /// Which of them have variances of their own; planes of the others hold 0, and the pipeline estimates them.
    pub feature_variances: [bool; MAX_FEATURES],
    /// How the channels of further features belong together (see [`with_further_feature`](Self::with_further_feature)).
    pub further: FurtherFeatures,
    /// Extra colour layers to denoise with the models of the colour.
    pub layers: usize,
    /// Whether the image has an alpha, denoised likewise, by which the colour is premultiplied.
    pub alpha: bool,
    /// Other channels that are no light (depths, masks, vectors), denoised likewise.
    pub scalars: usize,
    /// Whether it says how many samples each pixel has, which [`sampling`](crate::sampling) asks for.
    pub samples: bool,
    /// What it says of motion, which [`temporal`](crate::temporal) asks for.
    pub motion: Motion,
    /// Whether it is made of several frames of a sequence.
    pub frames: bool,
    /// Columns at either end that are not the image's own, and not counted.
    pub(crate) margin: usize,
}

impl RowLayout {
    /// An image with a colour and nothing beside it.
    pub fn new(size: ImageSize, variance: VarianceKind) -> Self {
        Self {
            size,
            variance,
            features: [false; MAX_FEATURES],
            feature_variances: [false; MAX_FEATURES],
            further: FurtherFeatures::default(),
            layers: 0,
            alpha: false,
            scalars: 0,
            samples: false,
            motion: Motion::default(),
            frames: false,
            margin: 0,
        }
    }

    /// The same of another size.
    pub fn with_size(self, size: ImageSize) -> Self {
        Self { size, ..self }
    }

    /// Adds a feature, whose variances the pipeline estimates.
    pub fn with_feature(mut self, feature: Feature) -> Self {
        self.features[feature.range()].fill(true);
        self
    }

    /// Adds a feature that comes with its variances.
    pub fn with_feature_and_variance(mut self, feature: Feature) -> Self {
        self.feature_variances[feature.range()].fill(true);
        self.with_feature(feature)
    }

    /// Adds a feature that has no name here: whatever light may follow, of one to three channels that belong together; the pipeline estimates its variances. Its
    /// channels are those after the last of the features before it (see [`further_features`](Self::further_features)). A channel that is not finite counts as missing, and one of
    /// a magnitude of 1e9 or more as 0: a ray has left the scene.
    ///
    /// [`Error::Usage`] if it has none or more channels, or the further features of the image more than [`FURTHER`](crate::FURTHER).
    pub fn with_further_feature(mut self, channels: usize) -> Result<Self, Error> {
        self.further = self.further.with(channels)?;
        for range in self.further.ranges() {
            self.features[range].fill(true);
        }
        Ok(self)
    }

    /// The same of one that comes with its variances.
    pub fn with_further_feature_and_variance(self, channels: usize) -> Result<Self, Error> {
        let mut all = self.with_further_feature(channels)?;
        if let Some(last) = all.further.ranges().last() {
            all.feature_variances[last].fill(true);
        }
        Ok(all)
    }

    /// Where the channels of each further feature are in [`InputRow::features`] and [`InputRow::feature_variances`].
    pub fn further_features(&self) -> impl Iterator<Item = Range<usize>> {
        self.further.ranges()
    }

    /// With this many layers beside the colour.
    pub fn with_layers(self, layers: usize) -> Self {
        Self { layers, ..self }
    }

    /// With an alpha.
    pub fn with_alpha(self) -> Self {
        Self {
            alpha: true,
            ..self
        }
    }

    /// With this many channels that are no light.
    pub fn with_scalars(self, scalars: usize) -> Self {
        Self { scalars, ..self }
    }

    /// With the samples of each pixel.
    pub fn with_samples(self) -> Self {
        Self {
            samples: true,
            ..self
        }
    }

    /// With what the frame says of motion.
    pub fn with_motion(self, motion: Motion) -> Self {
        Self { motion, ..self }
    }

    /// Made of several frames.
    pub(crate) fn with_frames(self) -> Self {
        Self {
            frames: true,
            ..self
        }
    }

    /// Pixels that are the image's own.
    pub(crate) fn pixels(&self) -> u64 {
        let columns = self.size.width().saturating_sub(2 * self.margin);
        columns as u64 * self.size.height() as u64
    }

    /// The alpha and the other channels that are no light.
    pub(crate) fn all_scalars(&self) -> usize {
        usize::from(self.alpha) + self.scalars
    }

    /// Triples of channels that follow the colour: the layers, and then what is no light.
    pub(crate) fn followers(&self) -> usize {
        self.layers + self.all_scalars().div_ceil(3)
    }

    /// Channels that leave beside the colour: those of the layers, and what is no light.
    pub(crate) fn following_planes(&self) -> usize {
        3 * self.layers + self.all_scalars()
    }

    /// Whether the image has a feature.
    pub(crate) fn has(&self, feature: Feature) -> bool {
        self.features[feature.range().start]
    }

    /// Channels of all its features.
    pub(crate) fn feature_channels(&self) -> usize {
        self.features.iter().filter(|present| **present).count()
    }

    /// Whether it has more features than those that are known by their names.
    pub(crate) fn is_wide(&self) -> bool {
        self.further.channels() > 0
    }

    /// Where the channels are that belong together: of each feature that is known by its name, whether the image has it or not, and of each further one.
    pub(crate) fn groups(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let known = Feature::ALL.into_iter().map(Feature::range);
        known.chain(self.further.ranges())
    }
}

/// One row of input. Every plane has the image's width, but those of features that the image lacks are empty.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct InputRow {
    /// Mean radiance, red green blue.
    pub colour: [Vec<f32>; 3],
    /// Variance of the mean radiance (see [`VarianceKind`]). 0 says that the pixel is exact; a pixel with a NaN or an infinity in one of the channels has none that is
    /// known, and the pipeline estimates it from the picture (see [`Counts::estimated`](crate::Counts)).
    pub variance: [Vec<f32>; 3],
    /// Features, those of [`Feature::ALL`] first (see [`Feature::range`]) and then the further ones (see [`RowLayout::further_features`]).
    pub features: [Vec<f32>; MAX_FEATURES],
    /// Variances of the features' means.
    pub feature_variances: [Vec<f32>; MAX_FEATURES],
    /// Extra layers, each red green blue.
    pub layers: Vec<[Vec<f32>; 3]>,
    /// Alpha, 0 to 1; empty if the image has none.
    pub alpha: Vec<f32>,
    /// Channels that are no light.
    pub scalars: Vec<Vec<f32>>,
    /// How many samples each pixel has; empty unless the layout says so.
    pub samples: Vec<f32>,
    /// Where what pixel (x, y) shows was in the frame before: at (x + the first, y + the second), in pixels, x to the right and y down. NaN where nobody knows. Empty unless the layout says so.
    pub backward: [Vec<f32>; 2],
    /// Likewise where it is in the frame after.
    pub forward: [Vec<f32>; 2],
    /// Where in the world it is, in a frame's own units; not finite where there is nothing. Empty unless the layout says so.
    pub position: [Vec<f32>; 3],
    /// How many frames each pixel is made of, 1 and more; empty unless the layout says so.
    pub frames: Vec<f32>,
    /// Of a row that is made of several frames what its own frame has: the mean of the channels of the colour, and their variances' sum. Empty otherwise.
    pub light: [Vec<f32>; 2],
}

impl InputRow {
    /// A row of zeros that fits `layout`.
    pub fn new(layout: &RowLayout) -> Self {
        fn planes<const N: usize>(width: usize) -> [Vec<f32>; N] {
            core::array::from_fn(|_| vec![0.0; width])
        }
        let width = layout.size.width();
        let feature = |k: usize| vec![0.0; if layout.features[k] { width } else { 0 }];
        Self {
            colour: planes(width),
            variance: planes(width),
            features: core::array::from_fn(feature),
            feature_variances: core::array::from_fn(feature),
            layers: (0..layout.layers).map(|_| planes(width)).collect(),
            alpha: vec![0.0; if layout.alpha { width } else { 0 }],
            scalars: vec![vec![0.0; width]; layout.scalars],
            samples: vec![0.0; if layout.samples { width } else { 0 }],
            backward: planes(if layout.motion.backward { width } else { 0 }),
            forward: planes(if layout.motion.forward { width } else { 0 }),
            position: planes(if layout.motion.position { width } else { 0 }),
            frames: vec![0.0; if layout.frames { width } else { 0 }],
            light: planes(if layout.frames { width } else { 0 }),
        }
    }

    /// The planes of a feature: as many as it has channels, empty if the image lacks it.
    pub fn feature_mut(&mut self, feature: Feature) -> &mut [Vec<f32>] {
        &mut self.features[feature.range()]
    }

    /// The planes of its variances.
    pub fn feature_variance_mut(&mut self, feature: Feature) -> &mut [Vec<f32>] {
        &mut self.feature_variances[feature.range()]
    }

    /// Makes what pixels without samples hold unknown, colour, noise and features, so that their neighbours predict them. Renderers leave such pixels black; one that is not has a colour, whatever its `samples` say.
    pub(crate) fn forget_unsampled(&mut self, samples: &[f32]) {
        for (x, &count) in samples.iter().enumerate() {
            let empty = self
                .colour
                .iter()
                .all(|plane| plane[x] == 0.0 || plane[x].is_nan());
            if empty && (count == 0.0 || count.is_nan()) {
                let planes = self.colour.iter_mut().chain(&mut self.variance);
                let planes = planes.chain(&mut self.features);
                // a feature that the image lacks has no columns
                for value in planes.filter_map(|plane| plane.get_mut(x)) {
                    *value = f32::NAN;
                }
            }
        }
    }

    /// Every plane; a feature that the image lacks has empty ones.
    pub(crate) fn planes(&self) -> impl Iterator<Item = &Vec<f32>> {
        let features = self.features.iter().chain(&self.feature_variances);
        let radiance = self.colour.iter().chain(&self.variance);
        let layers = self.layers.iter().flatten();
        let scalars = [&self.alpha, &self.samples, &self.frames]
            .into_iter()
            .chain(&self.scalars);
        let motion = self.backward.iter().chain(&self.forward);
        let rest = motion.chain(&self.position).chain(&self.light);
        let light = radiance.chain(features).chain(layers);
        light.chain(scalars).chain(rest)
    }

    /// The same, to be filled.
    pub(crate) fn planes_mut(&mut self) -> impl Iterator<Item = &mut Vec<f32>> {
        let features = self.features.iter_mut().chain(&mut self.feature_variances);
        let radiance = self.colour.iter_mut().chain(&mut self.variance);
        let layers = self.layers.iter_mut().flatten();
        let scalars = [&mut self.alpha, &mut self.samples, &mut self.frames]
            .into_iter()
            .chain(&mut self.scalars);
        let motion = self.backward.iter_mut().chain(&mut self.forward);
        let rest = motion.chain(&mut self.position).chain(&mut self.light);
        let light = radiance.chain(features).chain(layers);
        light.chain(scalars).chain(rest)
    }

    /// Whether its planes have the sizes of a row made for `layout`.
    pub fn fits(&self, layout: &RowLayout) -> bool {
        let width = layout.size.width();
        let whole = |planes: &[Vec<f32>]| planes.iter().all(|plane| plane.len() == width);
        let features = |planes: &[Vec<f32>; MAX_FEATURES]| {
            let present = planes.iter().zip(layout.features);
            present
                .map(|(plane, present)| (plane.len(), if present { width } else { 0 }))
                .all(|(length, wanted)| length == wanted)
        };
        whole(&self.colour)
            && whole(&self.variance)
            && features(&self.features)
            && features(&self.feature_variances)
            && self.layers.len() == layout.layers
            && self.layers.iter().all(|layer| whole(layer))
            && self.alpha.len() == if layout.alpha { width } else { 0 }
            && self.scalars.len() == layout.scalars
            && whole(&self.scalars)
            && [
                (std::slice::from_ref(&self.samples), layout.samples),
                (&self.backward, layout.motion.backward),
                (&self.forward, layout.motion.forward),
                (&self.position, layout.motion.position),
                (std::slice::from_ref(&self.frames), layout.frames),
                (&self.light, layout.frames),
            ]
            .into_iter()
            .all(|(planes, present)| {
                let wanted = if present { width } else { 0 };
                planes.iter().all(|plane| plane.len() == wanted)
            })
    }

    /// Bytes of a row.
    pub fn bytes(layout: &RowLayout) -> u64 {
        let features = layout.feature_channels();
        let Motion {
            backward,
            forward,
            position,
        } = layout.motion;
        let motion =
            2 * usize::from(backward) + 2 * usize::from(forward) + 3 * usize::from(position);
        let others = motion + usize::from(layout.samples) + 3 * usize::from(layout.frames);
        let planes = 6 + 2 * features + layout.following_planes() + others;
        plane_bytes(layout.size, 1, planes)
    }
}

/// One row of output. Every plane has the image's width.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct OutputRow {
    /// Denoised radiance, red green blue; always finite.
    pub colour: [Vec<f32>; 3],
    /// Estimated mean squared error of the denoised radiance, mean over the channels, radiance squared.
    pub error: Vec<f32>,
    /// Half-width of the prediction windows that predicted the pixel, weighted mean, 0 to 9 pixels.
    pub radius: Vec<f32>,
    /// Local rank of those models, weighted mean, 0 to 9, or to 15 with further features.
    pub rank: Vec<f32>,
    /// Denoised extra layers, each red green blue.
    pub layers: Vec<[Vec<f32>; 3]>,
    /// Denoised alpha, 0 to 1; empty if the image has none.
    pub alpha: Vec<f32>,
    /// Denoised channels that are no light.
    pub scalars: Vec<Vec<f32>>,
    /// How many frames of a sequence each pixel is made of, 1 and more; empty for an image that is denoised alone.
    pub frames: Vec<f32>,
}

impl OutputRow {
    /// A row of zeros that fits `layout`.
    pub fn new(layout: &RowLayout) -> Self {
        let plane = || vec![0.0; layout.size.width()];
        Self {
            colour: std::array::from_fn(|_| plane()),
            error: plane(),
            radius: plane(),
            rank: plane(),
            layers: (0..layout.layers)
                .map(|_| std::array::from_fn(|_| plane()))
                .collect(),
            alpha: if layout.alpha { plane() } else { Vec::new() },
            scalars: (0..layout.scalars).map(|_| plane()).collect(),
            frames: if layout.frames { plane() } else { Vec::new() },
        }
    }

    /// Bytes of a row.
    pub fn bytes(layout: &RowLayout) -> u64 {
        plane_bytes(
            layout.size,
            1,
            6 + layout.following_planes() + usize::from(layout.frames),
        )
    }

    /// Every plane; an image without alpha has an empty one.
    pub(crate) fn planes(&self) -> impl Iterator<Item = &Vec<f32>> {
        let models = [&self.error, &self.radius, &self.rank, &self.frames];
        let layers = self.layers.iter().flatten();
        let scalars = std::iter::once(&self.alpha).chain(&self.scalars);
        let light = self.colour.iter().chain(layers);
        light.chain(models).chain(scalars)
    }

    /// The same, to be filled.
    pub(crate) fn planes_mut(&mut self) -> impl Iterator<Item = &mut Vec<f32>> {
        let models = [
            &mut self.error,
            &mut self.radius,
            &mut self.rank,
            &mut self.frames,
        ];
        let layers = self.layers.iter_mut().flatten();
        let scalars = std::iter::once(&mut self.alpha).chain(&mut self.scalars);
        let light = self.colour.iter_mut().chain(layers);
        light.chain(models).chain(scalars)
    }

    /// The alpha, if there is one, and the other channels that are no light.
    pub(crate) fn all_scalars(&self) -> impl Iterator<Item = &Vec<f32>> {
        let alpha = Some(&self.alpha).filter(|alpha| !alpha.is_empty());
        alpha.into_iter().chain(&self.scalars)
    }

    /// The same, to be filled.
    pub(crate) fn all_scalars_mut(&mut self) -> impl Iterator<Item = &mut Vec<f32>> {
        let alpha = Some(&mut self.alpha).filter(|alpha| !alpha.is_empty());
        alpha.into_iter().chain(&mut self.scalars)
    }
}

/// Half floats have 11 bits: each of a few layers and the colour may be rounded by 2^-12 of itself.
const SUM_TOLERANCE: f32 = 1.0 / 1024.0;

/// Whether the layers of a pixel sum to its colour, to the precision of half floats. Values that are not finite do not tell.
pub(crate) fn sums_up(colour: f32, layers: impl Iterator<Item = f32>) -> bool {
    let (mut sum, mut size) = (0.0, 0.0);
    for layer in layers {
        sum += layer;
        size += layer.abs();
    }
    let off = (sum - colour).abs() > SUM_TOLERANCE * colour.abs().max(size);
    !off
}

/// Delivers the rows of an image. An error of its own is an [`Error::renderer`](crate::Error::renderer).
pub trait RowSource: Send {
    /// What the rows hold.
    fn layout(&self) -> RowLayout;

    /// Fills `row` (made by [`InputRow::new`] for this layout) with row `y`. The pipeline asks for every row once,
    /// from 0 to `height - 1`; what takes several runs says so.
    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error>;
}

impl<S: RowSource + ?Sized> RowSource for &mut S {
    fn layout(&self) -> RowLayout {
        (**self).layout()
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        (**self).read_row(y, row)
    }
}

/// Takes the rows of a denoised image; a function of a row's number and the row does. An error of its own is an [`Error::renderer`](crate::Error::renderer).
pub trait RowSink: Send {
    /// Takes row `y`; called once for every row, from 0 to `height - 1`.
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error>;
}

impl<F: FnMut(usize, &OutputRow) -> Result<(), Error> + Send> RowSink for F {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        self(y, row)
    }
}
