//! Eigenvalues and eigenvectors of a small symmetric matrix, by cyclic Jacobi rotations.
//!
//! The Gramian of a window's centred features has the squared singular values as eigenvalues and V as eigenvectors
//! (WLR section 4), which is all that the truncated SVD needs.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::float::fine_reciprocal_sqrt;
use crate::lanes::{Lanes, Matrix, Vector, lanes_stay_innermost};

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
    pub fn new(matrix: &[[f32; D]; D]) -> Option<Self> {
        const {
            assert!(
                D <= 16,
                "written for window features, not for large matrices"
            )
        };
        let mut rotated = matrix.map(|row| row.map(|v| [v]));
        let found = decorrelate(&mut rotated, 0.0);
        if found.finite != [true] {
            return None;
        }
        let mut values = found.values.map(|[v]| v);
        let mut vectors = found.vectors.map(|row| row.map(|[v]| v));
        sort_falling(&mut values, &mut vectors);
        Some(Self { values, vectors })
    }
}

/// `L` decomposed matrices.
pub(crate) struct Decomposed<const D: usize, const L: usize> {
    /// Eigenvalues, in no order.
    pub(crate) values: Vector<D, L>,
    /// The eigenvector of each.
    pub(crate) vectors: Matrix<D, L>,
    /// Whether the matrix was.
    pub(crate) finite: [bool; L],
}

/// Decomposes `L` matrices side by side.
///
/// Ends when no two directions of any matrix correlate by more than `correlation`: the vectors are as orthonormal as
/// with 0, the values right to about `correlation^2` of themselves, for half the sweeps. A lane whose matrix is there
/// already is not rotated, so its bits do not depend on the others.
#[inline(always)]
pub(crate) fn decorrelate<const D: usize, const L: usize>(
    matrix: &mut Matrix<D, L>,
    correlation: f32,
) -> Decomposed<D, L> {
    let (scale, finite) = scale_and_mirror(matrix);
    let mut vectors = [[[0.0; L]; D]; D];
    for i in 0..D {
        vectors[i][i] = [1.0; L];
    }
    for _ in 0..SWEEPS {
        if !sweep(matrix, &mut vectors, correlation * correlation) {
            break;
        }
    }
    let mut values = [[0.0; L]; D];
    for i in 0..D {
        for l in 0..L {
            values[i][l] = (matrix[i][i][l] * scale[l]).clamp(f32::MIN, f32::MAX);
        }
        lanes_stay_innermost();
    }
    Decomposed {
        values,
        vectors,
        finite,
    }
}

/// Brings each matrix into [-1, 1], so that no product in a rotation overflows and thresholds are relative; its scale, and whether
/// it was finite (one that was not becomes 0).
#[inline(always)]
fn scale_and_mirror<const D: usize, const L: usize>(
    matrix: &mut Matrix<D, L>,
) -> (Lanes<L>, [bool; L]) {
    let mut scale = [0.0f32; L];
    let mut finite = [true; L];
    for i in 0..D {
        for j in i..D {
            for l in 0..L {
                let magnitude = matrix[i][j][l].abs();
                finite[l] &= magnitude.is_finite();
                scale[l] = if magnitude > scale[l] {
                    magnitude
                } else {
                    scale[l]
                };
            }
        }
    }
    for i in 0..D {
        for j in i..D {
            for l in 0..L {
                let usable = finite[l] && scale[l] > 0.0;
                let value = if usable {
                    matrix[i][j][l] / scale[l]
                } else {
                    0.0
                };
                matrix[i][j][l] = value;
                matrix[j][i][l] = value;
            }
        }
    }
    (scale, finite)
}

/// Rotates every off-diagonal element away once, in a fixed order; whether any was worth it.
///
/// An element below a sixteenth of a unit in the last place of the largest is left: a row of them moves an eigenvalue by less
/// than rounding does. So is one whose square is below `negligible` times the product of its diagonal elements.
#[inline(always)]
fn sweep<const D: usize, const L: usize>(
    matrix: &mut Matrix<D, L>,
    vectors: &mut Matrix<D, L>,
    negligible: f32,
) -> bool {
    let mut rotated = false;
    for p in 0..D {
        for q in p + 1..D {
            let mut worth = [false; L];
            let mut any = false;
            for l in 0..L {
                let element = matrix[p][q][l];
                let bound = negligible * matrix[p][p][l] * matrix[q][q][l];
                worth[l] = (element.abs() > f32::EPSILON / 16.0) & (element * element > bound);
                any |= worth[l];
            }
            if any {
                rotate(matrix, vectors, p, q, &worth);
                rotated = true;
            }
        }
    }
    rotated
}

/// One Jacobi rotation in the plane (p, q) (Golub and Van Loan, Matrix Computations, section 8.5.2), by an angle of 0 in
/// the lanes for which it is not worth it.
#[inline(always)]
fn rotate<const D: usize, const L: usize>(
    matrix: &mut Matrix<D, L>,
    vectors: &mut Matrix<D, L>,
    p: usize,
    q: usize,
    worth: &[bool; L],
) {
    let (pp, qq, element) = (matrix[p][p], matrix[q][q], matrix[p][q]);
    let mut tangent = [0.0; L];
    let mut cosine = [1.0; L];
    let mut sine = [0.0; L];
    for l in 0..L {
        let element = if worth[l] { element[l] } else { 1.0 };
        let theta = (qq[l] - pp[l]) / (2.0 * element);
        let hypotenuse = theta * theta + 1.0;
        let magnitude = 1.0 / (theta.abs() + hypotenuse * fine_reciprocal_sqrt(hypotenuse));
        let signed = if theta < 0.0 { -magnitude } else { magnitude };
        tangent[l] = if worth[l] { signed } else { 0.0 };
        cosine[l] = fine_reciprocal_sqrt(tangent[l] * tangent[l] + 1.0);
        sine[l] = tangent[l] * cosine[l];
    }
    mix_rows(matrix, p, q, &cosine, &sine);
    mix_rows(vectors, p, q, &cosine, &sine);
    for l in 0..L {
        matrix[p][p][l] = pp[l] - tangent[l] * element[l];
        matrix[q][q][l] = qq[l] + tangent[l] * element[l];
        let left = if worth[l] { 0.0 } else { element[l] };
        matrix[p][q][l] = left;
        matrix[q][p][l] = left;
    }
    for k in 0..D {
        matrix[k][p] = matrix[p][k];
        matrix[k][q] = matrix[q][k];
        lanes_stay_innermost();
    }
}

/// Row p becomes `cosine p - sine q`, row q becomes `sine p + cosine q`.
#[inline(always)]
fn mix_rows<const D: usize, const L: usize>(
    rows: &mut Matrix<D, L>,
    p: usize,
    q: usize,
    cosine: &Lanes<L>,
    sine: &Lanes<L>,
) {
    for k in 0..D {
        let (at_p, at_q) = (rows[p][k], rows[q][k]);
        for l in 0..L {
            rows[p][k][l] = cosine[l] * at_p[l] - sine[l] * at_q[l];
            rows[q][k][l] = sine[l] * at_p[l] + cosine[l] * at_q[l];
        }
        lanes_stay_innermost();
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
