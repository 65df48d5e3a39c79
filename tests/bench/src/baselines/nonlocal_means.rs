//! Non-local means of the colour, patches compared by the pixels' own variances (Rousselle, Knaus and Zwicker, Adaptive
//! Rendering with Non-Local Means Filtering, 2012, Eq. 3 to 5).

use super::planes::{Planes, box_mean};

/// Half-width of the search.
const SEARCH: isize = 7;
/// Half-width of the patches.
const PATCH: usize = 3;
/// k: larger is smoother.
const STRENGTH: f32 = 0.6;
/// Half-width of the mean that steadies the variances.
const STEADY: usize = 1;

pub(super) fn filter(planes: &Planes) -> [Vec<f32>; 3] {
    let variance = planes
        .variance
        .each_ref()
        .map(|v| box_mean(v, planes.width, STEADY));
    let pixels = planes.width * planes.height;
    let mut sums: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; pixels]);
    let mut weights = vec![0.0f32; pixels];
    for dy in -SEARCH..=SEARCH {
        for dx in -SEARCH..=SEARCH {
            let distances = distances(planes, &variance, dx, dy);
            let patches = box_mean(&distances, planes.width, PATCH);
            for p in 0..pixels {
                let weight = (-patches[p].max(0.0)).exp();
                let q = planes.beside(p % planes.width, p / planes.width, dx, dy);
                weights[p] += weight;
                for (sum, plane) in sums.iter_mut().zip(&planes.colour) {
                    sum[p] += weight * plane[q];
                }
            }
        }
    }
    for sum in &mut sums {
        sum.iter_mut().zip(&weights).for_each(|(s, w)| *s /= w);
    }
    sums
}

/// `((u_p - u_q)^2 - (v_p + min(v_p, v_q))) / (eps + k^2 (v_p + v_q))`, mean over the channels.
fn distances(planes: &Planes, variance: &[Vec<f32>; 3], dx: isize, dy: isize) -> Vec<f32> {
    let mut out = vec![0.0; planes.width * planes.height];
    for (p, out) in out.iter_mut().enumerate() {
        let q = planes.beside(p % planes.width, p / planes.width, dx, dy);
        for (u, v) in planes.colour.iter().zip(variance) {
            let difference = u[p] - u[q];
            let noise = v[p] + v[p].min(v[q]);
            let scale = 1e-10 + STRENGTH * STRENGTH * (v[p] + v[q]);
            *out += (difference * difference - noise) / scale / 3.0;
        }
    }
    out
}
