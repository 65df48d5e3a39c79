//! Errors of one form against f64 QR, its breakdowns and its time.

use std::hint::black_box;
use std::time::Instant;

use crate::forms::{CHANNELS, Form};
use linpred_tests::oracle::{BatchFit, Prior, Row, forget};
use linpred_tests::windows::{Random, WINDOW_PIXELS, Window, pixels_within};
use nalgebra::DMatrix;
use num_traits::Float;

/// Terms of the study's models: the intercept and four local features, WLR's average rank.
pub(crate) const TERMS: usize = 5;

/// Updates of the long run, and how often it is compared.
const LONG_RUN: usize = 1_000_000;
const COMPARE_EVERY: usize = 10_000;
/// Forgetting factor of the long run (LPR section 6).
const LAMBDA: f64 = 0.98;
/// Updates after which 0.98^n is below 1e-17: older ones are left out of the reference.
const MEMORY: usize = 2000;

/// The worst that happened to one form at one condition number.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Worst {
    /// Fitted values at the end of every ring, relative to the window's largest response.
    pub(crate) prediction: f64,
    /// The same at the end of the last ring alone.
    pub(crate) last_prediction: f64,
    /// Coefficients, relative to their norm.
    pub(crate) coefficients: f64,
    /// Share of the updates after which P was not symmetric to the bit.
    pub(crate) asymmetric: f64,
    /// Share of the updates after which P had no Cholesky factor.
    pub(crate) indefinite: f64,
}

type Coefficients = [[f64; TERMS]; CHANNELS];

/// Coefficients of a form at the ends of the rings 1 to 9.
pub(crate) fn fit_window<R: Float, F: Form<R, TERMS>>(
    window: &Window<TERMS>,
    delta: f32,
) -> Vec<Coefficients> {
    let mut form = start::<R, F>(window, delta);
    let mut ends = Vec::with_capacity(9);
    for (i, (z, y)) in window.z.iter().zip(&window.y).enumerate() {
        form.update(&z.map(convert), &y.map(convert), R::one(), R::one());
        if (1..=9).any(|radius| pixels_within(radius) == i + 1) {
            ends.push(form.coefficients().map(|beta| beta.map(to_f64)));
        }
    }
    ends
}

fn start<R: Float, F: Form<R, TERMS>>(window: &Window<TERMS>, delta: f32) -> F {
    let mut initial = [[R::zero(); TERMS]; CHANNELS];
    for (initial, &y) in initial.iter_mut().zip(&window.y[0]) {
        initial[0] = convert(y);
    }
    F::new(&initial, &[convert(delta); TERMS])
}

fn convert<R: Float>(v: f32) -> R {
    R::from(v).expect("every float is a float")
}

fn to_f64<R: Float>(v: R) -> f64 {
    v.to_f64().unwrap_or(f64::NAN)
}

/// The exact fits of a window at the ends of the rings 1 to 9.
pub(crate) struct Reference {
    rows: Vec<Row>,
    unit: f64,
    fits: Vec<BatchFit>,
}

impl Reference {
    pub(crate) fn new(window: &Window<TERMS>, delta: f32) -> Self {
        let rows: Vec<Row> = window
            .z
            .iter()
            .zip(&window.y)
            .map(|(z, y)| Row::from_f32(z, y, 1.0))
            .collect();
        let prior = prior(&window.y[0], delta);
        let fits = (1..=9).map(|radius| BatchFit::new(&rows[..pixels_within(radius)], &prior));
        Self {
            unit: window.largest_response(),
            fits: fits.collect(),
            rows,
        }
    }

    /// Takes the errors of a form's fits into `worst`.
    pub(crate) fn compare(&self, ends: &[Coefficients], worst: &mut Worst) {
        for (i, (beta, exact)) in ends.iter().zip(&self.fits).enumerate() {
            let prediction =
                prediction_error(beta, exact, &self.rows[..pixels_within(i + 1)]) / self.unit;
            worst.prediction = worst.prediction.max(prediction);
            worst.coefficients = worst.coefficients.max(coefficient_error(beta, exact));
            if i == 8 {
                worst.last_prediction = worst.last_prediction.max(prediction);
            }
        }
    }

    /// The exact coefficients rounded to f32: what no f32 form can be expected to pass.
    pub(crate) fn rounded(&self) -> Vec<Coefficients> {
        let round = |fit: &BatchFit| {
            [0, 1, 2].map(|c| std::array::from_fn(|j| f64::from(fit.beta[c][j] as f32)))
        };
        self.fits.iter().map(round).collect()
    }
}

fn prior(first: &[f32; 3], delta: f32) -> Prior {
    Prior::from_f32(&linpred_core::Prior::<TERMS>::at_centre(
        first, delta, delta,
    ))
}

/// The largest error of a fitted value; infinite if one is not a number.
fn prediction_error(beta: &Coefficients, exact: &BatchFit, rows: &[Row]) -> f64 {
    let mut largest: f64 = 0.0;
    for row in rows {
        let expected = exact.predict(&row.z);
        for (beta, expected) in beta.iter().zip(expected) {
            let ours: f64 = beta.iter().zip(&row.z).map(|(b, z)| b * z).sum();
            largest = largest.max(never_nan((ours - expected).abs()));
        }
    }
    largest
}

fn coefficient_error(beta: &Coefficients, exact: &BatchFit) -> f64 {
    let channels = beta.iter().zip(&exact.beta).map(|(beta, exact)| {
        let squares = beta.iter().zip(exact.iter()).map(|(b, e)| (b - e).powi(2));
        never_nan(squares.sum::<f64>().sqrt() / exact.norm())
    });
    channels.fold(0.0, f64::max)
}

fn never_nan(v: f64) -> f64 {
    if v.is_nan() { f64::INFINITY } else { v }
}

/// Shares of the updates that left P asymmetric and indefinite.
pub(crate) fn breakdowns<R: Float, F: Form<R, TERMS>>(
    windows: &[Window<TERMS>],
    delta: f32,
) -> Option<(f64, f64)> {
    let (mut asymmetric, mut indefinite) = (0, 0);
    for window in windows {
        let mut form = start::<R, F>(window, delta);
        for (z, y) in window.z.iter().zip(&window.y) {
            form.update(&z.map(convert), &y.map(convert), R::one(), R::one());
            let p = form.covariance()?;
            asymmetric += usize::from(!is_symmetric(&p));
            indefinite += usize::from(!is_positive_definite(&p));
        }
    }
    let updates = (windows.len() * WINDOW_PIXELS) as f64;
    Some((asymmetric as f64 / updates, indefinite as f64 / updates))
}

fn is_symmetric(p: &[[f64; TERMS]; TERMS]) -> bool {
    (0..TERMS).all(|i| (0..i).all(|j| p[i][j] == p[j][i]))
}

fn is_positive_definite(p: &[[f64; TERMS]; TERMS]) -> bool {
    let unit: [f64; TERMS] = std::array::from_fn(|j| p[j][j].sqrt());
    // Of a form that is not symmetric, the symmetric part.
    DMatrix::from_fn(TERMS, TERMS, |i, j| {
        0.5 * (p[i][j] + p[j][i]) / (unit[i] * unit[j])
    })
    .cholesky()
    .is_some()
}

/// A million updates with forgetting over the pixels of endless windows, compared every 10,000.
pub(crate) fn long_run<R: Float, F: Form<R, TERMS>>(condition: f64, delta: f32) -> Worst {
    let mut random = Random::new(99);
    let windows: Vec<_> = (0..20)
        .map(|_| Window::with_condition(condition, &mut random))
        .collect();
    let pixel = |i: usize| {
        // A stride prime to the window mixes the rings, so that every stretch of fifty is a window's sample.
        let window = &windows[(i / WINDOW_PIXELS) % windows.len()];
        let place = (i * 101) % WINDOW_PIXELS;
        (&window.z[place], &window.y[place])
    };
    let mut form = start::<R, F>(&windows[0], delta);
    let mut worst = Worst::default();
    let lambda = R::from(LAMBDA).expect("every float is a float");
    for i in 0..LONG_RUN {
        let (z, y) = pixel(i);
        form.update(&z.map(convert), &y.map(convert), R::one(), lambda);
        if (i + 1) % COMPARE_EVERY == 0 {
            let rows: Vec<Row> = (i + 1 - MEMORY..=i)
                .map(|i| Row::from_f32(pixel(i).0, pixel(i).1, 1.0))
                .collect();
            let (aged, prior) = forget(&rows, &prior(&windows[0].y[0], delta), to_f64(lambda));
            let exact = BatchFit::new(&aged, &prior);
            let beta = form.coefficients().map(|beta| beta.map(to_f64));
            let unit = windows
                .iter()
                .map(Window::largest_response)
                .fold(0.0, f64::max);
            let recent = &rows[MEMORY - 50..];
            worst.prediction = worst
                .prediction
                .max(prediction_error(&beta, &exact, recent) / unit);
            worst.coefficients = worst.coefficients.max(coefficient_error(&beta, &exact));
        }
    }
    worst
}

/// Nanoseconds of a whole model: 361 updates and coefficients at nine ring ends. The least of several rounds.
pub(crate) fn nanoseconds<R: Float, F: Form<R, TERMS>>(windows: &[Window<TERMS>]) -> f64 {
    let round = || {
        let started = Instant::now();
        for window in windows {
            black_box(fit_window::<R, F>(black_box(window), 1e-3));
        }
        started.elapsed().as_nanos() as f64 / windows.len() as f64
    };
    (0..30).map(|_| round()).fold(f64::INFINITY, f64::min)
}
