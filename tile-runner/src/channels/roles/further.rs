//! Finds the features beside normal, albedo and depth that are asked for.

use super::search::above;
use super::{FeatureRequest, FurtherChannels, NamedFeature, Search};
use crate::channels::identifiers::{Cryptomattes, is_identifier, is_integer};
use crate::channels::names::ChannelRef;
use crate::channels::presets::{Components, MOMENT, Role};
use crate::channels::samples::Samples;
use crate::error::{Error, Setting};
use crate::further::{FEATURE_CHANNELS, FurtherFeatures};

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
            let known = self.known_further(samples);
            if known.is_empty() {
                let none = "nothing that the presets know is in this file: see what `linpred inspect` lists, and give it by its name";
                self.notes.push(refused("auto", none.into()).to_string());
            }
            for feature in known {
                let is_asked_for = |other: &FurtherChannels| {
                    let mut own = feature.channels.iter();
                    own.any(|at| other.channels.contains(at))
                };
                if all.iter().any(is_asked_for) {
                    continue;
                }
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

    /// The channels of the layer, or else the channel, that is called so in the picture's own view layer, and its whole name. Where the colour stands in no view layer, what
    /// ends in the name after a dot is called so, too: a part's name or an integrator's stands before.
    pub(super) fn channels_called(&self, wanted: &str) -> Option<(String, Vec<ChannelRef>)> {
        let prefix = self.colour_prefix();
        let foreign = |name: &str| {
            let beside = name
                .strip_prefix(prefix)
                .is_some_and(|own| !own.contains('.'));
            !prefix.is_empty() && name.contains('.') && !beside
        };
        let mut names = vec![format!("{prefix}{wanted}"), wanted.to_owned()];
        if prefix.is_empty() {
            let below = |name: &&str| !name.starts_with(MOMENT) && above(name, wanted).is_some();
            let layers = self.names.layers(0).into_iter().filter(below);
            names.extend(layers.map(str::to_owned));
            let channels = self.names.in_file(0).map(|own| own.full());
            names.extend(channels.filter(|name| below(&name.as_str())));
        }
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
    pub(super) fn channels_of_layer(&self, layer: &str) -> Vec<ChannelRef> {
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
        let whole = wanted.whole_names().into_iter();
        let mut whole = whole.filter(|own| self.channels_called(&own.name).is_some());
        let whole = whole.next();
        let wanted = whole.as_ref().unwrap_or(wanted);
        let Some((name, all)) = self.channels_called(&wanted.name) else {
            let called = |own: &str| own == wanted.name || above(own, &wanted.name).is_some();
            let mut names = self.names.in_file(0);
            if names.any(|own| called(&own.layer) || called(&own.full())) {
                let problem = "is that of another view layer: this one is denoised without it";
                let problem = refused(&wanted.name, problem.into()).to_string();
                self.warnings.push(problem);
                return Ok(None);
            }
            return Err(refused(&wanted.to_string(), self.not_there(&wanted.name)));
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

    fn not_there(&self, wanted: &str) -> String {
        let path = self.names.files()[0].path().display();
        let mut layers: Vec<String> = Vec::new();
        let mut named: Vec<ChannelRef> = Vec::new();
        for name in self.names.in_file(0) {
            // a channel of a part with a name has two, the shorter first
            if named.contains(&name.at) {
                continue;
            }
            named.push(name.at);
            let own = match name.layer.is_empty() {
                true => name.full(),
                false => name.layer.clone(),
            };
            if !layers.contains(&own) {
                layers.push(own);
            }
        }
        let alike = layers.iter().find(|own| own.eq_ignore_ascii_case(wanted));
        let hint = match alike {
            Some(alike) => format!(" (did you mean {alike}?)"),
            None if wanted.contains([',', '*', '?']) => {
                " (one layer or channel for each time that the option is given)".into()
            }
            None => String::new(),
        };
        let more = layers.len().saturating_sub(NAMED_LAYERS);
        layers.truncate(NAMED_LAYERS);
        let more = match more {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        format!(
            "{path} has no such layer or channel{hint}; it has {}{more}",
            layers.join(", ")
        )
    }

    pub(super) fn in_words(&self, channels: &[ChannelRef]) -> String {
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
        let roles = [
            Role::Colour,
            Role::Normal,
            Role::Albedo,
            Role::Depth,
            Role::Variance,
            Role::HalfA,
            Role::HalfB,
        ];
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
            Some(role @ (Role::Variance | Role::HalfA | Role::HalfB)) => {
                let role = role.name();
                return refuse(format!(
                    "{name} is the {role} of the colour and has its noise, which a model that sees it predicts"
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
    pub(super) fn component(&self, at: ChannelRef) -> String {
        let name = self.names.in_file(0).find(|name| name.at == at);
        name.map_or_else(String::new, |name| name.component.clone())
    }
}

pub(super) fn refused(feature: &str, problem: String) -> Error {
    Error::Setting {
        setting: Setting::Feature,
        value: feature.to_owned(),
        problem,
    }
}
