//! The images of a comparison as rows.

use std::num::NonZeroUsize;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::channels::presets::Role;
use crate::channels::roles::{Assignment, Mapping, RoleRequest};
use crate::channels::variance::{Meaning, Variance};
use crate::error::Error;
use crate::geometry::{ImageSize, plane_bytes};
use crate::image::source::ExrSource;
use crate::job::input::Input;
use crate::job::memory::DEFAULT_MEMORY_LIMIT;
use crate::job::request::InputRequest;
use crate::row::{InputRow, RowSource};
use crate::stream::threads::threads_to_use;

/// Which images are compared.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CompareRequest {
    /// The image.
    pub image: PathBuf,
    /// What it should be.
    pub reference: PathBuf,
    /// What it was made of: measured too, if it is given.
    pub input: Option<PathBuf>,
    /// Which layer is the colour, where the names of a file do not say.
    pub map: Vec<Mapping>,
    /// Bytes that may be used.
    pub memory_limit: u64,
    /// Threads that compute FLIP; fewer where all would take more than the limit. No figure depends on it.
    pub threads: NonZeroUsize,
}

impl CompareRequest {
    /// `image` against `reference`, in up to [`DEFAULT_MEMORY_LIMIT`] bytes, on as many threads as there are processors.
    pub fn new(image: impl Into<PathBuf>, reference: impl Into<PathBuf>) -> Self {
        Self {
            image: image.into(),
            reference: reference.into(),
            input: None,
            map: Vec::new(),
            memory_limit: DEFAULT_MEMORY_LIMIT,
            threads: threads_to_use(None),
        }
    }

    /// With the image that the compared one was made of.
    pub fn with_input(self, input: Option<PathBuf>) -> Self {
        Self { input, ..self }
    }

    /// With roles given to channels.
    pub fn with_map(self, map: Vec<Mapping>) -> Self {
        Self { map, ..self }
    }

    /// With another limit on memory.
    pub fn with_memory_limit(self, memory_limit: u64) -> Self {
        Self {
            memory_limit,
            ..self
        }
    }

    /// With up to so many threads.
    pub fn with_threads(self, threads: NonZeroUsize) -> Self {
        Self { threads, ..self }
    }
}

/// The colours of one row of the images that are compared: red green blue, each of the image's width.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct ColourRow<'a> {
    /// From the top.
    pub y: usize,
    /// The image's.
    pub image: &'a [Vec<f32>; 3],
    /// The reference's.
    pub reference: &'a [Vec<f32>; 3],
    /// Those of what the image was made of.
    pub input: Option<&'a [Vec<f32>; 3]>,
}

/// A row of each image. Only the reference's variances are filled, where it has any.
pub(super) struct Rows<'a> {
    pub(super) y: usize,
    pub(super) image: &'a InputRow,
    pub(super) reference: &'a InputRow,
    pub(super) input: Option<&'a InputRow>,
}

impl Rows<'_> {
    pub(super) fn colours(&self) -> ColourRow<'_> {
        ColourRow {
            y: self.y,
            image: &self.image.colour,
            reference: &self.reference.colour,
            input: self.input.map(|row| &row.colour),
        }
    }
}

/// An image that is read.
#[derive(Debug)]
struct Opened {
    input: Input,
    source: ExrSource,
}

/// The open images, all of one size.
#[derive(Debug)]
pub(super) struct Images {
    image: Opened,
    reference: Opened,
    input: Option<Opened>,
    size: ImageSize,
}

impl Images {
    /// [`Error::Invalid`] if sizes differ.
    pub(super) fn open(request: &CompareRequest) -> Result<Self, Error> {
        let (map, limit) = (&request.map, request.memory_limit);
        let image = Opened::new(shown(colour_alone(&request.image, map)?), limit)?;
        let reference = shown(colour_alone(&request.reference, map)?);
        let reference = Opened::new(with_own_variance(reference), limit)?;
        let open_input = |path| Opened::new(colour_alone(path, map)?, limit);
        let input = request.input.as_deref().map(open_input).transpose()?;
        for other in std::iter::once(&image).chain(&input) {
            check_sizes(other, &reference)?;
        }
        let size = reference.size();
        Ok(Self {
            image,
            reference,
            input,
            size,
        })
    }

    pub(super) fn size(&self) -> ImageSize {
        self.size
    }

    pub(super) fn has_input(&self) -> bool {
        self.input.is_some()
    }

    /// Images that are compared with the reference.
    pub(super) fn pairs(&self) -> u64 {
        1 + u64::from(self.has_input())
    }

    pub(super) fn reference_has_variance(&self) -> bool {
        self.reference.input.roles.variance != Variance::None
    }

    pub(super) fn inputs(&self) -> Vec<&Input> {
        let first = [&self.image, &self.reference];
        let all = first.into_iter().chain(&self.input);
        all.map(|opened| &opened.input).collect()
    }

    /// Bytes of a row of each, and of the two that a source works in.
    pub(super) fn bytes(&self) -> u64 {
        let row = InputRow::bytes(&self.image.source.layout());
        let row = row.saturating_add(plane_bytes(self.size, 1, 2));
        row.saturating_mul(1 + self.pairs())
    }

    /// Gives these rows of all images to `each`. [`Error::Cancelled`] once `stop` is set.
    pub(super) fn read(
        &mut self,
        rows: Range<usize>,
        stop: &AtomicBool,
        mut each: impl FnMut(&Rows<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let new = |opened: &Opened| InputRow::new(&opened.source.layout());
        let (mut image, mut reference) = (new(&self.image), new(&self.reference));
        let mut input = self.input.as_ref().map(new);
        for y in rows {
            check_stop(stop)?;
            self.image.source.read_row(y, &mut image)?;
            self.reference.source.read_row(y, &mut reference)?;
            if let (Some(opened), Some(row)) = (&mut self.input, &mut input) {
                opened.source.read_row(y, row)?;
            }
            each(&Rows {
                y,
                image: &image,
                reference: &reference,
                input: input.as_ref(),
            })?;
        }
        Ok(())
    }

    /// Gives the colours of every row of the reference to `each`. [`Error::Cancelled`] once `stop` is set.
    pub(super) fn read_reference(
        &mut self,
        stop: &AtomicBool,
        mut each: impl FnMut(&[Vec<f32>; 3]),
    ) -> Result<(), Error> {
        let source = &mut self.reference.source;
        let mut row = InputRow::new(&source.layout());
        for y in 0..self.size.height() {
            check_stop(stop)?;
            source.read_row(y, &mut row)?;
            each(&row.colour);
        }
        Ok(())
    }
}

impl Opened {
    fn new(input: Input, limit: u64) -> Result<Self, Error> {
        let source = input.source(limit)?;
        Ok(Self { input, source })
    }

    fn size(&self) -> ImageSize {
        self.source.layout().size
    }
}

fn check_stop(stop: &AtomicBool) -> Result<(), Error> {
    match stop.load(Ordering::Relaxed) {
        true => Err(Error::Cancelled),
        false => Ok(()),
    }
}

fn check_sizes(image: &Opened, reference: &Opened) -> Result<(), Error> {
    let (size, other) = (image.size(), reference.size());
    if size == other {
        return Ok(());
    }
    Err(Error::Invalid(format!(
        "{} is {} x {} pixels, {} is {} x {}",
        image.input.path().display(),
        size.width(),
        size.height(),
        reference.input.path().display(),
        other.width(),
        other.height()
    )))
}

/// A file of which nothing but the colour is read; a variance that lacks its sample count is no obstacle.
fn colour_alone(path: &Path, map: &[Mapping]) -> Result<Input, Error> {
    let no_variance = Mapping {
        role: Role::Variance,
        meaning: Meaning::OfMean,
        target: "none".into(),
    };
    let roles = RoleRequest {
        map: std::iter::once(no_variance)
            .chain(map.iter().cloned())
            .collect(),
        ..RoleRequest::default()
    };
    let request = InputRequest::new(path).with_roles(roles);
    let mut input = Input::assign(&request)?.swap_remove(0);
    let roles = &mut input.roles;
    roles.alpha = None;
    roles.variance = Variance::None;
    roles.features.clear();
    roles.further.clear();
    roles.assignments.retain(|a| a.role == Role::Colour);
    Ok(input)
}

/// The same with the colour that people look at, where the renderer keeps the noisy one beside it.
fn shown(mut input: Input) -> Input {
    input.roles.colour = input.roles.target;
    input
}

/// The same with bare `variance.R/G/B`, if there are such.
fn with_own_variance(mut input: Input) -> Input {
    let found = input.names.components(0, "variance", &[["R", "G", "B"]]);
    if let Some(channels) = found {
        let meaning = Meaning::OfMean;
        input.roles.variance = Variance::Given {
            meaning,
            channels: channels.to_vec(),
            count: None,
        };
        input.roles.assignments.push(Assignment {
            role: Role::Variance,
            channels: channels.to_vec(),
            meaning,
            signs: [1.0; 2],
            rule: "the reference's own".into(),
            by_user: false,
        });
    }
    input
}
