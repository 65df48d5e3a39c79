//! Eigenvalues and eigenvectors of a small symmetric matrix, by cyclic Jacobi rotations.
//!
//! The Gramian of a window's centred features has the squared singular values as eigenvalues and V as eigenvectors
//! (WLR section 4), which is all that the truncated SVD needs.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::float::sqrt;

/// Sweeps at most; six are the most seen on windows of real and of adversarial features.
const SWEEPS: usize = 12;

/// Eigenvalues of a symmetric matrix, largest first, and the eigenvector of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetricEigen<const D: usize> {
    /// Eigenvalues, falling. Each is within `D` units in the last place **of the largest** of the exact one; those of a
    /// Gramian may come out that much below 0.
    pub values: [f32; D],
    /// `vectors[m]` is the unit eigenvector of `values[m]`, of arbitrary sign; orthonormal to `4 D` units in the last place of 1.
    pub vectors: [[f32; D]; D],
}

impl<const D: usize> SymmetricEigen<D> {
    /// Decomposes `matrix`, of which only the upper triangle is read; `None` if that holds a value that is not finite.
    ///
    /// Any finite matrix is decomposed to finite numbers, denormal and huge ones among them (an eigenvalue beyond f32
    /// is given as the largest finite float). Same input, same bits. Cost: about `6 D^3` multiply-adds a sweep, 4 to 6 sweeps.
    #[inline(always)]
    pub fn new(matrix: &[[f32; D]; D]) -> Option<Self> {
        const {
            assert!(
                D <= 16,
                "written for window features, not for large matrices"
            )
        };
        let scale = largest_magnitude(matrix)?;
        let mut rotated = scaled_and_mirrored(matrix, scale);
        let mut vectors = identity();
        for _ in 0..SWEEPS {
            if !sweep(&mut rotated, &mut vectors) {
                break;
            }
        }
        let mut values = [0.0; D];
        for (m, (value, row)) in values.iter_mut().zip(&rotated).enumerate() {
            *value = row.get(m).map_or(0.0, |v| v * scale);
            *value = value.clamp(f32::MIN, f32::MAX);
        }
        sort_falling(&mut values, &mut vectors);
        Some(Self { values, vectors })
    }
}

/// The largest magnitude of the upper triangle, `None` if something in it is not finite.
#[inline(always)]
fn largest_magnitude<const D: usize>(matrix: &[[f32; D]; D]) -> Option<f32> {
    let mut largest = 0.0f32;
    for i in 0..D {
        for j in i..D {
            let magnitude = matrix[i][j].abs();
            if !magnitude.is_finite() {
                return None;
            }
            largest = largest.max(magnitude);
        }
    }
    Some(largest)
}

/// The matrix in [-1, 1], so that no product in a rotation overflows and thresholds are relative.
#[inline(always)]
fn scaled_and_mirrored<const D: usize>(matrix: &[[f32; D]; D], scale: f32) -> [[f32; D]; D] {
    let mut scaled = [[0.0; D]; D];
    if scale > 0.0 {
        for i in 0..D {
            for j in i..D {
                let value = matrix[i][j] / scale;
                scaled[i][j] = value;
                scaled[j][i] = value;
            }
        }
    }
    scaled
}

#[inline(always)]
fn identity<const D: usize>() -> [[f32; D]; D] {
    let mut identity = [[0.0; D]; D];
    for (i, row) in identity.iter_mut().enumerate() {
        if let Some(unit) = row.get_mut(i) {
            *unit = 1.0;
        }
    }
    identity
}

/// Rotates every off-diagonal element away once, in a fixed order; whether any was worth it.
///
/// An element below a sixteenth of a unit in the last place of the largest is left: a row of them moves an eigenvalue by less
/// than rounding does.
#[inline(always)]
fn sweep<const D: usize>(matrix: &mut [[f32; D]; D], vectors: &mut [[f32; D]; D]) -> bool {
    let mut rotated = false;
    for p in 0..D {
        for q in p + 1..D {
            if matrix[p][q].abs() > f32::EPSILON / 16.0 {
                rotate(matrix, vectors, p, q);
                rotated = true;
            }
        }
    }
    rotated
}

/// One Jacobi rotation in the plane (p, q) (Golub and Van Loan, Matrix Computations, section 8.5.2).
#[inline(always)]
fn rotate<const D: usize>(
    matrix: &mut [[f32; D]; D],
    vectors: &mut [[f32; D]; D],
    p: usize,
    q: usize,
) {
    let element = matrix[p][q];
    let theta = (matrix[q][q] - matrix[p][p]) / (2.0 * element);
    let magnitude = 1.0 / (theta.abs() + sqrt(theta * theta + 1.0));
    let tangent = if theta < 0.0 { -magnitude } else { magnitude };
    let cosine = 1.0 / sqrt(tangent * tangent + 1.0);
    let sine = tangent * cosine;
    let (pp, qq) = (matrix[p][p], matrix[q][q]);
    mix_rows(matrix, p, q, cosine, sine);
    mix_rows(vectors, p, q, cosine, sine);
    matrix[p][p] = pp - tangent * element;
    matrix[q][q] = qq + tangent * element;
    matrix[p][q] = 0.0;
    matrix[q][p] = 0.0;
    for k in 0..D {
        matrix[k][p] = matrix[p][k];
        matrix[k][q] = matrix[q][k];
    }
}

/// Row p becomes `cosine p - sine q`, row q becomes `sine p + cosine q`.
#[inline]
fn mix_rows<const D: usize>(rows: &mut [[f32; D]; D], p: usize, q: usize, cosine: f32, sine: f32) {
    let (row_p, row_q) = (rows[p], rows[q]);
    for k in 0..D {
        rows[p][k] = cosine * row_p[k] - sine * row_q[k];
        rows[q][k] = sine * row_p[k] + cosine * row_q[k];
    }
}

/// Insertion sort of the values, falling, and of the vectors with them; equal values keep their order.
#[inline(always)]
fn sort_falling<const D: usize>(values: &mut [f32; D], vectors: &mut [[f32; D]; D]) {
    for m in 1..D {
        let mut place = m;
        while place > 0 && values[place - 1] < values[place] {
            values.swap(place - 1, place);
            vectors.swap(place - 1, place);
            place -= 1;
        }
    }
}
