//! What became of a call: a code, and a sentence.

use std::ffi::{CStr, CString, c_char};

use linpred::{Error, Remedy};

/// What became of a call. Numbers up to 6 mean what they mean in OIDN.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum linpred_status {
    /// All went well.
    LINPRED_OK = 0,
    /// A fault of the library itself, which the message describes. Nothing was lost but this call.
    LINPRED_ERROR_INTERNAL = 1,
    /// An argument, or what was set before, makes no sense.
    LINPRED_ERROR_ARGUMENT = 2,
    /// The call does not fit what was called before.
    LINPRED_ERROR_OPERATION = 3,
    /// It takes more memory than it may use, or than there is; or there are no more threads.
    LINPRED_ERROR_MEMORY = 4,
    /// The progress function asked to stop.
    LINPRED_ERROR_CANCELLED = 6,
    /// The handle is NULL: never made, or freed.
    LINPRED_ERROR_HANDLE = 7,
    /// Another call with this handle is at work: in another thread, or this one comes from a function that it called.
    LINPRED_ERROR_BUSY = 8,
    /// A function of the caller's failed.
    LINPRED_ERROR_CALLBACK = 9,
    /// A file is of a kind that is not denoised.
    LINPRED_ERROR_UNSUPPORTED = 10,
    /// A file contradicts itself or what was asked for, or lacks what is needed.
    LINPRED_ERROR_INPUT = 11,
    /// A file can't be read.
    LINPRED_ERROR_READ = 12,
    /// A file can't be written.
    LINPRED_ERROR_WRITE = 13,
}

use linpred_status::*;

impl linpred_status {
    const ALL: [Self; 13] = [
        LINPRED_OK,
        LINPRED_ERROR_INTERNAL,
        LINPRED_ERROR_ARGUMENT,
        LINPRED_ERROR_OPERATION,
        LINPRED_ERROR_MEMORY,
        LINPRED_ERROR_CANCELLED,
        LINPRED_ERROR_HANDLE,
        LINPRED_ERROR_BUSY,
        LINPRED_ERROR_CALLBACK,
        LINPRED_ERROR_UNSUPPORTED,
        LINPRED_ERROR_INPUT,
        LINPRED_ERROR_READ,
        LINPRED_ERROR_WRITE,
    ];

    /// A sentence for it.
    pub(crate) const fn text(self) -> &'static CStr {
        match self {
            LINPRED_OK => c"no error",
            LINPRED_ERROR_INTERNAL => c"a fault of the library itself",
            LINPRED_ERROR_ARGUMENT => c"an argument makes no sense",
            LINPRED_ERROR_OPERATION => c"the call does not fit what was called before",
            LINPRED_ERROR_MEMORY => c"not enough memory or threads",
            LINPRED_ERROR_CANCELLED => c"stopped before the end",
            LINPRED_ERROR_HANDLE => c"the denoiser is NULL: never made, or freed",
            LINPRED_ERROR_BUSY => c"another call with this denoiser is at work",
            LINPRED_ERROR_CALLBACK => c"a function of the caller's failed",
            LINPRED_ERROR_UNSUPPORTED => c"a file is of a kind that is not denoised",
            LINPRED_ERROR_INPUT => c"a file contradicts itself or lacks what is needed",
            LINPRED_ERROR_READ => c"a file can't be read",
            LINPRED_ERROR_WRITE => c"a file can't be written",
        }
    }
}

/// A sentence for a code, in English, which stays where it is; what exactly went wrong says linpred_message(). Any
/// number is allowed.
#[unsafe(no_mangle)]
pub extern "C" fn linpred_status_text(status: i32) -> *const c_char {
    let known = linpred_status::ALL
        .into_iter()
        .find(|known| *known as i32 == status);
    known
        .map_or(c"not a code of this version", linpred_status::text)
        .as_ptr()
}

/// Why a call failed.
#[derive(Debug, PartialEq)]
pub(crate) struct Failure {
    pub(crate) status: linpred_status,
    pub(crate) message: String,
}

impl Failure {
    pub(crate) fn new(status: linpred_status, message: impl Into<String>) -> Self {
        Self {
            status,
            message: message.into(),
        }
    }

    /// An argument, or what was set before, makes no sense.
    pub(crate) fn argument(message: impl Into<String>) -> Self {
        Self::new(LINPRED_ERROR_ARGUMENT, message)
    }
}

/// What a function of the caller's returned.
#[derive(Debug, thiserror::Error)]
#[error("{function} returned {code} for row {y}")]
pub(crate) struct CallbackFailed {
    pub(crate) function: &'static str,
    pub(crate) code: i32,
    pub(crate) y: usize,
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match &error {
            Error::Unsupported(_) => LINPRED_ERROR_UNSUPPORTED,
            Error::Invalid(_) | Error::Incomplete { .. } => LINPRED_ERROR_INPUT,
            Error::Read { .. } => LINPRED_ERROR_READ,
            Error::Write { .. } => LINPRED_ERROR_WRITE,
            Error::Usage(_) | Error::Setting { .. } => LINPRED_ERROR_ARGUMENT,
            Error::Budget(_) | Error::OverLimit { .. } => LINPRED_ERROR_MEMORY,
            Error::Cancelled => LINPRED_ERROR_CANCELLED,
            Error::Renderer(_) => LINPRED_ERROR_CALLBACK,
            _ => LINPRED_ERROR_INTERNAL,
        };
        Self::new(
            status,
            format!("{error}{}{}", advice(&error), error.causes()),
        )
    }
}

/// What would mend it, where that is a member of the header's.
fn advice(error: &Error) -> &'static str {
    match error {
        Error::Incomplete {
            remedy: Remedy::Samples | Remedy::SamplesOrNoVariance,
            ..
        } => "; set samples_per_pixel of linpred_file_options",
        _ => "",
    }
}

/// A message as C reads it.
pub(crate) fn to_c(message: String) -> CString {
    let bytes: Vec<u8> = message
        .into_bytes()
        .into_iter()
        .filter(|byte| *byte != 0)
        .collect();
    // there are no zeros left
    CString::new(bytes).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_a_sentence_of_its_own() {
        for (n, status) in linpred_status::ALL.into_iter().enumerate() {
            assert!(
                linpred_status::ALL[..n]
                    .iter()
                    .all(|other| other.text() != status.text())
            );
        }
    }

    #[test]
    fn causes_are_part_of_the_message() {
        let source = std::io::Error::other("disk on fire");
        let context = "in.exr: can't read".to_owned();
        let failure = Failure::from(Error::Read { context, source });
        assert_eq!(
            failure,
            Failure::new(LINPRED_ERROR_READ, "in.exr: can't read: disk on fire")
        );
    }
}
