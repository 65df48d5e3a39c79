//! Text that C hands over.

use std::ffi::{CStr, c_char};
use std::path::PathBuf;

use crate::status::Failure;

/// A string.
///
/// # Safety
/// `given` is NULL or ends with a zero.
pub(crate) unsafe fn text<'a>(what: &str, given: *const c_char) -> Result<&'a CStr, Failure> {
    if given.is_null() {
        return Err(Failure::argument(format!("{what} is NULL")));
    }
    // SAFETY: it is not NULL, so the caller promises that it ends with a zero
    Ok(unsafe { CStr::from_ptr(given) })
}

/// A string in UTF-8.
///
/// # Safety
/// `given` is NULL or ends with a zero.
pub(crate) unsafe fn utf8<'a>(what: &str, given: *const c_char) -> Result<&'a str, Failure> {
    // SAFETY: the caller's promise
    let given = unsafe { text(what, given) }?;
    given
        .to_str()
        .map_err(|_| Failure::argument(format!("{what} is not UTF-8: {}", given.to_string_lossy())))
}

/// A path: bytes as the system has them, in UTF-8 on Windows.
///
/// # Safety
/// `given` is NULL or ends with a zero.
pub(crate) unsafe fn path(what: &str, given: *const c_char) -> Result<PathBuf, Failure> {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        // SAFETY: the caller's promise
        let given = unsafe { text(what, given) }?;
        Ok(std::ffi::OsStr::from_bytes(given.to_bytes()).into())
    }
    #[cfg(not(unix))]
    {
        // SAFETY: the caller's promise
        Ok(unsafe { utf8(what, given) }?.into())
    }
}
