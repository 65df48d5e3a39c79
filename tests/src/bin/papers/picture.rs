//! A noisy picture with its reference, and its tiles as the runner prepares them.

use std::error::Error;
use std::path::Path;

use exr::prelude::{FlatImage, FlatSamples};
use linpred_core::{
    BLOCK_HEIGHT, BLOCK_WIDTH, CELL, ColourBlock, Feature, FeatureGroup, FilteredGroup, HALO,
    POSITION, PREFILTER_HALO, Pixel, PixelState, TILE, WEIGHTS_HALO, WeightBlock, prefilter,
    weigh_samples,
};
use linpred_tests::cells::{FEATURES, Tile};
use linpred_tests::images;

/// Features of a file.
const CHANNELS: usize = FEATURES - POSITION;
/// Channels of a file and those with their variances, in core's order of features.
const FEATURE_CHANNELS: [[&str; 2]; CHANNELS] = [
    ["N.X", "NVariance.X"],
    ["N.Y", "NVariance.Y"],
    ["N.Z", "NVariance.Z"],
    ["albedo.R", "albedoVariance.R"],
    ["albedo.G", "albedoVariance.G"],
    ["albedo.B", "albedoVariance.B"],
    ["Z", "ZVariance.Z"],
];
const COLOUR: [[&str; 2]; 3] = [
    ["R", "variance.R"],
    ["G", "variance.G"],
    ["B", "variance.B"],
];

/// Pixels of a picture, row after row, and the variances of their means.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) colour: Vec<[f32; 3]>,
    pub(crate) variance: Vec<[f32; 3]>,
    features: Vec<[f32; CHANNELS]>,
    feature_variance: Vec<[f32; CHANNELS]>,
}

impl Picture {
    /// Reads a file with all features and variances.
    pub(crate) fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let file = File::read(path)?;
        let [colour, variance] = file.pixels(COLOUR)?;
        let [features, feature_variance] = file.pixels(FEATURE_CHANNELS)?;
        Ok(Self {
            width: file.width,
            height: file.height,
            colour,
            variance,
            features,
            feature_variance,
        })
    }

    /// The samples that `twice` has beyond those of `self`, of which it has twice as many: a picture with other noise.
    pub(crate) fn rest_of(&self, twice: &Self, samples: f32) -> Self {
        let (colour, variance) = rests(
            (&self.colour, &self.variance),
            (&twice.colour, &twice.variance),
            samples,
        );
        let (features, feature_variance) = rests(
            (&self.features, &self.feature_variance),
            (&twice.features, &twice.feature_variance),
            samples,
        );
        Self {
            colour,
            variance,
            features,
            feature_variance,
            ..*self
        }
    }

    /// Position in the picture of the nearest pixel to a column and row.
    fn clamped(&self, x: isize, y: isize) -> usize {
        let inside = |v: isize, size: usize| v.clamp(0, size as isize - 1) as usize;
        inside(y, self.height) * self.width + inside(x, self.width)
    }
}

/// Mean and variance of the mean of the second half of `2 n` samples, from those of all and of the first half.
fn rests<const N: usize>(
    (half, of_half): (&[[f32; N]], &[[f32; N]]),
    (all, of_all): (&[[f32; N]], &[[f32; N]]),
    n: f32,
) -> (Vec<[f32; N]>, Vec<[f32; N]>) {
    let each = half.iter().zip(of_half).zip(all.iter().zip(of_all));
    each.map(|((half, of_half), (all, of_all))| {
        let mean: [f32; N] = std::array::from_fn(|c| 2.0 * all[c] - half[c]);
        let variance = std::array::from_fn(|c| {
            let apart = half[c] - mean[c];
            let squares = of_all[c] * 2.0 * n * (2.0 * n - 1.0) - of_half[c] * n * (n - 1.0);
            ((squares - 0.5 * n * apart * apart) / (n * (n - 1.0))).max(0.0)
        });
        (mean, variance)
    })
    .unzip()
}

/// The reference: radiance and the variance of its mean.
#[derive(Clone, Debug)]
pub(crate) struct Reference {
    pub(crate) colour: Vec<[f32; 3]>,
    variance: Vec<[f32; 3]>,
}

impl Reference {
    /// Reads a file, which must say how noisy it is.
    pub(crate) fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let [colour, variance] = File::read(path)?.pixels(COLOUR)?;
        Ok(Self { colour, variance })
    }

    /// Squared error of a pixel, summed over the channels, without the reference's own noise: negative by chance where the error is small.
    pub(crate) fn squared_error(&self, pixel: usize, radiance: &[f64; 3]) -> f64 {
        let channels = radiance
            .iter()
            .zip(self.colour[pixel])
            .zip(self.variance[pixel]);
        channels
            .map(|((v, f), noise)| (v - f64::from(f)).powi(2) - f64::from(noise))
            .sum()
    }

    /// Relative mean squared error of a picture, as `linpred compare` has it.
    pub(crate) fn relative_error(&self, picture: &[[f64; 3]]) -> f64 {
        let pixels = picture.iter().zip(&self.colour).zip(&self.variance);
        let errors = pixels.flat_map(|((v, f), noise)| {
            (0..3).map(move |c| {
                let f = f64::from(f[c]);
                ((v[c] - f).powi(2) - f64::from(noise[c])) / (f * f + 0.01)
            })
        });
        errors.sum::<f64>() / (3 * picture.len()) as f64
    }
}

/// A file's first part.
struct File {
    path: String,
    image: FlatImage,
    width: usize,
    height: usize,
}

impl File {
    fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let path_text = path.display().to_string();
        if !path.is_file() {
            return Err(format!("{path_text}: no such file").into());
        }
        let image = images::read(path);
        let size = image.layer_data[0].size;
        Ok(Self {
            path: path_text,
            image,
            width: size.0,
            height: size.1,
        })
    }

    fn plane(&self, name: &str) -> Result<Vec<f32>, Box<dyn Error>> {
        let channels = &self.image.layer_data[0].channel_data.list;
        let channel = channels.iter().find(|channel| channel.name.eq(name));
        let channel = channel.ok_or_else(|| format!("{}: no channel {name}", self.path))?;
        let values: Vec<f32> = match &channel.sample_data {
            FlatSamples::F16(values) => values.iter().map(|v| v.to_f32()).collect(),
            FlatSamples::F32(values) => values.clone(),
            FlatSamples::U32(_) => {
                return Err(format!("{}: channel {name} holds integers", self.path).into());
            }
        };
        if values.iter().any(|v| !v.is_finite()) {
            return Err(format!(
                "{}: channel {name} holds what is not finite; the study takes none",
                self.path
            )
            .into());
        }
        Ok(values)
    }

    /// Pixels of channels, and of their variances.
    fn pixels<const N: usize>(
        &self,
        names: [[&str; 2]; N],
    ) -> Result<[Vec<[f32; N]>; 2], Box<dyn Error>> {
        let mut sets = [
            vec![[0.0; N]; self.width * self.height],
            vec![[0.0; N]; self.width * self.height],
        ];
        for (c, pair) in names.iter().enumerate() {
            for (set, name) in sets.iter_mut().zip(pair) {
                for (pixel, value) in set.iter_mut().zip(self.plane(name)?) {
                    pixel[c] = value;
                }
            }
        }
        Ok(sets)
    }
}

/// A picture after the stages before the fit, but fireflies: the papers know of none.
pub(crate) struct Prepared<'a> {
    pub(crate) picture: &'a Picture,
    weights: Vec<[f32; 3]>,
    features: Vec<[f32; CHANNELS]>,
    feature_variance: Vec<[f32; CHANNELS]>,
}

impl<'a> Prepared<'a> {
    /// Weighs the samples and filters the features; as rendered, these stay what they are.
    pub(crate) fn new(picture: &'a Picture, prefiltered: bool) -> Self {
        let mut prepared = Self {
            picture,
            weights: vec![[0.0; 3]; picture.colour.len()],
            features: picture.features.clone(),
            feature_variance: picture.feature_variance.clone(),
        };
        for y in (0..picture.height).step_by(BLOCK_HEIGHT) {
            for x in (0..picture.width).step_by(BLOCK_WIDTH) {
                prepared.weigh(x, y);
                if prefiltered {
                    prepared.filter::<3>(x, y, Feature::Normal);
                    prepared.filter::<3>(x, y, Feature::Albedo);
                    prepared.filter::<1>(x, y, Feature::Depth);
                }
            }
        }
        prepared
    }

    fn weigh(&mut self, x: usize, y: usize) {
        let mut input = Box::new(ColourBlock::BLACK);
        for row in 0..ColourBlock::HEIGHT {
            for column in 0..ColourBlock::WIDTH {
                let from = self.picture.clamped(
                    (x + column) as isize - WEIGHTS_HALO as isize,
                    (y + row) as isize - WEIGHTS_HALO as isize,
                );
                let colour = self.picture.colour[from];
                input.luminance[row][column] = colour.iter().map(|v| v.abs()).sum::<f32>() / 3.0;
                input.variance[row][column] = self.picture.variance[from].iter().sum();
                input.good[row][column] = 1.0;
            }
        }
        let mut output = Box::new(WeightBlock::EMPTY);
        weigh_samples(&input, &mut output);
        for (row, column, pixel) in inside(self.picture, x, y) {
            self.weights[pixel] =
                [&output.weight, &output.variance, &output.tolerance].map(|p| p[row][column]);
        }
    }

    fn filter<const N: usize>(&mut self, x: usize, y: usize, feature: Feature) {
        let mut input = Box::new(FeatureGroup::<N>::ZERO);
        for (c, k) in feature.range().enumerate() {
            for row in 0..FeatureGroup::<N>::HEIGHT {
                for column in 0..FeatureGroup::<N>::WIDTH {
                    let from = self.picture.clamped(
                        (x + column) as isize - PREFILTER_HALO as isize,
                        (y + row) as isize - PREFILTER_HALO as isize,
                    );
                    input.value[c][row][column] = self.picture.features[from][k];
                    input.variance[c][row][column] = self.picture.feature_variance[from][k];
                }
            }
        }
        let mut output = Box::new(FilteredGroup::<N>::ZERO);
        if prefilter(&input, &mut output, None) {
            for (c, k) in feature.range().enumerate() {
                for (row, column, pixel) in inside(self.picture, x, y) {
                    self.features[pixel][k] = output.value[c][row][column];
                    self.feature_variance[pixel][k] = output.variance[c][row][column];
                }
            }
        }
    }

    /// The cells of the picture, row after row.
    pub(crate) fn cells(&self) -> Vec<Cell> {
        let rows = (0..self.picture.height).step_by(CELL);
        rows.flat_map(|y| (0..self.picture.width).step_by(CELL).map(move |x| (x, y)))
            .map(|(x, y)| self.cell(x, y))
            .collect()
    }

    fn cell(&self, x: usize, y: usize) -> Cell {
        let mut cell = Cell {
            tile: Box::new(Tile::EMPTY),
            x,
            y,
            width: self.picture.width,
        };
        for position in 0..TILE * TILE {
            let (tx, ty) = (position % TILE, position / TILE);
            let pixel = &mut cell.tile.pixels[position];
            let (Some(px), Some(py)) = ((x + tx).checked_sub(HALO), (y + ty).checked_sub(HALO))
            else {
                continue;
            };
            if px >= self.picture.width || py >= self.picture.height {
                continue;
            }
            let from = py * self.picture.width + px;
            let [weight, variance, tolerance] = self.weights[from];
            *pixel = Pixel {
                features: [0.0; FEATURES],
                colour: self.picture.colour[from],
                weight,
                variance,
                tolerance,
                state: PixelState::Noisy,
            };
            pixel.features[POSITION..].copy_from_slice(&self.features[from]);
            cell.tile.feature_variance[position][POSITION..]
                .copy_from_slice(&self.feature_variance[from]);
        }
        for (position, pixel) in cell.tile.pixels.iter_mut().enumerate() {
            pixel.features[0] = (position % TILE) as f32;
            pixel.features[1] = (position / TILE) as f32;
        }
        cell
    }
}

/// Row and column of a block, and position in the picture, of the pixels of a block that are inside it.
fn inside(picture: &Picture, x: usize, y: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    let (width, height) = (picture.width, picture.height);
    let rows = (0..BLOCK_HEIGHT).filter(move |row| y + row < height);
    rows.flat_map(move |row| {
        let columns = (0..BLOCK_WIDTH).filter(move |column| x + column < width);
        columns.map(move |column| (row, column, (y + row) * width + x + column))
    })
}

/// A cell of the picture.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub(crate) tile: Box<Tile>,
    x: usize,
    y: usize,
    width: usize,
}

impl Cell {
    /// Whether a position of the tile is in the picture.
    pub(crate) fn holds(&self, position: usize) -> bool {
        self.tile.pixels[position].state != PixelState::Outside
    }

    /// Where in the picture a position of the tile is that lies inside it.
    pub(crate) fn pixel(&self, position: usize) -> usize {
        let (x, y) = (position % TILE, position / TILE);
        (self.y + y - HALO) * self.width + self.x + x - HALO
    }

    /// The position in the tile of a pixel of the cell.
    pub(crate) fn position(&self, x: usize, y: usize) -> usize {
        (y - self.y + HALO) * TILE + x - self.x + HALO
    }
}
