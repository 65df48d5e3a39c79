//! An opened file whose channels have their roles.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::roles::layers::{self, Layer};
use crate::channels::roles::{RoleRequest, Roles, resolve};
use crate::error::{Error, Setting};
use crate::exr_file::ExrFile;
use crate::exr_file::compression::SharedCodec;
use crate::geometry::ImageSize;
use crate::image::rewrite::{ExtraLayers, Rewrite};
use crate::image::sink::ExrSink;
use crate::image::source::{self, ExrSource};
use crate::row::RowLayout;

/// Which channels of which files.
#[derive(Clone, Debug, Default)]
pub struct InputRequest {
    /// The noisy image.
    pub path: PathBuf,
    /// The image from the other half of the samples, if the noisy image is from one half.
    pub other_half: Option<PathBuf>,
    /// How roles are assigned.
    pub roles: RoleRequest,
    /// Names, with `*` and `?`, of layers to denoise with the models of the colour.
    pub layers: Vec<String>,
}

impl InputRequest {
    /// The image at `path`, with the roles that its names suggest.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            ..Self::default()
        }
    }
}

/// An opened input whose channels have their roles.
#[derive(Clone, Debug)]
pub struct Input {
    /// The files, and their channels by name.
    pub names: ChannelNames,
    /// Which channel does what.
    pub roles: Roles,
    /// The layers to be denoised beside the colour.
    pub layers: Vec<Layer>,
}

impl Input {
    /// Opens the files and assigns the roles.
    pub fn open(request: &InputRequest) -> Result<Self, Error> {
        let mut names = ChannelNames::new(Arc::new(ExrFile::open(&request.path)?));
        let mut roles = request.roles.clone();
        if let Some(path) = &request.other_half {
            if same_file::is_same_file(path, &request.path).unwrap_or(false) {
                return Err(Error::Setting {
                    setting: Setting::OtherHalf,
                    value: path.display().to_string(),
                    problem: "is the noisy image itself".into(),
                });
            }
            roles.other_half = Some(names.add(Arc::new(ExrFile::open(path)?)));
        }
        let roles = resolve(&names, &roles)?;
        let layers = layers::select(&names, &roles, &request.layers)?;
        Ok(Self {
            names,
            roles,
            layers,
        })
    }

    /// The path of the noisy image.
    pub fn path(&self) -> &Path {
        self.file().path()
    }

    /// The noisy image.
    pub(crate) fn file(&self) -> &Arc<ExrFile> {
        &self.names.files()[0]
    }

    /// Rows of the image.
    pub fn height(&self) -> usize {
        let at = self.roles.colour[0];
        self.names.files()[at.file].parts()[at.part]
            .header
            .layer_size
            .1
    }

    /// Columns of the image.
    pub fn width(&self) -> usize {
        let at = self.roles.colour[0];
        self.names.files()[at.file].parts()[at.part]
            .header
            .layer_size
            .0
    }

    /// What its rows hold; of an empty image, those of one pixel.
    pub fn layout(&self) -> RowLayout {
        let pixel = || ImageSize::new(1, 1).expect("one pixel is an image");
        let size = ImageSize::new(self.width(), self.height()).unwrap_or_else(pixel);
        source::layout(&self.roles, size, self.layers.len())
    }

    /// Every channel that is read.
    pub fn channels(&self) -> Vec<ChannelRef> {
        let assigned = self.roles.assignments.iter().flat_map(|a| &a.channels);
        let mut all: Vec<ChannelRef> = assigned.copied().collect();
        for layer in &self.layers {
            all.extend(layer.channels);
            all.extend(layer.variance.channels());
        }
        all
    }

    /// A source of its rows (see [`ExrSource::new`]).
    pub fn source(&self, limit: u64) -> Result<ExrSource, Error> {
        ExrSource::new(self.names.files(), &self.roles, &self.layers, limit)
    }

    /// A sink for its denoised rows, into the file that [`denoise`](super::denoise) writes.
    ///
    /// [`Error::Unsupported`] if what is to be denoised holds integers, [`Error::Write`] if the file cannot be created, [`Error::Budget`] if a row of
    /// chunks takes more than `limit` bytes, [`Error::Cancelled`] once `stop` is set.
    pub fn sink(
        &self,
        output: &Path,
        extra: ExtraLayers,
        limit: u64,
        stop: Arc<AtomicBool>,
    ) -> Result<ExrSink, Error> {
        let codec = SharedCodec::default();
        let rewrite = self.rewrite(extra)?;
        ExrSink::create(output, self.file().clone(), rewrite, &codec, limit, stop)
    }

    /// What a user should know about the output: what it loses, and why it is stored in another way than the input.
    pub fn notes_on_output(&self, extra: ExtraLayers) -> Result<Vec<String>, Error> {
        Ok(self.rewrite(extra)?.notes)
    }

    /// The output file that denoising it makes.
    pub(crate) fn rewrite(&self, extra: ExtraLayers) -> Result<Rewrite, Error> {
        let layers: Vec<_> = self.layers.iter().map(|layer| layer.channels).collect();
        Rewrite::new(self.file(), &self.roles.colour, &layers, extra)
    }
}
