//! Row by row, by functions of the caller's.

use std::ffi::c_void;

use linpred::job::check_memory;
use linpred::{Error, InputRow, OutputRow, RowLayout, RowSource};

use crate::handle::{Denoiser, call, linpred_denoiser};
use crate::report::Done;
use crate::row::{LentInput, LentOutput, linpred_input_row, linpred_layout, linpred_output_row};
use crate::status::{CallbackFailed, Failure, linpred_status};
use crate::versioned::{self, Versioned};

/// Fills a row; 0 says that it is filled, anything else ends the run with LINPRED_ERROR_CALLBACK. Must return: no
/// exception or longjmp may leave it.
pub type linpred_read_row_function =
    Option<unsafe extern "C" fn(user: *mut c_void, row: *const linpred_input_row) -> i32>;

/// Takes a denoised row; 0 says that it is taken, anything else ends the run with LINPRED_ERROR_CALLBACK. Must
/// return: no exception or longjmp may leave it.
pub type linpred_write_row_function =
    Option<unsafe extern "C" fn(user: *mut c_void, row: *const linpred_output_row) -> i32>;

/// Whom to ask for rows and whom to give them. LINPRED_ROW_FUNCTIONS_INIT sets the size.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct linpred_row_functions {
    /// sizeof(linpred_row_functions).
    pub struct_size: usize,
    /// What the functions are given.
    pub user: *mut c_void,
    /// Is asked for every row, once, from top to bottom. The row is lent for the call.
    pub read_row: linpred_read_row_function,
    /// Is given every row, once, from top to bottom. The row is lent for the call.
    pub write_row: linpred_write_row_function,
}

// SAFETY: the size first, then pointers and functions, for which zero is NULL
unsafe impl Versioned for linpred_row_functions {
    const NAME: &'static str = "linpred_row_functions";
}

/// A function of the caller's, and what it is given.
struct Called<F> {
    function: F,
    user: *mut c_void,
}

// SAFETY: `linpred::denoise` uses its source and its sink in the thread that called it, so it does not leave that of linpred_run_rows()
unsafe impl<F> Send for Called<F> {}

fn told(function: &'static str, code: i32, y: usize) -> Result<(), Error> {
    match code {
        0 => Ok(()),
        code => Err(Error::renderer(CallbackFailed { function, code, y })),
    }
}

struct Source {
    layout: RowLayout,
    lent: LentInput,
    read_row: Called<unsafe extern "C" fn(*mut c_void, *const linpred_input_row) -> i32>,
}

impl RowSource for Source {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        let (lent, call) = (self.lent.lend(&self.layout, y, row), &self.read_row);
        // SAFETY: who gave the function promised that it can be called so
        let code = unsafe { (call.function)(call.user, lent) };
        told("read_row", code, y)?;
        // SAFETY: `row` is where it was, and the function has returned
        unsafe { self.lent.take_back() };
        Ok(())
    }
}

fn missing(name: &str) -> Failure {
    Failure::argument(format!("{name} of linpred_row_functions is NULL"))
}

/// # Safety
/// Both are NULL or can be read over their sizes, and the functions can be called.
unsafe fn run(
    denoiser: &mut Denoiser,
    layout: *const linpred_layout,
    functions: *const linpred_row_functions,
) -> Result<(), Failure> {
    denoiser.check_idle()?;
    // SAFETY: the caller's promise
    let layout = unsafe { versioned::read(layout) }?.layout()?;
    // SAFETY: the caller's promise
    let functions = unsafe { versioned::read(functions) }?;
    check_memory(
        &layout,
        &denoiser.settings.options,
        denoiser.settings.memory_limit,
    )?;
    let user = functions.user;
    let mut source = Source {
        layout,
        lent: LentInput::new(),
        read_row: Called {
            function: functions.read_row.ok_or_else(|| missing("read_row"))?,
            user,
        },
    };
    let write_row = Called {
        function: functions.write_row.ok_or_else(|| missing("write_row"))?,
        user,
    };
    let mut output = LentOutput::new();
    let mut sink = move |y: usize, row: &OutputRow| {
        let write_row = &write_row;
        // SAFETY: who gave the function promised that it can be called so
        let code = unsafe { (write_row.function)(write_row.user, output.lend(y, row)) };
        told("write_row", code, y)
    };
    let (options, progress) = (denoiser.settings.options, denoiser.progress);
    let tell = &mut |rows| progress.tell(rows, layout.size.height());
    let report = linpred::denoise(&mut source, &mut sink, &options, tell)?;
    denoiser.done = Done::new(report, 0);
    Ok(())
}

/// Denoises an image whose rows come from a function and go to another, for images larger than memory: no more than
/// some 100 rows are in memory. The functions are called in this thread.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; `layout` and `functions` are NULL or can be read over their
/// sizes. The functions can be called with `user`, and write nothing beyond the planes of a row.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_run_rows(
    denoiser: *mut linpred_denoiser,
    layout: *const linpred_layout,
    functions: *const linpred_row_functions,
) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe { call(denoiser, |denoiser| run(denoiser, layout, functions)) }
}
