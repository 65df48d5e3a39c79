//! Estimates of how far a model may predict, over the same windows: the papers' iterative validation, cross validation, and what they warn of.
//!
//! Recursive least squares as LPR section 4.1 has it; LPR section 7 compares the estimates in time and in the error of the picture.

use std::hint::black_box;
use std::time::Instant;

use linpred_core::{CHANNELS, Prior, RADIUS, Rls};
use linpred_tests::definition::Window;
use linpred_tests::windows::pixels_within;

use crate::picture::Cell;

/// delta of LPR section 7.
const DELTA: f32 = 1e-3;

/// How a half-width is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Estimate {
    /// Each ring by the model before it (LPR Eq. 5), after leave-one-out at r = 1 (Eq. 7).
    Iterative,
    /// The same with the variance of each tested pixel taken off, as the error at r = 0 is without noise, too.
    WithoutNoise,
    /// Leave-one-out over the whole window at each half-width, in closed form (Allen 1974).
    CrossValidation,
    /// The residuals of the fit itself, which LPR section 7 warns of.
    Residuals,
    /// None: this half-width everywhere (LPR Fig. 2).
    Fixed(usize),
}

impl Estimate {
    /// All that are compared, and what they are called.
    pub(crate) const ALL: [(&'static str, Self); 6] = [
        ("iterative validation", Self::Iterative),
        ("iterative validation without the noise", Self::WithoutNoise),
        ("cross validation", Self::CrossValidation),
        ("residuals of the fit", Self::Residuals),
        ("r = 1 everywhere", Self::Fixed(1)),
        ("r = 9 everywhere", Self::Fixed(9)),
    ];
}

/// Regressors and radiance of a pixel.
#[derive(Clone, Copy, Debug)]
struct Row<const T: usize> {
    z: [f32; T],
    y: [f32; CHANNELS],
    /// Summed over the channels.
    variance: f32,
    valid: bool,
}

/// The window of one centre with `T` terms.
#[derive(Clone, Debug)]
pub(crate) struct Terms<const T: usize> {
    rows: Vec<Row<T>>,
}

/// A chosen model: its estimated error (mean over the prediction window, summed over the channels) and its predictions.
#[derive(Clone, Debug)]
pub(crate) struct Chosen {
    pub(crate) error: f64,
    pub(crate) radiance: Vec<[f32; CHANNELS]>,
}

/// The window of one centre, whatever its rank.
pub(crate) trait Fitted {
    /// The model with the least estimated error.
    fn choose(&self, estimate: Estimate) -> Chosen;

    /// Fits all half-widths, with or without estimates of their errors, of which nothing is kept.
    fn work(&self, estimate: Option<Estimate>);

    /// Local features that are kept.
    fn rank(&self) -> usize;
}

/// A window of the cell's tile.
pub(crate) fn fitted(cell: &Cell, window: &Window) -> Box<dyn Fitted> {
    macro_rules! of_rank {
        ($($terms:literal)*) => {
            match window.rank + 1 {
                $($terms => Box::new(Terms::<$terms>::new(cell, window)),)*
                terms => unreachable!("{terms} terms of nine features"),
            }
        };
    }
    of_rank!(1 2 3 4 5 6 7 8 9 10)
}

impl<const T: usize> Terms<T> {
    fn new(cell: &Cell, window: &Window) -> Self {
        let rows = window.regressors().map(|(position, z)| {
            let pixel = &cell.tile.pixels[position];
            Row {
                z: std::array::from_fn(|t| z[t] as f32),
                y: pixel.colour,
                variance: pixel.variance,
                valid: cell.holds(position),
            }
        });
        Self {
            rows: rows.collect(),
        }
    }

    fn rows(&self, from: usize, to: usize) -> impl Iterator<Item = &Row<T>> {
        self.rows[from..to].iter().filter(|row| row.valid)
    }

    /// Calls `keep` with each half-width from 1 on, its model and its estimated error.
    fn grow(&self, estimate: Option<Estimate>, mut keep: impl FnMut(usize, f64, &Rls<T>)) {
        let mut rls = Rls::new(&Prior::at_centre(&self.rows[0].y, DELTA, DELTA));
        self.take_in(&mut rls, 0, 1);
        let mut accumulated = 0.0;
        for radius in 1..=RADIUS {
            let (inner, outer) = (pixels_within(radius - 1), pixels_within(radius));
            let iterative = matches!(estimate, Some(Estimate::Iterative | Estimate::WithoutNoise));
            if iterative && radius > 1 {
                accumulated += self.squares(&rls, inner, outer);
            }
            self.take_in(&mut rls, inner, outer);
            let error = match estimate {
                Some(Estimate::Iterative | Estimate::WithoutNoise) => {
                    if radius == 1 {
                        accumulated = self.left_out(&rls, outer);
                    }
                    if estimate == Some(Estimate::WithoutNoise) {
                        accumulated - self.noise(outer)
                    } else {
                        accumulated
                    }
                }
                Some(Estimate::CrossValidation) => self.left_out(&rls, outer),
                Some(Estimate::Residuals) => self.squares(&rls, 0, outer),
                Some(Estimate::Fixed(wanted)) if wanted == radius => f64::NEG_INFINITY,
                Some(Estimate::Fixed(_)) | None => f64::INFINITY,
            };
            keep(radius, error / outer as f64, &rls);
        }
    }

    fn take_in(&self, rls: &mut Rls<T>, from: usize, to: usize) {
        for row in self.rows(from, to) {
            // an update that is refused leaves the model as it was
            let _ = rls.update(&row.z, &row.y, 1.0);
        }
    }

    /// Squared residuals, summed over the channels.
    fn squares(&self, rls: &Rls<T>, from: usize, to: usize) -> f64 {
        let rows = self.rows(from, to);
        rows.map(|row| f64::from(squared_distance(&rls.predict(&row.z), &row.y)))
            .sum()
    }

    /// Variances, summed over the channels.
    fn noise(&self, to: usize) -> f64 {
        self.rows(0, to).map(|row| f64::from(row.variance)).sum()
    }

    /// Squared errors of the models without the pixel each (LPR Eq. 7).
    fn left_out(&self, rls: &Rls<T>, to: usize) -> f64 {
        self.rows(0, to)
            .map(|row| {
                let remaining = (1.0 - rls.leverage(&row.z)).max(f32::EPSILON);
                let squared = squared_distance(&rls.predict(&row.z), &row.y);
                f64::from(squared / (remaining * remaining))
            })
            .sum()
    }
}

impl<const T: usize> Fitted for Terms<T> {
    fn choose(&self, estimate: Estimate) -> Chosen {
        let mut chosen = Chosen {
            error: f64::from(self.rows[0].variance),
            radiance: vec![self.rows[0].y],
        };
        self.grow(Some(estimate), |radius, error, rls| {
            if error < chosen.error {
                let rows = &self.rows[..pixels_within(radius)];
                chosen = Chosen {
                    error,
                    radiance: rows.iter().map(|row| rls.predict(&row.z)).collect(),
                };
            }
        });
        chosen
    }

    fn work(&self, estimate: Option<Estimate>) {
        self.grow(estimate, |_, error, rls| {
            black_box((error, rls));
        });
    }

    fn rank(&self) -> usize {
        T - 1
    }
}

fn squared_distance(a: &[f32; CHANNELS], b: &[f32; CHANNELS]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Seconds that windows take with nothing estimated, and with either validation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seconds {
    pub(crate) fits: f64,
    pub(crate) iterative: f64,
    pub(crate) cross: f64,
}

/// Times the same windows in all three ways, one after the other.
pub(crate) fn time(windows: &[Box<dyn Fitted>]) -> Seconds {
    let seconds = |estimate| {
        let started = Instant::now();
        windows.iter().for_each(|window| window.work(estimate));
        started.elapsed().as_secs_f64()
    };
    Seconds {
        fits: seconds(None),
        iterative: seconds(Some(Estimate::Iterative)),
        cross: seconds(Some(Estimate::CrossValidation)),
    }
}
