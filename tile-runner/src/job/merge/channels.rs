//! What becomes of each channel of the passes.

use std::collections::BTreeMap;

use crate::channels::identifiers::{Cryptomattes, is_identifier, is_integer};
use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::presets::{MOMENT, Role};
use crate::channels::roles::is_noise;
use crate::channels::samples::is_fraction;
use crate::channels::variance::{Count, Meaning, Variance};
use crate::error::{Error, Remedy};
use crate::exr_file::Part;
use crate::exr_file::header::Refusal;
use crate::job::input::Input;

/// How a channel is merged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The mean of all samples.
    Mean,
    /// The mean of their squares.
    Moment,
    /// The noise of the [`Mean`](Self::Mean) at this position of the list of channels.
    Noise {
        of: usize,
        /// The variance of the mean, or that of one sample.
        meaning: Meaning,
    },
    /// As it is in the pass with the most samples: no arithmetic may touch it.
    Identifier { integer: bool },
    /// How many samples there are. Not read here: passes may state them elsewhere.
    Samples,
}

impl Kind {
    /// What it holds, for messages.
    fn in_words(self) -> &'static str {
        match self {
            Self::Mean => "a mean",
            Self::Moment => Meaning::SecondMoment.stored(),
            Self::Noise { meaning, .. } => meaning.stored(),
            Self::Identifier { integer: true } => "integers",
            Self::Identifier { integer: false } => "identifiers",
            Self::Samples => "a number of samples",
        }
    }
}

/// A channel of the output.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    /// Where it is in the pass; for [`Kind::Samples`] its part is that of the colour.
    pub(super) at: ChannelRef,
    /// Its name in its part.
    pub(super) name: String,
    /// Its name with its layer, by which passes are compared.
    pub(super) full: String,
    pub(super) kind: Kind,
    /// The picture whose samples it is made of.
    pub(super) picture: usize,
    /// The part that it is alone in, if it has one of its own.
    pub(super) own_part: Option<String>,
}

/// What is merged of a pass.
#[derive(Debug)]
pub(super) struct Channels {
    pub(super) list: Vec<Channel>,
    /// The samples of each picture.
    pub(super) counts: Vec<Count>,
    /// What a user should know of what is left out.
    pub(super) notes: Vec<String>,
}

impl Channels {
    /// The channels of a pass with these pictures, at least one.
    ///
    /// [`Error::Incomplete`] if it does not state its samples per pixel, [`Error::Unsupported`] if a part has another data window than the colour.
    pub(super) fn of(pictures: &[Input]) -> Result<Self, Error> {
        let mut found = Self {
            list: Vec::new(),
            counts: pictures.iter().map(count).collect::<Result<_, Error>>()?,
            notes: Vec::new(),
        };
        let file = pictures[0].file();
        let read = Reading::new(pictures);
        let mut noise = Vec::new();
        for part in file.parts() {
            if part.refusal == Some(Refusal::Deep) {
                let label = part.label();
                found.notes.push(format!("{label} is deep: left out"));
                continue;
            }
            check_window(&pictures[0], part)?;
            for channel in 0..part.header.channels.list.len() {
                let at = ChannelRef {
                    file: 0,
                    part: part.index,
                    channel,
                };
                match read.kind(at) {
                    Some(kind) => found.list.push(read.channel(at, kind)),
                    None if !read.samples.contains(&at) => noise.push(at),
                    None => {}
                }
            }
        }
        noise.into_iter().for_each(|at| found.add_noise(&read, at));
        for (index, picture) in pictures.iter().enumerate() {
            let samples = samples_channel(picture, index, pictures.len());
            let known = |own: &Channel| own.kind == Kind::Samples && own.full == samples.full;
            if !found.list.iter().any(known) {
                found.list.push(samples);
            }
        }
        Ok(found)
    }

    /// Adds the noise of a channel that has been added, or says why it is left out.
    fn add_noise(&mut self, read: &Reading<'_>, at: ChannelRef) {
        let mean = |mean: ChannelRef| {
            let is_it = |channel: &Channel| channel.at == mean && channel.kind == Kind::Mean;
            self.list.iter().position(is_it)
        };
        let known = read.noise.get(&at);
        match known.and_then(|(of, meaning, _)| Some((mean(*of)?, *meaning))) {
            Some((of, meaning)) => {
                self.list.push(read.channel(at, Kind::Noise { of, meaning }));
            }
            None => self.notes.push(format!(
                "channel {:?} is called as a variance is, and has no role that says of what: left out",
                read.names().name(at)
            )),
        }
    }

    /// Those that are read of every pass; the samples may be stated in other ways.
    pub(super) fn read(&self) -> impl Iterator<Item = &Channel> {
        let read = |channel: &&Channel| channel.kind != Kind::Samples;
        self.list.iter().filter(read)
    }

    /// [`Error::Invalid`] if the channels of another pass, of the file `other`, are not these, of the file `own`.
    pub(super) fn check_alike(
        &self,
        own: &std::path::Path,
        theirs: &Self,
        other: &std::path::Path,
    ) -> Result<(), Error> {
        let missing = |from: &Self, of: &Self| {
            let has = |name: &str| from.read().any(|channel| channel.full == name);
            let lost = of.read().find(|channel| !has(&channel.full));
            lost.map(|channel| channel.full.clone())
        };
        let (own, other) = (own.display(), other.display());
        for (path, has_it, name) in [
            (&other, &own, missing(theirs, self)),
            (&own, &other, missing(self, theirs)),
        ] {
            if let Some(name) = name {
                return Err(Error::Invalid(format!(
                    "{path} has no channel {name:?}, which {has_it} has: passes of one picture hold the same channels"
                )));
            }
        }
        let mut pairs = self.read().zip(theirs.read());
        let odd = pairs.find(|(a, b)| (&a.full, a.kind) != (&b.full, b.kind));
        match odd {
            None => Ok(()),
            Some((a, b)) => Err(Error::Invalid(format!(
                "channel {:?} of {own} holds {}, channel {:?} of {other} {}: passes of one picture hold the same",
                a.full,
                a.kind.in_words(),
                b.full,
                b.kind.in_words()
            ))),
        }
    }
}

/// What the roles of a pass say of its channels.
struct Reading<'a> {
    pictures: &'a [Input],
    cryptomattes: Cryptomattes,
    /// The mean of each noise, what that holds, and the picture.
    noise: BTreeMap<ChannelRef, (ChannelRef, Meaning, usize)>,
    /// Channels that hold samples per pixel.
    samples: Vec<ChannelRef>,
}

impl<'a> Reading<'a> {
    fn new(pictures: &'a [Input]) -> Self {
        let mut noise = BTreeMap::new();
        for (index, Input { roles, .. }) in pictures.iter().enumerate() {
            let mut add = |means: &[ChannelRef], variance: &Variance| {
                if let Variance::Given {
                    meaning, channels, ..
                } = variance
                {
                    for (mean, at) in means.iter().zip(channels) {
                        noise.entry(*at).or_insert((*mean, *meaning, index));
                    }
                }
            };
            add(&roles.colour, &roles.variance);
            for feature in &roles.features {
                add(&feature.channels, &feature.variance);
            }
            for feature in &roles.further {
                add(&feature.channels, &feature.variance);
            }
        }
        let samples = pictures.iter();
        let samples = samples
            .flat_map(|picture| samples_at(picture, pictures.len()))
            .collect();
        Self {
            pictures,
            cryptomattes: Cryptomattes::of(pictures[0].file()),
            noise,
            samples,
        }
    }

    fn names(&self) -> &ChannelNames {
        &self.pictures[0].names
    }

    /// How a channel is merged; `None` if it is noise or holds samples per pixel.
    fn kind(&self, at: ChannelRef) -> Option<Kind> {
        let full = self.names().name(at);
        let layer = full.rsplit_once('.').map_or("", |(layer, _)| layer);
        if self.samples.contains(&at) {
            return None;
        }
        let integer = is_integer(self.pictures[0].file(), at);
        if integer || is_identifier(&full) || self.cryptomattes.has(layer) {
            return Some(Kind::Identifier { integer });
        }
        match self.noise.get(&at) {
            Some((_, Meaning::SecondMoment, _)) => Some(Kind::Moment),
            Some(_) => None,
            None if full.starts_with(MOMENT) => Some(Kind::Moment),
            None if is_noise(&full) => None,
            None => Some(Kind::Mean),
        }
    }

    fn channel(&self, at: ChannelRef, kind: Kind) -> Channel {
        let full = self.names().name(at);
        let picture = match self.noise.get(&at) {
            Some((_, _, picture)) => *picture,
            None => self.picture(at, &full),
        };
        Channel {
            at,
            name: self.names().files()[0].parts()[at.part].channel_name(at.channel),
            full,
            kind,
            picture,
            own_part: None,
        }
    }

    /// The picture that a channel is of: of those whose view has it that in whose view layer it lies, or else the first.
    fn picture(&self, at: ChannelRef, full: &str) -> usize {
        let seen = |picture: &Input| picture.names.in_file(0).any(|name| name.at == at);
        let pictures = self.pictures.iter().enumerate();
        let seeing: Vec<_> = pictures.filter(|(_, picture)| seen(picture)).collect();
        let inside = |picture: &Input| {
            let prefix = &picture.roles.prefix;
            !prefix.is_empty() && full.starts_with(prefix.as_str())
        };
        let own = seeing.iter().find(|(_, picture)| inside(picture));
        own.or(seeing.first()).map_or(0, |(index, _)| *index)
    }
}

/// The channels that hold the samples per pixel of a picture, one of several, whether they are read or the request says otherwise; and one that is called as the output's.
fn samples_at(picture: &Input, pictures: usize) -> Vec<ChannelRef> {
    let assigned = picture.roles.assignment(Role::Samples);
    let mut all = assigned.map_or_else(Vec::new, |found| found.channels.clone());
    let ours = samples_channel(picture, 0, pictures);
    let part = &picture.file().parts()[ours.at.part];
    let channel = part.channel(&ours.name).filter(|_| ours.own_part.is_none());
    all.extend(channel.map(|channel| ChannelRef { channel, ..ours.at }));
    all
}

/// The samples per pixel that a picture states.
fn count(picture: &Input) -> Result<Count, Error> {
    let incomplete = |what: String| {
        let label = picture.roles.label();
        let colon = if label.is_empty() { "" } else { ": " };
        Error::Incomplete {
            problem: format!(
                "{}{colon}{label}: {what}, by which passes are weighed",
                picture.path().display()
            ),
            remedy: Remedy::Samples,
        }
    };
    match picture.roles.samples.as_ref().map(|samples| samples.count) {
        None => Err(incomplete("does not state the samples per pixel".into())),
        Some(Count::Channel { at, scale: 1.0 }) if is_fraction(&picture.names.name(at)) => {
            Err(incomplete(format!(
                "{:?} holds fractions, and nothing states the samples per pixel",
                picture.names.name(at)
            )))
        }
        Some(count) => Ok(count),
    }
}

/// Where the output states the samples of a picture: in the channel that states them in the pass, unless that holds fractions of a total; or in a new one, beside the colour, in
/// a file of several parts in a part of its own, whose name lookups understand.
fn samples_channel(picture: &Input, index: usize, pictures: usize) -> Channel {
    let names = &picture.names;
    let whole = match picture.roles.samples.as_ref().map(|samples| samples.count) {
        Some(Count::Channel { at, .. }) if !is_fraction(&names.name(at)) => Some(at),
        _ => None,
    };
    let channel = |at: ChannelRef, name: String, full: String, own_part| Channel {
        at,
        name,
        full,
        kind: Kind::Samples,
        picture: index,
        own_part,
    };
    let parts = names.files()[0].parts();
    if let Some(at) = whole {
        let name = parts[at.part].channel_name(at.channel);
        return channel(at, name, names.name(at), None);
    }
    let at = picture.roles.colour[0];
    let view = picture.roles.view.as_ref().filter(|_| pictures > 1);
    let view = view.map_or(String::new(), |view| format!("{view}."));
    let layer = format!("{}{view}sampleCount", picture.roles.prefix);
    if parts.len() > 1 {
        return channel(at, "X".into(), format!("{layer}.X"), Some(layer));
    }
    // a layer of its own keeps it apart from those of other view layers
    let name = match picture.roles.prefix.is_empty() {
        true => layer,
        false => format!("{layer}.X"),
    };
    channel(at, name.clone(), name, None)
}

/// Samples are counted at the colour's pixels, so that all there is to merge lies in its data window.
fn check_window(picture: &Input, part: &Part) -> Result<(), Error> {
    let file = picture.file();
    let colour = &file.parts()[picture.roles.colour[0].part];
    match part.data_window() == colour.data_window() {
        true => Ok(()),
        false => Err(Error::Unsupported(format!(
            "{}: {} has another data window than the colour in {}: passes are merged whose parts have one",
            file.path().display(),
            part.label(),
            colour.label()
        ))),
    }
}
