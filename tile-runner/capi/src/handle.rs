//! A denoiser: what C holds of it, and how one call at a time gets at what is inside.

use std::cell::UnsafeCell;
use std::ffi::{CString, c_char};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::frame::Images;
use crate::guard::guard;
use crate::options::Settings;
use crate::progress::Progress;
use crate::report::Done;
use crate::status::linpred_status::{self, LINPRED_ERROR_BUSY, LINPRED_ERROR_HANDLE, LINPRED_OK};
use crate::status::{Failure, to_c};
use crate::steps::Stepping;

/// A denoiser: options, images and what went wrong last. One call at a time may use it; denoisers do not know of one
/// another.
pub struct linpred_denoiser {
    /// Whether a call is at work, to which alone `inside` belongs.
    busy: AtomicBool,
    inside: UnsafeCell<Inside>,
}

struct Inside {
    denoiser: Denoiser,
    /// What the last call that could enter has to say.
    message: CString,
}

/// What calls work on.
#[derive(Default)]
pub(crate) struct Denoiser {
    pub(crate) settings: Settings,
    pub(crate) progress: Progress,
    pub(crate) images: Images,
    pub(crate) stepping: Option<Box<Stepping>>,
    pub(crate) done: Done,
    /// What a call that succeeds has to say.
    pub(crate) notes: String,
}

impl Denoiser {
    /// Refuses another run while one is taken step by step.
    pub(crate) fn check_idle(&self) -> Result<(), Failure> {
        match self.stepping {
            None => Ok(()),
            Some(_) => Err(Failure::new(
                linpred_status::LINPRED_ERROR_OPERATION,
                "a run that linpred_start_rows began has not ended; linpred_stop_rows gives it up",
            )),
        }
    }
}

/// A call at work; others may enter once it is dropped.
struct Entered<'a>(&'a AtomicBool);

impl Drop for Entered<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}

impl linpred_denoiser {
    fn enter(&self) -> Option<Entered<'_>> {
        let was_busy = self.busy.swap(true, Ordering::Acquire);
        (!was_busy).then(|| Entered(&self.busy))
    }
}

/// Does `body` with what is inside a denoiser, and keeps what it has to say.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed.
pub(crate) unsafe fn call(
    denoiser: *const linpred_denoiser,
    body: impl FnOnce(&mut Denoiser) -> Result<(), Failure>,
) -> linpred_status {
    // SAFETY: the caller's promise; what is shared of it by several threads is atomic or behind `busy`
    let Some(handle) = (unsafe { denoiser.as_ref() }) else {
        return LINPRED_ERROR_HANDLE;
    };
    let Some(entered) = handle.enter() else {
        return LINPRED_ERROR_BUSY;
    };
    // SAFETY: whoever sets `busy` has it alone until `entered` is dropped, below
    let inside = unsafe { &mut *handle.inside.get() };
    let denoiser = &mut inside.denoiser;
    denoiser.notes.clear();
    let (status, message) = match guard(|| body(denoiser)) {
        Ok(()) if denoiser.notes.is_empty() => (LINPRED_OK, LINPRED_OK.text().to_owned()),
        Ok(()) => (LINPRED_OK, to_c(std::mem::take(&mut denoiser.notes))),
        Err(failure) => (failure.status, to_c(failure.message)),
    };
    inside.message = message;
    drop(entered);
    status
}

/// A new denoiser, to be freed by linpred_free(). Never NULL.
#[unsafe(no_mangle)]
pub extern "C" fn linpred_new() -> *mut linpred_denoiser {
    Box::into_raw(Box::new(linpred_denoiser {
        busy: AtomicBool::new(false),
        inside: UnsafeCell::new(Inside {
            denoiser: Denoiser::default(),
            message: LINPRED_OK.text().to_owned(),
        }),
    }))
}

/// Frees a denoiser and sets the caller's pointer to NULL, so that another call with it is told. A run that was begun
/// is given up. Images are the caller's and stay as they are. LINPRED_ERROR_BUSY, and nothing is freed, while a call
/// is at work.
///
/// # Safety
/// `denoiser` is NULL or points to NULL or to what linpred_new() gave; no copy of that pointer is used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_free(denoiser: *mut *mut linpred_denoiser) -> linpred_status {
    if denoiser.is_null() {
        return LINPRED_ERROR_HANDLE;
    }
    // SAFETY: it is not NULL, so the caller promises that it points to a pointer
    let handle = unsafe { denoiser.read() };
    // SAFETY: the caller's promise
    let Some(shared) = (unsafe { handle.as_ref() }) else {
        return LINPRED_ERROR_HANDLE;
    };
    let Some(entered) = shared.enter() else {
        return LINPRED_ERROR_BUSY;
    };
    // it stays busy
    std::mem::forget(entered);
    // SAFETY: of a box that `linpred_new` gave away, and nobody else is inside
    let owned = unsafe { Box::from_raw(handle) };
    let dropped = guard(|| {
        drop(owned);
        Ok(())
    });
    // SAFETY: as above
    unsafe { denoiser.write(std::ptr::null_mut()) };
    dropped.map_or_else(|failure| failure.status, |()| LINPRED_OK)
}

/// What the last call with this denoiser has to say: what went wrong; after LINPRED_OK warnings, or "no error".
/// English, UTF-8, without a line break at the end. It stays where it is until the next call with the denoiser. With
/// NULL, or while another call is at work, the sentence of that code.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_message(denoiser: *const linpred_denoiser) -> *const c_char {
    // SAFETY: the caller's promise
    let Some(handle) = (unsafe { denoiser.as_ref() }) else {
        return LINPRED_ERROR_HANDLE.text().as_ptr();
    };
    let Some(_entered) = handle.enter() else {
        return LINPRED_ERROR_BUSY.text().as_ptr();
    };
    // SAFETY: whoever sets `busy` has it alone
    unsafe { (*handle.inside.get()).message.as_ptr() }
}
