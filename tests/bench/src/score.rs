//! Error against a reference.

use crate::image::{Colour, Image};

/// Added to the squared reference, so that black pixels do not rule the relative error.
const RELATIVE_FLOOR: f64 = 0.01;

/// Relative mean squared error with the reference's own noise taken off: mean over pixels and channels of
/// `((a - f)^2 - var f) / (f^2 + 0.01)`. NaN if a pixel is not finite.
pub(crate) fn rmse(image: &Colour, reference: &Image) -> f64 {
    let width = reference.layout.size.width();
    let mut sum = 0.0;
    for (y, row) in reference.rows.iter().enumerate() {
        for (c, plane) in image.planes.iter().enumerate() {
            for x in 0..width {
                let f = f64::from(row.colour[c][x]);
                let noise = if reference.has_variance() {
                    f64::from(row.variance[c][x])
                } else {
                    0.0
                };
                let d = f64::from(plane[y * width + x]) - f;
                sum += (d * d - noise) / (f * f + RELATIVE_FLOOR);
            }
        }
    }
    sum / (3.0 * reference.layout.size.pixels() as f64)
}
