//! Finds the features beside normal, albedo and depth that are asked for.

use exr::meta::attribute::SampleType;

use super::search::above;
use super::{FeatureRequest, FurtherChannels, NamedFeature, Search};
use crate::channels::identifiers::{Cryptomattes, is_identifier, is_integer};
use crate::channels::names::ChannelRef;
use crate::channels::presets::{Components, MOMENT, Role};
use crate::channels::samples::Samples;
use crate::channels::variance::{Meaning, Variance};
use crate::error::{Error, Setting};
use crate::further::{FEATURE_CHANNELS, FurtherFeatures};

/// How renderers call the variance of a layer, by what stands before and after its name, and what it holds.
const VARIANCES: [(&str, &str, Meaning); 6] = [
    ("", "Variance", Meaning::OfMean),
    ("", " Variance", Meaning::OfMean),
    ("", "_variance", Meaning::OfMean),
    ("", "_mse", Meaning::OfMean),
    ("", "_var", Meaning::OfSample),
    (MOMENT, "", Meaning::SecondMoment),
];

/// Layers of a file that a message names.
const NAMED_LAYERS: usize = 40;

impl Search<'_> {
    /// The further features that are asked for, once all else has its role. What an automatic choice has no room for is a note.
    ///
    /// [`Error::Setting`] if one is not there, cannot be one, or does not fit.
    pub(super) fn further(
        &mut self,
        samples: Option<&Samples>,
    ) -> Result<Vec<FurtherChannels>, Error> {
        let mut all = Vec::new();
        let request = self.request;
        for wanted in &request.features {
            if let FeatureRequest::Named(named) = wanted
                && let Some(feature) = self.named_feature(named, samples)?
            {
                self.check_further(&feature, &all)?;
                all.push(feature);
            }
        }
        if request.features.contains(&FeatureRequest::Auto) {
            for feature in self.known_further(samples) {
                match self.check_further(&feature, &all) {
                    Ok(()) => all.push(feature),
                    Err(error) => self.notes.push(error.to_string()),
                }
            }
        }
        Ok(all)
    }

    /// Names of what the renderer is known to write beside the features that have roles, as far as the picture has it.
    pub(super) fn offered(&self) -> Vec<String> {
        let found = self.known_further_names().into_iter();
        found.map(|(name, _)| name).collect()
    }

    fn known_further(&mut self, samples: Option<&Samples>) -> Vec<FurtherChannels> {
        let found = self.known_further_names().into_iter();
        let feature = |(name, channels): (String, Vec<ChannelRef>)| {
            let variance = self.further_variance(&channels, samples);
            FurtherChannels {
                name,
                channels,
                variance,
            }
        };
        found.map(feature).collect()
    }

    fn known_further_names(&self) -> Vec<(String, Vec<ChannelRef>)> {
        let names = self.presets.iter().flat_map(|(preset, _)| preset.further);
        let mut found: Vec<(String, Vec<ChannelRef>)> = Vec::new();
        for name in names {
            let Some((name, channels)) = self.channels_called(name) else {
                continue;
            };
            let taken = self.found.iter().filter(|a| !a.role.is_of_motion());
            let mut taken = taken.flat_map(|a| &a.channels);
            let known = found.iter().any(|(_, own)| *own == channels);
            let fits = channels.len() <= FEATURE_CHANNELS && self.decodable(&channels);
            if fits && !known && !taken.any(|at| channels.contains(at)) {
                found.push((name, channels));
            }
        }
        found
    }

    /// The channels of the layer, or else the channel, that is called so in the picture's own view layer, and its whole name.
    fn channels_called(&self, wanted: &str) -> Option<(String, Vec<ChannelRef>)> {
        let prefix = self.colour_prefix();
        let foreign = |name: &str| {
            let beside = name
                .strip_prefix(prefix)
                .is_some_and(|own| !own.contains('.'));
            !prefix.is_empty() && name.contains('.') && !beside
        };
        let names = [format!("{prefix}{wanted}"), wanted.to_owned()];
        names.into_iter().find_map(|name| {
            let channels = self.channels_of_layer(&name);
            if !channels.is_empty() {
                return (!foreign(&name)).then_some((name, channels));
            }
            let at = self.names.channel(0, &name)?;
            let layer = name.rsplit_once('.').map_or("", |(layer, _)| layer);
            (!foreign(layer)).then_some((name, vec![at]))
        })
    }

    /// The channels of a layer: those of a colour or a vector in their order and without an alpha, else all as they come.
    fn channels_of_layer(&self, layer: &str) -> Vec<ChannelRef> {
        let mut all: Vec<ChannelRef> = Vec::new();
        let inside = self.names.in_file(0).filter(|name| name.layer == layer);
        let mut alpha = None;
        for name in inside.filter(|_| !layer.is_empty()) {
            if !all.contains(&name.at) {
                all.push(name.at);
                if name.component.eq_ignore_ascii_case("a") {
                    alpha = Some(name.at);
                }
            }
        }
        let triple = self
            .names
            .components(0, layer, Components::Vector.triples());
        let triple = triple.filter(|triple| {
            let beside = all.iter().find(|at| !triple.contains(at));
            all.len() == triple.len() || (all.len() == triple.len() + 1 && beside == alpha.as_ref())
        });
        triple.map_or(all, Vec::from)
    }

    /// The feature that is meant; `None` if another view layer than the picture's has it.
    fn named_feature(
        &mut self,
        wanted: &NamedFeature,
        samples: Option<&Samples>,
    ) -> Result<Option<FurtherChannels>, Error> {
        let Some((name, all)) = self.channels_called(&wanted.name) else {
            let called = |own: &str| own == wanted.name || above(own, &wanted.name).is_some();
            let mut names = self.names.in_file(0);
            if names.any(|own| called(&own.layer) || called(&own.full())) {
                let problem = "is that of another view layer".into();
                self.notes.push(refused(&wanted.name, problem).to_string());
                return Ok(None);
            }
            return Err(refused(&wanted.name, self.not_there()));
        };
        let mut channels = all;
        if !wanted.channels.is_empty() {
            let own = |component: &String| {
                let mut inside = self.names.in_file(0).filter(|own| own.layer == name);
                let own = inside.find(|own| own.component.eq_ignore_ascii_case(component));
                own.map(|own| own.at).ok_or_else(|| {
                    let problem = format!(
                        "has no channel {component:?}; it has {}",
                        self.in_words(&channels)
                    );
                    refused(&wanted.name, problem)
                })
            };
            channels = wanted.channels.iter().map(own).collect::<Result<_, _>>()?;
        }
        let variance = match &wanted.variance {
            Some(variance) => self.stated_variance(wanted, variance, &channels)?,
            None => self.further_variance(&channels, samples),
        };
        Ok(Some(FurtherChannels {
            name,
            channels,
            variance,
        }))
    }

    fn not_there(&self) -> String {
        let path = self.names.files()[0].path().display();
        let mut layers: Vec<String> = Vec::new();
        for name in self.names.in_file(0) {
            let own = match name.layer.is_empty() {
                true => name.full(),
                false => name.layer.clone(),
            };
            if !layers.contains(&own) {
                layers.push(own);
            }
        }
        let more = layers.len().saturating_sub(NAMED_LAYERS);
        layers.truncate(NAMED_LAYERS);
        let more = match more {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        format!(
            "{path} has no such layer or channel; it has {}{more}",
            layers.join(", ")
        )
    }

    fn in_words(&self, channels: &[ChannelRef]) -> String {
        let names: Vec<String> = channels.iter().map(|at| self.names.name(*at)).collect();
        names.join(", ")
    }

    /// Whether a feature can be one beside `others`.
    fn check_further(
        &self,
        feature: &FurtherChannels,
        others: &[FurtherChannels],
    ) -> Result<(), Error> {
        let FurtherChannels { name, channels, .. } = feature;
        let refuse = |problem: String| Err(refused(name, problem));
        if channels.len() > FEATURE_CHANNELS {
            return refuse(format!(
                "has {} channels ({}), and a feature {FEATURE_CHANNELS} at most: choose some of them, as in {name}:{}",
                channels.len(),
                self.in_words(channels),
                self.component(channels[0]),
            ));
        }
        for at in channels {
            self.check_channel(name, *at, others)?;
        }
        let twice = |k: usize| channels[..k].contains(&channels[k]);
        if (1..channels.len()).any(twice) {
            return refuse("names a channel twice".into());
        }
        let lengths = others.iter().map(|other| other.channels.len());
        let mut lengths = lengths.chain([channels.len()]);
        let fits = lengths.try_fold(FurtherFeatures::default(), FurtherFeatures::with);
        match fits {
            Ok(_) => Ok(()),
            Err(error) => {
                let others: Vec<&str> = others.iter().map(|other| other.name.as_str()).collect();
                let others = others.join(", ");
                refuse(format!("does not fit beside {others}: {error}"))
            }
        }
    }

    /// Whether a channel can be one of a feature.
    fn check_channel(
        &self,
        feature: &str,
        at: ChannelRef,
        others: &[FurtherChannels],
    ) -> Result<(), Error> {
        let name = self.names.name(at);
        let refuse = |problem: String| Err(refused(feature, problem));
        let roles = [Role::Colour, Role::Normal, Role::Albedo, Role::Depth];
        let role = roles.into_iter().find(|role| {
            let own = self.get(*role);
            own.is_some_and(|own| own.channels.contains(&at))
        });
        match role {
            Some(Role::Colour) => {
                return refuse(format!(
                    "{name} is the colour itself, which no model may see"
                ));
            }
            Some(role) => {
                let role = role.name();
                return refuse(format!("{name} is the {role} already: leave it out"));
            }
            None => {}
        }
        if others.iter().any(|other| other.channels.contains(&at)) {
            return refuse(format!("{name} is a feature already: name it once"));
        }
        let file = &self.names.files()[at.file];
        let layer = name.rsplit_once('.').map_or("", |(layer, _)| layer);
        if is_integer(file, at) || is_identifier(&name) || Cryptomattes::of(file).has(layer) {
            return refuse(format!(
                "{name} holds identifiers, between which there is nothing"
            ));
        }
        if let Some(refusal) = &file.parts()[at.part].refusal {
            return refuse(format!("{name} cannot be read: {refusal}"));
        }
        Ok(())
    }

    /// What stands after the last dot of a channel's name.
    fn component(&self, at: ChannelRef) -> String {
        let name = self.names.in_file(0).find(|name| name.at == at);
        name.map_or_else(String::new, |name| name.component.clone())
    }

    /// The variance of the mean that is said to be in these channels or in this layer.
    fn stated_variance(
        &self,
        feature: &NamedFeature,
        target: &str,
        means: &[ChannelRef],
    ) -> Result<Variance, Error> {
        let joined = target
            .split(',')
            .map(|own| self.names.channel(0, own.trim()));
        let joined: Option<Vec<ChannelRef>> = joined.collect();
        let joined = joined.filter(|channels| channels.len() == means.len());
        let channels = joined.or_else(|| {
            let (layer, all) = self.channels_called(target)?;
            self.beside(&layer, means)
                .or_else(|| (all.len() == means.len()).then_some(all))
        });
        let channels = channels.ok_or_else(|| {
            let path = self.names.files()[0].path().display();
            let (count, of) = (means.len(), self.in_words(means));
            let problem =
                format!("{path} has no {count} channels {target} for the variance of {of}");
            refused(&feature.name, problem)
        })?;
        Ok(Variance::Given {
            meaning: Meaning::OfMean,
            channels,
            count: None,
        })
    }

    /// The channels of a layer whose components are called as those of the means, or its only one for a single mean.
    fn beside(&self, layer: &str, means: &[ChannelRef]) -> Option<Vec<ChannelRef>> {
        let all = self.channels_of_layer(layer);
        let own = |mean: &ChannelRef| {
            let component = self.component(*mean);
            let mut all = all.iter();
            all.find(|at| self.component(**at) == component).copied()
        };
        let alike: Option<Vec<ChannelRef>> = means.iter().map(own).collect();
        alike.or_else(|| (all.len() == 1 && means.len() == 1).then_some(all))
    }

    /// The variance of a feature's channels by what renderers call it, or [`Variance::None`]: then it is estimated.
    fn further_variance(&mut self, means: &[ChannelRef], samples: Option<&Samples>) -> Variance {
        if let Some(file) = self.request.other_half {
            let twins = means.iter().map(|at| self.names.twin(*at, file));
            let twins: Result<Vec<ChannelRef>, Error> = twins.collect();
            return twins.map_or(Variance::None, Variance::OtherFile);
        }
        let count = samples.map(|samples| samples.count);
        let own = self.layer_of(means[0]).to_owned();
        let stem = match own.is_empty() {
            true => self.component(means[0]),
            false => own,
        };
        for (before, after, meaning) in VARIANCES {
            let name = format!("{before}{stem}{after}");
            let single = || {
                (means.len() == 1)
                    .then(|| self.names.channel(0, &name))
                    .flatten()
            };
            let channels = self
                .beside(&name, means)
                .or_else(|| single().map(|at| vec![at]));
            let Some(channels) = channels.filter(|channels| self.decodable(channels)) else {
                continue;
            };
            let half = |at: &ChannelRef| {
                let part = &self.names.files()[at.file].parts()[at.part];
                part.sample_type(at.channel) == SampleType::F16
            };
            let problem = if meaning.needs_count() && count.is_none() {
                Some("the number of samples is not known")
            } else if meaning == Meaning::SecondMoment && channels.iter().chain(means).any(half) {
                Some("second moments in half precision keep no digit of it")
            } else {
                None
            };
            match problem {
                Some(problem) => self.warnings.push(format!("{name} not used: {problem}")),
                None => {
                    return Variance::Given {
                        meaning,
                        channels,
                        count,
                    };
                }
            }
        }
        Variance::None
    }
}

fn refused(feature: &str, problem: String) -> Error {
    Error::Setting {
        setting: Setting::Feature,
        value: feature.to_owned(),
        problem,
    }
}
