//! Iterative validation from one recursion is what refitting from scratch gives (LPR Eq. 5 and 7).

use linpred_core::{Rls, Taken};
use linpred_tests::oracle::{BatchFit, Prior};
use linpred_tests::strategies::{Fit, fits};
use linpred_tests::tolerance::{RECURSIVE_LEVERAGE, RECURSIVE_PREDICTION, RING_ERROR, close};
use linpred_tests::windows::pixels_within;
use proptest::prelude::{TestCaseError, prop_assert, proptest};

/// Each ring, predicted by the recursion before its pixels enter, against a model fitted anew to the pixels inside.
fn rings<const T: usize>(fit: &Fit<T>) -> Result<(), TestCaseError> {
    let rows = fit.rows();
    let prior = Prior::from_f32(&fit.prior);
    let mut rls = Rls::new(&fit.prior);
    let mut inside = 0;
    for radius in 0..=9 {
        let end = pixels_within(radius).min(rows.len());
        let refit = BatchFit::new(&rows[..inside], &prior);
        let (mut ours, mut exact) = (0.0, 0.0);
        for (pixel, row) in fit.pixels[inside..end].iter().zip(&rows[inside..end]) {
            let (recursive, batch) = (rls.predict(&pixel.z), refit.predict(&row.z));
            for c in 0..3 {
                ours += (f64::from(recursive[c]) - row.y[c]).powi(2);
                exact += (batch[c] - row.y[c]).powi(2);
            }
        }
        let scale = (end - inside) as f64 * worst_case(fit, &refit, inside..end).powi(2);
        prop_assert!(
            close(ours, exact, RING_ERROR * scale),
            "ring {radius}: {ours} against {exact} of {scale}"
        );
        for pixel in &fit.pixels[inside..end] {
            assert_eq!(rls.update(&pixel.z, &pixel.y, pixel.weight), Taken::Yes);
        }
        inside = end;
    }
    Ok(())
}

/// The largest radiance, or the largest extrapolation of it to pixels that the model has not seen.
fn worst_case<const T: usize>(fit: &Fit<T>, refit: &BatchFit, ring: std::ops::Range<usize>) -> f64 {
    let reach = fit.pixels[ring]
        .iter()
        .map(|p| refit.leverage(&p.z.map(f64::from)).sqrt());
    fit.largest_radiance() * reach.fold(1.0, f64::max)
}

/// The closed form of leave-one-out over nine pixels against nine refits without the pixel.
fn leave_one_out<const T: usize>(fit: &Fit<T>) -> Result<(), TestCaseError> {
    let rows = &fit.rows()[..fit.pixels.len().min(9)];
    let prior = Prior::from_f32(&fit.prior);
    let mut rls = Rls::new(&fit.prior);
    for pixel in &fit.pixels[..rows.len()] {
        assert_eq!(rls.update(&pixel.z, &pixel.y, pixel.weight), Taken::Yes);
    }
    for (left_out, pixel) in fit.pixels[..rows.len()].iter().enumerate() {
        let denominator = 1.0 - pixel.weight * rls.leverage(&pixel.z);
        if denominator < 1e-2 {
            continue;
        }
        let mut others = rows.to_vec();
        others.remove(left_out);
        let refit = BatchFit::new(&others, &prior).predict(&rows[left_out].z);
        let fitted = rls.predict(&pixel.z);
        for c in 0..3 {
            let ours = f64::from((fitted[c] - pixel.y[c]) / denominator);
            let exact = refit[c] - rows[left_out].y[c];
            // Both errors of the closed form, of its residual and of its denominator, are divided by that denominator.
            let residual = RECURSIVE_PREDICTION * fit.prediction_unit(pixel);
            let tolerance = (residual + RECURSIVE_LEVERAGE * exact.abs()) / f64::from(denominator);
            prop_assert!(
                close(ours, exact, tolerance),
                "pixel {left_out}: {ours} against {exact}"
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
                fn ring_errors_are_those_of_refitted_models(fit in fits::<$terms>()) {
                    rings(&fit)?;
                }

                #[test]
                fn leave_one_out_is_nine_refits(fit in fits::<$terms>()) {
                    leave_one_out(&fit)?;
                }
            }
        }
    )*};
}

with_terms! { one_term 1 two_terms 2 four_terms 4 seven_terms 7 ten_terms 10 }
