//! A function of the caller's that is told how far a run is.

use std::ffi::c_void;
use std::ops::ControlFlow;

use crate::handle::{call, linpred_denoiser};
use crate::status::linpred_status;

/// Is told that `rows` rows of `of` are done, `user` as it was given; true goes on, false stops the run, which
/// then returns LINPRED_ERROR_CANCELLED. Called in the thread that called the library, and must return: no exception
/// or longjmp may leave it.
pub type linpred_progress_function =
    Option<unsafe extern "C" fn(user: *mut c_void, rows: usize, of: usize) -> bool>;

/// Whom to tell.
#[derive(Clone, Copy)]
pub(crate) struct Progress {
    function: linpred_progress_function,
    user: *mut c_void,
}

impl Default for Progress {
    fn default() -> Self {
        Self {
            function: None,
            user: std::ptr::null_mut(),
        }
    }
}

impl Progress {
    pub(crate) fn tell(&self, rows: usize, of: usize) -> ControlFlow<()> {
        let Some(function) = self.function else {
            return ControlFlow::Continue(());
        };
        // SAFETY: who set it promised a function of this kind that can be called until it is replaced
        match unsafe { function(self.user, rows, of) } {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    }
}

/// Has `function` told of every row that linpred_execute(), linpred_run_rows() and linpred_denoise_file() have
/// written, and of those that linpred_sample_map() and linpred_sample_map_file() have denoised, up to twice the image's;
/// NULL tells nobody.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; `function` can be called with `user` until another is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_set_progress(
    denoiser: *mut linpred_denoiser,
    function: linpred_progress_function,
    user: *mut c_void,
) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            denoiser.progress = Progress { function, user };
            Ok(())
        })
    }
}
