//! P is symmetric to the bit and positive definite after every update, whatever was fed to it.

use linpred_core::{Prior, Rls, Taken};
use linpred_tests::strategies::{any_bits, any_finite, fits_with_forgetting};
use linpred_tests::windows::{Random, Window};
use nalgebra::DMatrix;
use proptest::collection::vec;
use proptest::prelude::{TestCaseError, prop_assert, proptest};
use proptest::sample::select;

fn check<const T: usize>(rls: &Rls<T>) -> Result<(), TestCaseError> {
    let p = rls.covariance();
    for (i, row) in p.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            prop_assert!(entry.to_bits() == p[j][i].to_bits(), "P({i}, {j})");
        }
    }
    let (upper, diagonal) = rls.factors();
    for d in diagonal {
        prop_assert!(d > 0.0 && d.is_finite(), "D holds {d}");
    }
    for (i, row) in upper.iter().enumerate() {
        prop_assert!(
            row[i] == 1.0 && row[..i].iter().all(|&u| u == 0.0),
            "U row {i} {row:?}"
        );
        prop_assert!(row.iter().all(|u| u.is_finite()), "U row {i} {row:?}");
    }
    Ok(())
}

fn is_finite<const T: usize>(rls: &Rls<T>, z: &[f32; T]) -> bool {
    let mut all = rls.predict(z).to_vec();
    all.extend(rls.coefficients().as_flattened());
    all.push(rls.leverage(z));
    all.iter().all(|v| v.is_finite()) && rls.leverage(z) >= 0.0
}

proptest! {
    #[test]
    fn on_windows_that_aim_at_trouble((fit, lambda) in fits_with_forgetting::<6>()) {
        let mut rls = Rls::new(&fit.prior);
        for pixel in &fit.pixels {
            let _ = rls.update_forgetting(&pixel.z, &pixel.y, pixel.weight, lambda);
            check(&rls)?;
            prop_assert!(is_finite(&rls, &pixel.z));
        }
    }

    #[test]
    fn on_any_finite_numbers(
        prior in proptest::array::uniform4(any_finite()),
        pixels in vec((proptest::array::uniform4(any_finite()), proptest::array::uniform3(any_finite()), any_finite(), select(&[1.0f32, 0.98, 1e-30][..])), 1..60),
    ) {
        let mut rls = Rls::new(&Prior { coefficients: [prior; 3], strengths: prior });
        check(&rls)?;
        for (z, y, weight, lambda) in pixels {
            let _ = rls.update_forgetting(&z, &y, weight.abs(), lambda);
            check(&rls)?;
            prop_assert!(is_finite(&rls, &z));
        }
    }

    #[test]
    fn on_any_bits(pixels in vec((proptest::array::uniform3(any_bits()), proptest::array::uniform3(any_bits()), any_bits(), any_bits()), 1..60)) {
        let mut rls = Rls::new(&Prior::at_centre(&[1.0; 3], f32::NAN, f32::INFINITY));
        for (z, y, weight, lambda) in pixels {
            let before = rls;
            let taken = rls.update_forgetting(&z, &y, weight, lambda);
            prop_assert!(taken == Taken::Yes || rls == before, "a refused pixel changed the fit");
            check(&rls)?;
            prop_assert!(is_finite(&rls, &z));
        }
    }
}

/// Formed in f64 from the factors, P has a Cholesky factor after each pixel of windows of every condition number.
#[test]
fn on_windows_of_any_condition_number() {
    for exponent in 0..=8 {
        let window =
            Window::<5>::with_condition(10f64.powi(exponent), &mut Random::new(exponent as u64));
        let mut rls = Rls::new(&Prior::at_centre(&window.y[0], 1e-9, 1e-9));
        for (z, y) in window.z.iter().zip(&window.y) {
            assert_eq!(rls.update(z, y, 1.0), Taken::Yes);
            let (upper, diagonal) = rls.factors();
            let root = DMatrix::from_fn(5, 5, |i, j| {
                f64::from(upper[i][j]) * f64::from(diagonal[j]).sqrt()
            });
            let mut p = &root * root.transpose();
            let unit: Vec<f64> = (0..5).map(|j| p[(j, j)].sqrt()).collect();
            p = DMatrix::from_fn(5, 5, |i, j| p[(i, j)] / (unit[i] * unit[j]));
            assert!(p.cholesky().is_some(), "condition 1e{exponent}");
        }
    }
}

/// A long run with forgetting in which one regressor is never excited: its uncertainty grows to the stated bound and stays.
#[test]
fn in_a_long_run_without_excitation() {
    let mut rls = Rls::<3>::new(&Prior::at_centre(&[1.0; 3], 1e-3, 1e-3));
    let mut random = Random::new(7);
    for _ in 0..100_000 {
        let z = [1.0, random.normal() as f32, 0.0];
        assert_eq!(
            rls.update_forgetting(&z, &[1.0, 2.0, 3.0], 1.0, 0.98),
            Taken::Yes
        );
        check(&rls).expect("positive definite");
    }
    assert_eq!(
        rls.update(&[1.0, 0.0, 1.0], &[2.0, 2.0, 2.0], 1.0),
        Taken::Yes
    );
    check(&rls).expect("positive definite after the first excitation");
    assert!(is_finite(&rls, &[1.0, 0.0, 1.0]));
}
