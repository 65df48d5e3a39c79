//! The rows of a pass, and how many samples are in each of its pixels.

use std::sync::Arc;

use crate::channels::names::ChannelRef;
use crate::channels::roles::in_words;
use crate::channels::variance::{Count, Variance};
use crate::error::Error;
use crate::exr_file::attributes::{MERGED_ATTRIBUTE, VERSION_ATTRIBUTE};
use crate::exr_file::compression::SharedCodec;
use crate::exr_file::{ExrFile, PartRows};
use crate::job::input::Input;
use crate::job::merge::channels::Channels;
use crate::job::request::InputRequest;

/// A pass whose channels have their roles.
#[derive(Debug)]
pub(super) struct Pass {
    pub(super) pictures: Vec<Input>,
    pub(super) channels: Channels,
    /// The fingerprints of the passes that it is made of: its own, unless it was merged.
    pub(super) made_of: Vec<String>,
    fingerprint: u32,
}

impl Pass {
    /// Opens a pass. Errors as for [`Input::open_all`] and [`Channels::of`]; [`Error::Invalid`] for an image that was denoised.
    pub(super) fn open(request: &InputRequest) -> Result<Self, Error> {
        let pictures = Input::open_all(request)?;
        let file = pictures[0].file();
        // it was looked at: from now on one codec decodes all passes in turn
        file.codec().rest();
        let mut parts = file.parts().iter();
        if parts.any(|part| part.attributes.string(VERSION_ATTRIBUTE).is_some()) {
            return Err(Error::Invalid(format!(
                "{} was denoised by linpred: merge what was rendered, and denoise what comes of it",
                file.path().display()
            )));
        }
        let fingerprint = file.fingerprint()?;
        let mut parts = file.parts().iter();
        let merged = parts.find_map(|part| part.attributes.string(MERGED_ATTRIBUTE));
        let made_of = match merged {
            Some(list) => list.split(' ').map(str::to_owned).collect(),
            None => vec![format!("{fingerprint:08x}")],
        };
        Ok(Self {
            channels: Channels::of(&pictures)?,
            made_of,
            fingerprint,
            pictures,
        })
    }

    pub(super) fn file(&self) -> &Arc<ExrFile> {
        self.pictures[0].file()
    }

    pub(super) fn name(&self) -> String {
        self.file().path().display().to_string()
    }

    /// [`Error::Invalid`] if another pass is of another size, or has other channels.
    pub(super) fn check_alike(&self, other: &Self) -> Result<(), Error> {
        let window = |pass: &Self| {
            let at = pass.pictures[0].roles.colour[0];
            pass.file().parts()[at.part].data_window()
        };
        let (own, theirs) = (window(self), window(other));
        if own != theirs {
            return Err(Error::Invalid(format!(
                "{} is {}, {} is {}: passes of one picture have one size",
                self.name(),
                in_words(own),
                other.name(),
                in_words(theirs)
            )));
        }
        let (own, theirs) = (self.file().path(), other.file().path());
        self.channels.check_alike(own, &other.channels, theirs)
    }

    /// What sorts passes, in whatever order they were given.
    pub(super) fn order(&self) -> (u32, std::path::PathBuf) {
        (self.fingerprint, self.file().path().to_owned())
    }

    /// Every channel that is read of the pass.
    pub(super) fn read_channels(&self) -> Vec<ChannelRef> {
        let mut all: Vec<ChannelRef> = self.channels.read().map(|channel| channel.at).collect();
        for (picture, count) in self.pictures.iter().zip(&self.channels.counts) {
            all.extend(picture.roles.colour);
            if let Count::Channel { at, .. } = count {
                all.push(*at);
            }
        }
        all.sort();
        all.dedup();
        all
    }
}

/// The samples of one picture of a pass in the current row.
#[derive(Debug)]
pub(super) struct Samples {
    count: Count,
    colour: [ChannelRef; 3],
    /// The variances of the colour, if a 0 in all of them says that nothing is known.
    unsure: Vec<ChannelRef>,
    /// Of each pixel; 0 where the pass takes no part.
    pub(super) counts: Vec<f32>,
    /// Whether a variance of 0 is none.
    pub(super) unknown: Vec<bool>,
}

/// A pass that is read row by row.
#[derive(Debug)]
pub(super) struct PassRows {
    parts: Vec<Option<PartRows>>,
    pub(super) samples: Vec<Samples>,
    /// Pixels whose samples were lost: their colour or their count is no number.
    pub(super) lost: u64,
}

impl PassRows {
    /// Errors as for [`PartRows::new`].
    pub(super) fn new(pass: &Pass, codec: &SharedCodec, limit: u64) -> Result<Self, Error> {
        let file = pass.file();
        let mut parts: Vec<Option<PartRows>> = Vec::new();
        parts.resize_with(file.parts().len(), || None);
        for at in pass.read_channels() {
            let rows = match &mut parts[at.part] {
                Some(rows) => rows,
                free => free.insert(PartRows::new(file.clone(), codec.clone(), at.part, limit)?),
            };
            rows.keep(at.channel);
        }
        let samples = pass.pictures.iter().zip(&pass.channels.counts);
        Ok(Self {
            parts,
            samples: samples
                .map(|(picture, count)| Samples::new(picture, *count))
                .collect(),
            lost: 0,
        })
    }

    /// Reads row `y` of a channel; integers are rounded to the nearest `f32`.
    pub(super) fn read(&mut self, at: ChannelRef, y: usize, out: &mut [f32]) -> Result<(), Error> {
        self.rows(at).read_row(at.channel, y, out)
    }

    /// Reads the bits of row `y` of a channel that holds integers.
    pub(super) fn read_integers(
        &mut self,
        at: ChannelRef,
        y: usize,
        out: &mut [f32],
    ) -> Result<(), Error> {
        let bits = bytemuck::cast_slice_mut(out);
        self.rows(at).copy_row(at.channel, y, bits)
    }

    fn rows(&mut self, at: ChannelRef) -> &mut PartRows {
        self.parts[at.part]
            .as_mut()
            .expect("the part of every channel that is read was opened")
    }

    /// Counts the samples of the pixels of row `y`; `row` is to work in. A pixel whose colour is not finite takes no part: what its samples were is lost.
    pub(super) fn count(&mut self, y: usize, row: &mut [f32]) -> Result<(), Error> {
        let mut samples = std::mem::take(&mut self.samples);
        let counted = samples
            .iter_mut()
            .try_for_each(|own| own.fill(self, y, row));
        self.samples = samples;
        counted
    }
}

impl Samples {
    fn new(picture: &Input, count: Count) -> Self {
        let width = picture.width();
        let unsure = match &picture.roles.variance {
            Variance::Given { channels, .. } if picture.roles.zero_is_unknown => channels.clone(),
            _ => Vec::new(),
        };
        Self {
            count,
            colour: picture.roles.colour,
            unknown: vec![false; width],
            unsure,
            counts: vec![0.0; width],
        }
    }

    fn fill(&mut self, pass: &mut PassRows, y: usize, row: &mut [f32]) -> Result<(), Error> {
        match self.count {
            Count::Fixed(count) => self.counts.fill(count),
            Count::Channel { at, scale } => {
                pass.read(at, y, &mut self.counts)?;
                if scale != 1.0 {
                    // fractions of whole numbers, which half floats hold but for their rounding
                    self.counts
                        .iter_mut()
                        .for_each(|count| *count = (*count * scale).round());
                }
            }
        }
        // what is no number of samples is taken off with the colours that are none
        for count in &mut self.counts {
            *count = if *count >= 0.0 { *count } else { f32::INFINITY };
        }
        for at in self.colour {
            pass.read(at, y, row)?;
            for (count, value) in self.counts.iter_mut().zip(&*row) {
                if !value.is_finite() && *count > 0.0 {
                    *count = f32::INFINITY;
                }
            }
        }
        for count in &mut self.counts {
            if count.is_infinite() {
                pass.lost += 1;
                *count = 0.0;
            }
        }
        self.unknown.fill(!self.unsure.is_empty());
        for at in &self.unsure {
            pass.read(*at, y, row)?;
            let zeros = row.iter().map(|variance| *variance == 0.0);
            self.unknown
                .iter_mut()
                .zip(zeros)
                .for_each(|(unknown, zero)| *unknown &= zero);
        }
        Ok(())
    }
}
