//! Synthetic frames in memory whose truth is known, and the pipeline run on them.

use std::num::NonZeroUsize;
use std::ops::{ControlFlow, Range};

use linpred::survey::{Survey, survey};
use linpred::{
    Error, FEATURES, Feature, ImageSize, InputRow, Options, OutputRow, Report, RowLayout, RowSink,
    RowSource, VarianceKind, denoise,
};
use linpred_core::Params;
use proptest::prelude::{Just, Strategy, any};
use proptest::sample::select;

use crate::images::noise;

/// Side of a cell.
pub const CELL: usize = 19;

/// Rows and columns around a pixel, beyond which nothing is read for it: it lies at the rim of a tile (36), whose farthest pixel
/// was prepared from 10 more, whose variances were estimated from 6 more, which may be fireflies by 4 more; after the blend it is smoothed with
/// pixels 3 and 12 away and what those are weighed by (3 more), cleared of specks beside 1 and lit by 16.
pub const REACH: usize = 36 + 10 + 6 + 4 + (3 + 12 + 3) + 1 + 16;

/// An image and, where it was made here, what it would be without noise.
#[derive(Clone, Debug)]
pub struct Frame {
    /// What the rows hold.
    pub layout: RowLayout,
    /// The rows.
    pub rows: Vec<InputRow>,
    /// Noiseless radiance, row after row.
    pub truth: Vec<[f32; 3]>,
}

/// What comes out.
#[derive(Clone, Debug)]
pub struct Output {
    /// The rows.
    pub rows: Vec<OutputRow>,
    /// The counts.
    pub report: Report,
}

/// A wall of `side` x `side` pixels, whose normals say nothing, and of which every pixel has `samples` samples, `sample(x, y, i)` the i-th.
pub fn sampled(
    side: usize,
    variance: VarianceKind,
    samples: usize,
    sample: impl Fn(usize, usize, usize) -> f32,
) -> Frame {
    let size = ImageSize::new(side, side).expect("not empty");
    let layout = RowLayout::new(size, variance).with_feature(Feature::Normal);
    let mut rows = vec![InputRow::new(&layout); side];
    for (y, row) in rows.iter_mut().enumerate() {
        row.features[2].fill(1.0);
        for x in 0..side {
            let values: Vec<f32> = (0..samples).map(|i| sample(x, y, i)).collect();
            let count = samples as f32;
            let mean = values.iter().sum::<f32>() / count;
            let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f32>();
            row.colour.iter_mut().for_each(|plane| plane[x] = mean);
            let of_mean = squares / (count - 1.0) / count;
            if variance != VarianceKind::Estimated {
                row.variance.iter_mut().for_each(|plane| plane[x] = of_mean);
            }
        }
    }
    Frame {
        layout,
        rows,
        truth: Vec::new(),
    }
}

/// A ball before a chequered wall under a soft shadow, and how it is sampled.
#[derive(Clone, Copy, Debug)]
pub struct Scene {
    /// Columns and rows.
    pub size: (usize, usize),
    /// The frame's top left pixel in the scene, for frames that are moved.
    pub origin: (usize, usize),
    /// Of the noise.
    pub seed: u32,
    /// Standard deviation of the radiance, as a part of it.
    pub noise: f32,
    /// Standard deviation of the features.
    pub feature_noise: f32,
    /// Whether features come at all.
    pub features: bool,
    /// Whether the variances come with the image.
    pub variances: bool,
    /// Extra layers; the last is what is missing to the colour.
    pub layers: usize,
}

impl Scene {
    /// A noisy image with everything that a renderer can write, but no layers.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            size: (width, height),
            origin: (0, 0),
            seed: 1,
            noise: 0.3,
            feature_noise: 0.02,
            features: true,
            variances: true,
            layers: 0,
        }
    }

    /// The image.
    pub fn render(&self) -> Frame {
        let (width, height) = self.size;
        let size = ImageSize::new(width, height).expect("not empty");
        let variance = match self.variances {
            true => VarianceKind::OfMean,
            false => VarianceKind::Estimated,
        };
        let mut layout = RowLayout::new(size, variance).with_layers(self.layers);
        layout.features[..FEATURES].fill(self.features);
        layout.feature_variances[..FEATURES].fill(self.features && self.variances);
        let mut frame = Frame {
            layout,
            rows: (0..height).map(|_| InputRow::new(&layout)).collect(),
            truth: Vec::with_capacity(width * height),
        };
        for (y, row) in frame.rows.iter_mut().enumerate() {
            for x in 0..width {
                let truth = self.sample(row, x, (x + self.origin.0, y + self.origin.1));
                frame.truth.push(truth);
            }
        }
        frame
    }

    fn sample(&self, row: &mut InputRow, x: usize, at: (usize, usize)) -> [f32; 3] {
        let clean = features(at);
        let radiance = radiance(&clean, at);
        let present = FEATURES * usize::from(self.features);
        for (k, &value) in clean.iter().enumerate().take(present) {
            row.features[k][x] = value + self.feature_noise * self.normal(k + 8, at);
            if self.variances {
                row.feature_variances[k][x] = self.feature_noise * self.feature_noise;
            }
        }
        for (c, &value) in radiance.iter().enumerate() {
            let deviation = self.noise * value;
            row.colour[c][x] = value + deviation * self.normal(c, at);
            if self.variances {
                row.variance[c][x] = deviation * deviation;
            }
            let mut rest = row.colour[c][x];
            for k in 0..self.layers {
                let share = if k + 1 < self.layers {
                    row.colour[c][x] * (0.2 + 0.5 * clean[3] * self.normal(k + 20, at))
                } else {
                    rest
                };
                rest -= share;
                row.layers[k][c][x] = share;
            }
        }
        radiance
    }

    /// A number of mean 0 and variance 1 that depends on the pixel of the scene alone: the sum of twelve uniform ones.
    fn normal(&self, stream: usize, (x, y): (usize, usize)) -> f32 {
        let index = (y << 12) + x;
        let uniform = |i| noise(self.seed * 1000 + (12 * stream + i) as u32, index);
        (0..12).map(uniform).sum::<f32>() - 6.0
    }
}

/// Normal, albedo and depth.
fn features((x, y): (usize, usize)) -> [f32; FEATURES] {
    let (u, v) = ((x % 64) as f32 / 32.0 - 1.0, (y % 64) as f32 / 32.0 - 1.0);
    let height = 0.6 - u * u - v * v;
    if height > 0.0 {
        let z = height.sqrt();
        return [u, v, z, 0.7, 0.4, 0.2, 3.0 - z];
    }
    let bright = (x / 7 + y / 11) % 2 == 0;
    let albedo = if bright { 0.8 } else { 0.25 };
    [0.0, 0.0, 1.0, albedo, albedo, 0.9 * albedo, 4.0 + 0.2 * u]
}

/// Light from the upper left, and a soft shadow that no feature knows of.
fn radiance(features: &[f32; FEATURES], (x, y): (usize, usize)) -> [f32; 3] {
    let [nx, ny, nz, red, green, blue, _] = *features;
    let light = (0.6 * nz - 0.5 * nx - 0.4 * ny).max(0.0) + 0.1;
    let shadow = 0.6 + 0.4 * ((x as f32 + 0.5 * y as f32) / 9.0).sin();
    [red, green, blue].map(|albedo| albedo * light * shadow)
}

impl Frame {
    /// Columns.
    pub fn width(&self) -> usize {
        self.layout.size.width()
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.layout.size.height()
    }

    /// Only these rows.
    pub fn crop(&self, rows: Range<usize>) -> Self {
        let size = ImageSize::new(self.width(), rows.len()).expect("not empty");
        Self {
            layout: self.layout.with_size(size),
            rows: self.rows[rows.clone()].to_vec(),
            truth: self.truth[rows.start * self.width()..rows.end * self.width()].to_vec(),
        }
    }

    /// Denoises it on one thread.
    pub fn denoise(&self, params: Params) -> Output {
        self.denoise_on(1, params)
    }

    /// Denoises it on several threads.
    pub fn denoise_on(&self, threads: usize, params: Params) -> Output {
        let mut source = Asked {
            frame: self,
            next: 0,
        };
        let mut sink = Taken { rows: Vec::new() };
        let threads = NonZeroUsize::new(threads).expect("at least one");
        let options = Options::new(params).with_threads(threads);
        let report = denoise(&mut source, &mut sink, &options, &mut |_| {
            ControlFlow::Continue(())
        })
        .expect("memory does not fail");
        assert_eq!(
            (source.next, sink.rows.len()),
            (self.height(), self.height())
        );
        Output {
            rows: sink.rows,
            report,
        }
    }
}

impl Frame {
    /// Makes `columns` of `rows` one colour and one surface without noise, whether variances come with the image or not.
    pub fn calm(&mut self, columns: Range<usize>, rows: Range<usize>) {
        let set = |plane: &mut Vec<f32>, value| {
            // a feature that the image lacks has no columns
            let inside = plane.iter_mut().take(columns.end).skip(columns.start);
            inside.for_each(|v| *v = value);
        };
        for row in &mut self.rows[rows] {
            let values = row.colour.iter_mut().chain(&mut row.features);
            let values = values.chain(row.layers.iter_mut().flatten());
            values.for_each(|plane| set(plane, 0.5));
            let variances = row.variance.iter_mut().chain(&mut row.feature_variances);
            variances.for_each(|plane| set(plane, 0.0));
        }
    }

    /// Makes the pixel at (x, y) a firefly: radiance `value` by one sample alone, which is how large its standard deviation then is.
    pub fn add_firefly(&mut self, (x, y): (usize, usize), value: f32) {
        let row = &mut self.rows[y];
        row.colour.iter_mut().for_each(|plane| plane[x] = value);
        if self.layout.variance != VarianceKind::Estimated {
            let planes = row.variance.iter_mut();
            planes.for_each(|plane| plane[x] = value * value);
        }
    }

    /// Which pixels are fireflies, row after row, by the definition.
    pub fn fireflies(&self) -> Vec<bool> {
        let (width, height) = (self.width(), self.height());
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels.map(|(x, y)| self.is_firefly(x, y)).collect()
    }

    /// Mean magnitude of the channels, and the variance of the mean summed over them; 0 where the pixel is bad.
    fn luminance(&self, x: usize, y: usize) -> (f64, f64) {
        let row = &self.rows[y];
        let colour = row.colour.each_ref().map(|plane| f64::from(plane[x]));
        if colour.iter().any(|v| v.is_nan() || v.abs() > 1e15) {
            return (0.0, 0.0);
        }
        let variance = row.variance.iter().map(|plane| f64::from(plane[x])).sum();
        (colour.iter().map(|v| v.abs()).sum::<f64>() / 3.0, variance)
    }

    fn is_firefly(&self, x: usize, y: usize) -> bool {
        let (own, variance) = self.luminance(x, y);
        let around = |radius: usize| -> Vec<f64> {
            let rows = y.saturating_sub(radius)..self.height().min(y + radius + 1);
            let columns = x.saturating_sub(radius)..self.width().min(x + radius + 1);
            let pixels = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            let others = pixels.filter(|other| *other != (x, y));
            let mut values: Vec<f64> = others.map(|(x, y)| self.luminance(x, y).0).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let stated = self.layout.variance != VarianceKind::Estimated;
        let near = around(2);
        let level = near.iter().rev().nth(usize::from(stated));
        let level = level.copied().unwrap_or(0.0);
        let rivals = around(4).iter().filter(|v| 8.0 * **v >= own).count();
        let noise = !stated || (own - level).powi(2) < 3.0 * variance;
        level > 0.0 && own > 8.0 * level && rivals <= 1 && noise
    }

    /// Surveys it on several threads.
    pub fn survey_on(&self, threads: usize) -> Survey {
        let mut source = Asked {
            frame: self,
            next: 0,
        };
        let threads = NonZeroUsize::new(threads).expect("at least one");
        let mut rows = 0;
        let survey = survey(&mut source, threads, &mut |done| {
            assert!(done > rows);
            rows = done;
            ControlFlow::Continue(())
        })
        .expect("memory does not fail");
        assert_eq!((source.next, rows), (self.height(), self.height()));
        survey
    }
}

impl Output {
    /// Denoised radiance, row after row.
    pub fn colours(&self) -> Vec<[f32; 3]> {
        let row = |row: &OutputRow| pixels(&row.colour);
        self.rows.iter().flat_map(row).collect()
    }

    /// The bits of every value of these rows and columns: radiance, error, radius, rank and layers.
    pub fn bits(&self, rows: Range<usize>, columns: Range<usize>) -> Vec<u32> {
        let rows = self.rows[rows].iter();
        let planes = rows.flat_map(|row| {
            let layers = row.layers.iter().flatten();
            let colour = row.colour.iter().chain(layers);
            colour.chain([&row.error, &row.radius, &row.rank])
        });
        planes
            .flat_map(|plane| plane[columns.clone()].iter().map(|v| v.to_bits()))
            .collect()
    }

    /// The bits of everything.
    pub fn all_bits(&self) -> Vec<u32> {
        self.bits(0..self.rows.len(), 0..self.rows[0].error.len())
    }

    /// Whether every value is finite.
    pub fn is_finite(&self) -> bool {
        self.all_bits()
            .into_iter()
            .all(|v| f32::from_bits(v).is_finite())
    }
}

/// The pixels of three planes.
pub fn pixels(planes: &[Vec<f32>; 3]) -> Vec<[f32; 3]> {
    let [red, green, blue] = planes;
    let pairs = red.iter().zip(green).zip(blue);
    pairs.map(|((&r, &g), &b)| [r, g, b]).collect()
}

/// A source that insists on what the pipeline promises: every row once, from the top.
struct Asked<'a> {
    frame: &'a Frame,
    next: usize,
}

impl RowSource for Asked<'_> {
    fn layout(&self) -> RowLayout {
        self.frame.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        assert_eq!(y, self.next);
        self.next += 1;
        row.clone_from(&self.frame.rows[y]);
        Ok(())
    }
}

/// A frame whose rows may be asked for in any order, and several times.
#[derive(Clone, Copy, Debug)]
pub struct AnyRow<'a>(pub &'a Frame);

impl RowSource for AnyRow<'_> {
    fn layout(&self) -> RowLayout {
        self.0.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        row.clone_from(&self.0.rows[y]);
        Ok(())
    }
}

struct Taken {
    rows: Vec<OutputRow>,
}

impl RowSink for Taken {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        assert_eq!(y, self.rows.len());
        self.rows.push(row.clone());
        Ok(())
    }
}

/// Scenes of all sizes up to 90 x 70, those about cells (19) and blocks (28) more often than others.
pub fn scenes() -> impl Strategy<Value = Scene> {
    let side = |largest: usize| {
        select(vec![1, 2, 9, 18, 19, 20, 28, 29, 37, 38, 39, 57, largest])
            .prop_flat_map(move |side| proptest::prop_oneof![Just(side), 1..=largest])
    };
    let noise = (
        select(vec![0.0f32, 0.1, 0.3, 1.0]),
        select(vec![0.0f32, 0.02, 0.1]),
    );
    let what = (any::<bool>(), any::<bool>(), 0usize..3);
    (side(90), side(70), any::<u16>(), noise, what).prop_map(
        |(width, height, seed, (noise, feature_noise), (features, variances, layers))| Scene {
            seed: u32::from(seed),
            noise,
            feature_noise,
            features,
            variances,
            layers,
            ..Scene::new(width, height)
        },
    )
}
