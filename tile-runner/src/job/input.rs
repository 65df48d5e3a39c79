//! An opened file whose channels have their roles.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::roles::layers::{self, Layer};
use crate::channels::roles::{Roles, resolve};
use crate::channels::variance::Variance;
use crate::error::{Error, Setting};
use crate::exr_file::ExrFile;
use crate::exr_file::compression::SharedCodec;
use crate::geometry::ImageSize;
use crate::image::area::{Area, wrapped_layout};
use crate::image::motion::MotionChannels;
use crate::image::rewrite::{OutputOptions, Rewrite, Targets};
use crate::image::sink::ExrSink;
use crate::image::source::{self, ExrSource};
use crate::job::look::look;
use crate::job::memory::DEFAULT_MEMORY_LIMIT;
use crate::job::request::InputRequest;
use crate::row::{Motion, RowLayout};

/// A picture of an opened file whose channels have their roles. Most files have one; a view, or a view layer, is a picture of its own.
#[derive(Clone, Debug)]
pub struct Input {
    /// The files, and their channels by name: those that the picture's view sees.
    pub names: ChannelNames,
    /// Which channel does what.
    pub roles: Roles,
    /// The layers to be denoised beside the colour.
    pub layers: Vec<Layer>,
    /// What of the picture is denoised: what was rendered. The rest is 0 and stays so.
    pub area: Area,
    /// Whether its windows wrap around its left and right ends.
    pub wrap: bool,
    /// The frames that help it, if it is of a frame of a sequence (see [`open_frame`](super::open_frame)).
    pub neighbours: Option<Neighbours>,
}

/// The frames beside that of a picture, as far as they can help it.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Neighbours {
    /// The same picture of the frames before it, nearest first.
    pub before: Vec<Input>,
    /// The same picture of those after it, nearest first.
    pub after: Vec<Input>,
    /// Frames that were asked for and do not help, on each side the nearest: none beyond it does either.
    pub unused: Vec<Unused>,
}

/// A frame that cannot help those beside it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unused {
    /// Its file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub why: String,
}

impl fmt::Display for Unused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { path, why } = self;
        let path = path.display();
        write!(
            f,
            "{path} does not help the frames beside it, nor does any beyond it: {why}"
        )
    }
}

impl Input {
    /// Opens the files, assigns the roles and looks at some of the pixels. The first of several pictures.
    pub fn open(request: &InputRequest) -> Result<Self, Error> {
        let mut pictures = Self::open_all(request)?;
        Ok(pictures.swap_remove(0))
    }

    /// The same for every picture of the file, at least one.
    ///
    /// [`Error::Setting`] or [`Error::Invalid`], among others, if two halves are not of one picture.
    pub fn open_all(request: &InputRequest) -> Result<Vec<Self>, Error> {
        let mut pictures = Self::assign(request)?;
        for picture in &mut pictures {
            // what cannot be read is told by who needs it
            let limit = request.memory_limit.unwrap_or(DEFAULT_MEMORY_LIMIT);
            let Ok(found) = look(picture, request.wrap, limit) else {
                continue;
            };
            if let Some(problem) = found.problem {
                return Err(problem);
            }
            picture.roles.zero_is_unknown = found.zero_is_unknown;
            let roles = &mut picture.roles;
            let known = roles.features.iter_mut().map(|own| &mut own.variance);
            let further = roles.further.iter_mut().map(|own| &mut own.variance);
            for variance in known.chain(further) {
                if found.halves_are_one && matches!(variance, Variance::OtherFile(_)) {
                    *variance = Variance::None;
                }
            }
            picture.roles.warnings.extend(found.warnings);
            picture.roles.notes.extend(found.notes);
            picture.area = found.area.unwrap_or(picture.area);
            picture.wrap = found.wrap;
        }
        Ok(pictures)
    }

    /// Opens the files and assigns the roles.
    pub(crate) fn assign(request: &InputRequest) -> Result<Vec<Self>, Error> {
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
        let pictures = resolve(&names, &roles)?;
        let layers = layers::select_all(&pictures, &request.layers)?;
        let picture = |((names, roles), layers): ((ChannelNames, Roles), Vec<Layer>)| {
            let at = roles.colour[0];
            let part = &names.files()[at.file].parts()[at.part];
            let size = part.size().ok_or_else(|| {
                let path = names.files()[at.file].path().display();
                Error::Invalid(format!(
                    "{path}: {}: the data window is empty",
                    part.label()
                ))
            })?;
            Ok(Self {
                area: Area::whole(size),
                wrap: false,
                neighbours: None,
                names,
                roles,
                layers,
            })
        };
        pictures.into_iter().zip(layers).map(picture).collect()
    }

    /// The path of the noisy image.
    pub fn path(&self) -> &Path {
        self.file().path()
    }

    /// The noisy image.
    pub(crate) fn file(&self) -> &Arc<ExrFile> {
        &self.names.files()[0]
    }

    /// Size of the image.
    pub(crate) fn size(&self) -> ImageSize {
        let at = self.roles.colour[0];
        let part = &self.names.files()[at.file].parts()[at.part];
        // it was not empty when it was opened
        part.size().unwrap_or(self.area.size)
    }

    /// Rows of the image.
    pub fn height(&self) -> usize {
        self.size().height()
    }

    /// Columns of the image.
    pub fn width(&self) -> usize {
        self.size().width()
    }

    /// What its rows hold, of what is denoised.
    pub fn layout(&self) -> RowLayout {
        let alone = source::layout(&self.roles, self.area.size, &self.layers);
        match self.helpers().next() {
            Some(_) => alone.with_frames(),
            None => alone,
        }
    }

    /// The same picture of the frames that help it.
    pub(crate) fn helpers(&self) -> impl Iterator<Item = &Self> {
        let neighbours = self.neighbours.iter();
        neighbours.flat_map(|of| of.before.iter().chain(&of.after))
    }

    /// What the pipeline's rows hold: those of a panorama are wider.
    pub(crate) fn computed_layout(&self) -> RowLayout {
        match self.wrap {
            true => wrapped_layout(self.layout()),
            false => self.layout(),
        }
    }

    /// Every channel that is read where the frame is denoised alone.
    pub fn channels(&self) -> Vec<ChannelRef> {
        let assigned = self.roles.assignments.iter();
        let assigned = assigned.filter(|a| !a.role.is_of_motion());
        let mut all: Vec<ChannelRef> = assigned.flat_map(|a| &a.channels).copied().collect();
        for layer in &self.layers {
            all.extend(layer.channels.iter().copied());
            all.extend(layer.variance.channels());
        }
        for feature in &self.roles.further {
            all.extend(feature.channels.iter().copied());
            all.extend(feature.variance.channels());
        }
        all.extend(self.roles.variance.channels());
        all
    }

    /// What it says of where its surfaces are in the frames beside it.
    pub fn motion(&self) -> Motion {
        MotionChannels::of(&self.roles).layout()
    }

    /// Every channel that is read where the frame is one of a sequence whose frames help each other: those that tell of motion are added, and layers that are no light,
    /// which are not averaged over frames, left out.
    pub fn channels_in_sequence(&self) -> Vec<ChannelRef> {
        let mut all = self.in_sequence().channels();
        all.extend(MotionChannels::of(&self.roles).all());
        all
    }

    /// What the rows of [`source_in_sequence`](Self::source_in_sequence) hold.
    pub fn layout_in_sequence(&self) -> RowLayout {
        let Self { roles, layers, .. } = self.in_sequence();
        source::layout(&roles, self.area.size, &layers).with_motion(self.motion())
    }

    /// A source of the rows of a frame of a sequence whose frames help each other: with what it says of motion, and without layers that are no light. Errors as those of
    /// [`ExrSource::new`].
    pub fn source_in_sequence(&self, limit: u64) -> Result<ExrSource, Error> {
        let source = self.in_sequence().source(limit)?;
        source.with_motion(self.names.files(), &self.roles, limit)
    }

    /// A source of the rows of the frame that the others help: with what it says of motion, and everything that is denoised. Errors as those of [`ExrSource::new`].
    pub(crate) fn source_to_help(&self, limit: u64) -> Result<ExrSource, Error> {
        let source = self.source(limit)?;
        source.with_motion(self.names.files(), &self.roles, limit)
    }

    /// The same without layers that are no light.
    fn in_sequence(&self) -> Self {
        let mut own = self.clone();
        own.layers.retain(|layer| layer.is_light);
        own
    }

    /// A source of the rows of what is denoised (see [`ExrSource::new`]).
    pub fn source(&self, limit: u64) -> Result<ExrSource, Error> {
        ExrSource::new(
            self.names.files(),
            &self.roles,
            &self.layers,
            self.area,
            limit,
        )
    }

    /// Every channel that is read: of a frame of a sequence also those that say how it moves.
    pub(crate) fn channels_to_read(&self) -> Vec<ChannelRef> {
        let mut all = self.channels();
        if self.neighbours.is_some() {
            all.extend(MotionChannels::of(&self.roles).all());
        }
        all
    }

    /// A sink for its denoised rows, into the file that [`denoise`](super::denoise) writes of a file with one picture.
    ///
    /// [`Error::Unsupported`] if what is to be denoised holds integers, [`Error::Write`] if the file cannot be created, [`Error::Budget`] if a row of
    /// chunks takes more than `limit` bytes, [`Error::Cancelled`] once `stop` is set.
    pub fn sink(
        &self,
        path: &Path,
        output: OutputOptions,
        limit: u64,
        stop: Arc<AtomicBool>,
    ) -> Result<ExrSink, Error> {
        let codec = SharedCodec::default();
        let rewrite = rewrite(std::slice::from_ref(self), output, &[])?;
        ExrSink::create(path, self.file().clone(), rewrite, &codec, limit, stop)
    }

    /// How it is read, and what is odd about it; with its name, if it has one.
    pub fn remarks(&self) -> Vec<Remark> {
        let roles = &self.roles;
        let label = match roles.label() {
            label if label.is_empty() => label,
            label => format!("{label}: "),
        };
        let notes = roles.notes.iter();
        let notes = notes.map(|note| Remark::Note(format!("{label}{note}")));
        let warnings = roles.warnings.iter();
        let warnings = warnings.map(|warning| Remark::Warning(format!("{label}{warning}")));
        notes.chain(warnings).collect()
    }

    /// What says in an output which files it was made of: their checksums.
    pub(super) fn fingerprints(&self) -> Result<String, Error> {
        let files = self.names.files().iter();
        let all: Result<Vec<String>, Error> = files
            .map(|file| Ok(format!("{:08x}", file.fingerprint()?)))
            .collect();
        Ok(all?.join(" "))
    }

    /// Where its denoised channels go; it is one of `count` pictures.
    fn targets(&self, count: usize) -> Targets {
        let (light, plain): (Vec<&Layer>, Vec<&Layer>) =
            self.layers.iter().partition(|layer| layer.is_light);
        let triple = |layer: &Layer| <[_; 3]>::try_from(layer.channels.as_slice()).ok();
        let view = self.roles.view.as_ref().map(|view| format!("{view}."));
        let prefix = format!("{}{}", self.roles.prefix, view.unwrap_or_default());
        Targets {
            colour: self.roles.target,
            alpha: self
                .roles
                .alpha_target
                .filter(|_| self.roles.alpha.is_some()),
            layers: light.into_iter().filter_map(triple).collect(),
            scalars: plain
                .iter()
                .flat_map(|layer| &layer.channels)
                .copied()
                .collect(),
            prefix: if count > 1 { prefix } else { String::new() },
            frames: self.neighbours.is_some(),
        }
    }
}

/// Opens a file for what takes one picture. [`Error::Unsupported`] if it has several; and the errors of [`Input::open_all`].
pub fn only_picture(request: &InputRequest) -> Result<Input, Error> {
    let mut pictures = Input::open_all(request)?;
    if let [first, second, ..] = &pictures[..] {
        return Err(Error::Unsupported(format!(
            "{}: has {} pictures ({}, {}{}): map the colour of one",
            request.path.display(),
            pictures.len(),
            first.roles.label(),
            second.roles.label(),
            if pictures.len() > 2 { ", ..." } else { "" }
        )));
    }
    Ok(pictures.swap_remove(0))
}

/// What a user should know before pictures are denoised.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remark {
    /// Something about how they are read.
    Note(String),
    /// Something that is not as it should be, or that the output loses.
    Warning(String),
}

/// All there is to say before the pictures of a file are denoised: of each how it is read and what is odd about it, with its name where there are several; then which
/// frames do not help it, what the output loses, and why it is stored in another way than the input.
pub fn remarks(pictures: &[Input], output: OutputOptions) -> Result<Vec<Remark>, Error> {
    let mut remarks: Vec<Remark> = pictures.iter().flat_map(Input::remarks).collect();
    // of every picture the same
    let neighbours = pictures.first().and_then(|first| first.neighbours.as_ref());
    let unused = neighbours.into_iter().flat_map(|of| &of.unused);
    remarks.extend(unused.map(|frame| Remark::Warning(frame.to_string())));
    let of_output = rewrite(pictures, output, &[])?.notes;
    remarks.extend(of_output.into_iter().map(Remark::Warning));
    Ok(remarks)
}

/// The output file that denoising the pictures of a file makes, with these attributes.
pub(crate) fn rewrite(
    pictures: &[Input],
    output: OutputOptions,
    marks: &[(&str, String)],
) -> Result<Rewrite, Error> {
    let count = pictures.len();
    let targets: Vec<Targets> = pictures
        .iter()
        .map(|picture| picture.targets(count))
        .collect();
    let Some(first) = pictures.first() else {
        return Err(Error::Usage("no picture to denoise".into()));
    };
    Rewrite::new(first.file(), &targets, output, marks)
}
