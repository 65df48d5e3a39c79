//! The recursive fit is the batch fit: coefficients, P, leverage and fitted values, for 1 to 10 terms.

use linpred_core::{Rls, Taken};
use linpred_tests::oracle::{BatchFit, Prior, Row, forget};
use linpred_tests::strategies::{Fit, fits, fits_with_forgetting};
use linpred_tests::tolerance::{
    RECURSIVE_COEFFICIENTS, RECURSIVE_COVARIANCE, RECURSIVE_LEVERAGE, RECURSIVE_PREDICTION, close,
};
use linpred_tests::windows::{Random, Window, pixels_within};
use proptest::prelude::{TestCaseError, prop_assert, proptest};

fn recursive<const T: usize>(fit: &Fit<T>, lambda: f32) -> Rls<T> {
    let mut rls = Rls::new(&fit.prior);
    for p in &fit.pixels {
        assert_eq!(
            rls.update_forgetting(&p.z, &p.y, p.weight, lambda),
            Taken::Yes
        );
    }
    rls
}

fn agree<const T: usize>(
    rls: &Rls<T>,
    batch: &BatchFit,
    fit: &Fit<T>,
) -> Result<(), TestCaseError> {
    let unit = fit.largest_radiance();
    for pixel in &fit.pixels {
        let z = pixel.z.map(f64::from);
        let (ours, exact) = (rls.predict(&pixel.z), batch.predict(&z));
        for c in 0..3 {
            let tolerance = RECURSIVE_PREDICTION * fit.prediction_unit(pixel);
            prop_assert!(
                close(f64::from(ours[c]), exact[c], tolerance),
                "prediction {} against {} of {unit}",
                ours[c],
                exact[c],
            );
        }
        let exact = batch.leverage(&z);
        prop_assert!(
            close(
                f64::from(rls.leverage(&pixel.z)),
                exact,
                RECURSIVE_LEVERAGE * exact
            ),
            "leverage {} against {exact}",
            rls.leverage(&pixel.z),
        );
    }
    coefficients_agree(rls, batch, unit)?;
    covariances_agree(rls, batch)
}

fn coefficients_agree<const T: usize>(
    rls: &Rls<T>,
    batch: &BatchFit,
    unit: f64,
) -> Result<(), TestCaseError> {
    for c in 0..3 {
        for j in 0..T {
            let (ours, exact) = (f64::from(rls.coefficients()[c][j]), batch.beta[c][j]);
            let uncertainty = batch.covariance[(j, j)].sqrt().max(1.0);
            prop_assert!(
                close(ours, exact, RECURSIVE_COEFFICIENTS * unit * uncertainty),
                "coefficient {j} {ours} against {exact}, in units of {unit} x {uncertainty}",
            );
        }
    }
    Ok(())
}

fn covariances_agree<const T: usize>(rls: &Rls<T>, batch: &BatchFit) -> Result<(), TestCaseError> {
    let covariance = rls.covariance();
    for (i, row) in covariance.iter().enumerate() {
        for (j, &ours) in row.iter().enumerate() {
            let exact = batch.covariance[(i, j)];
            let unit = (batch.covariance[(i, i)] * batch.covariance[(j, j)]).sqrt();
            prop_assert!(
                close(f64::from(ours), exact, RECURSIVE_COVARIANCE * unit),
                "P({i}, {j}) {ours} against {exact}, in units of {unit}",
            );
        }
    }
    Ok(())
}

macro_rules! with_terms {
    ($($name:ident $terms:literal)*) => {$(
        mod $name {
            use super::*;

            proptest! {
                #[test]
                fn any_order_weights_and_missing_pixels(fit in fits::<$terms>()) {
                    agree(&recursive(&fit, 1.0), &fit.batch(), &fit)?;
                }

                #[test]
                fn forgetting((fit, lambda) in fits_with_forgetting::<$terms>()) {
                    let prior = Prior::from_f32(&fit.prior);
                    let (aged, prior) = forget(&fit.rows(), &prior, f64::from(lambda));
                    agree(&recursive(&fit, lambda), &BatchFit::new(&aged, &prior), &fit)?;
                }
            }
        }
    )*};
}

with_terms! {
    one_term 1 two_terms 2 three_terms 3 four_terms 4 five_terms 5
    six_terms 6 seven_terms 7 eight_terms 8 nine_terms 9 ten_terms 10
}

/// The bar: to a condition number of 10^4, at the end of every ring, with the paper's delta.
#[test]
fn every_ring_of_windows_of_condition_to_ten_thousand() {
    for exponent in 0..=4 {
        let mut random = Random::new(exponent);
        for _ in 0..10 {
            let window = Window::<5>::with_condition(10f64.powi(exponent as i32), &mut random);
            let prior = linpred_core::Prior::at_centre(&window.y[0], 1e-3, 1e-3);
            let mut rls = Rls::new(&prior);
            let mut rows = Vec::new();
            for (z, y) in window.z.iter().zip(&window.y) {
                assert_eq!(rls.update(z, y, 1.0), Taken::Yes);
                rows.push(Row::from_f32(z, y, 1.0));
                if (1..=9).any(|radius| pixels_within(radius) == rows.len()) {
                    let batch = BatchFit::new(&rows, &Prior::from_f32(&prior));
                    predictions_agree(&rls, &batch, &window, rows.len());
                }
            }
        }
    }
}

fn predictions_agree<const T: usize>(
    rls: &Rls<T>,
    batch: &BatchFit,
    window: &Window<T>,
    count: usize,
) {
    for place in 0..count {
        prediction_agrees(rls, batch, window, place);
    }
}

fn prediction_agrees<const T: usize>(
    rls: &Rls<T>,
    batch: &BatchFit,
    window: &Window<T>,
    place: usize,
) {
    let unit = window.largest_response();
    let z = &window.z[place];
    let (ours, exact) = (rls.predict(z), batch.predict(&z.map(f64::from)));
    for c in 0..3 {
        let (ours, exact) = (f64::from(ours[c]), exact[c]);
        assert!(
            close(ours, exact, RECURSIVE_PREDICTION * unit),
            "{ours} against {exact} of {unit}"
        );
    }
}

/// 100,000 updates with lambda = 0.98 against the batch solution of the last 2,000, before which 0.98^n is below 1e-17; at the
/// latest fifty pixels, which are what the fit remembers. The prior is forgotten too, so nothing regularises the fit, and
/// f32 holds the bar to a condition number of 10^3.
#[test]
fn in_a_long_run_with_forgetting() {
    for exponent in 0..=3 {
        let window = Window::<5>::with_condition(10f64.powi(exponent), &mut Random::new(41));
        let pixel = |i: usize| (i * 101) % window.z.len();
        let prior = linpred_core::Prior::at_centre(&window.y[0], 1e-3, 1e-3);
        let mut rls = Rls::new(&prior);
        for i in 0..100_000 {
            let (z, y) = (&window.z[pixel(i)], &window.y[pixel(i)]);
            assert_eq!(rls.update_forgetting(z, y, 1.0, 0.98), Taken::Yes);
        }
        let recent: Vec<Row> = (98_000..100_000)
            .map(|i| Row::from_f32(&window.z[pixel(i)], &window.y[pixel(i)], 1.0))
            .collect();
        let (aged, prior) = forget(&recent, &Prior::from_f32(&prior), f64::from(0.98f32));
        let exact = BatchFit::new(&aged, &prior);
        for i in 99_950..100_000 {
            prediction_agrees(&rls, &exact, &window, pixel(i));
        }
    }
}
