//! The unit of work: a cell with its halo.

/// Side of a cell in pixels: the windows' granularity (LPR section 5.1).
pub const CELL: usize = 19;
/// Largest half-width of a window and of a prediction window, R in the papers.
pub const RADIUS: usize = 9;
/// Pixels around a cell that its windows read and predict.
pub const HALO: usize = RADIUS;
/// Side of a tile: a cell with its halo.
pub const TILE: usize = CELL + 2 * HALO;
/// Pixels of a tile.
pub const TILE_AREA: usize = TILE * TILE;
/// Pixels of the largest window.
pub const WINDOW_AREA: usize = (2 * RADIUS + 1) * (2 * RADIUS + 1);

/// Channels of radiance: red, green, blue.
pub const CHANNELS: usize = 3;

/// What its cell does with a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PixelState {
    /// Outside the image: nothing reads or predicts it.
    #[default]
    Outside,
    /// Its variance and its neighbours' are 0: it passes through unchanged.
    Clean,
    /// Predicted, and read by fits.
    Noisy,
    /// Its colour is not finite, or one sample's alone: predicted by its neighbours' models, and never read by a fit.
    Bad,
}

/// One pixel of a tile with `D` features, of which the first two are the position.
///
/// With nine features it fills 64 bytes, a line of the cache: windows are read from several tiles at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Pixel<const D: usize> {
    /// Features after the prefilter, in any unit; finite.
    pub features: [f32; D],
    /// Radiance, red green blue; finite, 0 where the pixel is bad.
    pub colour: [f32; 3],
    /// Weight of the pixel's squared residual in a fit, 1 / radiance^2; 0 keeps it out.
    pub weight: f32,
    /// Variance of the mean radiance, summed over the channels and averaged over the neighbourhood.
    pub variance: f32,
    /// Squared distance, summed over the channels, within which a prediction agrees with the pixel.
    pub tolerance: f32,
    /// What its cell does with it.
    pub state: PixelState,
}

impl<const D: usize> Pixel<D> {
    /// A pixel outside the image.
    pub const OUTSIDE: Self = Self {
        features: [0.0; D],
        colour: [0.0; 3],
        weight: 0.0,
        variance: 0.0,
        tolerance: 0.0,
        state: PixelState::Outside,
    };
}

/// A cell with its halo, row after row: `pixels[y * TILE + x]`, the cell from (HALO, HALO) on.
#[derive(Clone, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Tile<const D: usize> {
    /// The pixels.
    pub pixels: [Pixel<D>; TILE_AREA],
    /// Variance that each pixel's features have kept, in the square of their units; 0 for the position.
    pub feature_variance: [[f32; D]; TILE_AREA],
}

/// Sets of features that models are shared out over: prefiltered, smoothed more, as rendered.
pub const SETS: usize = 3;

/// The features of a tile otherwise than its pixels have them: smoothed more, and as rendered. Models that differ in what they see are wrong in
/// different places.
pub type OtherFeatures<const D: usize> = [FeatureSet<D>; SETS - 1];

/// The features of a tile's pixels, position included, and the variance left in them.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureSet<const D: usize> {
    /// Features, as [`Pixel::features`].
    pub value: [[f32; D]; TILE_AREA],
    /// Variance, as [`Tile::feature_variance`].
    pub variance: [[f32; D]; TILE_AREA],
}

impl<const D: usize> FeatureSet<D> {
    /// Zeros.
    pub const EMPTY: Self = Self {
        value: [[0.0; D]; TILE_AREA],
        variance: [[0.0; D]; TILE_AREA],
    };
}

impl<const D: usize> Tile<D> {
    /// A tile that lies outside the image.
    pub const EMPTY: Self = Self {
        pixels: [Pixel::OUTSIDE; TILE_AREA],
        feature_variance: [[0.0; D]; TILE_AREA],
    };

    /// The pixel at `y * TILE + x`; beyond the tile, one outside the image.
    #[inline(always)]
    pub(crate) fn pixel_at(&self, position: usize) -> &Pixel<D> {
        self.pixels.get(position).unwrap_or(&Pixel::OUTSIDE)
    }
}

/// A tile and the sets of features that its models see.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a, const D: usize> {
    pub(crate) tile: &'a Tile<D>,
    /// `None` where every model sees the features of the tile's pixels.
    pub(crate) otherwise: Option<&'a OtherFeatures<D>>,
}

impl<'a, const D: usize> Seen<'a, D> {
    /// Set `set`, if it is not that of the tile's pixels.
    #[inline(always)]
    pub(crate) fn other(&self, set: usize) -> Option<&'a FeatureSet<D>> {
        let otherwise = self.otherwise?;
        set.checked_sub(1).and_then(|set| otherwise.get(set))
    }

    /// The variances of set `set`.
    #[inline(always)]
    pub(crate) fn variance_of(&self, set: usize) -> &'a [[f32; D]; TILE_AREA] {
        match self.other(set) {
            Some(features) => &features.variance,
            None => &self.tile.feature_variance,
        }
    }
}
