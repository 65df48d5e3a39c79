//! What a change of units does to a fit: nothing but the change itself, to the bit where the change is a power of two.

use linpred_core::{NormalEquations, Prior, Rls};
use linpred_tests::strategies::{Fit, fits};
use linpred_tests::tolerance::{RECURSIVE_PREDICTION, close};
use proptest::prelude::{prop_assert, prop_assert_eq, proptest};

fn predictions<const T: usize>(fit: &Fit<T>) -> Vec<[f32; 3]> {
    let mut rls = Rls::new(&fit.prior);
    let mut sums = NormalEquations::new();
    for p in &fit.pixels {
        let _ = rls.update(&p.z, &p.y, p.weight);
        sums.add(&p.z, &p.y, p.weight);
    }
    let solution = sums.solve(&fit.prior).expect("finite");
    let both = fit
        .pixels
        .iter()
        .flat_map(|p| [rls.predict(&p.z), solution.predict(&p.z)]);
    both.collect()
}

fn map_radiance<const T: usize>(fit: &Fit<T>, change: impl Fn([f32; 3]) -> [f32; 3]) -> Fit<T> {
    let mut changed = fit.clone();
    for pixel in &mut changed.pixels {
        pixel.y = change(pixel.y);
    }
    for j in 0..T {
        let column = change([0, 1, 2].map(|c| fit.prior.coefficients[c][j]));
        for (coefficients, value) in changed.prior.coefficients.iter_mut().zip(column) {
            coefficients[j] = value;
        }
    }
    changed
}

proptest! {
    #[test]
    fn exposure_scales_the_prediction(fit in fits::<5>()) {
        // Tiny radiance has denormal coefficients, which a scale rounds.
        let brightest = fit.largest_radiance();
        if brightest > 1e-20 {
            let scaled = map_radiance(&fit, |y| y.map(|v| v * 0.25));
            let expected: Vec<_> = predictions(&fit).iter().map(|y| y.map(|v| v * 0.25)).collect();
            let ours = predictions(&scaled);
            for (a, b) in expected.as_flattened().iter().zip(ours.as_flattened()) {
                prop_assert!(close(f64::from(*a), f64::from(*b), f64::from(f32::MIN_POSITIVE)), "{a} {b}");
            }
        }
    }

    #[test]
    fn channels_do_not_see_each_other(fit in fits::<5>()) {
        let turned = map_radiance(&fit, |[r, g, b]| [g, b, r]);
        let expected: Vec<_> = predictions(&fit).iter().map(|&[r, g, b]| [g, b, r]).collect();
        prop_assert_eq!(predictions(&turned), expected);
    }

    #[test]
    fn a_rotation_of_the_features_changes_nothing(fit in fits::<5>(), angle in 0.0f32..6.3) {
        let (sine, cosine) = angle.sin_cos();
        let mut rotated = fit.clone();
        for p in &mut rotated.pixels {
            let [one, a, b, c, d] = p.z;
            p.z = [one, cosine * a - sine * c, b, sine * a + cosine * c, d];
        }
        let (ours, expected) = (predictions(&rotated), predictions(&fit));
        for (i, (ours, expected)) in ours.iter().zip(&expected).enumerate() {
            let tolerance = RECURSIVE_PREDICTION * fit.prediction_unit(&fit.pixels[i / 2]);
            for (&a, &b) in ours.iter().zip(expected) {
                prop_assert!(close(f64::from(a), f64::from(b), tolerance), "{a} {b} within {tolerance}");
            }
        }
    }

    #[test]
    fn an_affine_image_is_predicted_exactly(fit in fits::<5>(), slopes in proptest::array::uniform5(-4.0f32..4.0)) {
        let mut affine = fit;
        for p in &mut affine.pixels {
            p.y = [0.0, 1.0, -1.0].map(|offset| offset + (0..5).map(|j| slopes[j] * p.z[j]).sum::<f32>());
        }
        // A prior at the true slopes, so that the minimum is the image itself, whatever the strengths.
        affine.prior = Prior { coefficients: [0.0, 1.0, -1.0].map(|offset| {
            let mut slopes = slopes;
            slopes[0] += offset;
            slopes
        }), ..affine.prior };
        let predicted = predictions(&affine);
        for (i, p) in predicted.iter().enumerate() {
            let tolerance = RECURSIVE_PREDICTION * affine.largest_radiance().max(1.0);
            for (&ours, exact) in p.iter().zip(affine.pixels[i / 2].y) {
                prop_assert!(close(f64::from(ours), f64::from(exact), tolerance), "{ours} {exact}");
            }
        }
    }
}
