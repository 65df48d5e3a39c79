//! Errors as exceptions: who can mend it decides which.

use linpred::{Error, Remedy};
use pyo3::exceptions::{
    PyKeyboardInterrupt, PyMemoryError, PyOSError, PyRuntimeError, PyValueError,
};
use pyo3::{PyErr, create_exception};

create_exception!(
    linpred,
    InputError,
    PyValueError,
    "A file cannot be denoised as asked for: it is damaged, of a kind that is not handled, or lacks something."
);

create_exception!(
    linpred,
    Busy,
    PyRuntimeError,
    "Rows are asked for while they are already."
);

/// An error with its causes, in the words of this package's arguments.
pub(crate) fn in_words(error: &Error) -> String {
    let words = match error {
        Error::Incomplete { remedy, .. } => format!("{error}{}", advice(*remedy)),
        Error::OverLimit { .. } => error.to_string().replacen("the limit", "max_memory", 1),
        _ => error.to_string(),
    };
    words + &error.causes()
}

fn advice(remedy: Remedy) -> &'static str {
    match remedy {
        Remedy::Colour => "; give map={'colour': LAYER}",
        Remedy::SamplesOrNoVariance => {
            "; give spp=N, or map={'variance': 'none'} to estimate the variance from the picture"
        }
        Remedy::NoVariance => {
            ", or give map={'variance': 'none'} to estimate the variance from the picture"
        }
        Remedy::Samples => "; give spp=N, or map={'samples': CHANNEL}",
        _ => "",
    }
}

/// The exception that an error is.
pub(crate) fn raise(error: Error) -> PyErr {
    let words = in_words(&error);
    match error {
        Error::Usage(_) => PyValueError::new_err(words),
        // a setting does not suit what the file holds
        Error::Setting { .. }
        | Error::Unsupported(_)
        | Error::Invalid(_)
        | Error::Incomplete { .. } => InputError::new_err(words),
        Error::Read { source, .. } | Error::Write { source, .. } => match source.raw_os_error() {
            // Python picks FileNotFoundError and the like by the number
            Some(number) => {
                let twice = format!(" (os error {number})");
                PyOSError::new_err((number, words.replace(&twice, "")))
            }
            None => PyOSError::new_err(words),
        },
        Error::Budget(_) | Error::OverLimit { .. } => PyMemoryError::new_err(words),
        Error::Cancelled => PyKeyboardInterrupt::new_err(words),
        _ => PyRuntimeError::new_err(words),
    }
}
