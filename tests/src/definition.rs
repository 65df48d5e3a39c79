//! One model of a tile from its formulas, in f64 and from scratch for every radius: nothing shared, nothing recursive.

mod wlr;

pub use wlr::Regression;

use linpred_core::{Formulas, LayerTile, Params, TILE};
use nalgebra::DMatrix;

use crate::cells::{FEATURES, Tile};
use crate::oracle::{BatchFit, Prior, Row};
use crate::windows::{pixels_within, ring_order};

/// A pixel of the window, in the window's unit of radiance.
#[derive(Clone, Debug)]
struct Sample {
    /// Of which frame, 0 the window's own.
    frame: usize,
    /// In the tile.
    position: usize,
    y: [f64; 3],
    weight: f64,
    variance: f64,
    tolerance: f64,
}

impl Sample {
    /// Its weight; without one, that of the window's darkest.
    fn own_weight(&self) -> f64 {
        if self.weight > 0.0 { self.weight } else { 1.0 }
    }

    /// Variance relative to the radiance around.
    fn noise(&self) -> f64 {
        self.variance * self.own_weight() + 1e-6
    }

    fn valid(&self) -> bool {
        self.weight > 0.0
    }
}

/// The window of one centre.
#[derive(Clone, Debug)]
pub struct Window {
    samples: Vec<Sample>,
    /// Regressors of every pixel, 1 first.
    z: Vec<Vec<f64>>,
    radiance_scale: f64,
    params: Params,
    /// Directions kept, by feature, in the unit of the features' range.
    axes: DMatrix<f64>,
    /// Variance left in each feature in that unit, mean over the valid pixels.
    feature_noise: Vec<f64>,
    /// How many directions are kept.
    pub rank: usize,
    /// The factor, above 1, between the threshold and the singular value nearest to it.
    pub clearance: f64,
    /// Whether a direction that the features do move along was dropped.
    pub truncated: bool,
    /// The least difference of two kept eigenvalues, as a part of the larger: where they are alike, so are all directions between theirs.
    pub gap: f64,
}

/// A fit of some radius.
#[derive(Clone, Debug)]
pub struct Model {
    /// Half-width of its window.
    pub radius: usize,
    /// Its mean squared error as it is estimated.
    pub risk: f64,
    beta: [Vec<f64>; 3],
    terms: usize,
}

impl Model {
    /// Whether it has the terms of all kept directions.
    pub fn is_of_full_rank(&self) -> bool {
        self.terms == self.beta[0].len()
    }
}

/// What a model says of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Prediction {
    /// Of the pixel in the tile.
    pub position: usize,
    /// Radiance.
    pub colour: [f64; 3],
    /// Its weight among others.
    pub weight: f64,
    /// Its squared error as it is estimated, mean over the channels.
    pub error: f64,
}

impl Window {
    /// The window around a position of the tile. It has a valid pixel.
    pub fn new(tile: &Tile, centre: usize, params: Params) -> Self {
        Self::within(&[tile], 9, centre, params)
    }

    /// The 7 x 7 pixels around a position in each of several frames, the first the window's own (WLR section 8).
    pub fn over_frames(frames: &[&Tile], centre: usize, params: Params) -> Self {
        Self::within(frames, 3, centre, params)
    }

    fn within(frames: &[&Tile], radius: usize, centre: usize, params: Params) -> Self {
        let around = ring_order().into_iter().take(pixels_within(radius));
        let positions: Vec<usize> = around
            .map(|(x, y)| (centre as i32 + y * TILE as i32 + x) as usize)
            .collect();
        let of_frame = |frame| positions.iter().map(move |&position| (frame, position));
        let places: Vec<(usize, usize)> = (0..frames.len()).flat_map(of_frame).collect();
        let weights = places.iter().map(|&(k, i)| frames[k].pixels[i].weight);
        let heaviest = f64::from(weights.fold(0.0, f32::max));
        let samples: Vec<Sample> = places
            .iter()
            .map(|&(frame, position)| {
                let pixel = &frames[frame].pixels[position];
                Sample {
                    frame,
                    position,
                    y: pixel.colour.map(|v| f64::from(v) * heaviest.sqrt()),
                    weight: f64::from(pixel.weight) / heaviest,
                    variance: f64::from(pixel.variance) * heaviest,
                    tolerance: f64::from(pixel.tolerance) * heaviest,
                }
            })
            .collect();
        let mut window = Self {
            samples,
            z: Vec::new(),
            radiance_scale: heaviest.sqrt(),
            params,
            axes: DMatrix::zeros(FEATURES, 0),
            feature_noise: vec![0.0; FEATURES],
            rank: 0,
            clearance: 0.0,
            truncated: false,
            gap: 0.0,
        };
        window.find_features(frames);
        window
    }

    fn valid(&self) -> Vec<usize> {
        (0..self.samples.len())
            .filter(|&i| self.samples[i].valid())
            .collect()
    }

    /// Local features: range, mean and truncated SVD (WLR section 4 and 7).
    fn find_features(&mut self, frames: &[&Tile]) {
        let valid = self.valid();
        let feature = |i: usize, j: usize| {
            let sample = &self.samples[i];
            f64::from(frames[sample.frame].pixels[sample.position].features[j])
        };
        let mut mapped = DMatrix::zeros(self.samples.len(), FEATURES);
        let mut noise = 0.0;
        for j in 0..FEATURES {
            let of_valid = || valid.iter().map(|&i| feature(i, j));
            let (low, high) = (
                of_valid().fold(f64::MAX, f64::min),
                of_valid().fold(f64::MIN, f64::max),
            );
            if high - low <= 1e-5 * (high.abs() + low.abs()) {
                continue;
            }
            let scale = 2.0 / (high - low);
            let inside = |i| feature(i, j).clamp(low, high);
            for i in 0..self.samples.len() {
                mapped[(i, j)] = (inside(i) - inside(0)) * scale;
            }
            for &i in &valid {
                let sample = &self.samples[i];
                let variance = frames[sample.frame].feature_variance[sample.position][j];
                let mapped = f64::from(variance) * scale * scale;
                noise += mapped;
                self.feature_noise[j] += mapped / valid.len() as f64;
            }
        }
        let mut centred = mapped.select_rows(&valid);
        for mut column in centred.column_iter_mut() {
            let mean = column.mean();
            column.add_scalar_mut(-mean);
        }
        let gramian = (centred.transpose() * centred).symmetric_eigen();
        let largest = gramian.eigenvalues.max();
        let truncation = f64::from(self.params.truncation);
        let threshold = (truncation * truncation * noise).max(1e-8 * largest);
        let mut order: Vec<usize> = (0..FEATURES).collect();
        order.sort_by(|&a, &b| gramian.eigenvalues[b].total_cmp(&gramian.eigenvalues[a]));
        order.retain(|&m| gramian.eigenvalues[m] > threshold);
        self.rank = order.len();
        let kept = order.iter().map(|&m| gramian.eigenvalues[m]);
        let next = kept.clone().skip(1);
        self.gap = kept.zip(next).map(|(a, b)| 1.0 - b / a).fold(1.0, f64::min);
        let distances = gramian.eigenvalues.iter().map(|v| {
            let ratio = v.max(1e-12 * largest) / threshold;
            ratio.max(1.0 / ratio)
        });
        self.clearance = distances.fold(f64::INFINITY, f64::min);
        let moving = gramian.eigenvalues.iter().filter(|v| **v > 1e-8 * largest);
        self.truncated = moving.count() > self.rank;
        self.axes = gramian.eigenvectors.select_columns(&order);
        let local = mapped * &self.axes;
        self.z = local
            .row_iter()
            .map(|row| std::iter::once(1.0).chain(row.iter().copied()).collect())
            .collect();
    }

    /// The largest radiance of the valid pixels.
    pub fn largest_radiance(&self) -> f64 {
        let all = self.valid().into_iter().flat_map(|i| self.samples[i].y);
        all.fold(0.0, |a: f64, b| a.max(b.abs())) / self.radiance_scale
    }

    fn rows(&self, pixels: std::ops::Range<usize>, y: &[[f64; 3]]) -> Vec<Row> {
        let pixels = pixels.filter(|&i| self.samples[i].valid());
        pixels
            .map(|i| Row {
                z: self.z[i].clone(),
                y: y[i],
                weight: match self.params.formulas {
                    Formulas::Robust => self.weight(i),
                    Formulas::Literal => 1.0,
                    other => panic!("{other:?} has no definition"),
                },
            })
            .collect()
    }

    /// A pixel's weight, half of it where its local features are the root of 5 away from the centre's.
    fn weight(&self, i: usize) -> f64 {
        let squared: f64 = self.z[i].iter().skip(1).map(|z| z * z).sum();
        self.samples[i].weight * 5.0 / (5.0 + squared)
    }

    /// The prior of a fit to these rows: the centre and no gradients (LPR Eq. 3), in pixels of average weight.
    fn prior(&self, rows: &[Row], centre: [f64; 3]) -> Prior {
        let mean_weight = rows.iter().map(|row| row.weight).sum::<f64>() / rows.len() as f64;
        let mut delta = vec![f64::from(self.params.gradient_strength); self.rank + 1];
        delta[0] = f64::from(self.params.intercept_strength);
        if self.params.formulas == Formulas::Robust {
            delta.iter_mut().for_each(|d| *d *= mean_weight);
            if !self.samples[0].valid() {
                delta[0] = 0.0;
            }
        }
        let initial = centre.map(|y| {
            let mut initial = vec![0.0; self.rank + 1];
            initial[0] = y;
            initial
        });
        Prior { initial, delta }
    }

    fn own(&self) -> Vec<[f64; 3]> {
        self.samples.iter().map(|sample| sample.y).collect()
    }

    fn batch(&self, radius: usize, y: &[[f64; 3]]) -> (Vec<Row>, BatchFit) {
        let rows = self.rows(0..pixels_within(radius), y);
        let prior = self.prior(&rows, y[0]);
        let fit = BatchFit::new(&rows, &prior);
        (rows, fit)
    }

    /// The models of all radii, 0 first. A radius without a valid pixel has none.
    pub fn models(&self) -> Vec<Model> {
        let mut models = vec![self.centre()];
        let mut accumulated = 0.0;
        for radius in 1..=9 {
            if self.rows(0..pixels_within(radius), &self.own()).is_empty() {
                continue;
            }
            let (rows, fit) = self.batch(radius, &self.own());
            let risk = match self.params.formulas {
                Formulas::Robust => self.robust_risk(radius, &rows, &fit, &mut accumulated),
                Formulas::Literal => self.literal_risk(radius, &rows, &mut accumulated),
                other => panic!("{other:?} has no definition"),
            };
            models.push(Model {
                radius,
                risk,
                beta: fit.beta.map(|beta| beta.iter().copied().collect()),
                terms: self.rank + 1,
            });
        }
        models
    }

    /// The pixel itself (LPR section 4.2).
    fn centre(&self) -> Model {
        let centre = &self.samples[0];
        Model {
            radius: 0,
            risk: if centre.valid() {
                centre.variance
            } else {
                f64::INFINITY
            },
            beta: centre.y.map(|y| {
                let mut beta = vec![0.0; self.rank + 1];
                beta[0] = y;
                beta
            }),
            terms: match self.params.formulas {
                Formulas::Robust => 1,
                Formulas::Literal => self.rank + 1,
                other => panic!("{other:?} has no definition"),
            },
        }
    }

    /// Stein's unbiased risk up to r = 2; from there on, the ring's error without its noise by the fit before it.
    fn robust_risk(&self, radius: usize, rows: &[Row], fit: &BatchFit, risk: &mut f64) -> f64 {
        let inside = (0..pixels_within(radius)).filter(|&i| self.samples[i].valid());
        let (mut weights, mut noise, mut squares, mut freedom) = (0.0, 0.0, 0.0, 0.0);
        for (i, row) in inside.zip(rows) {
            weights += row.weight;
            noise += row.weight * self.samples[i].variance;
            squares += row.weight * distance(&fit.predict(&row.z), &row.y);
            freedom += row.weight * fit.leverage(&row.z);
        }
        let mean_noise = noise / rows.len() as f64;
        if radius < 3 {
            let stein = squares - noise + 2.0 * mean_noise * freedom;
            *risk = stein.max(0.3 * mean_noise * freedom);
        } else {
            let (_, before) = self.batch(radius - 1, &self.own());
            let ring = pixels_within(radius - 1)..pixels_within(radius);
            for i in ring.filter(|&i| self.samples[i].valid()) {
                let sample = &self.samples[i];
                let error = distance(&before.predict(&self.z[i]), &sample.y);
                *risk += self.weight(i) * (error - sample.variance);
            }
        }
        risk.max(0.3 * mean_noise * (self.rank + 1) as f64) / weights
    }

    /// Leave-one-out at r = 1, by as many refits (LPR Eq. 7); then each ring's error by the fit before it (Eq. 5).
    fn literal_risk(&self, radius: usize, rows: &[Row], risk: &mut f64) -> f64 {
        if radius == 1 {
            for left_out in 0..rows.len() {
                let mut others = rows.to_vec();
                let row = others.remove(left_out);
                let fit = BatchFit::new(&others, &self.prior(rows, self.samples[0].y));
                *risk += distance(&fit.predict(&row.z), &row.y);
            }
        } else {
            let (_, before) = self.batch(radius - 1, &self.own());
            for row in self.rows(
                pixels_within(radius - 1)..pixels_within(radius),
                &self.own(),
            ) {
                *risk += distance(&before.predict(&row.z), &row.y);
            }
        }
        *risk / pixels_within(radius) as f64
    }

    /// The pixels of the window, ring by ring, and what a model says of their radiance.
    pub fn radiance<'a>(
        &'a self,
        model: &'a Model,
    ) -> impl Iterator<Item = (usize, [f64; 3])> + 'a {
        let pixels = self.samples.iter().zip(&self.z);
        pixels.take(pixels_within(model.radius)).map(|(sample, z)| {
            let radiance = evaluate(&model.beta, z).map(|v| v / self.radiance_scale);
            (sample.position, radiance)
        })
    }

    /// Position in the tile and regressors, 1 first, of each pixel of the window, ring by ring.
    pub fn regressors(&self) -> impl Iterator<Item = (usize, &[f64])> {
        let pixels = self.samples.iter().zip(&self.z);
        pixels.map(|(sample, z)| (sample.position, z.as_slice()))
    }

    /// What a squared error in the unit of the window's risks is divided by to be one of radiance.
    pub fn squared_scale(&self) -> f64 {
        self.radiance_scale * self.radiance_scale
    }

    /// What a model predicts, and how much that weighs.
    pub fn predictions(&self, model: &Model) -> Vec<Prediction> {
        let pixels = pixels_within(model.radius);
        let predicted: Vec<[f64; 3]> = self.z[..pixels]
            .iter()
            .map(|z| evaluate(&model.beta, z))
            .collect();
        let unit = self.radiance_scale;
        let own_variance = (model.terms as f64 / pixels as f64).min(1.0);
        let excess = self.mean_excess(&predicted);
        let printed = self.printed_variance(model);
        (0..pixels)
            .map(|i| {
                let sample = &self.samples[i];
                let squared = self.squared_bias_around(i, &predicted);
                let bias = excess + (squared + printed * sample.own_weight()) / sample.noise();
                let ring = (0..).find(|&r| i < pixels_within(r)).unwrap_or(0);
                let agreement = if sample.valid() {
                    let squared = distance(&predicted[i], &sample.y);
                    1.0 / (1.0 + squared / (6.0 * sample.tolerance + f64::from(f32::MIN_POSITIVE)))
                } else {
                    1.0
                };
                Prediction {
                    position: sample.position,
                    colour: predicted[i].map(|v| v / unit),
                    weight: match self.params.formulas {
                        Formulas::Robust if self.goes_below(i, &predicted[i]) => 0.0,
                        Formulas::Robust => {
                            let edge = ring as f64 / (model.radius + 1) as f64;
                            agreement * (1.0 - 0.7 * edge * edge) * (bias + 0.5).powf(-1.5)
                        }
                        Formulas::Literal => 1.0,
                        other => panic!("{other:?} has no definition"),
                    },
                    error: (squared + printed + own_variance * sample.variance)
                        / (unit * unit)
                        / 3.0,
                }
            })
            .collect()
    }

    /// Whether a prediction is negative by more than a tenth of its magnitudes where its pixel is nowhere negative.
    fn goes_below(&self, i: usize, predicted: &[f64; 3]) -> bool {
        let least = predicted.iter().copied().fold(f64::INFINITY, f64::min);
        let magnitudes: f64 = predicted.iter().map(|v| v.abs()).sum();
        self.samples[i].y.iter().all(|y| *y >= 0.0) && least < -0.1 * magnitudes
    }

    /// Variance that the features' noise prints into a model's predictions, summed over the channels.
    fn printed_variance(&self, model: &Model) -> f64 {
        let channels = model.beta.iter().map(|beta| {
            let features = self.feature_noise.iter().enumerate().map(|(j, noise)| {
                let slope: f64 = (0..self.rank)
                    .map(|k| self.axes[(j, k)] * beta[k + 1])
                    .sum();
                slope * slope * noise
            });
            features.sum::<f64>()
        });
        channels.sum()
    }

    /// Square of the mean residual over the valid pixels of the prediction window in the 5 x 5 around, summed over the channels, less the noise's
    /// share of it.
    fn squared_bias_around(&self, i: usize, predicted: &[[f64; 3]]) -> f64 {
        let offsets = ring_order();
        let near = (0..predicted.len()).filter(|&k| {
            let ((ax, ay), (bx, by)) = (offsets[i], offsets[k]);
            self.samples[k].valid() && (ax - bx).abs() <= 2 && (ay - by).abs() <= 2
        });
        let (mut sums, mut count) = ([0.0; 3], 0.0);
        for k in near {
            for ((sum, predicted), y) in sums.iter_mut().zip(predicted[k]).zip(self.samples[k].y) {
                *sum += predicted - y;
            }
            count += 1.0;
        }
        let squares: f64 = sums.iter().map(|sum| sum * sum).sum();
        let pixels = f64::max(count, 1.0);
        f64::max(
            squares / (pixels * pixels) - self.samples[i].variance / pixels,
            0.0,
        )
    }

    /// Mean over the valid pixels of the prediction window of squared errors in units of variance, each at most 100, less 1.
    fn mean_excess(&self, predicted: &[[f64; 3]]) -> f64 {
        let valid = self.samples.iter().zip(predicted);
        let distances: Vec<f64> = valid
            .filter(|(sample, _)| sample.valid())
            .map(|(sample, p)| (distance(p, &sample.y) * sample.weight / sample.noise()).min(100.0))
            .collect();
        let mean = distances.iter().sum::<f64>() / distances.len().max(1) as f64;
        (mean - 1.0).max(0.0)
    }

    /// A layer as it follows the model: the same fit to its own radiance.
    pub fn follow(&self, model: &Model, layer: &LayerTile) -> Vec<[f64; 3]> {
        let y: Vec<[f64; 3]> = self
            .samples
            .iter()
            .map(|sample| layer.colour[sample.position].map(f64::from))
            .collect();
        let pixels = pixels_within(model.radius);
        if model.radius == 0 {
            return vec![y[0]];
        }
        let (_, fit) = self.batch(model.radius, &y);
        self.z[..pixels].iter().map(|z| fit.predict(z)).collect()
    }
}

fn evaluate(beta: &[Vec<f64>; 3], z: &[f64]) -> [f64; 3] {
    beta.each_ref()
        .map(|beta| beta.iter().zip(z).map(|(b, z)| b * z).sum())
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}
