//! What can go wrong, by who can mend it.

/// An error of the runner. Every message names the file, and the part, channel or row where one is at fault.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The input is valid but of a kind that is not handled (deep data, subsampled channels).
    #[error("{0}")]
    Unsupported(String),
    /// The input contradicts itself or the request (damaged file, missing channel, sizes that differ).
    #[error("{0}")]
    Invalid(String),
    /// Reading the input failed.
    #[error("{context}: {source}")]
    Read {
        /// What was being read.
        context: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Writing the output failed (disk full, no permission, another process at it).
    #[error("{context}: {source}")]
    Write {
        /// What was being written.
        context: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The request makes no sense whatever the input holds (output equal to input, a malformed option).
    #[error("{0}")]
    Usage(String),
    /// The work does not fit the memory that it may use.
    #[error("{0}")]
    Budget(String),
    /// A signal or the caller asked to stop.
    #[error("stopped before the end")]
    Cancelled,
}
