//! A pass of the smoothing.

use linpred_core::{
    ComparedRow, ERROR_RADIUS, Feature, FinishedPlane, MEAN_RADIUS, Precisions, SMOOTH_SPAN,
    Smoothing, Surroundings,
};
use linpred_dispatch::InstructionSet;

use crate::row::RowLayout;
use crate::stream::finish::blended_rows::{BlendedRows, extend, nearest};
use crate::stream::finish::planes::{Plane, Radiance};
use crate::stream::finish::ready;
use crate::stream::row_ring::RowRing;

/// A pass and the rows that it holds.
pub(crate) struct Pass {
    smoothing: Smoothing,
    instruction_set: InstructionSet,
    precisions: RowRing<Precision>,
    pub(crate) smoothed: RowRing<Radiance>,
    /// A plane of zeros, for features that the image lacks and rows beyond it.
    zeros: Plane,
}

/// What pixels of a row may differ by.
struct Precision {
    takes_part: Plane,
    colour: Plane,
    features: [Plane; Feature::ALL.len()],
}

impl Precision {
    fn new(layout: &RowLayout) -> Self {
        let plane = || Plane::new(layout.size.width());
        Self {
            takes_part: plane(),
            colour: plane(),
            features: std::array::from_fn(|_| plane()),
        }
    }
}

impl Pass {
    /// Planes of a row of precisions.
    pub(crate) const PRECISION_PLANES: usize = 2 + Feature::ALL.len();

    pub(crate) fn new(
        smoothing: Smoothing,
        layout: &RowLayout,
        instruction_set: InstructionSet,
    ) -> Self {
        Self {
            smoothing,
            instruction_set,
            precisions: RowRing::new(),
            smoothed: RowRing::new(),
            zeros: Plane::new(layout.size.width()),
        }
    }

    /// The first row whose error the next rows need.
    pub(crate) fn first_error(&self) -> usize {
        self.precisions.next().saturating_sub(ERROR_RADIUS)
    }

    /// The first row whose radiance and features the next rows need.
    pub(crate) fn first_read(&self) -> usize {
        let precisions = self.precisions.next().saturating_sub(MEAN_RADIUS);
        precisions.min(self.smoothed.next().saturating_sub(self.smoothing.reach()))
    }

    /// Works out the rows, at most `batch`, for which there is enough of `radiance`.
    pub(crate) fn advance(
        &mut self,
        blended: &BlendedRows,
        radiance: &RowRing<Radiance>,
        batch: usize,
    ) {
        let (layout, height) = (&blended.layout, blended.layout.size.height());
        let Self {
            smoothing,
            instruction_set,
            precisions,
            smoothed,
            zeros,
        } = self;
        let row = |y| around(blended, radiance, zeros, y);
        let end = ready(radiance.next(), MEAN_RADIUS, height);
        let end = end.min(ready(blended.next(), ERROR_RADIUS, height));
        let end = end.min(precisions.next() + batch);
        extend(
            precisions,
            end,
            || Precision::new(layout),
            |y, own| {
                let mut output = Precisions {
                    takes_part: own.takes_part.padded_mut(),
                    colour: own.colour.padded_mut(),
                    features: own.features.each_mut().map(Plane::padded_mut),
                };
                instruction_set.weigh_pixels(smoothing, &row(y), &mut output);
                own.takes_part.pad_with_zeros();
            },
        );
        let reach = smoothing.reach();
        let end = ready(precisions.next(), reach, height).min(smoothed.next() + batch);
        let precisions = &*precisions;
        extend(
            smoothed,
            end,
            || Radiance::new(layout),
            |y, own| {
                let neighbours = Neighbours {
                    blended,
                    radiance,
                    precisions,
                    zeros,
                    smoothing,
                    y,
                };
                let rows = std::array::from_fn(|k| neighbours.compared(k));
                let mut planes = neighbours.planes(own);
                instruction_set.smooth(smoothing, &rows, &mut planes);
                own.all_mut().for_each(Plane::pad);
            },
        );
        let kept = smoothed.next().saturating_sub(reach);
        self.precisions.drop_before(kept);
    }
}

/// A row of the image with what is around it.
fn around<'a>(
    blended: &'a BlendedRows,
    radiance: &'a RowRing<Radiance>,
    zeros: &'a Plane,
    y: usize,
) -> Surroundings<'a> {
    let height = blended.layout.size.height();
    let near = |k: usize, radius: usize| (y + k) as isize - radius as isize;
    let guides = blended.guides.row(y);
    Surroundings {
        colour: std::array::from_fn(|k| nearest(radiance, near(k, MEAN_RADIUS), height).colour()),
        error: std::array::from_fn(|k| {
            nearest(&blended.rest, near(k, ERROR_RADIUS), height)
                .error
                .padded()
        }),
        level: guides.level.padded(),
        noisy: blended.rest.row(y).noisy.padded(),
        features: std::array::from_fn(|k| {
            let row = nearest(&blended.guides, near(k, MEAN_RADIUS), height);
            row.features.each_ref().map(|plane| plane.padded_or(zeros))
        }),
        feature_variance: guides
            .feature_variance
            .each_ref()
            .map(|plane| plane.padded_or(zeros)),
    }
}

/// The rows of a row's neighbours.
struct Neighbours<'a> {
    blended: &'a BlendedRows,
    radiance: &'a RowRing<Radiance>,
    precisions: &'a RowRing<Precision>,
    zeros: &'a Plane,
    smoothing: &'a Smoothing,
    y: usize,
}

impl<'a> Neighbours<'a> {
    /// The number of the `k`-th row, if it is in the image.
    fn row(&self, k: usize) -> Option<usize> {
        let Smoothing { step, .. } = *self.smoothing;
        let y = (self.y + k * step).checked_sub(self.smoothing.reach());
        y.filter(|y| *y < self.blended.layout.size.height())
    }

    fn compared(&self, k: usize) -> ComparedRow<'a> {
        let Some(y) = self.row(k) else {
            return ComparedRow::outside(self.zeros.padded());
        };
        let (precision, guides) = (self.precisions.row(y), self.blended.guides.row(y));
        ComparedRow {
            takes_part: precision.takes_part.padded(),
            colour: self.radiance.row(y).colour(),
            colour_precision: precision.colour.padded(),
            features: guides
                .features
                .each_ref()
                .map(|plane| plane.padded_or(self.zeros)),
            feature_precision: precision.features.each_ref().map(Plane::padded),
        }
    }

    /// Every plane of the rows, to be smoothed into `own`.
    fn planes<'b>(&self, own: &'b mut Radiance) -> Vec<FinishedPlane<'b, SMOOTH_SPAN>>
    where
        'a: 'b,
    {
        let zeros = self.zeros.padded();
        let outputs = own.all_mut().map(|output| FinishedPlane {
            rows: [zeros; SMOOTH_SPAN],
            output: output.padded_mut(),
        });
        let mut planes: Vec<_> = outputs.collect();
        for k in 0..SMOOTH_SPAN {
            let Some(y) = self.row(k) else { continue };
            for (plane, row) in planes.iter_mut().zip(self.radiance.row(y).all()) {
                plane.rows[k] = row.padded();
            }
        }
        planes
    }
}
