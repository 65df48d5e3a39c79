//! An arbitrary sequence of updates against the batch solution in f64, and arbitrary bits against non-finite output.
//!
//! The first byte chooses: values that a renderer could send, compared with the batch, or raw floats, which may only be
//! refused or kept finite.

#![no_main]

use libfuzzer_sys::fuzz_target;
use linpred_core::{Prior, Rls, Taken};
use linpred_tests::oracle::{self, BatchFit, forget, worst_condition};
use linpred_tests::strategies::{Fit, Pixel};
use linpred_tests::tolerance::{RECURSIVE_LEVERAGE, RECURSIVE_PREDICTION, close, searched};

const LAMBDAS: [f32; 4] = [1.0, 0.999, 0.98, 0.9];

fuzz_target!(|data: &[u8]| {
    let Some((&mode, rest)) = data.split_first() else {
        return;
    };
    match mode & 3 {
        0 => against_batch::<2>(mode, rest),
        1 => against_batch::<4>(mode, rest),
        2 => against_batch::<8>(mode, rest),
        _ => raw_bits::<4>(rest),
    }
});

fn against_batch<const T: usize>(mode: u8, data: &[u8]) {
    let Some((strengths, rest)) = data.split_at_checked(2) else {
        return;
    };
    let lambda = LAMBDAS[usize::from(mode >> 2) % 4];
    let remembered = if lambda < 1.0 {
        (0.1f32.ln() / lambda.ln()) as usize
    } else {
        361
    };
    let pixels: Vec<Pixel<T>> = rest
        .chunks_exact(T + 3)
        .take(remembered)
        .map(pixel)
        .collect();
    let Some(first) = pixels.first() else {
        return;
    };
    let strength = |byte: u8| 10f32.powf(f32::from(byte) / 64.0 - 3.0);
    let prior = Prior::at_centre(&first.y, strength(strengths[0]), strength(strengths[1]));
    compare(&Fit { pixels, prior }, lambda);
}

/// One byte per regressor but the first, three for radiance, one for the weight.
fn pixel<const T: usize>(bytes: &[u8]) -> Pixel<T> {
    let mut z = [1.0f32; T];
    for j in 1..T {
        z[j] = match bytes[j - 1] {
            251 => 1e-30,
            252 => 1e-40,
            253 => -0.0,
            254 => z[j - 1],
            255 => z[j - 1].next_up(),
            byte => f32::from(byte) / 125.0 - 1.0,
        };
    }
    let radiance = |byte: u8| {
        if byte == 255 {
            1e6
        } else {
            f32::from(byte) / 50.0 - 0.5
        }
    };
    let y = [0, 1, 2].map(|c| radiance(bytes[T - 1 + c]));
    let weight = 10f32.powf(f32::from(bytes[T + 2]) / 64.0 - 2.0);
    Pixel { z, y, weight }
}

fn compare<const T: usize>(fit: &Fit<T>, lambda: f32) {
    let mut rls = Rls::new(&fit.prior);
    for p in &fit.pixels {
        assert_eq!(
            rls.update_forgetting(&p.z, &p.y, p.weight, lambda),
            Taken::Yes
        );
        assert!(rls.factors().1.iter().all(|&d| d > 0.0));
    }
    let rows = fit.rows();
    let prior = oracle::Prior::from_f32(&fit.prior);
    let condition = worst_condition(&rows, &prior, f64::from(lambda));
    let (rows, prior) = forget(&rows, &prior, f64::from(lambda));
    let batch = BatchFit::new(&rows, &prior);
    for p in &fit.pixels {
        let z = p.z.map(f64::from);
        let tolerance = searched(RECURSIVE_PREDICTION, condition) * fit.prediction_unit(p);
        for (ours, exact) in rls.predict(&p.z).into_iter().zip(batch.predict(&z)) {
            assert!(
                close(f64::from(ours), exact, tolerance),
                "{ours} against {exact} within {tolerance}"
            );
        }
        let (ours, exact) = (f64::from(rls.leverage(&p.z)), batch.leverage(&z));
        assert!(
            close(ours, exact, searched(RECURSIVE_LEVERAGE, condition) * exact),
            "leverage {ours} against {exact}"
        );
    }
}

fn raw_bits<const T: usize>(data: &[u8]) {
    let mut floats = bytemuck::pod_collect_to_vec::<u8, f32>(data).into_iter();
    let mut next = || floats.next();
    let (Some(intercept), Some(gradients)) = (next(), next()) else {
        return;
    };
    let mut rls = Rls::<T>::new(&Prior::at_centre(&[1.0; 3], intercept, gradients));
    while let Some(weight) = next() {
        let lambda = next().unwrap_or(1.0);
        let z = std::array::from_fn(|_| next().unwrap_or(1.0));
        let y = [0; 3].map(|_| next().unwrap_or(0.0));
        let before = rls;
        let taken = rls.update_forgetting(&z, &y, weight, lambda);
        assert!(taken == Taken::Yes || rls == before);
        assert!(rls.factors().1.iter().all(|&d| d > 0.0 && d.is_finite()));
        let outputs = rls.predict(&z).into_iter().chain([rls.leverage(&z)]);
        assert!(
            outputs
                .chain(rls.coefficients().as_flattened().iter().copied())
                .all(f32::is_finite)
        );
    }
}
