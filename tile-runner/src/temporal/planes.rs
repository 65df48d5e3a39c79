//! The planes of a row that are averaged over frames, as the core wants them.

use linpred_core::{Averaged, FEATURES, Feature, FrameRow, MAX_FEATURES};

use crate::error::Error;
use crate::row::{InputRow, RowLayout, RowSource, VarianceKind};
use crate::stream::finish::planes::Plane;
use crate::stream::{LARGEST, NO_SURFACE};
use crate::temporal::held_frame::HeldFrame;
use crate::temporal::track::Track;

// places of the planes; after them those of the layers, and the alpha
const COLOUR: usize = 0;
const VARIANCE: usize = 3;
const FEATURE: usize = 6;
const FURTHER: usize = FEATURE + FEATURES;
const FEATURE_VARIANCE: usize = FEATURE + MAX_FEATURES;
const LAYERS: usize = FEATURE_VARIANCE + MAX_FEATURES;

/// The planes of a row of input in that order.
fn averaged(row: &InputRow) -> impl Iterator<Item = &Vec<f32>> {
    let light = row.colour.iter().chain(&row.variance);
    let features = row.features.iter().chain(&row.feature_variances);
    let layers = row.layers.iter().flatten();
    light
        .chain(features)
        .chain(layers)
        .chain(std::iter::once(&row.alpha))
}

/// The same, to be filled.
pub(super) fn averaged_mut(row: &mut InputRow) -> impl Iterator<Item = &mut Vec<f32>> {
    let light = row.colour.iter_mut().chain(&mut row.variance);
    let features = row.features.iter_mut().chain(&mut row.feature_variances);
    let layers = row.layers.iter_mut().flatten();
    light
        .chain(features)
        .chain(layers)
        .chain(std::iter::once(&mut row.alpha))
}

/// The planes of a row of a frame, of its own pixels or of those that another frame has found in it.
#[derive(Debug)]
pub(super) struct Planes {
    pub(super) planes: Vec<Plane>,
    /// 1 where there is a pixel, and 0 elsewhere.
    pub(super) known: Plane,
}

impl Planes {
    /// How many there are.
    pub(super) fn count(layout: &RowLayout) -> usize {
        7 + 2 * layout.feature_channels() + 3 * layout.layers + usize::from(layout.alpha)
    }

    pub(super) fn new(layout: &RowLayout) -> Self {
        let plane = |present: bool| match present {
            true => Plane::new(layout.size.width()),
            false => Plane::none(),
        };
        let variance = layout.variance != VarianceKind::Estimated;
        let light = [true, true, true, variance, variance, variance];
        let features = layout.features.iter().chain(&layout.features).copied();
        let layers = std::iter::repeat_n(true, 3 * layout.layers);
        let present = light.into_iter().chain(features).chain(layers);
        Self {
            planes: present.chain([layout.alpha]).map(plane).collect(),
            known: plane(true),
        }
    }

    /// What the plane in this place holds.
    pub(super) fn what(place: usize) -> Averaged {
        match place {
            VARIANCE..FEATURE | FEATURE_VARIANCE..LAYERS => Averaged::Variances,
            _ => Averaged::Means,
        }
    }

    /// By which power of the factor of a neighbour's depths its plane in this place is to be divided: 0 for what is no depth.
    pub(super) fn depth_power(place: usize) -> i32 {
        let depth = Feature::Depth.range().start;
        match place {
            place if place == FEATURE + depth => 1,
            place if place == FEATURE_VARIANCE + depth => 2,
            _ => 0,
        }
    }

    /// Takes the frame's own pixels.
    pub(super) fn take(&mut self, row: &InputRow) {
        for (own, plane) in self.planes.iter_mut().zip(averaged(row)) {
            if own.is_some() {
                own.image_mut().copy_from_slice(plane);
            }
        }
        self.known.image_mut().fill(1.0);
        self.forget_unknown(None);
    }

    /// Takes the pixels of a neighbouring frame that are nearest to where `track` says. `own` is the frame's own row.
    pub(super) fn gather<S: RowSource>(
        &mut self,
        track: &Track,
        frame: &mut HeldFrame<S>,
        own: &Self,
    ) -> Result<(), Error> {
        let (width, rows) = (frame.width(), frame.within());
        let mut x = 0;
        while x < width {
            let Some([column, y]) = track.pixel(x, width, &rows) else {
                self.known.image_mut()[x] = 0.0;
                x += 1;
                continue;
            };
            // pixels that lie side by side there, too, are copied at once
            let beside = |i: &usize| track.pixel(x + i, width, &rows) == Some([column + i, y]);
            let length = 1 + (1..width - x).take_while(beside).count();
            let row = frame.row(y)?;
            for (own, plane) in self.planes.iter_mut().zip(averaged(row)) {
                if own.is_some() {
                    let source = &plane[column..column + length];
                    own.image_mut()[x..x + length].copy_from_slice(source);
                }
            }
            self.known.image_mut()[x..x + length].fill(1.0);
            x += length;
        }
        self.forget_unknown(Some(own));
        Ok(())
    }

    /// Notes that pixels are not there which hold what cannot be averaged: of a neighbour also those that show the sky where `own` shows a surface, or the other way round. A feature
    /// that a neighbour lacks at a pixel is that of the frame.
    fn forget_unknown(&mut self, own: Option<&Self>) {
        let Self { planes, known } = self;
        let known = known.image_mut();
        let keep = |known: &mut [f32], plane: &[f32], usable: &dyn Fn(f32) -> bool| {
            for (known, value) in known.iter_mut().zip(plane) {
                *known = if usable(*value) { *known } else { 0.0 };
            }
        };
        let light = (COLOUR..VARIANCE).chain(LAYERS..planes.len());
        for place in light.filter(|place| planes[*place].is_some()) {
            keep(known, planes[place].image(), &|value| {
                value.abs() <= LARGEST
            });
        }
        let Some(own) = own else { return };
        for place in (VARIANCE..FEATURE).filter(|place| planes[*place].is_some()) {
            keep(known, planes[place].image(), &|value| {
                value >= 0.0 && value.is_finite()
            });
        }
        for (known, own) in known.iter_mut().zip(own.known.image()) {
            *known *= own;
        }
        for (place, plane) in planes.iter_mut().enumerate().take(LAYERS).skip(FEATURE) {
            if !plane.is_some() {
                continue;
            }
            let is_depth = Self::depth_power(place) == 1;
            let is_further = (FURTHER..FEATURE_VARIANCE).contains(&place);
            let pixels = plane.image_mut().iter_mut().zip(own.planes[place].image());
            for ((value, own), known) in pixels.zip(&mut *known) {
                if is_depth && is_sky(*value) != is_sky(*own) {
                    *known = 0.0;
                }
                // a position in the world is endless beyond the scene, and averages with none
                let endless = is_further && (is_sky(*value) || is_sky(*own));
                *value = if value.is_finite() && !endless {
                    *value
                } else {
                    *own
                };
            }
        }
    }

    /// Gives the columns beyond the image the values of the nearest; none is known there.
    pub(super) fn pad(&mut self) {
        self.planes
            .iter_mut()
            .filter(|plane| plane.is_some())
            .for_each(Plane::pad);
        self.known.pad_with_zeros();
    }

    /// What the core compares.
    pub(super) fn row(&self) -> FrameRow<'_> {
        let plane = |place: usize| self.planes[place].padded();
        let three = |first: usize| [plane(first), plane(first + 1), plane(first + 2)];
        FrameRow {
            colour: three(COLOUR),
            variance: three(VARIANCE),
            normal: three(FEATURE + Feature::Normal.range().start),
            albedo: three(FEATURE + Feature::Albedo.range().start),
            depth: plane(FEATURE + Feature::Depth.range().start),
        }
    }
}

fn is_sky(depth: f32) -> bool {
    depth.is_nan() || depth.abs() >= NO_SURFACE
}
