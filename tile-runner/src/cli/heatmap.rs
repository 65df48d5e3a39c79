//! A picture of where an image is wrong.

use std::path::Path;

use crate::{Error, ImageSize};

use super::png_rows::PngRows;

/// Relative squared error that is drawn black, and that is drawn white: four decades between.
const DARKEST: f32 = 1e-4;
const BRIGHTEST: f32 = 1.0;

/// Colours on the way from the darkest to the brightest: black, violet, red, yellow, white.
const RAMP: [[f32; 3]; 5] = [
    [0.0, 0.0, 0.0],
    [0.35, 0.0, 0.5],
    [0.9, 0.2, 0.1],
    [1.0, 0.8, 0.1],
    [1.0, 1.0, 1.0],
];
/// What a pixel without a number is drawn in: a colour that is not on the ramp.
pub(super) const NO_NUMBER: [u8; 3] = [0, 255, 255];

/// A picture of relative squared errors, drawn row by row.
#[derive(Debug)]
pub(crate) struct Heatmap {
    rows: PngRows,
}

impl Heatmap {
    /// Begins a picture. [`Error::Write`] if the file cannot be created.
    pub(crate) fn create(path: &Path, size: ImageSize) -> Result<Self, Error> {
        let rows = PngRows::create(path, size.width(), size.height())?;
        Ok(Self { rows })
    }

    /// Draws a row of relative squared errors.
    pub(crate) fn row(&mut self, errors: &[f32]) -> Result<(), Error> {
        let pixels: Vec<[u8; 3]> = errors.iter().map(|&error| colour(error)).collect();
        self.rows.row(&pixels)
    }

    /// Completes the picture.
    pub(crate) fn finish(self) -> Result<(), Error> {
        self.rows.finish()
    }
}

/// The colour of a relative squared error.
pub(super) fn colour(error: f32) -> [u8; 3] {
    if !error.is_finite() {
        return NO_NUMBER;
    }
    let decades = (BRIGHTEST / DARKEST).log10();
    ramp((error.max(DARKEST) / DARKEST).log10() / decades)
}

/// The colour at a place on the way from black, at 0, to white, from 1 on.
pub(super) fn ramp(place: f32) -> [u8; 3] {
    let place = place.min(1.0) * (RAMP.len() - 1) as f32;
    let below = (place as usize).min(RAMP.len() - 2);
    let share = place - below as f32;
    let mix = |k: usize| RAMP[below][k] * (1.0 - share) + RAMP[below + 1][k] * share;
    [mix(0), mix(1), mix(2)].map(|v| (v * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_errors_are_never_darker() {
        let brightness = |error| colour(error).iter().map(|&v| u32::from(v)).sum::<u32>();
        let errors: Vec<f32> = (0..60)
            .map(|i| 10_f32.powf(-5.0 + f32::from(i as u8) * 0.1))
            .collect();
        assert!(
            errors
                .windows(2)
                .all(|e| brightness(e[0]) <= brightness(e[1]))
        );
        assert_eq!(
            (colour(0.0), colour(-1.0), colour(9.0)),
            ([0; 3], [0; 3], [255; 3])
        );
        assert_eq!(colour(f32::NAN), NO_NUMBER);
    }
}
