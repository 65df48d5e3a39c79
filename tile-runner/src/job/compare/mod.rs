//! How far an image is from a reference, row by row.
//!
//! The reference is read twice or more: what is bright, and what is dark, depends on all of it. Then all images are read once, through a window of 17
//! rows. Nothing grows with the height of the image.

mod figures;
mod images;
mod light;
mod pixels;
mod places;
mod quantile;
mod reference;
mod specks;
mod window;

pub use figures::{Comparison, Figures};
pub use images::{ColourRow, CompareRequest};
pub use pixels::{WorstPixel, tone_mapped};
pub use places::{PLACE, WorstPlace, worst_places};

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use crate::error::Error;
use crate::geometry::ImageSize;
use crate::job::memory::{MemoryPlan, check_available};
use crate::job::plan::compare_plan;
use figures::Measures;
use images::Images;
use places::Places;

/// Images that are about to be compared.
#[derive(Debug)]
pub struct Comparing {
    images: Images,
    memory_limit: u64,
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
        })
    }

    /// The size of each of the images.
    pub fn size(&self) -> ImageSize {
        self.images.size()
    }

    /// What [`measure`](Self::measure) holds in memory.
    pub fn plan(&self) -> MemoryPlan {
        let size = self.size();
        let pairs = self.images.pairs();
        let measures = Measures::bytes(size).saturating_mul(pairs);
        let computing = [self.images.bytes(), Places::bytes(size), quantile::BYTES];
        let computing = computing.into_iter().fold(measures, u64::saturating_add);
        compare_plan(&self.images.inputs(), computing)
    }

    /// Compares the images. Gives each row of their colours to `each`, from top to bottom, with the relative squared error of the image's pixels
    /// (mean over the channels, the reference's own variance taken off; NaN where no channel is finite).
    ///
    /// [`Error::OverLimit`] or [`Error::Budget`] if the [`plan`](Self::plan) is more than may or can be had, [`Error::Cancelled`] once `stop` is set.
    pub fn measure(
        &mut self,
        stop: &AtomicBool,
        mut each: impl FnMut(&ColourRow<'_>, &[f32]) -> Result<(), Error>,
    ) -> Result<Comparison, Error> {
        let plan = self.plan();
        plan.check(self.memory_limit)?;
        check_available(&plan, 0)?;
        let size = self.size();
        let scale = reference::measure(&mut self.images, stop)?;
        let mut image = Measures::new(size, scale);
        let mut input = self.images.has_input().then(|| Measures::new(size, scale));
        let mut places = Places::new(size);
        self.images.read(0..size.height(), stop, |rows| {
            let errors = image.add_row(rows.y, &rows.image.colour, rows.reference);
            places.add_row(rows.y, errors);
            each(&rows.colours(), errors)?;
            if let (Some(measures), Some(row)) = (&mut input, rows.input) {
                measures.add_row(rows.y, &row.colour, rows.reference);
            }
            Ok(())
        })?;
        let own_variance = self.images.reference_has_variance();
        let input = input.map(Measures::finish);
        Ok(Comparison::new(
            image.finish(),
            input,
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
