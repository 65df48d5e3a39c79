//! What the pixels of an image hold, and what a run will skip of them: its stages before the fit, and no fit.

use std::fmt;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred_core::{CELL, FEATURE_NAMES, Formulas, MAX_FEATURES, Params, PixelState};
use linpred_dispatch::InstructionSet;

use crate::error::Error;
use crate::row::{RowLayout, RowSource};
use crate::stream::neighbourhood::{CellAt, Neighbourhood};
use crate::stream::preparation::Preparation;
use crate::stream::report::Counts;
use crate::stream::threads::{pool, stack_bytes};

/// What the pixels of an image hold.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Survey {
    /// What a run will count, but for the papers' formulas, which skip no cell and know no fireflies.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub counts: Counts,
    /// Column and row, from the top left of the data window, of the first pixel with a NaN or infinite colour.
    pub first_repaired: Option<[usize; 2]>,
    /// The same of the first firefly.
    pub first_firefly: Option<[usize; 2]>,
    /// The smallest and the largest radiance, of any channel; fireflies left out.
    pub radiance: Option<[f32; 2]>,
    /// The same of the variances that a run works with: of the mean, the three channels' added up, estimated if the file has none.
    pub variance: Option<[f32; 2]>,
    /// Whether red, green and blue are equal at every pixel.
    pub grey: bool,
    /// Features that are the same at every pixel: they tell a run nothing.
    pub constant_features: Vec<String>,
    /// Pixels where some feature is NaN or infinite, and filled in from its neighbours.
    pub features_missing: u64,
}

/// Bytes that a survey takes at most, beside the source.
pub(crate) fn bytes(layout: &RowLayout, threads: NonZeroUsize) -> u64 {
    let threads = threads.get() as u64;
    Preparation::bytes(layout, threads, 1, false).saturating_add(stack_bytes(threads))
}

/// Surveys the rows of `source`, each of which is read once, on `threads` threads, whose number changes nothing. `progress` is told how many
/// rows are done; when it breaks, the survey ends with [`Error::Cancelled`].
pub fn survey(
    source: &mut dyn RowSource,
    threads: NonZeroUsize,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<Survey, Error> {
    let pool = pool(threads)?;
    let layout = source.layout();
    let height = layout.size.height();
    let params = Params::default().with_vary_features(false);
    let mut input = Preparation::new(layout, &params, (threads, 1), InstructionSet::detect());
    let mut found = Findings::new(layout);
    for row in 0..height.div_ceil(CELL) {
        let cells = row..row + 1;
        input.read(source, &cells)?;
        pool.install(|| input.prepare(&cells, &mut found.counts));
        found.add_cells(&input.around(&cells), row);
        input.advance(&cells);
        if progress(height.min((row + 1) * CELL)).is_break() {
            return Err(Error::Cancelled);
        }
    }
    Ok(found.survey())
}

/// What has been found so far.
struct Findings {
    layout: RowLayout,
    counts: Counts,
    first_repaired: Option<[usize; 2]>,
    first_firefly: Option<[usize; 2]>,
    radiance: Extremes,
    variance: Extremes,
    coloured: bool,
    features: [Extremes; MAX_FEATURES],
    features_missing: u64,
}

impl Findings {
    fn new(layout: RowLayout) -> Self {
        Self {
            layout,
            counts: Counts {
                pixels: layout.size.pixels(),
                ..Counts::default()
            },
            first_repaired: None,
            first_firefly: None,
            radiance: Extremes::EMPTY,
            variance: Extremes::EMPTY,
            coloured: false,
            features: [Extremes::EMPTY; MAX_FEATURES],
            features_missing: 0,
        }
    }

    /// Row `row` of cells and its pixels.
    fn add_cells(&mut self, around: &Neighbourhood, row: usize) {
        for column in 0..self.layout.size.width().div_ceil(CELL) {
            self.counts.cells += 1;
            let skipped = !around.needs_models(CellAt { row, column }, Formulas::Robust);
            self.counts.cells_skipped += u64::from(skipped);
        }
        let first = row * CELL;
        for y in first..self.layout.size.height().min(first + CELL) {
            self.add_colours(around, y);
            self.add_features(around, y);
        }
    }

    fn add_colours(&mut self, around: &Neighbourhood, y: usize) {
        let variances = &around.held.colours(y as isize).variance;
        let row = around.row(y);
        for (x, variance) in variances.iter().enumerate() {
            let pixel = row.pixel::<0>(x);
            let is_firefly = row.colours.firefly[x];
            self.counts.add_pixel(pixel.state, row.colours, x);
            if pixel.state == PixelState::Bad {
                let first = match is_firefly {
                    true => &mut self.first_firefly,
                    false => &mut self.first_repaired,
                };
                first.get_or_insert([x, y]);
                continue;
            }
            let [red, green, blue] = pixel.colour;
            self.coloured |= red != green || green != blue;
            pixel.colour.iter().for_each(|v| self.radiance.add(*v));
            self.variance.add(*variance);
        }
    }

    fn add_features(&mut self, around: &Neighbourhood, y: usize) {
        let planes = &around.held.guides(y as isize).features;
        for (range, plane) in self.features.iter_mut().zip(planes) {
            plane.iter().for_each(|v| range.add(*v));
        }
        let missing = |x: &usize| {
            let mut values = planes.iter().filter_map(|plane| plane.get(*x));
            values.any(|v| v.is_nan())
        };
        let width = self.layout.size.width();
        self.features_missing += (0..width).filter(missing).count() as u64;
    }

    fn survey(self) -> Survey {
        let constant = |k: &usize| self.layout.features[*k] && !self.features[*k].is_wide();
        Survey {
            counts: self.counts,
            first_repaired: self.first_repaired,
            first_firefly: self.first_firefly,
            radiance: self.radiance.ends(),
            variance: self.variance.ends(),
            grey: !self.coloured,
            constant_features: (0..MAX_FEATURES).filter(constant).map(name).collect(),
            features_missing: self.features_missing,
        }
    }
}

/// What channel `k` of the features is called; of the further ones only their number is known here.
fn name(k: usize) -> String {
    match FEATURE_NAMES.get(k) {
        Some(name) => (*name).to_owned(),
        None => further_name(k - FEATURE_NAMES.len()),
    }
}

/// What channel `n` of the further features is called where nobody knows its name.
pub(crate) fn further_name(n: usize) -> String {
    format!("further {}", n + 1)
}

/// From the smallest to the largest of some numbers.
#[derive(Clone, Copy)]
struct Extremes {
    smallest: f32,
    largest: f32,
}

impl Extremes {
    const EMPTY: Self = Self {
        smallest: f32::INFINITY,
        largest: f32::NEG_INFINITY,
    };

    /// A NaN is passed over.
    fn add(&mut self, value: f32) {
        self.smallest = self.smallest.min(value);
        self.largest = self.largest.max(value);
    }

    fn is_wide(self) -> bool {
        self.smallest < self.largest
    }

    fn ends(self) -> Option<[f32; 2]> {
        (self.smallest <= self.largest).then_some([self.smallest, self.largest])
    }
}

impl fmt::Display for Survey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts = &self.counts;
        let percent = |part: u64, whole: u64| 100.0 * part as f64 / whole.max(1) as f64;
        let passed = percent(counts.passed_through, counts.pixels);
        writeln!(
            f,
            "  pixels            {}, {passed:.1} % without noise pass through",
            counts.pixels
        )?;
        if let Some([x, y]) = self.first_repaired {
            let repaired = counts.repaired;
            writeln!(
                f,
                "  not finite        {repaired} pixels, the first at x {x}, y {y}: predicted from their neighbours"
            )?;
        }
        if let Some([x, y]) = self.first_firefly {
            let fireflies = counts.fireflies;
            writeln!(
                f,
                "  fireflies         {fireflies} pixels, the first at x {x}, y {y}: predicted from their neighbours"
            )?;
        }
        if counts.estimated > 0 {
            let estimated = counts.estimated;
            writeln!(
                f,
                "  no variance       {estimated} pixels have none that is known: estimated from the picture"
            )?;
        }
        let cells = percent(counts.cells_skipped, counts.cells);
        let blocks = percent(counts.feature_blocks_skipped, counts.feature_blocks);
        writeln!(
            f,
            "  skipped           {cells:.1} % of {} cells (nothing fitted), {blocks:.1} % of {} feature blocks (not filtered)",
            counts.cells, counts.feature_blocks
        )?;
        for (what, range) in [("radiance", self.radiance), ("variance", self.variance)] {
            if let Some([smallest, largest]) = range {
                writeln!(f, "  {what:<17} {smallest} to {largest}")?;
            }
        }
        if self.grey {
            writeln!(
                f,
                "  grey              red, green and blue are equal everywhere"
            )?;
        }
        if !self.constant_features.is_empty() {
            let names = self.constant_features.join(", ");
            writeln!(f, "  never vary        {names} (they tell nothing)")?;
        }
        if self.features_missing > 0 {
            let pixels = self.features_missing;
            writeln!(
                f,
                "  features missing  at {pixels} pixels: filled in from their neighbours"
            )?;
        }
        Ok(())
    }
}
