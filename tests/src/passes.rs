//! Passes of a picture whose samples are all known, and what they are together by the definitions.

use std::path::{Path, PathBuf};

use exr::prelude::FlatSamples;

use crate::images::{NamedSamples, TestPart, exponential, noise, part, write};

/// What a pass is called, and the layer of its noise.
const LAYERS: [(&str, &str); 13] = [
    ("R", "variance.R"),
    ("G", "variance.G"),
    ("B", "variance.B"),
    ("albedo.R", "albedoVariance.R"),
    ("albedo.G", "albedoVariance.G"),
    ("albedo.B", "albedoVariance.B"),
    ("N.X", "NVariance.X"),
    ("N.Y", "NVariance.Y"),
    ("N.Z", "NVariance.Z"),
    ("Z", "ZVariance.Z"),
    ("P.X", "PVariance.X"),
    ("P.Y", "PVariance.Y"),
    ("P.Z", "PVariance.Z"),
];

/// The means that have noise, and its channels.
pub fn layers() -> impl Iterator<Item = (&'static str, &'static str)> {
    LAYERS.into_iter()
}

/// Samples of a picture: as many as one likes in every pixel.
#[derive(Clone, Copy, Debug)]
pub struct Picture {
    /// Columns and rows.
    pub size: (usize, usize),
    /// Another one shows something else.
    pub scene: u32,
}

/// The statistics of some samples of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Statistics {
    /// How many.
    pub count: usize,
    /// 0 of none.
    pub mean: f64,
    /// Of one sample; NaN with fewer than two.
    pub variance: f64,
    /// The mean of the squares.
    pub moment: f64,
}

impl Picture {
    /// Pixels.
    pub fn pixels(self) -> usize {
        self.size.0 * self.size.1
    }

    /// A sample of one of the layers: noise, skewed as radiance is, around a picture with slopes and edges.
    pub fn sample(self, layer: usize, pixel: usize, sample: usize) -> f32 {
        let (x, y) = (pixel % self.size.0, pixel / self.size.0);
        let edge = noise(self.scene * 31 + layer as u32, x / 9 + 100 * (y / 7));
        let random = exponential(layer as u32 + 1, pixel * 997 + sample);
        (0.5 + edge + 0.01 * x as f32) * (0.8 + 0.2 * random)
    }

    /// What samples of a pixel are by the definitions.
    pub fn statistics(self, layer: usize, pixel: usize, samples: &[usize]) -> Statistics {
        let values = samples
            .iter()
            .map(|&s| f64::from(self.sample(layer, pixel, s)));
        let n = samples.len() as f64;
        let mean = values.clone().sum::<f64>() / n.max(1.0);
        let squares: f64 = values.clone().map(|v| (v - mean) * (v - mean)).sum();
        Statistics {
            count: samples.len(),
            mean,
            variance: if n < 2.0 {
                f64::NAN
            } else {
                squares / (n - 1.0)
            },
            moment: values.map(|v| v * v).sum::<f64>() / n.max(1.0),
        }
    }

    /// A pass of the samples `taken` of each pixel, with their number. A pixel without any is NaN.
    pub fn pass(self, taken: impl Fn(usize) -> Vec<usize>) -> Vec<NamedSamples> {
        let plane = |value: &dyn Fn(usize) -> f64| {
            let values = (0..self.pixels()).map(|pixel| value(pixel) as f32);
            FlatSamples::F32(values.collect())
        };
        let mut channels = Vec::new();
        for (layer, (name, noise)) in layers().enumerate() {
            let of = |pixel| self.statistics(layer, pixel, &taken(pixel));
            let mean = |pixel: usize| match of(pixel).count {
                0 => f64::NAN,
                _ => of(pixel).mean,
            };
            channels.push((name.to_owned(), plane(&mean)));
            let variance = |pixel: usize| of(pixel).variance / of(pixel).count as f64;
            channels.push((noise.to_owned(), plane(&variance)));
        }
        let count = |pixel: usize| taken(pixel).len() as f64;
        channels.push(("sampleCount".to_owned(), plane(&count)));
        channels
    }

    /// Writes passes of so many samples in every pixel, none of which two have: `1.exr`, `2.exr` and so on.
    pub fn write_passes(self, folder: &Path, counts: &[usize]) -> Vec<PathBuf> {
        let mut first = 0;
        let mut paths = Vec::new();
        for (n, count) in counts.iter().enumerate() {
            let taken = first..first + count;
            let path = folder.join(format!("{}.exr", n + 1));
            write(
                &path,
                self.size,
                vec![self.part(|_| taken.clone().collect())],
            );
            paths.push(path);
            first += count;
        }
        paths
    }

    /// The part of a file with such a pass.
    pub fn part(self, taken: impl Fn(usize) -> Vec<usize>) -> TestPart {
        part(self.pass(taken))
    }
}
