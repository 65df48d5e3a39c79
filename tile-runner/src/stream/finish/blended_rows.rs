//! Rows as the blend has left them, and what is known of their pixels, in four parts that are of use for different times.

use linpred_core::{FEATURES, Feature, PixelState, level_of};
use rayon::prelude::*;

use crate::row::{OutputRow, RowLayout};
use crate::stream::borders::clamped;
use crate::stream::finish::planes::{Plane, Radiance};
use crate::stream::neighbourhood::PixelRow;
use crate::stream::row_ring::RowRing;

/// The rows.
pub(crate) struct BlendedRows {
    pub(crate) layout: RowLayout,
    pub(crate) radiance: RowRing<Radiance>,
    pub(crate) guides: RowRing<Guides>,
    pub(crate) own: RowRing<Own>,
    pub(crate) rest: RowRing<Rest>,
}

impl BlendedRows {
    pub(crate) fn new(layout: RowLayout) -> Self {
        Self {
            layout,
            radiance: RowRing::new(),
            guides: RowRing::new(),
            own: RowRing::new(),
            rest: RowRing::new(),
        }
    }

    /// The row after the last that has come.
    pub(crate) fn next(&self) -> usize {
        self.radiance.next()
    }

    /// Takes the next rows, and how their pixels came.
    pub(crate) fn push(&mut self, rows: &[(&OutputRow, PixelRow<'_>)]) {
        let (layout, first) = (&self.layout, self.next());
        let end = first + rows.len();
        let row = |y: usize| &rows[y - first];
        extend(
            &mut self.radiance,
            end,
            || Radiance::new(layout),
            |y, own| own.fill(row(y).0),
        );
        extend(
            &mut self.guides,
            end,
            || Guides::new(layout),
            |y, own| own.fill(&row(y).1),
        );
        extend(
            &mut self.own,
            end,
            || Own::new(layout),
            |y, own| own.fill(&row(y).1),
        );
        extend(
            &mut self.rest,
            end,
            || Rest::new(layout),
            |y, own| own.fill(row(y).0, &row(y).1),
        );
    }
}

/// Adds rows up to `end`, which threads fill side by side.
pub(crate) fn extend<T: Send>(
    ring: &mut RowRing<T>,
    end: usize,
    new: impl Fn() -> T,
    fill: impl Fn(usize, &mut T) + Sync,
) {
    let first = ring.next();
    for _ in first..end {
        ring.push(&new);
    }
    let rows: Vec<_> = ring.rows_from_mut(first).collect();
    rows.into_par_iter().for_each(|(y, row)| fill(y, row));
}

/// Of rows of an image `height` rows high, the nearest to row `y`.
pub(crate) fn nearest<T>(rows: &RowRing<T>, y: isize, height: usize) -> &T {
    rows.row(clamped(y, height))
}

impl Radiance {
    fn fill(&mut self, blended: &OutputRow) {
        let layers = blended.layers.iter().flatten();
        let planes = blended
            .colour
            .iter()
            .chain(layers)
            .chain(blended.all_scalars());
        for (own, plane) in self.all_mut().zip(planes) {
            own.copy(plane);
        }
    }
}

/// What guides the smoothing.
pub(crate) struct Guides {
    /// Level of radiance around.
    pub(crate) level: Plane,
    /// Filtered features; none that the image lacks.
    pub(crate) features: [Plane; FEATURES],
    /// Variance left in each, summed over its channels.
    pub(crate) feature_variance: [Plane; Feature::ALL.len()],
}

impl Guides {
    pub(crate) fn planes(layout: &RowLayout) -> usize {
        let planes = Feature::ALL
            .into_iter()
            .filter(|feature| layout.has(*feature));
        1 + planes
            .map(|feature| 1 + feature.range().len())
            .sum::<usize>()
    }

    fn new(layout: &RowLayout) -> Self {
        let width = layout.size.width();
        let plane = |present: bool| {
            if present {
                Plane::new(width)
            } else {
                Plane::none()
            }
        };
        Self {
            level: Plane::new(width),
            features: std::array::from_fn(|k| plane(layout.features[k])),
            feature_variance: Feature::ALL.map(|feature| plane(layout.has(feature))),
        }
    }

    fn fill(&mut self, row: &PixelRow<'_>) {
        self.level.fill(|x| level_of(row.prepared.weight[x]));
        // a further feature may be anything: it guides no smoothing
        for (own, plane) in self.features.iter_mut().zip(&row.prepared.features) {
            if !plane.is_empty() {
                own.copy(plane);
            }
        }
        for (own, feature) in self.feature_variance.iter_mut().zip(Feature::ALL) {
            let planes = &row.prepared.feature_variances[feature.range()];
            match planes {
                [first, ..] if first.is_empty() => {}
                planes => own.fill(|x| planes.iter().map(|plane| plane[x]).sum()),
            }
        }
    }
}

/// What speaks for a pixel's own radiance.
pub(crate) struct Own {
    /// 1, or 0 where the input is not finite.
    pub(crate) good: Plane,
    /// Mean of the channels as they came.
    pub(crate) radiance: Plane,
    /// Its variance, summed over the channels.
    pub(crate) variance: Plane,
    /// That of the pixels around, if it is larger.
    pub(crate) largest_variance: Plane,
    /// Of a pixel that is made of several frames, its own frame's radiance and the variance of that, likewise; no planes for an image that is denoised alone.
    light: [Plane; 2],
}

impl Own {
    pub(crate) fn planes(layout: &RowLayout) -> usize {
        4 + 2 * usize::from(layout.frames)
    }

    /// The radiance, and its variance, whose light the frame has.
    pub(crate) fn light(&self) -> [&Plane; 2] {
        match &self.light {
            [radiance, variance] if radiance.is_some() => [radiance, variance],
            _ => [&self.radiance, &self.variance],
        }
    }

    fn new(layout: &RowLayout) -> Self {
        let plane = || Plane::new(layout.size.width());
        Self {
            light: std::array::from_fn(|_| {
                if layout.frames {
                    plane()
                } else {
                    Plane::none()
                }
            }),
            good: plane(),
            radiance: plane(),
            variance: plane(),
            largest_variance: plane(),
        }
    }

    fn fill(&mut self, row: &PixelRow<'_>) {
        let (colours, prepared) = (row.colours, row.prepared);
        let [red, green, blue] = &colours.colour;
        self.good.copy(&colours.good);
        self.radiance
            .fill(|x| (red[x] + green[x] + blue[x]) * (1.0 / 3.0));
        self.variance.copy(&colours.variance);
        self.largest_variance
            .fill(|x| prepared.variance[x].max(colours.variance[x]));
        let [light, light_variance] = &mut self.light;
        if light.is_some() {
            let [own, variance] = &colours.light;
            let usable = |x: usize| colours.good[x] > 0.0 && own[x].is_finite();
            light.fill(|x| if usable(x) { own[x] } else { 0.0 });
            // what is not known is taken for that of the pixel, of which the frame is a part
            let part = |x: usize| colours.frames[x] * colours.variance[x];
            light_variance.fill(|x| {
                if variance[x] >= 0.0 {
                    variance[x]
                } else {
                    part(x)
                }
            });
        }
    }
}

/// What else there is of a row.
pub(crate) struct Rest {
    /// 1, or 0 where a pixel passes through.
    pub(crate) noisy: Plane,
    pub(crate) error: Plane,
    pub(crate) radius: Plane,
    pub(crate) rank: Plane,
    /// Frames that pixels are made of; none for an image that is denoised alone.
    pub(crate) frames: Plane,
}

impl Rest {
    pub(crate) fn planes(layout: &RowLayout) -> usize {
        4 + usize::from(layout.frames)
    }

    fn new(layout: &RowLayout) -> Self {
        let plane = || Plane::new(layout.size.width());
        Self {
            frames: if layout.frames {
                plane()
            } else {
                Plane::none()
            },
            noisy: plane(),
            error: plane(),
            radius: plane(),
            rank: plane(),
        }
    }

    fn fill(&mut self, blended: &OutputRow, row: &PixelRow<'_>) {
        self.noisy
            .fill(|x| f32::from(row.pixel::<0>(x).state != PixelState::Clean));
        self.error.copy(&blended.error);
        self.radius.copy(&blended.radius);
        self.rank.copy(&blended.rank);
        if self.frames.is_some() {
            self.frames.copy(&blended.frames);
        }
    }
}
