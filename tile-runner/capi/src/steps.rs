//! Row by row, in a loop of the caller's.

use std::ptr::null;

use linpred::job::check_memory;
use linpred::steps::{Step, Steps};

use crate::handle::{Denoiser, call, linpred_denoiser};
use crate::report::Done;
use crate::row::{LentInput, LentOutput, linpred_input_row, linpred_layout, linpred_output_row};
use crate::status::{Failure, linpred_status};
use crate::versioned::{self, Versioned};

/// What comes next.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum linpred_step_kind {
    /// All rows are denoised.
    LINPRED_STEP_DONE = 0,
    /// `wanted` is to be filled.
    LINPRED_STEP_WANTED = 1,
    /// `denoised` is there.
    LINPRED_STEP_DENOISED = 2,
}

/// What comes next. LINPRED_STEP_INIT sets the size.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct linpred_step {
    /// sizeof(linpred_step).
    pub struct_size: usize,
    /// One of linpred_step_kind.
    pub kind: i32,
    /// 0.
    pub reserved: u32,
    /// A row to be filled, until the next call with the denoiser; else NULL.
    pub wanted: *const linpred_input_row,
    /// A denoised row, until the next call with the denoiser; else NULL.
    pub denoised: *const linpred_output_row,
}

// SAFETY: numbers and pointers, the size first
unsafe impl Versioned for linpred_step {
    const NAME: &'static str = "linpred_step";
}

/// A run that is taken step by step, and what it has lent.
pub(crate) struct Stepping {
    steps: Steps,
    input: LentInput,
    output: LentOutput,
    /// Whether `input` is lent.
    is_wanted: bool,
}

impl Stepping {
    fn next(&mut self) -> Result<(linpred_step, Option<Done>), Failure> {
        if std::mem::take(&mut self.is_wanted) {
            // SAFETY: `steps` has not been touched since it lent the row, and C has given it back by this call
            unsafe { self.input.take_back() };
        }
        let layout = self.steps.layout();
        let mut step = linpred_step {
            struct_size: size_of::<linpred_step>(),
            kind: linpred_step_kind::LINPRED_STEP_DONE as i32,
            reserved: 0,
            wanted: null(),
            denoised: null(),
        };
        match self.steps.next()? {
            Step::Wanted { y, row } => {
                step.kind = linpred_step_kind::LINPRED_STEP_WANTED as i32;
                step.wanted = self.input.lend(&layout, y, row);
                self.is_wanted = true;
            }
            Step::Denoised { y, row } => {
                step.kind = linpred_step_kind::LINPRED_STEP_DENOISED as i32;
                step.denoised = self.output.lend(y, row);
            }
            Step::Done(report) => return Ok((step, Some(Done::new(report, 0)))),
        }
        Ok((step, None))
    }
}

/// # Safety
/// `layout` is NULL or can be read over its size.
unsafe fn start(denoiser: &mut Denoiser, layout: *const linpred_layout) -> Result<(), Failure> {
    denoiser.check_idle()?;
    // SAFETY: the caller's promise
    let layout = unsafe { versioned::read(layout) }?.layout()?;
    check_memory(
        &layout,
        &denoiser.settings.options,
        denoiser.settings.memory_limit,
    )?;
    denoiser.stepping = Some(Box::new(Stepping {
        steps: Steps::start(layout, denoiser.settings.options)?,
        input: LentInput::new(),
        output: LentOutput::new(),
        is_wanted: false,
    }));
    Ok(())
}

fn next(denoiser: &mut Denoiser) -> Result<linpred_step, Failure> {
    let Some(stepping) = &mut denoiser.stepping else {
        return Err(Failure::new(
            linpred_status::LINPRED_ERROR_OPERATION,
            "no run was begun by linpred_start_rows, or it has ended",
        ));
    };
    let stepped = stepping.next();
    if !matches!(stepped, Ok((_, None))) {
        denoiser.stepping = None;
    }
    let (step, done) = stepped?;
    denoiser.done = done.unwrap_or(denoiser.done);
    Ok(step)
}

/// Begins a run that a loop of the caller's takes step by step, for images larger than memory or rows that become
/// ready in their own time: no more than some 100 rows are in memory. The options that are set now hold.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; `layout` is NULL or can be read over its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_start_rows(
    denoiser: *mut linpred_denoiser,
    layout: *const linpred_layout,
) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe { call(denoiser, |denoiser| start(denoiser, layout)) }
}

/// Goes on to the next step: a row that was wanted is taken now, as it was filled. Rows are wanted from top to
/// bottom, each once, and come out so some 90 rows later. The run ends with LINPRED_STEP_DONE, or with a failure.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; `step` is NULL or can be written over its size. Nothing is
/// written beyond the planes of a wanted row.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_next_step(
    denoiser: *mut linpred_denoiser,
    step: *mut linpred_step,
) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            // before a step is taken that nobody could be told of
            versioned::read(step)?;
            versioned::write(step, &next(denoiser)?)
        })
    }
}

/// Gives up a run that linpred_start_rows() began, if there is one.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_stop_rows(denoiser: *mut linpred_denoiser) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            denoiser.stepping = None;
            Ok(())
        })
    }
}
