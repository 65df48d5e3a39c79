//! A picture to look at: input, image, reference and error side by side, and the worst places larger.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::job::{ColourRow, Comparing, PLACE, WorstPlace, tone_mapped, worst_places};
use crate::{Error, ImageSize};

use super::heatmap::{NO_NUMBER, colour};
use super::png_rows::{self, PngRows};

/// How many times as large the worst places are.
const ZOOM: usize = 4;
/// Side of a place in the picture.
const ZOOMED: usize = PLACE * ZOOM;
/// Pixels between images of the same pixels.
const GAP: usize = 4;
/// Pixels between places, and above them.
const PLACE_GAP: usize = 16;
/// What lies between: a grey that neither dark nor bright images end in.
const BETWEEN: [u8; 3] = [96; 3];

/// Where everything goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Layout {
    size: ImageSize,
    /// Images that are shown: the input, if there is one, the image, the reference.
    images: usize,
    places: usize,
}

impl Layout {
    fn new(size: ImageSize, has_input: bool) -> Self {
        Self {
            size,
            images: if has_input { 3 } else { 2 },
            places: worst_places(size),
        }
    }

    /// Width of the images and the error beside them.
    fn side_by_side(&self) -> usize {
        (self.images + 1) * self.size.width() + self.images * GAP
    }

    /// Width of one place in all images.
    fn place_width(&self) -> usize {
        self.images * ZOOMED + (self.images - 1) * GAP
    }

    /// Places beside each other: as many as fit below the images, at least one.
    fn across(&self) -> usize {
        let fit = (self.side_by_side() + PLACE_GAP) / (self.place_width() + PLACE_GAP);
        fit.clamp(1, self.places)
    }

    fn width(&self) -> usize {
        let across = self.across();
        let places = across * self.place_width() + (across - 1) * PLACE_GAP;
        self.side_by_side().max(places)
    }

    fn height(&self) -> usize {
        self.size.height() + self.places.div_ceil(self.across()) * (PLACE_GAP + ZOOMED)
    }
}

/// A picture that is drawn from top to bottom.
#[derive(Debug)]
pub(crate) struct Picture {
    rows: PngRows,
    layout: Layout,
    line: Vec<[u8; 3]>,
}

impl Picture {
    /// Bytes that drawing takes.
    pub(crate) fn bytes(size: ImageSize, has_input: bool) -> u64 {
        let layout = Layout::new(size, has_input);
        let places = layout.across() * layout.images * PLACE * PLACE * size_of::<[u8; 3]>();
        png_rows::bytes(layout.width()).saturating_add(places as u64)
    }

    /// Begins a picture of images of this size. Errors as of [`PngRows::create`].
    pub(crate) fn create(path: &Path, size: ImageSize, has_input: bool) -> Result<Self, Error> {
        let layout = Layout::new(size, has_input);
        Ok(Self {
            rows: PngRows::create(path, layout.width(), layout.height())?,
            layout,
            line: vec![BETWEEN; layout.width()],
        })
    }

    /// Draws the next row of the images, and its relative squared errors.
    pub(crate) fn row(&mut self, row: &ColourRow<'_>, errors: &[f32]) -> Result<(), Error> {
        let width = self.layout.size.width();
        self.line.fill(BETWEEN);
        let mut panels = self.line.chunks_mut(width + GAP);
        for (colours, panel) in shown(row).zip(&mut panels) {
            for (x, pixel) in panel[..width].iter_mut().enumerate() {
                *pixel = seen(colours, x);
            }
        }
        if let Some(panel) = panels.next() {
            for (&error, pixel) in errors.iter().zip(panel) {
                *pixel = colour(error);
            }
        }
        self.rows.row(&self.line)
    }

    /// Draws the worst places below the images, and completes the picture.
    pub(crate) fn finish(
        mut self,
        images: &mut Comparing,
        worst: &[WorstPlace],
        stop: &AtomicBool,
    ) -> Result<(), Error> {
        for places in worst.chunks(self.layout.across()) {
            self.line.fill(BETWEEN);
            for _ in 0..PLACE_GAP {
                self.rows.row(&self.line)?;
            }
            let looked_at = places.iter().map(|place| look(images, place, stop));
            let looked_at = looked_at.collect::<Result<Vec<_>, Error>>()?;
            for y in 0..PLACE {
                self.draw_places(&looked_at, y);
                for _ in 0..ZOOM {
                    self.rows.row(&self.line)?;
                }
            }
        }
        self.rows.finish()
    }

    /// Draws row `y` of some places into the line, from left to right.
    fn draw_places(&mut self, places: &[Vec<Square>], y: usize) {
        let apart = self.layout.place_width() + PLACE_GAP;
        for (place, line) in places.iter().zip(self.line.chunks_mut(apart)) {
            for (square, panel) in place.iter().zip(line.chunks_mut(ZOOMED + GAP)) {
                for (pixels, &pixel) in panel.chunks_mut(ZOOM).zip(&square[y]) {
                    pixels.fill(pixel);
                }
            }
        }
    }
}

/// A place of one image. What lies beyond the image is as what lies between images.
type Square = Box<[[[u8; 3]; PLACE]; PLACE]>;

/// A place of each image that is shown.
fn look(
    images: &mut Comparing,
    place: &WorstPlace,
    stop: &AtomicBool,
) -> Result<Vec<Square>, Error> {
    let mut squares: Vec<Square> = Vec::new();
    images.look(place.y..place.y + place.height, stop, |row| {
        let new = || Box::new([[BETWEEN; PLACE]; PLACE]);
        squares.resize_with(shown(row).count(), new);
        for (colours, square) in shown(row).zip(&mut squares) {
            for x in 0..place.width {
                square[row.y - place.y][x] = seen(colours, place.x + x);
            }
        }
        Ok(())
    })?;
    Ok(squares)
}

/// The images from left to right.
fn shown<'a>(row: &ColourRow<'a>) -> impl Iterator<Item = &'a [Vec<f32>; 3]> {
    row.input.into_iter().chain([row.image, row.reference])
}

/// Pixel `x` as a screen shows it.
fn seen(colours: &[Vec<f32>; 3], x: usize) -> [u8; 3] {
    let radiance = [0, 1, 2].map(|k| f64::from(colours[k][x]));
    match radiance.iter().all(|value| value.is_finite()) {
        true => radiance.map(|value| (tone_mapped(value) * 255.0).round() as u8),
        false => NO_NUMBER,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_fill_the_width_of_the_images_and_no_more_than_there_are() {
        let size = |width, height| ImageSize::new(width, height).unwrap();
        let with_input = Layout::new(size(256, 256), true);
        assert_eq!(
            (with_input.side_by_side(), with_input.place_width()),
            (4 * 256 + 3 * 4, 3 * 128 + 2 * 4)
        );
        assert_eq!((with_input.across(), with_input.places), (2, 5));
        assert_eq!(
            (with_input.width(), with_input.height()),
            (1036, 256 + 3 * (16 + 128))
        );
        let pixel = Layout::new(size(1, 1), false);
        assert_eq!((pixel.width(), pixel.height()), (260, 1 + 16 + 128));
        let wide = Layout::new(size(4096, 20), false);
        assert_eq!((wide.across(), wide.height()), (5, 20 + 144));
    }
}
