//! Finds the noise of what has a role.

use exr::meta::attribute::SampleType;

use super::{Search, in_words, triple};
use crate::channels::names::ChannelRef;
use crate::channels::presets::Role;
use crate::channels::samples::Samples;
use crate::channels::variance::{Meaning, Variance};
use crate::error::{Error, Remedy};

impl Search<'_> {
    pub(super) fn colour_variance(
        &mut self,
        colour: [ChannelRef; 3],
        samples: Option<&Samples>,
    ) -> Result<Variance, Error> {
        if let Some(file) = self.request.other_half {
            return Ok(Variance::OtherFile(self.twins(&colour, file)?));
        }
        let [a, b] = [Role::HalfA, Role::HalfB].map(|role| triple(self.get(role)));
        let halves = a.zip(b).map(|(a, b)| Variance::Halves {
            a: a.to_vec(),
            b: b.to_vec(),
        });
        let by_user = |role| self.get(role).is_some_and(|a| a.by_user);
        if let Some(halves) = &halves
            && by_user(Role::HalfA)
            && !by_user(Role::Variance)
        {
            return Ok(halves.clone());
        }
        let Some(given) = self.get(Role::Variance).cloned() else {
            let unwanted = self.request.map.iter().any(|m| m.role == Role::Variance);
            return Ok(halves.filter(|_| !unwanted).unwrap_or(Variance::None));
        };
        if halves.is_some() {
            self.notes.push("half buffers not used: the given variance is better (theirs has one degree of freedom)".into());
        }
        let channels = triple(Some(&given)).unwrap_or(colour);
        if given.meaning == Meaning::SecondMoment {
            self.refuse_half_moments(&channels, &colour)?;
        }
        let count = samples.map(|s| s.count);
        if given.meaning.needs_count() && count.is_none() {
            return Err(Error::Incomplete {
                problem: format!(
                    "{}: holds the {}, and the file does not state the samples per pixel",
                    self.names.place(channels[0]),
                    given.meaning.stored()
                ),
                remedy: Remedy::SamplesOrNoVariance,
            });
        }
        Ok(Variance::Given {
            meaning: given.meaning,
            channels: channels.to_vec(),
            count,
        })
    }

    /// The same channels in the image of the other half, which has the same data window.
    fn twins(&self, channels: &[ChannelRef], file: usize) -> Result<Vec<ChannelRef>, Error> {
        let window = |at: ChannelRef| self.names.files()[at.file].parts()[at.part].data_window();
        let twin = |&at: &ChannelRef| {
            let twin = self.names.twin(at, file)?;
            match window(twin) == window(at) {
                true => Ok(twin),
                false => Err(Error::Invalid(format!(
                    "{}: its data window is {}, that of the first image {}: both halves must be of one picture in one size",
                    self.names.place(twin),
                    in_words(window(twin)),
                    in_words(window(at))
                ))),
            }
        };
        channels.iter().map(twin).collect()
    }

    fn is_half(&self, at: ChannelRef) -> bool {
        self.names.files()[at.file].parts()[at.part].sample_type(at.channel) == SampleType::F16
    }

    fn refuse_half_moments(
        &self,
        moments: &[ChannelRef],
        means: &[ChannelRef],
    ) -> Result<(), Error> {
        match moments.iter().chain(means).find(|at| self.is_half(**at)) {
            None => Ok(()),
            Some(at) => Err(Error::Incomplete {
                problem: format!(
                    "{} is half precision: the second moment less the squared mean keeps no digit of the variance; render it as float",
                    self.names.place(*at)
                ),
                remedy: Remedy::NoVariance,
            }),
        }
    }

    /// Noise of a feature: unlike the colour's it may be left out, so what is missing is a note.
    pub(super) fn feature_variance(
        &mut self,
        role: Role,
        means: &[ChannelRef],
        samples: Option<&Samples>,
    ) -> Variance {
        if let Some(file) = self.request.other_half {
            return self
                .twins(means, file)
                .map_or(Variance::None, Variance::OtherFile);
        }
        let Some(given) = self.get(role).cloned() else {
            return Variance::None;
        };
        let channels = given.channels;
        if channels.len() != means.len() {
            return Variance::None;
        }
        let count = samples.map(|s| s.count);
        let problem = if given.meaning.needs_count() && count.is_none() {
            Some("the number of samples is not known")
        } else if given.meaning == Meaning::SecondMoment
            && self.refuse_half_moments(&channels, means).is_err()
        {
            Some("second moments in half precision keep no digit of it")
        } else {
            None
        };
        if let Some(problem) = problem {
            self.found.retain(|a| a.role != role);
            self.warnings
                .push(format!("{} not used: {problem}", role.name()));
            return Variance::None;
        }
        Variance::Given {
            meaning: given.meaning,
            channels,
            count,
        }
    }
}
