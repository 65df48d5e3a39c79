//! What can go wrong, by who can mend it.

use std::error::Error as _;
use std::fmt;

/// An error of a run. Every message names the file, and the part, channel or row where one is at fault; a cause that lies outside this crate is the
/// error's [`source`](std::error::Error::source) and not part of the message.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The input is valid but of a kind that is not handled (deep data, subsampled channels).
    #[error("{0}")]
    Unsupported(String),
    /// The input contradicts itself or the request (damaged file, missing channel, sizes that differ).
    #[error("{0}")]
    Invalid(String),
    /// The input leaves open what the request could say.
    #[error("{problem}")]
    Incomplete {
        /// What is missing, and where.
        problem: String,
        /// What in the request would do.
        remedy: Remedy,
    },
    /// Reading the input failed.
    #[error("{context}")]
    Read {
        /// What was being read.
        context: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Writing the output failed (disk full, no permission, another process at it).
    #[error("{context}")]
    Write {
        /// What was being written.
        context: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The request makes no sense whatever the input holds (an output that is the input, a malformed number).
    #[error("{0}")]
    Usage(String),
    /// A setting of the request does not suit the input.
    #[error("{setting} {value}: {problem}")]
    Setting {
        /// Which setting.
        setting: Setting,
        /// What it was set to.
        value: String,
        /// Why that will not do.
        problem: String,
    },
    /// The system gives too little: threads, or memory.
    #[error("{0}")]
    Budget(String),
    /// The work takes more memory than it may use.
    #[error("needs {} of memory, the limit is {}; most of it is {most}", Mebibytes(*needed), Mebibytes(*limit))]
    OverLimit {
        /// Bytes that it takes.
        needed: u64,
        /// Bytes that it may use.
        limit: u64,
        /// What takes most, and how much that is.
        most: String,
    },
    /// A signal or the caller asked to stop.
    #[error("stopped before the end")]
    Cancelled,
    /// A [`RowSource`](crate::RowSource) or [`RowSink`](crate::RowSink) of the caller's own failed; see [`Error::renderer`].
    #[error(transparent)]
    Renderer(Box<dyn std::error::Error + Send + Sync>),
}

impl Error {
    /// An error of a renderer's own, for its [`RowSource`](crate::RowSource) or [`RowSink`](crate::RowSink). It reaches the caller as it is.
    pub fn renderer(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Renderer(error.into())
    }

    /// What lies behind the message, as text to be put after it: each cause with a colon before. Empty if nothing does.
    pub fn causes(&self) -> String {
        let mut words = String::new();
        let mut cause = self.source();
        while let Some(error) = cause {
            words += &format!(": {error}");
            cause = error.source();
        }
        words
    }
}

/// What of a request an error is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Setting {
    /// An entry of [`RoleRequest::map`](crate::channels::RoleRequest).
    Map,
    /// An entry of [`RoleRequest::features`](crate::channels::RoleRequest).
    Feature,
    /// A pattern of [`InputRequest::layers`](crate::job::InputRequest).
    Layers,
    /// [`InputRequest::other_half`](crate::job::InputRequest).
    OtherHalf,
    /// [`JobOptions::band`](crate::job::JobOptions).
    Band,
    /// [`OutputOptions::compression`](crate::image::OutputOptions).
    Compression,
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Map => "map",
            Self::Feature => "feature",
            Self::Layers => "layers",
            Self::OtherHalf => "other-half",
            Self::Band => "band",
            Self::Compression => "compression",
        })
    }
}

/// What in a request would make up for what an input leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Remedy {
    /// The colour's layer, mapped.
    Colour,
    /// The samples per pixel, or no variance, which is estimated then.
    SamplesOrNoVariance,
    /// No variance, which is estimated then.
    NoVariance,
    /// The samples per pixel.
    Samples,
}

/// Bytes for people, rounded up so that nothing is free.
pub(crate) struct Mebibytes(pub(crate) u64);

impl fmt::Display for Mebibytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tenths = (u128::from(self.0) * 10).div_ceil(1 << 20);
        write!(f, "{}.{} MiB", tenths / 10, tenths % 10)
    }
}
