//! Decides which channels play which role, and remembers why.

pub(crate) mod layers;
mod mapping;
mod search;
mod variances;

pub use mapping::Mapping;

use linpred_core::Feature;

use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::presets::{COMMON, Preset, Role};
use crate::channels::samples::{self, Samples};
use crate::channels::variance::{Meaning, Variance};
use crate::error::{Error, Setting};

/// What the user asked for.
#[derive(Clone, Debug, Default)]
pub struct RoleRequest {
    /// Preset by name; `None` for auto.
    pub preset: Option<&'static Preset>,
    /// Roles given to channels; a later one wins.
    pub map: Vec<Mapping>,
    /// Samples per pixel, whatever the file says.
    pub spp: Option<u32>,
    /// The position among the input files of the image from the other half of the samples.
    pub other_half: Option<usize>,
}

/// Channels in a role, and the rule that chose them.
#[derive(Clone, Debug, PartialEq)]
pub struct Assignment {
    /// The role.
    pub role: Role,
    /// One channel, or three; red green blue, or x y z.
    pub channels: Vec<ChannelRef>,
    /// What they hold, for variances.
    pub meaning: Meaning,
    /// Why these.
    pub rule: String,
    /// Whether the user mapped them.
    pub by_user: bool,
}

/// The channels of a feature, and its noise.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureChannels {
    /// Which feature.
    pub feature: Feature,
    /// As many as it has.
    pub channels: Vec<ChannelRef>,
    /// Noise of each.
    pub variance: Variance,
}

/// All roles of an input.
#[derive(Clone, Debug)]
pub struct Roles {
    /// Every assignment, the colour first.
    pub assignments: Vec<Assignment>,
    /// The colour; three times the same channel for a mono image.
    pub colour: [ChannelRef; 3],
    /// Noise of the colour.
    pub variance: Variance,
    /// The features that the image has.
    pub features: Vec<FeatureChannels>,
    /// Samples per pixel, if anything says.
    pub samples: Option<Samples>,
    /// What was left aside, and why.
    pub notes: Vec<String>,
}

impl Roles {
    /// The assignment of a role.
    pub fn assignment(&self, role: Role) -> Option<&Assignment> {
        self.assignments.iter().find(|a| a.role == role)
    }

    /// The channels of a feature; `None` if the image lacks it.
    pub fn feature(&self, feature: Feature) -> Option<&FeatureChannels> {
        self.features.iter().find(|found| found.feature == feature)
    }

    /// Whether the image has one channel.
    pub fn mono(&self) -> bool {
        self.colour[0] == self.colour[1]
    }
}

/// Assigns the roles of file 0 of `names`.
///
/// [`Error::Setting`] when a channel of [`RoleRequest::map`] is not there; [`Error::Invalid`] when there is no colour; [`Error::Incomplete`] when it may be one of
/// several, when a variance needs the number of samples and nothing states it, or when second moments are stored in half precision.
pub(crate) fn resolve(names: &ChannelNames, request: &RoleRequest) -> Result<Roles, Error> {
    let mut search = Search::new(names, request);
    for role in Role::ALL {
        search.assign(role)?;
    }
    search.drop_odd_sizes()?;
    search.finish()
}

struct Search<'a> {
    names: &'a ChannelNames,
    request: &'a RoleRequest,
    presets: Vec<(&'static Preset, String)>,
    found: Vec<Assignment>,
    notes: Vec<String>,
}

impl<'a> Search<'a> {
    fn new(names: &'a ChannelNames, request: &'a RoleRequest) -> Self {
        let file = &names.files()[0];
        let mut presets = Vec::new();
        if let Some(chosen) = request.preset {
            presets.push((chosen, format!("chosen preset {}", chosen.name)));
        } else if let Some(seen) = file
            .parts()
            .iter()
            .find_map(|part| Preset::detect(&part.attributes))
        {
            presets.push((
                seen,
                format!("preset {} (by the header's attributes)", seen.name),
            ));
        }
        presets.push((&COMMON, COMMON.name.to_owned()));
        Self {
            names,
            request,
            presets,
            found: Vec::new(),
            notes: Vec::new(),
        }
    }

    fn get(&self, role: Role) -> Option<&Assignment> {
        self.found.iter().find(|a| a.role == role)
    }

    /// What the user mapped first, then the presets in order, then, for the colour, what little the file may hold.
    fn assign(&mut self, role: Role) -> Result<(), Error> {
        if let Some(mapping) = self.request.map.iter().rev().find(|m| m.role == role) {
            if mapping.target != "none" {
                let assignment = self.mapped(mapping)?;
                self.found.push(assignment);
            }
            return Ok(());
        }
        let ruled = self.presets.iter().find_map(|(preset, why)| {
            let rules = preset.rules.iter().filter(|rule| rule.role == role);
            rules
                .flat_map(|rule| rule.patterns.iter().map(move |pattern| (rule, pattern)))
                .find_map(|(rule, pattern)| {
                    let (channels, which) = self
                        .matched(rule, *pattern)
                        .filter(|(channels, _)| self.decodable(channels))?;
                    let rule = Assignment {
                        role,
                        channels,
                        meaning: rule.meaning,
                        rule: format!("{why}: {which}"),
                        by_user: false,
                    };
                    Some(rule)
                })
        });
        match ruled {
            Some(assignment) => self.found.push(assignment),
            None if role == Role::Colour => {
                let assignment = self.only_colour()?;
                self.found.push(assignment);
            }
            None => {}
        }
        Ok(())
    }

    /// Channels must be of the colour's data window. Those that a rule chose are dropped with a note, those that the user
    /// chose are an error.
    fn drop_odd_sizes(&mut self) -> Result<(), Error> {
        let files = self.names.files();
        let window = |at: ChannelRef| files[at.file].parts()[at.part].data_window();
        let Some(colour) = self.get(Role::Colour).map(|a| window(a.channels[0])) else {
            return Ok(());
        };
        let mut kept = Vec::new();
        for assignment in std::mem::take(&mut self.found) {
            let Some(odd) = assignment.channels.iter().find(|at| window(**at) != colour) else {
                kept.push(assignment);
                continue;
            };
            let place = self.names.place(*odd);
            let reason = format!(
                "{place}: its data window {:?} is not the colour's, {colour:?}",
                window(*odd)
            );
            if assignment.role == Role::Colour || assignment.by_user {
                return Err(Error::Invalid(reason));
            }
            self.notes
                .push(format!("{} not used: {reason}", assignment.role.name()));
        }
        self.found = kept;
        Ok(())
    }

    fn finish(mut self) -> Result<Roles, Error> {
        let colour = triple(self.get(Role::Colour)).ok_or_else(|| Error::Setting {
            setting: Setting::Map,
            value: "colour=none".into(),
            problem: "leaves nothing to denoise".into(),
        })?;
        let names = self.names;
        let file = &names.files()[0];
        let parts = [&file.parts()[colour[0].part], &file.parts()[0]];
        let samples = samples::find(
            self.request.spp,
            self.get(Role::Samples).map(|a| a.channels[0]),
            names,
            &parts,
        );
        let variance = self.colour_variance(colour, samples.as_ref())?;
        let features = Feature::ALL.into_iter();
        let features = features
            .filter_map(|feature| self.feature(feature, samples.as_ref()))
            .collect();
        Ok(Roles {
            colour,
            variance,
            features,
            samples,
            assignments: self.found,
            notes: self.notes,
        })
    }
}

impl Search<'_> {
    /// The channels of a feature; where it has three, a single one stands for all.
    fn feature(&mut self, feature: Feature, samples: Option<&Samples>) -> Option<FeatureChannels> {
        let [role, noise] = Role::of(feature);
        let assignment = self.get(role);
        let channels = match feature.channels() {
            [_] => vec![assignment?.channels[0]],
            _ => triple(assignment)?.to_vec(),
        };
        let variance = self.feature_variance(noise, &channels, samples);
        Some(FeatureChannels {
            feature,
            channels,
            variance,
        })
    }
}

/// Three channels; a single one stands for all three.
fn triple(assignment: Option<&Assignment>) -> Option<[ChannelRef; 3]> {
    match assignment?.channels[..] {
        [one] => Some([one; 3]),
        [a, b, c] => Some([a, b, c]),
        _ => None,
    }
}
