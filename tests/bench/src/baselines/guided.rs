//! Guided filter (He, Sun and Tang, 2013) with the features as the guide: in every window a linear model of the
//! features, and at every pixel the mean of the models of the windows around.

use super::planes::{Planes, box_mean};

const RADIUS: usize = 4;
/// Epsilon of the guided filter, for a guide that spans 0 to 1. Customary values, not searched for.
const RIDGE: f32 = 1e-3;
/// Normal, albedo and depth.
const GUIDES: usize = 7;

pub(super) fn filter(planes: &Planes) -> [Vec<f32>; 3] {
    let mean = |plane: &[f32]| box_mean(plane, planes.width, RADIUS);
    let guides = scaled_guides(planes);
    let means: Vec<Vec<f32>> = guides.iter().map(|guide| mean(guide)).collect();
    let covariance = |a: &[f32], b: &[f32], mean_a: &[f32], mean_b: &[f32]| {
        let products: Vec<f32> = a.iter().zip(b).map(|(a, b)| a * b).collect();
        let mut covariance = mean(&products);
        for (p, value) in covariance.iter_mut().enumerate() {
            *value -= mean_a[p] * mean_b[p];
        }
        covariance
    };
    let mut matrices = vec![[[0.0f32; GUIDES]; GUIDES]; planes.width * planes.height];
    for i in 0..GUIDES {
        for j in 0..=i {
            let plane = covariance(&guides[i], &guides[j], &means[i], &means[j]);
            for (matrix, value) in matrices.iter_mut().zip(plane) {
                matrix[i][j] = value + if i == j { RIDGE } else { 0.0 };
            }
        }
    }
    matrices.iter_mut().for_each(factorise);
    planes.colour.each_ref().map(|colour| {
        let mean_colour = mean(colour);
        let crosses: Vec<Vec<f32>> = (0..GUIDES)
            .map(|i| covariance(&guides[i], colour, &means[i], &mean_colour))
            .collect();
        let mut slopes = crosses;
        let mut offset = mean_colour;
        for (p, matrix) in matrices.iter().enumerate() {
            let a = solve(matrix, std::array::from_fn(|i| slopes[i][p]));
            for i in 0..GUIDES {
                slopes[i][p] = a[i];
                offset[p] -= a[i] * means[i][p];
            }
        }
        let mut out = mean(&offset);
        for (slope, guide) in slopes.iter().zip(&guides) {
            for ((out, slope), guide) in out.iter_mut().zip(mean(slope)).zip(guide) {
                *out += slope * guide;
            }
        }
        out
    })
}

/// The features over the largest of their group: the normal and the albedo as they are, the depth from 0 to 1.
fn scaled_guides(planes: &Planes) -> Vec<Vec<f32>> {
    let mut guides = planes.features.clone();
    if let Some(depth) = guides.last_mut() {
        let largest = depth.iter().fold(f32::MIN_POSITIVE, |a, b| a.max(*b));
        depth.iter_mut().for_each(|v| *v /= largest);
    }
    guides
}

/// Cholesky factor in the lower triangle. The ridge keeps the pivots positive; rounding may not take that away.
fn factorise(matrix: &mut [[f32; GUIDES]; GUIDES]) {
    for j in 0..GUIDES {
        for k in 0..j {
            matrix[j][j] -= matrix[j][k] * matrix[j][k];
        }
        matrix[j][j] = matrix[j][j].max(0.1 * RIDGE).sqrt();
        for i in j + 1..GUIDES {
            for k in 0..j {
                matrix[i][j] -= matrix[i][k] * matrix[j][k];
            }
            matrix[i][j] /= matrix[j][j];
        }
    }
}

fn solve(factor: &[[f32; GUIDES]; GUIDES], mut x: [f32; GUIDES]) -> [f32; GUIDES] {
    for i in 0..GUIDES {
        for k in 0..i {
            x[i] -= factor[i][k] * x[k];
        }
        x[i] /= factor[i][i];
    }
    for i in (0..GUIDES).rev() {
        for k in i + 1..GUIDES {
            x[i] -= factor[k][i] * x[k];
        }
        x[i] /= factor[i][i];
    }
    x
}
