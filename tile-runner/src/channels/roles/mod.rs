//! Decides which channels play which role, and remembers why.

mod feature_request;
mod further;
mod further_noise;
pub(crate) mod layers;
mod mapping;
mod search;
mod variances;

pub use feature_request::{FeatureRequest, NamedFeature};
pub use mapping::Mapping;
pub(crate) use search::is_noise;

use std::sync::Arc;

use exr::meta::attribute::IntegerBounds;
use linpred_core::Feature;

use crate::channels::motion::Axes;
use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::presets::{COMMON, Preset, Role};
use crate::channels::samples::{self, Samples};
use crate::channels::variance::{Meaning, Variance};
use crate::error::{Error, Setting};
use crate::exr_file::ExrFile;
use crate::exr_file::attributes::{NOISE_ATTRIBUTE, VERSION_ATTRIBUTE};

/// What the user asked for.
#[derive(Clone, Debug, Default)]
pub struct RoleRequest {
    /// Preset by name; `None` for auto.
    pub preset: Option<&'static Preset>,
    /// Roles given to channels; a later one wins.
    pub map: Vec<Mapping>,
    /// Features beside normal, albedo and depth, in the order in which they come into the models.
    pub features: Vec<FeatureRequest>,
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
    /// One channel, two or three; red green blue, or x y z.
    pub channels: Vec<ChannelRef>,
    /// What they hold, for variances.
    pub meaning: Meaning,
    /// 1, or -1 for a channel that counts the other way than ours do, for motion vectors.
    pub signs: [f32; 2],
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

/// A feature beside normal, albedo and depth, and its noise.
#[derive(Clone, Debug, PartialEq)]
pub struct FurtherChannels {
    /// The name of its layer, or of its channel.
    pub name: String,
    /// One to three channels, which belong together.
    pub channels: Vec<ChannelRef>,
    /// Noise of each.
    pub variance: Variance,
}

/// All roles of a picture.
#[derive(Clone, Debug)]
pub struct Roles {
    /// Every assignment, the colour first.
    pub assignments: Vec<Assignment>,
    /// The colour; three times the same channel for a mono image.
    pub colour: [ChannelRef; 3],
    /// The channels that the denoised colour goes into: its own, or those that the renderer's own denoiser writes.
    pub target: [ChannelRef; 3],
    /// The alpha, if the colour has one.
    pub alpha: Option<ChannelRef>,
    /// The channel that the denoised alpha goes into.
    pub alpha_target: Option<ChannelRef>,
    /// Noise of the colour.
    pub variance: Variance,
    /// Whether a variance of 0 says that nothing is known of the noise, and not that there is none.
    pub zero_is_unknown: bool,
    /// The features that the image has.
    pub features: Vec<FeatureChannels>,
    /// Those beside them that are asked for.
    pub further: Vec<FurtherChannels>,
    /// The layers that could be further features, by what the renderer is known to write.
    pub offered: Vec<String>,
    /// Samples per pixel, if anything says.
    pub samples: Option<Samples>,
    /// What stands before the names of the picture's layers: that of a view layer and a dot, or nothing.
    pub prefix: String,
    /// The view that the picture is of, in a file with several.
    pub view: Option<Arc<str>>,
    /// What was left aside, and why.
    pub notes: Vec<String>,
    /// What a user should know: what cannot be used although it is there.
    pub warnings: Vec<String>,
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

    /// What tells the picture from others of its file: `view "right"`, `view layer "Back"`. Empty in a file with one.
    pub fn label(&self) -> String {
        let layer = self.prefix.trim_end_matches('.');
        let layer = (!layer.is_empty()).then(|| format!("view layer {layer:?}"));
        let view = self.view.as_ref().map(|view| format!("view {view:?}"));
        let words: Vec<String> = layer.into_iter().chain(view).collect();
        words.join(", ")
    }
}

/// Assigns the roles of the pictures of file 0 of `names`: of each of its views, and in each of its view layers, which see only their own channels. The
/// first is that which is shown by default. Where the user maps the colour it is the only one.
///
/// [`Error::Setting`] when a channel of [`RoleRequest::map`] is not there; [`Error::Invalid`] when there is no colour; [`Error::Incomplete`] when it may be one of
/// several, when a variance needs the number of samples and nothing states it, or when second moments are stored in half precision.
pub(crate) fn resolve(
    names: &ChannelNames,
    request: &RoleRequest,
) -> Result<Vec<(ChannelNames, Roles)>, Error> {
    let mapped = request.map.iter().rev().find(|m| m.role == Role::Colour);
    let only = match mapped.filter(|mapping| mapping.target != "none") {
        Some(mapping) => {
            let colour = Search::new(names, request, None).mapped(mapping)?;
            names.view(colour.channels[0])
        }
        None => None,
    };
    let views: Vec<Option<Arc<str>>> = match (&only, names.views()) {
        (None, []) => vec![None],
        (None, [first, ..]) if mapped.is_some() => vec![Some(first.clone())],
        (None, all) => all.iter().cloned().map(Some).collect(),
        (Some(_), _) => vec![only],
    };
    let mut pictures = Vec::new();
    let mut failures = Vec::new();
    for view in views {
        let own = view
            .as_ref()
            .map_or_else(|| names.clone(), |view| names.of_view(view));
        match resolve_view(&own, request, view.as_ref()) {
            Ok(found) => pictures.extend(found.into_iter().map(|roles| (own.clone(), roles))),
            // an eye without what the other has would look otherwise
            Err(Error::Setting {
                setting: setting @ Setting::Feature,
                value,
                problem,
            }) => {
                let view = view.map_or_else(String::new, |view| format!("in view {view:?} "));
                return Err(Error::Setting {
                    setting,
                    value,
                    problem: format!("{view}{problem}"),
                });
            }
            Err(error) => failures.push((view, error)),
        }
    }
    let mut failures = failures.into_iter();
    let Some((_, first)) = pictures.first_mut() else {
        let (_, error) = failures
            .next()
            .expect("there is a view, or none, that failed");
        return Err(error);
    };
    first.warnings.extend(failures.map(|(view, error)| {
        format!(
            "view {:?} stays noisy: {error}",
            view.as_deref().unwrap_or_default()
        )
    }));
    Ok(pictures)
}

/// The pictures of a view: one, or one of each view layer.
fn resolve_view(
    names: &ChannelNames,
    request: &RoleRequest,
    view: Option<&Arc<str>>,
) -> Result<Vec<Roles>, Error> {
    let mut search = Search::new(names, request, None);
    search.assign(Role::Colour)?;
    let prefixes = search
        .get(Role::Colour)
        .and_then(|colour| search.prefixes(colour));
    let prefixes = prefixes.map_or_else(|| vec![None], |all| all.into_iter().map(Some).collect());
    let picture = |prefix: Option<String>| {
        let mut search = Search::new(names, request, prefix);
        for role in Role::ALL {
            search.assign(role)?;
        }
        search.check_windows()?;
        search.finish(view.cloned())
    };
    prefixes.into_iter().map(picture).collect()
}

struct Search<'a> {
    names: &'a ChannelNames,
    request: &'a RoleRequest,
    presets: Vec<(&'static Preset, String)>,
    /// What must stand before the colour's layer, once that is known.
    prefix: Option<String>,
    /// Channels that tell of the noise of what an earlier run has denoised.
    outdated: Vec<String>,
    found: Vec<Assignment>,
    notes: Vec<String>,
    warnings: Vec<String>,
}

impl<'a> Search<'a> {
    fn new(names: &'a ChannelNames, request: &'a RoleRequest, prefix: Option<String>) -> Self {
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
        let blender = Preset::named("blender").filter(|_| presets.is_empty());
        let is_cycles = |layer: &&str| {
            let layer = layer.rsplit('.').next().unwrap_or(layer);
            layer == "Noisy Image" || layer.starts_with("Denoising ")
        };
        if let Some(blender) = blender
            && names.layers(0).iter().any(is_cycles)
        {
            presets.push((
                blender,
                "preset blender (by the names of its layers)".into(),
            ));
        }
        presets.push((&COMMON, COMMON.name.to_owned()));
        Self {
            names,
            request,
            presets,
            prefix,
            outdated: outdated(file),
            found: Vec::new(),
            notes: Vec::new(),
            warnings: Vec::new(),
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
        let (ruled, refused) = self.ruled(role);
        // what stands in for a layer that is there is worth a word, and what nothing stands in for more
        if let Some(refused) = refused {
            self.warn(role, refused);
        }
        match ruled {
            Some(assignment) => self.found.push(assignment),
            None if role == Role::Colour => {
                let assignment = self.only_colour()?;
                self.found.push(assignment);
            }
            None => {
                let alpha = self.colours_alpha().filter(|_| role == Role::Alpha);
                self.found.extend(alpha);
            }
        }
        Ok(())
    }

    /// Warns of channels in a role; of those that a frame alone does not read there is only a note.
    fn warn(&mut self, role: Role, problem: String) {
        match role.is_of_motion() {
            true => self.notes.push(problem),
            false => self.warnings.push(problem),
        }
    }

    /// What the presets' rules find for a role, and why what they would rather have cannot be used.
    fn ruled(&self, role: Role) -> (Option<Assignment>, Option<String>) {
        let mut refused = None;
        for (preset, why) in &self.presets {
            let rules = preset.rules.iter().filter(|rule| rule.role == role);
            let own_names = role.is_of_motion() && rules.clone().next().is_some();
            for (rule, pattern) in
                rules.flat_map(|rule| rule.patterns.iter().map(move |p| (rule, *p)))
            {
                let Some((channels, which)) = self.matched(rule, pattern) else {
                    continue;
                };
                if channels.iter().any(|at| self.is_outdated(*at)) {
                    continue;
                }
                if let Some(at) = self.undecodable(&channels) {
                    refused.get_or_insert_with(|| self.not_used(role, at));
                    continue;
                }
                let assignment = Assignment {
                    role,
                    channels,
                    meaning: rule.meaning,
                    signs: rule.axes.signs,
                    rule: format!("{why}: {which}"),
                    by_user: false,
                };
                return (Some(assignment), refused);
            }
            // what other renderers call a position is in another space in this one
            if own_names {
                break;
            }
        }
        (None, refused)
    }

    fn is_outdated(&self, at: ChannelRef) -> bool {
        !self.outdated.is_empty() && self.outdated.contains(&self.names.name(at))
    }

    /// Why a channel that would have a role has none.
    fn not_used(&self, role: Role, at: ChannelRef) -> String {
        let part = &self.names.files()[at.file].parts()[at.part];
        let reason = part.refusal.as_ref().map(ToString::to_string);
        let (role, name) = (role.name(), self.names.name(at));
        let (label, reason) = (part.label(), reason.unwrap_or_default());
        format!("{role} {name:?} not used: {label}: {reason}")
    }

    /// The alpha of the colour's layer.
    fn colours_alpha(&self) -> Option<Assignment> {
        let channels = &self.get(Role::Colour)?.channels;
        let colour = channels[0];
        let alpha = self.alpha_of(self.layer_of(colour), colour);
        let alpha = alpha.filter(|alpha| !channels.contains(alpha))?;
        Some(Assignment {
            role: Role::Alpha,
            channels: vec![alpha],
            meaning: Meaning::OfMean,
            signs: Axes::OURS.signs,
            rule: "of the colour's layer".into(),
            by_user: false,
        })
    }

    /// A colour's channels and its alpha must be of one data window. What else has another is used where it is, unless that is nowhere in the colour's.
    fn check_windows(&mut self) -> Result<(), Error> {
        let files = self.names.files();
        let window = |at: ChannelRef| files[at.file].parts()[at.part].data_window();
        let Some(colour) = self.get(Role::Colour).map(|a| window(a.channels[0])) else {
            return Ok(());
        };
        let mut kept = Vec::new();
        for assignment in std::mem::take(&mut self.found) {
            let odd = assignment.channels.iter().find(|at| window(**at) != colour);
            let Some(&odd) = odd else {
                kept.push(assignment);
                continue;
            };
            let own = window(odd);
            let differs = other_window(self.names, odd, colour);
            let role = assignment.role;
            let overlaps = overlap(own, colour);
            if matches!(role, Role::Colour | Role::Alpha) || (assignment.by_user && !overlaps) {
                return Err(Error::Invalid(differs));
            }
            if overlaps {
                if !own.contains(colour) {
                    let problem = format!("{} is not known everywhere: {differs}", role.name());
                    self.warn(role, problem);
                }
                kept.push(assignment);
            } else {
                self.warn(role, format!("{} not used: {differs}", role.name()));
            }
        }
        self.found = kept;
        Ok(())
    }

    fn finish(mut self, view: Option<Arc<str>>) -> Result<Roles, Error> {
        let colour = triple(self.get(Role::Colour)).ok_or_else(|| Error::Setting {
            setting: Setting::Map,
            value: "colour=none".into(),
            problem: "leaves nothing to denoise".into(),
        })?;
        if let Some(alpha) = self.get(Role::Alpha)
            && colour.contains(&alpha.channels[0])
        {
            return Err(Error::Setting {
                setting: Setting::Map,
                value: format!("alpha={}", self.names.name(alpha.channels[0])),
                problem: "is a channel of the colour".into(),
            });
        }
        let names = self.names;
        let file = &names.files()[0];
        let parts = [&file.parts()[colour[0].part], &file.parts()[0]];
        let samples = samples::find(
            self.request.spp,
            self.get(Role::Samples).map(|a| a.channels[0]),
            names,
            &parts,
            self.colour_prefix(),
        );
        let variance = self.colour_variance(colour, samples.as_ref())?;
        let features = Feature::ALL.into_iter();
        let features = features
            .filter_map(|feature| self.feature(feature, samples.as_ref()))
            .collect();
        let offered = self.offered();
        let further = self.further(samples.as_ref())?;
        let given = matches!(variance, Variance::Given { .. });
        let zero_is_unknown = given && self.presets.iter().any(|(p, _)| p.zero_is_unknown);
        let alpha = self.get(Role::Alpha).map(|alpha| alpha.channels[0]);
        let (target, alpha_target) = match self.shown(colour[0]) {
            None => (colour, alpha),
            Some((shown, layer)) => {
                let own = self.alpha_of(&layer, colour[0]);
                (shown, alpha.and(own))
            }
        };
        Ok(Roles {
            colour,
            target,
            alpha: alpha.filter(|_| alpha_target.is_some()),
            alpha_target,
            prefix: self.colour_prefix().to_owned(),
            view,
            variance,
            zero_is_unknown,
            features,
            further,
            offered,
            samples,
            assignments: self.found,
            notes: self.notes,
            warnings: already_denoised(&names.files()[0])
                .into_iter()
                .chain(self.warnings)
                .collect(),
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

/// The channels that an output of linpred says to be of its input's noise.
fn outdated(file: &ExrFile) -> Vec<String> {
    let parts = file.parts().iter();
    let marks = parts.filter_map(|part| part.attributes.string(NOISE_ATTRIBUTE));
    let mut names: Vec<String> = Vec::new();
    for name in marks.flat_map(|names| names.split(", ")) {
        if !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    }
    names
}

/// Says that a file is an output of linpred already.
fn already_denoised(file: &ExrFile) -> Option<String> {
    let mut versions = file
        .parts()
        .iter()
        .filter_map(|part| part.attributes.string(VERSION_ATTRIBUTE));
    let version = versions.next()?;
    let outdated = outdated(file);
    let noise = match outdated.is_empty() {
        true => String::new(),
        false => format!(
            "; {} are not used, for they tell of the noise that it had",
            outdated.join(" ")
        ),
    };
    Some(format!(
        "was denoised by linpred {version} already: denoise what was rendered, not the result{noise}"
    ))
}

/// Says that a channel has another data window than the colour, whose window is `colour`.
fn other_window(names: &ChannelNames, at: ChannelRef, colour: IntegerBounds) -> String {
    let own = names.files()[at.file].parts()[at.part].data_window();
    format!(
        "{}: its data window is {}, the colour's {}",
        names.place(at),
        in_words(own),
        in_words(colour)
    )
}

/// A data window for people.
pub(crate) fn in_words(window: IntegerBounds) -> String {
    let (size, corner) = (window.size, window.position);
    format!(
        "{} x {} pixels at ({}, {})",
        size.0, size.1, corner.0, corner.1
    )
}

/// Whether two windows have a pixel in common.
fn overlap(one: IntegerBounds, other: IntegerBounds) -> bool {
    let apart = |a: i32, length: usize, b: i32, other: usize| {
        let (a, b) = (i64::from(a), i64::from(b));
        a + length as i64 <= b || b + other as i64 <= a
    };
    let ((x, y), (u, v)) = (one.position.into(), other.position.into());
    !apart(x, one.size.0, u, other.size.0) && !apart(y, one.size.1, v, other.size.1)
}

/// Three channels; a single one stands for all three.
fn triple(assignment: Option<&Assignment>) -> Option<[ChannelRef; 3]> {
    match assignment?.channels[..] {
        [one] => Some([one; 3]),
        [a, b, c] => Some([a, b, c]),
        _ => None,
    }
}
