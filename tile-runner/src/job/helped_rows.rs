//! The rows of a picture, helped by the frames beside its own.

use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Error;
use crate::exr_file::compression::SharedCodec;
use crate::image::source::ExrSource;
use crate::job::input::{Input, Neighbours, Unused};
use crate::job::plan::Schedule;
use crate::row::{InputRow, RowLayout, RowSource};
use crate::temporal::Temporal;

/// How a picture was helped by the frames beside its own.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Help {
    /// How many frames a pixel is made of, its own among them: the mean over what is denoised.
    pub frames: f64,
    /// Of each frame before it that helped, nearest first, the mean weight of its pixels: 1 for those that are as good as the frame's own.
    pub before: Vec<f64>,
    /// Of each frame after it, likewise.
    pub after: Vec<f64>,
}

/// Which frame beside a picture's own could not be read.
#[derive(Clone, Debug, Default)]
pub(super) struct Broken(Arc<Mutex<Option<(Place, String)>>>);

/// A place among the frames that help: before or after, and how far away, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Before(usize),
    After(usize),
}

impl Broken {
    fn tell(&self, place: Place, error: &Error) {
        let why = format!("{error}{}", error.causes());
        let mut told = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        told.get_or_insert((place, why));
    }

    /// Takes the frame that broke, and those beyond it, from those that help `pictures`. Whether there was one.
    pub(super) fn leave_out_of(&self, pictures: &mut [Input]) -> bool {
        let mut told = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let Some((place, why)) = told.take() else {
            return false;
        };
        let neighbours = pictures.iter_mut().filter_map(|p| p.neighbours.as_mut());
        for Neighbours {
            before,
            after,
            unused,
            ..
        } in neighbours
        {
            let (side, at) = match place {
                Place::Before(at) => (before, at),
                Place::After(at) => (after, at),
            };
            if let Some(first) = side.drain(at..).next() {
                unused.push(Unused {
                    path: first.path().to_owned(),
                    why: why.clone(),
                });
            }
        }
        true
    }
}

/// The rows of a picture alone, or with the help of frames beside its own.
#[derive(Debug)]
pub(super) enum HelpedRows {
    Alone(Box<ExrSource>),
    Helped(Box<Temporal<FrameRows>>),
}

impl HelpedRows {
    /// Rows of `picture`, worked out as `schedule` says, on so many threads. An error that is of a frame beside its own is told to `broken`. Errors as for [`Input::source`].
    pub(super) fn of(
        picture: &Input,
        limit: u64,
        schedule: Schedule,
        threads: NonZeroUsize,
        broken: &Broken,
    ) -> Result<Self, Error> {
        let neighbours = picture.neighbours.as_ref();
        let Some(Neighbours { before, after, .. }) =
            neighbours.filter(|of| !of.before.is_empty() || !of.after.is_empty())
        else {
            return Ok(Self::Alone(Box::new(picture.source(limit)?)));
        };
        let codec = picture.file().codec();
        let open = |picture: &Input, place| {
            let rows = FrameRows::open(picture, limit, place, broken)?;
            Ok::<_, Error>(match schedule.codes_at_once {
                true => rows,
                false => rows.decoded_by(codec),
            })
        };
        let side = |pictures: &[Input], place: fn(usize) -> Place| {
            let rows = pictures.iter().enumerate();
            rows.map(|(at, picture)| open(picture, Some(place(at))))
                .collect::<Result<Vec<_>, Error>>()
        };
        let own = open(picture, None)?;
        let (before, after) = (side(before, Place::Before)?, side(after, Place::After)?);
        let rows = Temporal::new(own, before, after, threads)?.holding(schedule.rows_held);
        Ok(Self::Helped(Box::new(rows)))
    }

    /// See [`ExrSource::layers_off`].
    pub(super) fn layers_off(&self) -> u64 {
        match self {
            Self::Alone(source) => source.layers_off(),
            Self::Helped(rows) => rows.own().source.layers_off(),
        }
    }

    /// See [`Temporal::weights`].
    pub(super) fn weights(&self) -> [Vec<f64>; 2] {
        match self {
            Self::Alone(_) => Default::default(),
            Self::Helped(rows) => rows.weights(),
        }
    }
}

impl RowSource for HelpedRows {
    fn layout(&self) -> RowLayout {
        match self {
            Self::Alone(source) => source.layout(),
            Self::Helped(rows) => rows.layout(),
        }
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        match self {
            Self::Alone(source) => source.read_row(y, row),
            Self::Helped(rows) => rows.read_row(y, row),
        }
    }
}

/// The rows of a frame, which tells if they cannot be read and it is not the one that is helped.
#[derive(Debug)]
pub(super) struct FrameRows {
    source: ExrSource,
    place: Option<Place>,
    broken: Broken,
}

impl FrameRows {
    fn open(
        picture: &Input,
        limit: u64,
        place: Option<Place>,
        broken: &Broken,
    ) -> Result<Self, Error> {
        let source = match place {
            Some(_) => picture.source_in_sequence(limit),
            None => picture.source_to_help(limit),
        };
        if let (Err(error), Some(place)) = (&source, place) {
            broken.tell(place, error);
        }
        Ok(Self {
            source: source?,
            place,
            broken: broken.clone(),
        })
    }
}

impl FrameRows {
    /// See [`ExrSource::decoded_by`].
    fn decoded_by(self, codec: &SharedCodec) -> Self {
        Self {
            source: self.source.decoded_by(codec),
            ..self
        }
    }
}

impl RowSource for FrameRows {
    fn layout(&self) -> RowLayout {
        self.source.layout()
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        let read = self.source.read_row(y, row);
        if let (Err(error), Some(place)) = (&read, self.place) {
            self.broken.tell(place, error);
        }
        read
    }
}
