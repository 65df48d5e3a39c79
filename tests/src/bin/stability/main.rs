//! Rounding of the candidate arithmetics of one fit against f64 QR, over the condition number of the window.
//!
//! `cargo run --release -p linpred-tests --bin stability -- FOLDER` writes `results.csv`, `table.md` and `plot.svg` there.

mod forms;
mod measure;
mod plot;
mod report;

use std::path::Path;
use std::{env, fs, io};

use forms::{Bierman, Cholesky, Covariance, Form, Joseph, Rotations, ShippedNormal, ShippedRls};
use linpred_tests::windows::{Random, Window};
use measure::{Reference, TERMS, Worst, breakdowns, fit_window, long_run, nanoseconds};
use num_traits::Float;
use report::Measured;

/// Windows per condition number.
const WINDOWS: usize = 30;
/// Prior strengths of all terms: the paper's, and one that leaves the fit to its own condition.
const DELTAS: [f32; 2] = [1e-3, 1e-9];

/// Windows of condition 10^exponent.
fn windows(exponent: i32) -> Vec<Window<TERMS>> {
    let mut random = Random::new(1 + exponent as u64);
    (0..WINDOWS)
        .map(|_| Window::with_condition(10f64.powi(exponent), &mut random))
        .collect()
}

fn measure<R: Float, F: Form<R, TERMS>>(name: &'static str, forgets: bool) -> Measured {
    let rings = DELTAS.map(|delta| {
        (0..=8)
            .map(|exponent| {
                let windows = windows(exponent);
                let mut worst = Worst::default();
                for window in &windows {
                    Reference::new(window, delta)
                        .compare(&fit_window::<R, F>(window, delta), &mut worst);
                }
                if let Some((asymmetric, indefinite)) = breakdowns::<R, F>(&windows, delta) {
                    (worst.asymmetric, worst.indefinite) = (asymmetric, indefinite);
                }
                worst
            })
            .collect()
    });
    let long = forgets.then(|| {
        (0..=8)
            .map(|exponent| long_run::<R, F>(10f64.powi(exponent), DELTAS[0]))
            .collect()
    });
    eprintln!("{name}");
    Measured {
        name,
        rings,
        long,
        nanoseconds: nanoseconds::<R, F>(&windows(2)),
    }
}

/// The exact coefficients rounded to f32.
fn floor() -> Measured {
    let rings = DELTAS.map(|delta| {
        (0..=8)
            .map(|exponent| {
                let mut worst = Worst::default();
                for window in &windows(exponent) {
                    let reference = Reference::new(window, delta);
                    reference.compare(&reference.rounded(), &mut worst);
                }
                worst
            })
            .collect()
    });
    Measured {
        name: "QR f64, coefficients rounded to f32",
        rings,
        long: None,
        nanoseconds: f64::NAN,
    }
}

fn main() -> io::Result<()> {
    let folder = env::args().nth(1).unwrap_or_else(|| ".".to_owned());
    let folder = Path::new(&folder);
    fs::create_dir_all(folder)?;
    let all = [
        measure::<f32, ShippedRls<TERMS>>("linpred-core Rls (UD, f32)", true),
        measure::<f32, ShippedNormal<TERMS>>("linpred-core NormalEquations (f64 sums)", false),
        measure::<f32, Covariance<f32, TERMS>>("covariance f32", true),
        measure::<f32, Joseph<f32, TERMS>>("Joseph f32", true),
        measure::<f32, Bierman<f32, TERMS>>("UD f32", true),
        measure::<f32, Rotations<f32, TERMS>>("planar rotations f32", true),
        measure::<f32, Cholesky<f32, TERMS>>("Cholesky f32", true),
        measure::<f64, Covariance<f64, TERMS>>("covariance f64", true),
        measure::<f64, Joseph<f64, TERMS>>("Joseph f64", true),
        measure::<f64, Bierman<f64, TERMS>>("UD f64", true),
        measure::<f64, Rotations<f64, TERMS>>("planar rotations f64", true),
        measure::<f64, Cholesky<f64, TERMS>>("Cholesky f64", true),
        floor(),
    ];
    fs::write(folder.join("results.csv"), report::csv(&all))?;
    fs::write(folder.join("table.md"), report::markdown(&all))?;
    fs::write(folder.join("plot.svg"), plot::svg(&all))
}
