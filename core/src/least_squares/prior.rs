//! What a linear model is before it has seen a pixel.

use crate::tile::CHANNELS;

/// Coefficients that a fit is pulled to, and how strongly: the `delta |beta - beta(0)|^2` of LPR Eq. 3, with a `delta` per term.
///
/// Term 0 is the intercept. The paper has `coefficients = (y_c, 0, ..., 0)` and every strength 0.001; the strengths of the
/// gradients are a matter of noise and feature scale, so each term has its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior<const T: usize> {
    /// `beta(0)` per channel, in radiance per unit of the term's regressor.
    pub coefficients: [[f32; T]; CHANNELS],
    /// `delta` per term: the prior's precision, in the unit of a pixel's weight times its regressor squared. Positive;
    /// each fit says what it does with others.
    pub strengths: [f32; T],
}

impl<const T: usize> Prior<T> {
    /// The paper's prior: the centre's radiance and no gradients, with the strength of the intercept and of the gradients.
    pub fn at_centre(radiance: &[f32; CHANNELS], intercept: f32, gradients: f32) -> Self {
        let mut prior = Self {
            coefficients: [[0.0; T]; CHANNELS],
            strengths: [gradients; T],
        };
        for (coefficients, &radiance) in prior.coefficients.iter_mut().zip(radiance) {
            if let Some(first) = coefficients.first_mut() {
                *first = radiance;
            }
        }
        if let Some(first) = prior.strengths.first_mut() {
            *first = intercept;
        }
        prior
    }
}
