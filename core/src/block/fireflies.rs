//! Fireflies: pixels that one sample made so bright that nothing around comes near, and that no model should learn from.
//!
//! A pixel of luminance l is one where
//!
//! ```text
//! 8 b < l                          b the second largest luminance of the 5 x 5 around, above 0
//! at most one pixel of the 9 x 9 around has l / 8 or more
//! (l - b)^2 < 9 V / 3              V its variance, summed over the channels
//! ```
//!
//! The second largest, so that two fireflies side by side go. The second line keeps light that is sparse: a glossy caustic or a small lamp
//! found by a sample in a hundred makes pixels that are lone among 25, but not among 81, and they carry its radiance. The third keeps what
//! is bright by many samples: a lamp of one pixel has a small variance, one sample among n that hit the sun a standard deviation like
//! itself. Where all around is black b is 0, nothing tells how bright a sample may be there, and the pixel stays.
//!
//! Without a stated variance the third line falls away, and b is the largest luminance: nothing says that the pixel is noise.
//!
//! Measured on courtyard, toasters, sibenik, pool and backdrop at 4 samples per pixel: 0, 5, 5, 2 and 0 pixels of 65536. Without the second line
//! 0, 16, 12, 5 and 0, but then the light of the 33 x 33 pixels around those of toasters is 1.5 % short, where it was 0.8 % over and is
//! 0.1 % short with it; and of a light that a sample in 50 finds, over a faint one, 44 % goes at 4 samples per pixel, with it 1.5 %.

use crate::float::{larger, smaller};

/// Pixels around one that decide whether it is a firefly.
pub const FIREFLY_HALO: usize = 4;
/// Rows of them.
pub const FIREFLY_ROWS: usize = 2 * FIREFLY_HALO + 1;

/// Half-width of the neighbourhood whose second largest luminance a firefly outshines.
const NEAR: usize = 2;
/// How many times brighter it is (measured: on the five images above at 5 twice as many pixels, at 12 a third).
const RATIO: f32 = 8.0;
/// Pixels of the 9 x 9 around that may come near it: another firefly.
const RIVALS: u32 = 1;
/// Squared standard deviations of the mean luminance, 9 V / 3, within which its variance does not tell it from what is around.
const VARIANCES: f32 = 3.0;

/// Finds the fireflies of a row.
///
/// `luminance` is that of the row, in the middle, and of the four above and below: mean magnitudes of the channels as they came, finite, each row
/// with [`FIREFLY_HALO`] columns more at either end. A pixel that is bad or lies beyond the image counts as 0. `variance` is the stated
/// variance of the row's means, summed over the channels, NaN where none is stated, or `None`. Each of `fireflies` becomes whether its column is one; a column that
/// `luminance` or `variance` does not reach is none.
///
/// A factor of a power of two in the radiance changes no decision while `l^2` is a normal number.
pub fn find_fireflies(
    luminance: &[&[f32]; FIREFLY_ROWS],
    variance: Option<&[f32]>,
    fireflies: &mut [bool],
) {
    find_candidates(luminance, fireflies);
    for (x, firefly) in fireflies.iter_mut().enumerate() {
        if *firefly {
            let variance = variance.map(|row| row.get(x).copied().unwrap_or(0.0));
            *firefly = is_firefly(luminance, x, variance.filter(|v| !v.is_nan()));
        }
    }
}

/// Marks the columns that are brighter than [`RATIO`] times one horizontal and one vertical neighbour: all fireflies, and few more.
fn find_candidates(luminance: &[&[f32]; FIREFLY_ROWS], candidates: &mut [bool]) {
    candidates.fill(false);
    let from = |row: usize, first: usize| {
        let row = luminance.get(row).copied().unwrap_or(&[]);
        row.get(first..).unwrap_or(&[])
    };
    let left = from(FIREFLY_HALO, FIREFLY_HALO - 1);
    let own = from(FIREFLY_HALO, FIREFLY_HALO);
    let right = from(FIREFLY_HALO, FIREFLY_HALO + 1);
    let above = from(FIREFLY_HALO - 1, FIREFLY_HALO);
    let below = from(FIREFLY_HALO + 1, FIREFLY_HALO);
    let pixels = own.iter().zip(left).zip(right).zip(above).zip(below);
    for (candidate, ((((own, left), right), above), below)) in candidates.iter_mut().zip(pixels) {
        let level = larger(smaller(*left, *right), smaller(*above, *below));
        *candidate = *own > RATIO * level;
    }
}

/// Whether column `x` is a firefly.
fn is_firefly(luminance: &[&[f32]; FIREFLY_ROWS], x: usize, variance: Option<f32>) -> bool {
    let own = luminance[FIREFLY_HALO].get(x + FIREFLY_HALO);
    let own = own.copied().unwrap_or(0.0);
    let (mut largest, mut second, mut rivals) = (0.0, 0.0, 0);
    for (dy, row) in luminance.iter().enumerate() {
        let row: Option<&[f32; FIREFLY_ROWS]> = row.get(x..).and_then(<[f32]>::first_chunk);
        let Some(row) = row else { return false };
        for (dx, &other) in row.iter().enumerate() {
            let (across, down) = (dx.abs_diff(FIREFLY_HALO), dy.abs_diff(FIREFLY_HALO));
            if (across, down) == (0, 0) {
                continue;
            }
            rivals += u32::from(RATIO * other >= own);
            if across <= NEAR && down <= NEAR {
                second = larger(second, smaller(largest, other));
                largest = larger(largest, other);
            }
        }
        if rivals > RIVALS {
            return false;
        }
    }
    let level = if variance.is_some() { second } else { largest };
    let excess = own - level;
    let lone = level > 0.0 && own > RATIO * level;
    lone && variance.is_none_or(|variance| excess * excess < VARIANCES * variance)
}
