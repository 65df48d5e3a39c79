//! How far an image is from a reference, row by row.
//!
//! The reference is read twice or more: what is bright, and what is dark, depends on all of it. Then all images are read once, through a window of 17
//! rows, 52 for FLIP. Nothing grows with the height of the image.

mod figures;
mod flip;
mod images;
mod light;
mod pixels;
mod places;
mod reference;
mod specks;
mod window;

pub use figures::{Comparison, Figures};
pub use images::{ColourRow, CompareRequest};
pub use pixels::{WorstPixel, tone_mapped};
pub use places::{PLACE, WorstPlace, worst_places};

use std::num::NonZeroUsize;
use std::ops::Range;
use std::sync::atomic::AtomicBool;

use crate::error::Error;
use crate::geometry::ImageSize;
use crate::job::memory::{MemoryPlan, check_available};
use crate::job::plan::compare_plan;
use crate::stream::threads;
use figures::Measures;
use flip::Flip;
use images::Images;
use places::Places;

/// Images that are about to be compared.
#[derive(Debug)]
pub struct Comparing {
    images: Images,
    memory_limit: u64,
    threads: NonZeroUsize,
    /// What the caller holds meanwhile.
    reserved: Vec<(String, u64)>,
}

impl Comparing {
    /// Opens the files of `request`.
    ///
    /// [`Error::Invalid`] if their sizes differ or one has no colour, [`Error::Unsupported`] if one cannot be decoded, [`Error::Budget`] if a row of its
    /// chunks takes more than the limit.
    pub fn open(request: &CompareRequest) -> Result<Self, Error> {
        Ok(Self {
            images: Images::open(request)?,
            memory_limit: request.memory_limit,
            threads: request.threads,
            reserved: Vec::new(),
        })
    }

    /// Counts so many bytes, which the caller will hold meanwhile, among those of the [`plan`](Self::plan).
    pub fn reserve(&mut self, what: impl Into<String>, bytes: u64) {
        self.reserved.push((what.into(), bytes));
    }

    /// The size of each of the images.
    pub fn size(&self) -> ImageSize {
        self.images.size()
    }

    /// What [`measure`](Self::measure) holds in memory.
    pub fn plan(&self) -> MemoryPlan {
        self.schedule().1
    }

    /// As many threads as keep within the limit, one if none does, and the plan with them.
    fn schedule(&self) -> (NonZeroUsize, MemoryPlan) {
        let fewer = |threads: &NonZeroUsize| NonZeroUsize::new(threads.get() / 2);
        let mut schedules = std::iter::successors(Some(self.threads), fewer)
            .map(|threads| (threads, self.plan_with(threads)));
        schedules
            .find(|(_, plan)| plan.total() <= self.memory_limit)
            .unwrap_or_else(|| (NonZeroUsize::MIN, self.plan_with(NonZeroUsize::MIN)))
    }

    fn plan_with(&self, threads: NonZeroUsize) -> MemoryPlan {
        let size = self.size();
        let (pairs, threads) = (self.images.pairs(), threads.get() as u64);
        let measures = Measures::bytes(size).saturating_mul(pairs);
        let computing = [
            self.images.bytes(),
            Places::bytes(size),
            reference::BYTES,
            Flip::bytes(size, pairs, threads),
            threads::stack_bytes(threads),
        ];
        let computing = computing.into_iter().fold(measures, u64::saturating_add);
        let mut plan = compare_plan(&self.images.inputs(), computing);
        for (what, bytes) in &self.reserved {
            plan.add(what, *bytes);
        }
        plan
    }

    /// Compares the images. Gives each row of their colours to `each`, from top to bottom, with the relative squared error of the image's pixels
    /// (mean over the channels, the reference's own variance taken off; NaN where no channel is finite).
    ///
    /// Takes 0.35 CPU seconds per megapixel, and 0.11 more for each exposure of FLIP, of which there is one for each stop from the reference's median
    /// luminance to its largest; with an input half as much again (an Intel Xeon, images in ZIP).
    ///
    /// [`Error::OverLimit`] or [`Error::Budget`] if the [`plan`](Self::plan) is more than may or can be had, [`Error::Cancelled`] once `stop` is set.
    pub fn measure(
        &mut self,
        stop: &AtomicBool,
        mut each: impl FnMut(&ColourRow<'_>, &[f32]) -> Result<(), Error>,
    ) -> Result<Comparison, Error> {
        let (threads, plan) = self.schedule();
        plan.check(self.memory_limit)?;
        check_available(&plan, threads.get())?;
        let threads = threads::pool(threads)?;
        let size = self.size();
        let scale = reference::measure(&mut self.images, stop)?;
        let mut flip = Flip::new(size, scale.exposures, self.images.pairs() as usize, threads);
        let mut image = Measures::new(size, scale);
        let mut input = self.images.has_input().then(|| Measures::new(size, scale));
        let mut places = Places::new(size);
        self.images.read(0..size.height(), stop, |rows| {
            let errors = image.add_row(rows.y, &rows.image.colour, rows.reference);
            places.add_row(rows.y, errors);
            each(&rows.colours(), errors)?;
            flip.add_row(&rows.colours());
            if let (Some(measures), Some(row)) = (&mut input, rows.input) {
                measures.add_row(rows.y, &row.colour, rows.reference);
            }
            Ok(())
        })?;
        let own_variance = self.images.reference_has_variance();
        let flip = flip.finish();
        Ok(Comparison::new(
            image.finish(flip[0]),
            input.map(|measures| measures.finish(flip[1])),
            places.finish(),
            own_variance,
        ))
    }

    /// Gives the colours of these rows to `each`, from top to bottom: a closer look at what [`measure`](Self::measure) found.
    ///
    /// [`Error::Cancelled`] once `stop` is set.
    pub fn look(
        &mut self,
        rows: Range<usize>,
        stop: &AtomicBool,
        mut each: impl FnMut(&ColourRow<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.images.read(rows, stop, |rows| each(&rows.colours()))
    }
}
