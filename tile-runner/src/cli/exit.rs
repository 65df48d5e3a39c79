//! Exit codes: 0 done, 2 usage, 3 input, 4 memory budget, 1 anything else.

use linpred::Error;

/// The exit code that an error ends the process with.
pub(crate) fn code(error: &Error) -> u8 {
    match error {
        Error::Usage(_) => 2,
        Error::Unsupported(_) | Error::Invalid(_) | Error::Read { .. } => 3,
        Error::Budget(_) => 4,
        _ => 1,
    }
}
