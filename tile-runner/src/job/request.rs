//! Which channels of which files are asked for.

use std::path::PathBuf;

use crate::channels::roles::RoleRequest;

/// Whether the windows of a picture wrap around its left and right ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// They do if the header says that it is a latitude-longitude map (attribute `envmap`), or if it is twice as wide as high and its ends meet.
    #[default]
    Auto,
    /// They do.
    X,
    /// They do not.
    Never,
}

/// Which channels of which files.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct InputRequest {
    /// The noisy image.
    pub path: PathBuf,
    /// The image from the other half of the samples, if the noisy image is from one half.
    pub other_half: Option<PathBuf>,
    /// How roles are assigned.
    pub roles: RoleRequest,
    /// Names, with `*` and `?`, of layers to denoise with the models of the colour.
    pub layers: Vec<String>,
    /// Whether the picture is a panorama.
    pub wrap: Wrap,
    /// Bytes of memory that a look at the pixels may take; [`DEFAULT_MEMORY_LIMIT`](crate::job::DEFAULT_MEMORY_LIMIT) if `None`. Where it does not suffice nothing is looked at.
    pub memory_limit: Option<u64>,
}

impl InputRequest {
    /// The image at `path`, with the roles that its names suggest.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            ..Self::default()
        }
    }

    /// The path of the image from the other half of the samples.
    pub fn with_other_half(self, path: Option<PathBuf>) -> Self {
        Self {
            other_half: path,
            ..self
        }
    }

    /// Roles as asked for.
    pub fn with_roles(self, roles: RoleRequest) -> Self {
        Self { roles, ..self }
    }

    /// Layers by these names.
    pub fn with_layers(self, layers: Vec<String>) -> Self {
        Self { layers, ..self }
    }

    /// Looks at the pixels within so many bytes of memory.
    pub fn with_memory_limit(self, memory_limit: Option<u64>) -> Self {
        Self {
            memory_limit,
            ..self
        }
    }

    /// Wraps around, or not.
    pub fn with_wrap(self, wrap: Wrap) -> Self {
        Self { wrap, ..self }
    }
}
