//! Maps of samples: how many more a renderer should take of each pixel.

use std::ffi::c_void;

use linpred::image::Frame;
use linpred::job::check_memory_of_map;
use linpred::sampling::{Goal, Scratch, Summary, measure, rows_to_measure};
use linpred::{ImageSize, RowSource};

use crate::format::linpred_format;
use crate::frame::{Images, image};
use crate::handle::{Denoiser, call, linpred_denoiser};
use crate::names::Input;
use crate::raw_image::{Place, RawImage};
use crate::status::{Failure, linpred_status};
use crate::versioned::{self, Versioned};

/// What a map of samples is to reach: one of the two, or as little as one of them asks for. LINPRED_SAMPLE_GOAL_INIT
/// sets the size.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct linpred_sample_goal {
    /// sizeof(linpred_sample_goal).
    pub struct_size: usize,
    /// So many samples more for each pixel, on average: above 0, up to 2^24. The map sums up to it, rounded. 0 sets no
    /// bound.
    pub budget: f64,
    /// As few samples as it takes until `error_then` of the summary is so small, such as 0.005. 0 sets no target.
    pub target_error: f64,
}

// SAFETY: numbers alone, the size first
unsafe impl Versioned for linpred_sample_goal {
    const NAME: &'static str = "linpred_sample_goal";
}

impl linpred_sample_goal {
    pub(crate) fn goal(&self) -> Result<Goal, Failure> {
        let given = |value: f64| (value != 0.0).then_some(value);
        Ok(Goal::of(given(self.budget), given(self.target_error))?)
    }
}

/// What a map of samples gives, and what for. LINPRED_SAMPLE_SUMMARY_INIT sets the size.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct linpred_sample_summary {
    /// sizeof(linpred_sample_summary).
    pub struct_size: usize,
    /// Pixels of the image.
    pub pixels: u64,
    /// Samples that they have together.
    pub samples: u64,
    /// Samples that the map gives them together; 0 if the error is as small as it should be already.
    pub added: u64,
    /// The most that one of them gets.
    pub most: u32,
    /// 0.
    pub reserved: u32,
    /// The predicted error of the denoised image: mean over the pixels of the estimated squared error over the mean
    /// square of the colour and 0.003.
    pub error: f64,
    /// The same once the map is rendered.
    pub error_then: f64,
}

// SAFETY: numbers alone, the size first
unsafe impl Versioned for linpred_sample_summary {
    const NAME: &'static str = "linpred_sample_summary";
}

impl From<Summary> for linpred_sample_summary {
    fn from(summary: Summary) -> Self {
        Self {
            struct_size: size_of::<Self>(),
            pixels: summary.pixels,
            samples: summary.samples,
            added: summary.added,
            most: summary.most,
            reserved: 0,
            error: summary.error,
            error_then: summary.error_then,
        }
    }
}

/// Where a summary goes, if anywhere.
pub(crate) struct Told(*mut linpred_sample_summary);

impl Told {
    /// Checks that it can be told, before a run whose end nobody would hear of.
    ///
    /// # Safety
    /// `summary` is NULL or can be read and written over its size, until this is dropped.
    pub(crate) unsafe fn new(summary: *mut linpred_sample_summary) -> Result<Self, Failure> {
        if !summary.is_null() {
            // SAFETY: the caller's promise
            unsafe { versioned::read(summary) }?;
        }
        Ok(Self(summary))
    }

    pub(crate) fn tell(&self, summary: Summary) -> Result<(), Failure> {
        match self.0.is_null() {
            true => Ok(()),
            // SAFETY: whoever made this promised
            false => unsafe { versioned::write(self.0, &summary.into()) },
        }
    }
}

/// What is measured: the colour and what its models are made of, with the samples of its pixels.
fn frame(images: &Images) -> Result<Frame<'static>, Failure> {
    let frame = images.picture()?;
    let samples = images.input(&Input::Samples).ok_or_else(|| {
        Failure::argument("no image \"samples\" is set, which says how many each pixel has")
    })?;
    Ok(frame.with_samples(samples)?)
}

/// Where the map goes.
fn target(place: &Place, size: ImageSize) -> Result<RawImage, Failure> {
    let target = image("the map", Some(1), place)?;
    match target.size() == size {
        true => Ok(target),
        false => Err(Failure::argument(format!(
            "the map has {} x {} pixels, the image \"colour\" {} x {}",
            target.size().width(),
            target.size().height(),
            size.width(),
            size.height()
        ))),
    }
}

/// # Safety
/// Every image can be read, the place of the map written; the structs are NULL, or can be read, and the summary be
/// written, over their sizes.
unsafe fn sample_map(
    denoiser: &Denoiser,
    goal: *const linpred_sample_goal,
    place: &Place,
    summary: *mut linpred_sample_summary,
) -> Result<(), Failure> {
    denoiser.check_idle()?;
    // SAFETY: the caller's promise
    let goal = unsafe { versioned::read(goal) }?.goal()?;
    // SAFETY: the caller's promise
    let told = unsafe { Told::new(summary) }?;
    let mut frame = frame(&denoiser.images)?;
    let layout = frame.layout();
    let target = target(place, layout.size)?;
    let (settings, scratch) = (denoiser.settings, Scratch::Memory);
    let options = settings.for_sampling;
    check_memory_of_map(&layout, &options, &scratch, settings.memory_limit)?;
    let (progress, of) = (denoiser.progress, rows_to_measure(&layout));
    let tell = &mut |rows| progress.tell(rows, of);
    let mut map = measure(&mut frame, &options, &scratch, tell)?.plan(goal)?;
    let mut row = vec![0; layout.size.width()];
    for y in 0..layout.size.height() {
        map.read_row(y, &mut row)?;
        // SAFETY: the caller's promise
        unsafe { target.write_numbers(y, &row) };
    }
    told.tell(map.summary())
}

/// Fills `map` with the samples that each pixel should get next, so that the denoised image is best for what they
/// cost. The images are those of linpred_execute(), and "samples" must be one of them; outputs, layers and scalars play
/// no part. With "variance" or halves the map is better: the images are denoised twice.
///
/// Pixel x of row y of the map is the uint32_t at `map` + `byte_offset` + y * `row_stride` + x * `pixel_stride`, in
/// bytes, at any address; strides of 0 say that nothing lies between. It has the size of the colour, and may be the
/// memory of any image: it is written once all is read, and after a failure it is as it was. `summary` may be NULL.
/// If the target is met already, the map is all 0, and so is `added` of the summary; that is no error.
///
/// Beside what a run takes, up to 64 bytes of memory for each pixel.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; what the images were set to is there, as
/// linpred_set_image() says; `goal` and `summary` are NULL or can be read, `summary` also written, over their sizes;
/// `map` is NULL, or its pixels can be written, and nobody else uses them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_sample_map(
    denoiser: *mut linpred_denoiser,
    goal: *const linpred_sample_goal,
    map: *mut u32,
    width: usize,
    height: usize,
    byte_offset: usize,
    pixel_stride: usize,
    row_stride: usize,
    summary: *mut linpred_sample_summary,
) -> linpred_status {
    let place = Place {
        data: map.cast::<c_void>(),
        // as wide as a number of the map
        format: linpred_format::LINPRED_FORMAT_FLOAT as i32,
        width,
        height,
        byte_offset,
        pixel_stride,
        row_stride,
    };
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            sample_map(denoiser, goal, &place, summary)
        })
    }
}
