//! The Jacobi decomposition of a window's Gramian is the truncated SVD of its features.

use linpred_core::SymmetricEigen;
use linpred_tests::strategies::{any_bits, fits};
use linpred_tests::tolerance::{EIGENVALUE, ORTHONORMALITY, RECONSTRUCTION, close};
use nalgebra::DMatrix;
use proptest::prelude::{TestCaseError, prop_assert, proptest};

/// Z^T Z of the window's features without their means, rounded to f32 as the core would hold it, and Z.
fn centred_gramian<const D: usize>(z: &[[f32; D]]) -> ([[f32; D]; D], DMatrix<f64>) {
    let mut centred = DMatrix::from_fn(z.len(), D, |i, j| f64::from(z[i][j]));
    for mut column in centred.column_iter_mut() {
        let mean = column.mean();
        column.add_scalar_mut(-mean);
    }
    let gramian = centred.transpose() * &centred;
    let rounded = core::array::from_fn(|i| core::array::from_fn(|j| gramian[(i, j)] as f32));
    (rounded, centred)
}

fn to_f64<const D: usize>(rows: &[[f32; D]; D]) -> DMatrix<f64> {
    DMatrix::from_fn(D, D, |i, j| f64::from(rows[i][j]))
}

/// The matrix with elements below 1e-25 of its largest set to 0, which moves no singular value by more than that:
/// nalgebra's QR iteration divides products of denormals and returns NaN.
fn without_underflow(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let least = 1e-25 * matrix.amax();
    matrix.map(|v| if v.abs() < least { 0.0 } else { v })
}

fn is_a_decomposition<const D: usize>(gramian: &[[f32; D]; D]) -> Result<(), TestCaseError> {
    let ours = SymmetricEigen::new(gramian).expect("finite");
    let v = to_f64(&ours.vectors);
    let off = (&v * v.transpose() - DMatrix::identity(D, D)).amax();
    prop_assert!(off <= ORTHONORMALITY, "V^T V is off by {off}");
    prop_assert!(ours.values.is_sorted_by(|a, b| a >= b), "{:?}", ours.values);
    let values = DMatrix::from_fn(D, D, |i, j| {
        if i == j {
            f64::from(ours.values[i])
        } else {
            0.0
        }
    });
    let exact = to_f64(gramian);
    let scale = exact.amax();
    let off = (v.transpose() * values * &v - &exact).amax();
    prop_assert!(off <= RECONSTRUCTION * scale, "rebuilt to {off} of {scale}");
    let mut eigenvalues: Vec<f64> = without_underflow(&exact)
        .symmetric_eigenvalues()
        .iter()
        .copied()
        .collect();
    eigenvalues.sort_by(|a, b| b.total_cmp(a));
    let largest = eigenvalues[0].abs().max(eigenvalues[D - 1].abs());
    for (&ours, &exact) in ours.values.iter().zip(&eigenvalues) {
        prop_assert!(
            close(f64::from(ours), exact, EIGENVALUE * largest),
            "{ours} against {exact} of {largest}"
        );
    }
    Ok(())
}

/// Singular values above a threshold, counted by the decomposition and by the SVD of Z itself, wherever no singular value is
/// within rounding of the threshold.
fn rank_is_the_oracles<const D: usize>(z: &[[f32; D]]) -> Result<(), TestCaseError> {
    let (gramian, centred) = centred_gramian(z);
    let ours = SymmetricEigen::new(&gramian).expect("finite");
    let singular = without_underflow(&centred).singular_values();
    prop_assert!(
        singular.iter().all(|s| s.is_finite()),
        "the oracle's {singular}"
    );
    for relative in [0.5, 0.1, 0.02, 0.005] {
        let threshold = relative * singular.max();
        let rounding = EIGENVALUE * singular.max().powi(2);
        let square = threshold * threshold;
        let clear = singular
            .iter()
            .all(|s| (s * s - square).abs() > 2.0 * rounding);
        if clear && square > f64::from(f32::MIN_POSITIVE) {
            let exact = singular.iter().filter(|&&s| s > threshold).count();
            let count = ours
                .values
                .iter()
                .filter(|&&v| f64::from(v) > square)
                .count();
            prop_assert!(count == exact, "rank {count} against {exact} at {relative}");
        }
    }
    Ok(())
}

macro_rules! of_features {
    ($($name:ident $features:literal)*) => {$(
        mod $name {
            use super::*;

            proptest! {
                #[test]
                fn reconstructs_orthonormal_and_sorted(fit in fits::<$features>()) {
                    let z: Vec<[f32; $features]> = fit.pixels.iter().map(|p| p.z).collect();
                    is_a_decomposition(&centred_gramian(&z).0)?;
                }

                #[test]
                fn keeps_the_rank_of_the_features(fit in fits::<$features>()) {
                    let z: Vec<[f32; $features]> = fit.pixels.iter().map(|p| p.z).collect();
                    rank_is_the_oracles(&z)?;
                }

                #[test]
                fn any_bits_are_finite_or_refused(bits in proptest::array::uniform(proptest::array::uniform(any_bits()))) {
                    let matrix: [[f32; $features]; $features] = bits;
                    let upper = (0..$features).flat_map(|i| (i..$features).map(move |j| matrix[i][j]));
                    let finite = upper.fold(true, |all, v| all && v.is_finite());
                    match SymmetricEigen::new(&matrix) {
                        Some(eigen) => {
                            prop_assert!(finite);
                            prop_assert!(eigen.values.iter().chain(eigen.vectors.as_flattened()).all(|v| v.is_finite()));
                        }
                        None => prop_assert!(!finite),
                    }
                }
            }
        }
    )*};
}

of_features! { one_feature 1 two_features 2 three_features 3 five_features 5 nine_features 9 sixteen_features 16 }

#[test]
fn extreme_scales_keep_their_values() {
    for scale in [1e-44f32, 1e-38, 1e-20, 1.0, 1e20, 1e38] {
        let eigen =
            SymmetricEigen::new(&[[2.0 * scale, scale], [scale, 2.0 * scale]]).expect("finite");
        let tolerance = 1e-6 * f64::from(scale) + f64::from(f32::from_bits(2));
        assert!(
            close(
                f64::from(eigen.values[0]),
                3.0 * f64::from(scale).min(1.13e38),
                tolerance
            ),
            "{scale}"
        );
        assert!(
            close(f64::from(eigen.values[1]), f64::from(scale), tolerance),
            "{scale}"
        );
    }
}

#[test]
fn a_zero_matrix_has_zero_values_and_unit_vectors() {
    let eigen = SymmetricEigen::new(&[[0.0f32; 3]; 3]).expect("finite");
    assert_eq!(eigen.values, [0.0; 3]);
    assert_eq!(
        eigen.vectors,
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    );
}
