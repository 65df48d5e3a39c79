//! What flows between the layers: one row of an image as planes of `f32`.
//!
//! A [`RowSource`] (an EXR file, a renderer's buffers) delivers [`InputRow`]s from top to bottom; the
//! pipeline turns them into [`OutputRow`]s, from top to bottom, for a [`RowSink`]. Neither end knows the
//! other, and the pipeline knows neither files nor channel names.

use linpred_core::{FEATURES, Feature};

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

/// What a source's rows hold; constant for the whole image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct RowLayout {
    /// Size of the image.
    pub size: ImageSize,
    /// What [`InputRow::variance`] means.
    pub variance: VarianceKind,
    /// Which features the image has, all of a normal and of an albedo or none; the others have no planes.
    pub features: [bool; FEATURES],
    /// Which features have variances of their own; planes of the others hold 0, and the pipeline estimates them.
    pub feature_variances: [bool; FEATURES],
    /// Extra colour layers to denoise with the models of the colour.
    pub layers: usize,
}

impl RowLayout {
    /// An image with a colour and nothing beside it.
    pub fn new(size: ImageSize, variance: VarianceKind) -> Self {
        Self {
            size,
            variance,
            features: [false; FEATURES],
            feature_variances: [false; FEATURES],
            layers: 0,
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

    /// With this many layers beside the colour.
    pub fn with_layers(self, layers: usize) -> Self {
        Self { layers, ..self }
    }

    /// Whether the image has a feature.
    pub(crate) fn has(&self, feature: Feature) -> bool {
        self.features[feature.range().start]
    }
}

/// One row of input. Every plane has the image's width, but those of features that the image lacks are empty.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct InputRow {
    /// Mean radiance, red green blue.
    pub colour: [Vec<f32>; 3],
    /// Variance of the mean radiance (see [`VarianceKind`]).
    pub variance: [Vec<f32>; 3],
    /// Features (see [`FEATURES`] for the order).
    pub features: [Vec<f32>; FEATURES],
    /// Variances of the features' means.
    pub feature_variances: [Vec<f32>; FEATURES],
    /// Extra layers, each red green blue.
    pub layers: Vec<[Vec<f32>; 3]>,
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

    /// Whether its planes have the sizes of a row made for `layout`.
    pub fn fits(&self, layout: &RowLayout) -> bool {
        let width = layout.size.width();
        let whole = |planes: &[Vec<f32>]| planes.iter().all(|plane| plane.len() == width);
        let features = |planes: &[Vec<f32>; FEATURES]| {
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
    }

    /// Bytes of a row.
    pub fn bytes(layout: &RowLayout) -> u64 {
        let features = layout.features.iter().filter(|present| **present).count();
        plane_bytes(layout.size, 1, 6 + 2 * features + 3 * layout.layers)
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
    /// Local rank of those models, weighted mean, 0 to 9.
    pub rank: Vec<f32>,
    /// Denoised extra layers, each red green blue.
    pub layers: Vec<[Vec<f32>; 3]>,
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
        }
    }

    /// Bytes of a row.
    pub fn bytes(layout: &RowLayout) -> u64 {
        plane_bytes(layout.size, 1, 6 + 3 * layout.layers)
    }
}

/// Delivers the rows of an image. An error of its own is an [`Error::renderer`](crate::Error::renderer).
pub trait RowSource: Send {
    /// What the rows hold.
    fn layout(&self) -> RowLayout;

    /// Fills `row` (made by [`InputRow::new`] for this layout) with row `y`. The pipeline asks for every row once,
    /// from 0 to `height - 1`.
    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), crate::error::Error>;
}

/// Takes the rows of a denoised image. An error of its own is an [`Error::renderer`](crate::Error::renderer).
pub trait RowSink: Send {
    /// Takes row `y`; called once for every row, from 0 to `height - 1`.
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), crate::error::Error>;
}
