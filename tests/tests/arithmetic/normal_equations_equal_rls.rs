//! Sums and one factorisation per ring give the model that the recursion gives, and the batch solution.

use linpred_core::{Gram, NormalEquations, NotFinite, Prior, Rls, Solution, Taken};
use linpred_tests::oracle::BatchFit;
use linpred_tests::strategies::{Fit, fits};
use linpred_tests::tolerance::{
    NORMAL_COEFFICIENTS, NORMAL_LEVERAGE, NORMAL_PREDICTION, RECURSIVE_PREDICTION,
    RESIDUAL_SQUARES, TRACE, close,
};
use linpred_tests::windows::Random;
use proptest::prelude::{TestCaseError, prop_assert, proptest};

fn sums<const T: usize>(fit: &Fit<T>) -> NormalEquations<T> {
    let mut sums = NormalEquations::new();
    for p in &fit.pixels {
        sums.add(&p.z, &p.y, p.weight);
    }
    sums
}

fn equals_recursion<const T: usize>(fit: &Fit<T>) -> Result<(), TestCaseError> {
    let mut rls = Rls::new(&fit.prior);
    for p in &fit.pixels {
        assert_eq!(rls.update(&p.z, &p.y, p.weight), Taken::Yes);
    }
    let solution = sums(fit).solve(&fit.prior).expect("finite pixels");
    for p in &fit.pixels {
        let tolerance = RECURSIVE_PREDICTION * fit.prediction_unit(p);
        let (ours, recursive) = (solution.predict(&p.z), rls.predict(&p.z));
        for c in 0..3 {
            let (ours, recursive) = (f64::from(ours[c]), f64::from(recursive[c]));
            prop_assert!(
                close(ours, recursive, tolerance),
                "{ours} against {recursive}"
            );
        }
    }
    Ok(())
}

fn equals_batch<const T: usize>(fit: &Fit<T>) -> Result<(), TestCaseError> {
    let solution = sums(fit).solve(&fit.prior).expect("finite pixels");
    let exact = fit.batch();
    let unit = fit.largest_radiance();
    prop_assert!(solution.terms() == T, "{} of {T} terms", solution.terms());
    for p in &fit.pixels {
        let z = p.z.map(f64::from);
        let (ours, expected) = (solution.predict(&p.z), exact.predict(&z));
        for c in 0..3 {
            let (ours, expected) = (f64::from(ours[c]), expected[c]);
            prop_assert!(
                close(ours, expected, NORMAL_PREDICTION * unit),
                "{ours} against {expected}"
            );
        }
        let (ours, expected) = (f64::from(solution.leverage(&p.z)), exact.leverage(&z));
        prop_assert!(
            close(ours, expected, NORMAL_LEVERAGE * expected),
            "{ours} against {expected}"
        );
    }
    coefficients_agree(&solution, &exact, unit)
}

fn coefficients_agree<const T: usize>(
    solution: &Solution<T>,
    exact: &BatchFit,
    unit: f64,
) -> Result<(), TestCaseError> {
    for c in 0..3 {
        for j in 0..T {
            let (ours, expected) = (f64::from(solution.coefficients()[c][j]), exact.beta[c][j]);
            let unit = unit * exact.covariance[(j, j)].sqrt().max(1.0);
            prop_assert!(
                close(ours, expected, NORMAL_COEFFICIENTS * unit),
                "{ours} against {expected}"
            );
        }
    }
    Ok(())
}

/// Degrees of freedom, Stein's penalty and residual sums, each a sum over pixels in the oracle.
fn sums_need_no_second_pass<const T: usize>(fit: &Fit<T>) -> Result<(), TestCaseError> {
    let sums = sums(fit);
    let solution = sums.solve(&fit.prior).expect("finite pixels");
    let exact = fit.batch();
    let mut weighted = Gram::new();
    let (mut freedom, mut penalty) = (0.0, 0.0);
    let (mut residual, mut unit) = ([0.0; 3], [0.0; 3]);
    for (i, p) in fit.pixels.iter().enumerate() {
        let variance = (i % 7) as f32;
        weighted.add(&p.z, variance);
        let z = p.z.map(f64::from);
        let (weight, leverage) = (f64::from(p.weight), exact.leverage(&z));
        freedom += weight * leverage;
        penalty += f64::from(variance) * leverage;
        for c in 0..3 {
            let y = f64::from(p.y[c]);
            let beta = solution.coefficients()[c].map(f64::from);
            let terms: [f64; T] = std::array::from_fn(|j| beta[j] * z[j]);
            residual[c] += weight * (y - terms.iter().sum::<f64>()).powi(2);
            unit[c] += weight * (y.abs() + terms.iter().map(|t| t.abs()).sum::<f64>()).powi(2);
        }
    }
    let ours = f64::from(solution.trace(&sums.gram()));
    prop_assert!(
        close(ours, freedom, TRACE * freedom),
        "{ours} against {freedom}"
    );
    let ours = f64::from(solution.trace(&weighted));
    prop_assert!(
        close(ours, penalty, TRACE * penalty),
        "{ours} against {penalty}"
    );
    let ours = sums.residual_squares(solution.coefficients());
    for c in 0..3 {
        let (ours, exact) = (f64::from(ours[c]), residual[c].min(f64::from(f32::MAX)));
        let rounding = f64::from(f32::EPSILON) * exact + f64::from(f32::MIN_POSITIVE);
        let tolerance = RESIDUAL_SQUARES * unit[c] + rounding;
        prop_assert!(
            close(ours, exact, tolerance),
            "{ours} against {exact} of {}",
            unit[c]
        );
    }
    Ok(())
}

macro_rules! with_terms {
    ($($name:ident $terms:literal)*) => {$(
        mod $name {
            use super::*;

            proptest! {
                #[test]
                fn the_model_is_the_recursions(fit in fits::<$terms>()) {
                    equals_recursion(&fit)?;
                }

                #[test]
                fn the_model_is_the_batch_solution(fit in fits::<$terms>()) {
                    equals_batch(&fit)?;
                }

                #[test]
                fn its_sums_need_no_second_pass(fit in fits::<$terms>()) {
                    sums_need_no_second_pass(&fit)?;
                }
            }
        }
    )*};
}

with_terms! {
    one_term 1 two_terms 2 three_terms 3 four_terms 4 five_terms 5
    six_terms 6 seven_terms 7 eight_terms 8 nine_terms 9 ten_terms 10
}

/// Without a prior, a regressor that repeats another is left at its prior coefficient, and the model is that of the others.
#[test]
fn a_collinear_term_without_prior_is_dropped() {
    let mut twice = NormalEquations::<3>::new();
    let mut once = NormalEquations::<2>::new();
    for i in 0..20u8 {
        let x = f32::from(i) / 10.0 - 1.0;
        let y = [1.0 + 2.0 * x, 3.0 - x, x * x];
        twice.add(&[1.0, x, x], &y, 1.0);
        once.add(&[1.0, x], &y, 1.0);
    }
    let twice = twice
        .solve(&Prior::at_centre(&[0.0; 3], 0.0, 0.0))
        .expect("finite");
    let once = once
        .solve(&Prior::at_centre(&[0.0; 3], 0.0, 0.0))
        .expect("finite");
    assert_eq!((twice.terms(), once.terms()), (2, 2));
    for c in 0..3 {
        assert_eq!(
            twice.coefficients()[c],
            [once.coefficients()[c][0], once.coefficients()[c][1], 0.0]
        );
    }
}

/// Multiples of a regressor rounded to f32 leave a pivot of rounding, positive or negative: neither is information.
#[test]
fn a_term_collinear_to_rounding_is_dropped() {
    let mut random = Random::new(11);
    for _ in 0..200 {
        let factor = random.normal() as f32;
        let mut sums = NormalEquations::<3>::new();
        for _ in 0..25 {
            let x = random.normal() as f32;
            sums.add(&[1.0, x, factor * x], &[x; 3], 1.0);
        }
        let solution = sums
            .solve(&Prior::at_centre(&[0.0; 3], 0.0, 0.0))
            .expect("finite");
        assert_eq!(solution.terms(), 2, "factor {factor}");
    }
}

/// No pixel and no prior strength: the model is its prior, certain of nothing that it could be certain of.
#[test]
fn without_pixels_the_model_is_its_prior() {
    let prior = Prior::<4>::at_centre(&[1.0, 2.0, 3.0], 0.0, 0.0);
    let solution = NormalEquations::<4>::new().solve(&prior).expect("finite");
    assert_eq!(solution.terms(), 0);
    assert_eq!(solution.coefficients(), &prior.coefficients);
}

#[test]
fn a_value_that_is_not_finite_is_reported() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let prior = Prior::<2>::at_centre(&[0.0; 3], 1e-3, 1e-3);
        for place in 0..3 {
            let mut sums = NormalEquations::<2>::new();
            sums.add(&[1.0, 0.5], &[1.0; 3], 1.0);
            let value = |at: usize, good: f32| if place == at { bad } else { good };
            sums.add(
                &[1.0, value(0, 0.1)],
                &[1.0, value(1, 1.0), 1.0],
                value(2, 1.0),
            );
            assert_eq!(sums.solve(&prior), Err(NotFinite), "{bad} at {place}");
        }
    }
}
