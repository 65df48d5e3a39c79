//! Joint bilateral filter: weights from the distance of pixels and of their features, not of their colours.

use super::planes::Planes;

const RADIUS: isize = 5;
/// Standard deviations: pixels, normal, albedo, and depth relative to the depth. Customary values, not searched for.
const PIXELS: f32 = 3.0;
const NORMAL: f32 = 0.2;
const ALBEDO: f32 = 0.1;
const DEPTH: f32 = 0.05;

pub(super) fn filter(planes: &Planes) -> [Vec<f32>; 3] {
    let mut out: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; planes.width * planes.height]);
    for y in 0..planes.height {
        for x in 0..planes.width {
            let (mut sum, mut weights) = ([0.0; 3], 0.0);
            for dy in -RADIUS..=RADIUS {
                for dx in -RADIUS..=RADIUS {
                    let q = planes.beside(x, y, dx, dy);
                    let far = (dx * dx + dy * dy) as f32 / (PIXELS * PIXELS);
                    let weight = (-0.5 * (far + distance(planes, y * planes.width + x, q))).exp();
                    weights += weight;
                    for (sum, plane) in sum.iter_mut().zip(&planes.colour) {
                        *sum += weight * plane[q];
                    }
                }
            }
            for (out, sum) in out.iter_mut().zip(sum) {
                out[y * planes.width + x] = sum / weights;
            }
        }
    }
    out
}

/// Squared distance of the features in their standard deviations.
fn distance(planes: &Planes, p: usize, q: usize) -> f32 {
    let mut sum = 0.0;
    for (k, plane) in planes.features.iter().enumerate() {
        let deviation = match k {
            0..3 => NORMAL,
            3..6 => ALBEDO,
            _ => DEPTH * plane[p].abs() + 1e-6,
        };
        let difference = (plane[p] - plane[q]) / deviation;
        sum += difference * difference;
    }
    sum
}
