//! Whole images as planes, and their box means.

use anyhow::Result;
use linpred::{InputRow, RowSource};

use crate::image::{Image, MirroredRows};

/// An image in memory. Beyond its edges filters read the nearest pixel.
pub(crate) struct Planes {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) colour: [Vec<f32>; 3],
    pub(crate) variance: [Vec<f32>; 3],
    /// Normal, albedo, depth.
    pub(crate) features: Vec<Vec<f32>>,
}

impl Planes {
    /// `copies` x `copies` of an image.
    pub(crate) fn mirrored(image: &Image, copies: usize) -> Result<Self> {
        let mut rows = MirroredRows::new(image, copies)?;
        let layout = rows.layout();
        let mut planes = Self {
            width: layout.size.width(),
            height: layout.size.height(),
            colour: Default::default(),
            variance: Default::default(),
            features: vec![Vec::new(); layout.features.len()],
        };
        let mut row = InputRow::new(&layout);
        for y in 0..layout.size.height() {
            rows.read_row(y, &mut row)?;
            for c in 0..3 {
                planes.colour[c].extend_from_slice(&row.colour[c]);
                planes.variance[c].extend_from_slice(&row.variance[c]);
            }
            for (plane, row) in planes.features.iter_mut().zip(&row.features) {
                plane.extend_from_slice(row);
            }
        }
        Ok(planes)
    }

    /// Index of the pixel at (x + dx, y + dy), or of the nearest.
    pub(crate) fn beside(&self, x: usize, y: usize, dx: isize, dy: isize) -> usize {
        let x = x.saturating_add_signed(dx).min(self.width - 1);
        let y = y.saturating_add_signed(dy).min(self.height - 1);
        y * self.width + x
    }
}

/// Mean over the pixels of the image within `radius`, by running sums.
pub(crate) fn box_mean(plane: &[f32], width: usize, radius: usize) -> Vec<f32> {
    let height = plane.len() / width;
    let mut across = vec![0.0; plane.len()];
    for (out, row) in across.chunks_mut(width).zip(plane.chunks(width)) {
        let mut sum: f64 = row.iter().take(radius).map(|v| f64::from(*v)).sum();
        for (x, out) in out.iter_mut().enumerate() {
            sum += row.get(x + radius).map_or(0.0, |v| f64::from(*v));
            let (from, to) = span(x, radius, width);
            *out = sum / (to - from) as f64;
            sum -= x.checked_sub(radius).map_or(0.0, |x| f64::from(row[x]));
        }
    }
    let mut sums = vec![0.0; width];
    let mut mean = vec![0.0; plane.len()];
    for y in 0..radius.min(height) {
        accumulate(&mut sums, &across[y * width..][..width], 1.0);
    }
    for y in 0..height {
        if y + radius < height {
            accumulate(&mut sums, &across[(y + radius) * width..][..width], 1.0);
        }
        let (from, to) = span(y, radius, height);
        for (out, sum) in mean[y * width..][..width].iter_mut().zip(&sums) {
            *out = (sum / (to - from) as f64) as f32;
        }
        if y >= radius {
            accumulate(&mut sums, &across[(y - radius) * width..][..width], -1.0);
        }
    }
    mean
}

fn span(position: usize, radius: usize, length: usize) -> (usize, usize) {
    (
        position.saturating_sub(radius),
        (position + radius + 1).min(length),
    )
}

fn accumulate(sums: &mut [f64], row: &[f64], factor: f64) {
    for (sum, value) in sums.iter_mut().zip(row) {
        *sum += factor * value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn running_sums_are_means_of_what_lies_inside() {
        let (width, height, radius) = (7, 5usize, 2usize);
        let plane: Vec<f32> = (0..35).map(|i| ((i * i) % 11) as f32).collect();
        let means = box_mean(&plane, width, radius);
        for y in 0..height {
            for x in 0..width {
                let (mut sum, mut count) = (0.0, 0.0);
                for v in y.saturating_sub(radius)..(y + radius + 1).min(height) {
                    for u in x.saturating_sub(radius)..(x + radius + 1).min(width) {
                        sum += plane[v * width + u];
                        count += 1.0;
                    }
                }
                let difference = (means[y * width + x] - sum / count).abs();
                assert!(difference <= 1e-5, "{x} {y}: {difference}");
            }
        }
    }
}
