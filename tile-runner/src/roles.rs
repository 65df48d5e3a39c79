//! Decides which channels play which role, and remembers why.

use exr::meta::attribute::SampleType;

use crate::error::Error;
use crate::names::{ChannelNames, ChannelRef};
use crate::presets::{COMMON, Components, Pattern, Preset, Role, Rule};
use crate::samples::{self, Samples};
use crate::variance::{Meaning, Variance};

/// What the user asked for.
#[derive(Clone, Debug, Default)]
pub struct RoleRequest {
    /// Preset by name; `None` for auto.
    pub preset: Option<&'static Preset>,
    /// `--map` entries in order; a later one wins.
    pub map: Vec<Mapping>,
    /// `--spp`.
    pub spp: Option<u32>,
    /// `--other-half`: the position among the input files of the image from the other half of the samples.
    pub other_half: Option<usize>,
}

/// One `--map role=channel`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mapping {
    /// The role.
    pub role: Role,
    /// What a variance layer holds; [`Meaning::OfMean`] for other roles.
    pub meaning: Meaning,
    /// A layer, a channel, three channels joined by commas, or `none`.
    pub target: String,
}

impl Mapping {
    /// Parses `role=target`. `sample-variance` and `second-moment` are the role `variance` with that meaning, with
    /// `albedo-`, `normal-` or `depth-` before them those of a feature. [`Error::Usage`] otherwise.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let usage = || {
            let roles: Vec<&str> = Role::ALL.iter().map(|role| role.name()).collect();
            Error::Usage(format!(
                "--map {text}: expected role=channel, where role is one of {} (or sample-variance, second-moment)",
                roles.join(", ")
            ))
        };
        let (role, target) = text.split_once('=').ok_or_else(usage)?;
        let (role, meaning) = if let Some(start) = role.strip_suffix("sample-variance") {
            (format!("{start}variance"), Meaning::OfSample)
        } else if let Some(start) = role.strip_suffix("second-moment") {
            (format!("{start}variance"), Meaning::SecondMoment)
        } else {
            (role.replace("color", "colour"), Meaning::OfMean)
        };
        let role = Role::ALL
            .into_iter()
            .find(|known| known.name() == role)
            .ok_or_else(usage)?;
        let target = target.trim().to_owned();
        if target.is_empty() {
            return Err(usage());
        }
        Ok(Self {
            role,
            meaning,
            target,
        })
    }
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
}

/// All roles of an input.
#[derive(Clone, Debug)]
pub struct Roles {
    /// Every assignment, the colour first.
    pub assignments: Vec<Assignment>,
    /// The colour; three times the same channel for a mono image.
    pub colour: [ChannelRef; 3],
    /// Noise of the colour.
    pub variance: Variance<3>,
    /// Albedo and its noise.
    pub albedo: Option<([ChannelRef; 3], Variance<3>)>,
    /// Normal and its noise.
    pub normal: Option<([ChannelRef; 3], Variance<3>)>,
    /// Depth and its noise.
    pub depth: Option<([ChannelRef; 1], Variance<1>)>,
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

    /// Whether the image has one channel.
    pub fn mono(&self) -> bool {
        self.colour[0] == self.colour[1]
    }
}

/// Assigns the roles of file 0 of `names`.
///
/// [`Error::Usage`] when `--map` names a channel that is not there, [`Error::Invalid`] when no colour can be found, a variance
/// needs the number of samples and nothing states it, or second moments are stored in half precision.
pub fn resolve(names: &ChannelNames, request: &RoleRequest) -> Result<Roles, Error> {
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
            presets.push((chosen, format!("--preset {}", chosen.name)));
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

    /// `--map` first, then the presets in order, then, for the colour, what little the file may hold.
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
                    let (channels, which) = self.matched(rule, *pattern)?;
                    let rule = Assignment {
                        role,
                        channels,
                        meaning: rule.meaning,
                        rule: format!("{why}: {which}"),
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

    fn mapped(&self, mapping: &Mapping) -> Result<Assignment, Error> {
        let target = mapping.target.as_str();
        let components = mapping.role.components();
        let joined: Option<Vec<ChannelRef>> = target
            .split(',')
            .map(|name| self.names.channel(0, name.trim()))
            .collect();
        let channels = joined
            .filter(|channels| {
                matches!(
                    (channels.len(), components),
                    (1, Components::Scalar | Components::Colour)
                        | (3, Components::Colour | Components::Vector)
                )
            })
            .or_else(|| self.layer(target, components))
            .ok_or_else(|| self.unknown_target(mapping))?;
        Ok(Assignment {
            role: mapping.role,
            channels,
            meaning: mapping.meaning,
            rule: format!("--map {}={target}", mapping.role.name()),
        })
    }

    fn unknown_target(&self, mapping: &Mapping) -> Error {
        let path = self.names.files()[0].path().display();
        let wanted = match mapping.role.components() {
            Components::Scalar => "a channel, or a layer with a channel",
            Components::Colour => {
                "a layer with channels R G B, a channel, or three channels joined by commas"
            }
            Components::Vector => "a layer with channels X Y Z, or three channels joined by commas",
        };
        Error::Usage(format!(
            "--map {}={}: {path} has no such channel or layer (wanted: {wanted}); its channels are {}",
            mapping.role.name(),
            mapping.target,
            self.all_names()
        ))
    }

    fn all_names(&self) -> String {
        let mut names: Vec<String> = self
            .names
            .in_file(0)
            .map(|name| format!("{:?}", name.full()))
            .collect();
        let count = names.len();
        names.truncate(60);
        if count > names.len() {
            names.push(format!("and {} more", count - names.len()));
        }
        names.join(" ")
    }

    /// The channels of a layer by its exact name, if it has those components.
    fn layer(&self, layer: &str, components: Components) -> Option<Vec<ChannelRef>> {
        if components == Components::Scalar {
            let mut inside = self
                .names
                .in_file(0)
                .filter(|name| name.layer == layer && !layer.is_empty());
            let first = inside.next()?;
            return inside.next().is_none().then(|| vec![first.at]);
        }
        self.names
            .components(0, layer, components.triples())
            .map(Vec::from)
    }

    fn matched(&self, rule: &Rule, pattern: Pattern) -> Option<(Vec<ChannelRef>, String)> {
        let components = rule.role.components();
        match pattern {
            Pattern::Names(three) => {
                let channels: Option<Vec<_>> = three
                    .iter()
                    .map(|name| self.names.channel(0, name))
                    .collect();
                Some((channels?, format!("channels {}", three.join(" "))))
            }
            Pattern::Layer(wanted) => {
                let layer = self.find_layer(rule.role, wanted, components)?;
                Some((layer.1, describe_layer(&layer.0)))
            }
            Pattern::Prefixed(prefix) => {
                let mean = self.get(mean_of(rule.role)?)?;
                let layer = self.layer_of(mean.channels[0]);
                if layer.is_empty() {
                    return None;
                }
                let layer = format!("{prefix}{layer}");
                Some((self.layer(&layer, components)?, describe_layer(&layer)))
            }
            Pattern::PrefixedImage(prefix) => {
                let colour = self.get(Role::Colour)?;
                if !self.layer_of(colour.channels[0]).is_empty() {
                    return None;
                }
                let layer = self.names.layers(0).into_iter().find(|layer| {
                    layer.strip_prefix(prefix).is_some_and(|image| {
                        self.names
                            .components(0, image, &[["R", "G", "B", "A"]])
                            .is_some()
                    })
                })?;
                Some((self.layer(layer, components)?, describe_layer(layer)))
            }
        }
    }

    /// The first layer called `wanted`, or ending in `.wanted`, with these components. Once the colour is known to lie in
    /// `ViewLayer.`, so must the rest: another view layer shows other objects.
    fn find_layer(
        &self,
        role: Role,
        wanted: &str,
        components: Components,
    ) -> Option<(String, Vec<ChannelRef>)> {
        let prefix = self.colour_prefix();
        let mut layers = self.names.layers(0);
        if role != Role::Colour && !prefix.is_empty() {
            layers.retain(|layer| layer.starts_with(prefix) || !layer.contains('.'));
        }
        let called = |layer: &str| {
            layer == wanted
                || (!wanted.is_empty()
                    && layer.ends_with(wanted)
                    && layer[..layer.len() - wanted.len()].ends_with('.'))
        };
        let by_layer = layers
            .iter()
            .filter(|layer| called(layer))
            .find_map(|layer| Some(((*layer).to_owned(), self.layer(layer, components)?)));
        if by_layer.is_some() || components != Components::Scalar {
            return by_layer;
        }
        // a scalar may also be a component of its own (`Z`, `dd.T`), but not that of a vector (`N.Z`)
        layers.iter().find_map(|layer| {
            let inside: Vec<_> = self
                .names
                .in_file(0)
                .filter(|name| name.layer == **layer)
                .collect();
            let vector = inside
                .iter()
                .any(|name| matches!(name.component.as_str(), "X" | "Y" | "x" | "y"));
            let channel = inside
                .iter()
                .find(|name| name.component == wanted && (layer.is_empty() || !vector))?;
            Some((channel.full(), vec![channel.at]))
        })
    }

    /// `ViewLayer.` for a colour in `ViewLayer.Combined`; empty where the colour has no layer above it.
    fn colour_prefix(&self) -> &'a str {
        let Some(colour) = self.get(Role::Colour) else {
            return "";
        };
        let layer = self.layer_of(colour.channels[0]);
        layer.rfind('.').map_or("", |dot| &layer[..=dot])
    }

    fn layer_of(&self, at: ChannelRef) -> &'a str {
        let name = self.names.in_file(0).find(|name| name.at == at);
        name.map_or("", |name| name.layer.as_str())
    }

    /// A colour that no rule names: a luminance, the only channel, or the only layer with red, green and blue.
    fn only_colour(&self) -> Result<Assignment, Error> {
        let assign = |channels, rule: String| Assignment {
            role: Role::Colour,
            channels,
            meaning: Meaning::OfMean,
            rule,
        };
        let file = &self.names.files()[0];
        if let Some((part, refusal)) = file
            .parts()
            .iter()
            .find_map(|part| Some((part, part.refusal.as_ref()?)))
        {
            let (path, label) = (file.path().display(), part.label());
            return Err(Error::Unsupported(format!("{path}: {label}: {refusal}")));
        }
        if self.names.channel(0, "RY").is_some() || self.names.channel(0, "BY").is_some() {
            return Err(Error::Unsupported(format!(
                "{}: luminance with colour differences (channels Y, RY, BY) is not supported",
                file.path().display()
            )));
        }
        if let Some(luminance) = self.names.channel(0, "Y") {
            return Ok(assign(vec![luminance], "the luminance".into()));
        }
        let coloured: Vec<&str> = (self.names.layers(0).into_iter())
            .filter(|layer| self.layer(layer, Components::Colour).is_some())
            .collect();
        if let [only] = coloured[..] {
            let channels = self.layer(only, Components::Colour).unwrap_or_default();
            return Ok(assign(
                channels,
                format!("the only layer with R G B: {}", describe_layer(only)),
            ));
        }
        let mut channels = file
            .parts()
            .iter()
            .flat_map(|part| (0..part.header.channels.list.len()).map(|c| (part.index, c)));
        if let (Some((part, channel)), None) = (channels.next(), channels.next()) {
            return Ok(assign(
                vec![ChannelRef {
                    file: 0,
                    part,
                    channel,
                }],
                "the only channel".into(),
            ));
        }
        let why = if coloured.is_empty() {
            "no colour channels (R G B) found".to_owned()
        } else {
            let layers: Vec<String> = coloured.iter().map(|layer| format!("{layer:?}")).collect();
            format!(
                "which layer is the colour? It may be {}; say --map colour=LAYER",
                layers.join(", ")
            )
        };
        Err(Error::Invalid(format!(
            "{}: {why}; its channels are {}",
            file.path().display(),
            self.all_names()
        )))
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
            if assignment.role == Role::Colour || assignment.rule.starts_with("--map") {
                return Err(Error::Invalid(reason));
            }
            self.notes
                .push(format!("{} not used: {reason}", assignment.role.name()));
        }
        self.found = kept;
        Ok(())
    }

    fn finish(mut self) -> Result<Roles, Error> {
        let colour = triple(self.get(Role::Colour))
            .ok_or_else(|| Error::Usage("--map colour=none leaves nothing to denoise".into()))?;
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
        let count = samples.as_ref();
        let albedo = triple(self.get(Role::Albedo));
        let albedo = albedo.map(|mean| {
            (
                mean,
                self.feature_variance(Role::AlbedoVariance, &mean, count),
            )
        });
        let normal = triple(self.get(Role::Normal));
        let normal = normal.map(|mean| {
            (
                mean,
                self.feature_variance(Role::NormalVariance, &mean, count),
            )
        });
        let depth = self.get(Role::Depth).map(|a| [a.channels[0]]);
        let depth = depth.map(|mean| {
            (
                mean,
                self.feature_variance(Role::DepthVariance, &mean, count),
            )
        });
        Ok(Roles {
            colour,
            variance,
            albedo,
            normal,
            depth,
            samples,
            assignments: self.found,
            notes: self.notes,
        })
    }

    fn colour_variance(
        &mut self,
        colour: [ChannelRef; 3],
        samples: Option<&Samples>,
    ) -> Result<Variance<3>, Error> {
        if let Some(file) = self.request.other_half {
            return Ok(Variance::OtherFile(self.twins(&colour, file)?));
        }
        let halves = triple(self.get(Role::HalfA)).zip(triple(self.get(Role::HalfB)));
        let Some(given) = self.get(Role::Variance).cloned() else {
            let unwanted = self.request.map.iter().any(|m| m.role == Role::Variance);
            return Ok(match halves {
                Some((a, b)) if !unwanted => Variance::Halves { a, b },
                _ => Variance::None,
            });
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
            return Err(Error::Invalid(format!(
                "{}: holds the {}, and the file does not state the samples per pixel: add --spp N, \
                 or --map variance=none to estimate the variance from the picture",
                self.names.place(channels[0]),
                given.meaning.stored()
            )));
        }
        Ok(Variance::Given {
            meaning: given.meaning,
            channels,
            count,
        })
    }

    /// The same channels in the image of the other half, which has the same data window.
    fn twins<const N: usize>(
        &self,
        channels: &[ChannelRef; N],
        file: usize,
    ) -> Result<[ChannelRef; N], Error> {
        let mut twins = *channels;
        for (twin, &at) in twins.iter_mut().zip(channels) {
            *twin = self.names.twin(at, file)?;
            let window =
                |at: ChannelRef| self.names.files()[at.file].parts()[at.part].data_window();
            if window(*twin) != window(at) {
                return Err(Error::Invalid(format!(
                    "{}: its data window {:?} is not {:?}, that of the first image",
                    self.names.place(*twin),
                    window(*twin),
                    window(at)
                )));
            }
        }
        Ok(twins)
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
            Some(at) => Err(Error::Invalid(format!(
                "{} is half precision: the second moment less the squared mean keeps no digit of \
                 the variance; render it as float, or add --map variance=none to estimate the \
                 variance from the picture",
                self.names.place(*at)
            ))),
        }
    }

    /// Noise of a feature: unlike the colour's it may be left out, so what is missing is a note.
    fn feature_variance<const N: usize>(
        &mut self,
        role: Role,
        means: &[ChannelRef; N],
        samples: Option<&Samples>,
    ) -> Variance<N> {
        if let Some(file) = self.request.other_half {
            return self
                .twins(means, file)
                .map_or(Variance::None, Variance::OtherFile);
        }
        let Some(given) = self.get(role).cloned() else {
            return Variance::None;
        };
        let Ok(channels) = <[ChannelRef; N]>::try_from(given.channels) else {
            return Variance::None;
        };
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
            self.notes
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

fn describe_layer(layer: &str) -> String {
    if layer.is_empty() {
        "bare names".into()
    } else {
        format!("{layer:?}")
    }
}

/// The role whose noise a role is.
fn mean_of(role: Role) -> Option<Role> {
    match role {
        Role::Variance => Some(Role::Colour),
        Role::AlbedoVariance => Some(Role::Albedo),
        Role::NormalVariance => Some(Role::Normal),
        Role::DepthVariance => Some(Role::Depth),
        _ => None,
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
