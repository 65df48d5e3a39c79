//! Finds the layer that a rule or the user means.

use super::{Assignment, Mapping, Search};
use crate::channels::identifiers::is_identifier;
use crate::channels::motion::Axes;
use crate::channels::names::{ChannelRef, is_no_picture};
use crate::channels::presets::{Components, MOMENT, Pattern, Preset, Role, Rule};
use crate::channels::variance::Meaning;
use crate::error::{Error, Remedy, Setting};

impl<'a> Search<'a> {
    pub(super) fn mapped(&self, mapping: &Mapping) -> Result<Assignment, Error> {
        let target = mapping.target.as_str();
        let components = mapping.role.components();
        if components == Components::Pair {
            return self.mapped_vector(mapping);
        }
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
            signs: Axes::OURS.signs,
            rule: format!("mapped to {target}"),
            by_user: true,
        })
    }

    /// A motion vector: two channels, or a layer with X and Y. What has a minus before it counts the other way than ours: `vel.X,-vel.Y` is up.
    fn mapped_vector(&self, mapping: &Mapping) -> Result<Assignment, Error> {
        let target = mapping.target.as_str();
        let signed = |name: &str| {
            let name = name.trim();
            let turned = name.strip_prefix('-');
            let turned = turned.and_then(|name| Some((self.names.channel(0, name)?, -1.0)));
            let plain = self.names.channel(0, name).map(|at| (at, 1.0));
            plain.or(turned)
        };
        let joined: Option<Vec<(ChannelRef, f32)>> = target.split(',').map(signed).collect();
        let found = match joined.as_deref() {
            Some(&[(x, right), (y, down)]) => Some((vec![x, y], [right, down])),
            _ => {
                let layer = self.vector(target, Axes::OURS);
                layer.map(|channels| (channels, Axes::OURS.signs))
            }
        };
        let (channels, signs) = found.ok_or_else(|| self.unknown_target(mapping))?;
        Ok(Assignment {
            role: mapping.role,
            channels,
            meaning: mapping.meaning,
            signs,
            rule: format!("mapped to {target}"),
            by_user: true,
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
            Components::Pair => {
                "a layer with channels X Y, or two channels joined by a comma, with a minus before one that counts to the left or up"
            }
        };
        let target = mapping.target.as_str();
        let inside = self.names.in_file(0).filter(|name| name.layer == target);
        let inside: Vec<String> = inside.map(|name| format!("{:?}", name.full())).collect();
        let known = self.names.channel(0, target);
        let problem = if !inside.is_empty() && !target.is_empty() {
            format!(
                "is a layer of {path} with the channels {}; wanted is {wanted}",
                inside.join(" ")
            )
        } else if let Some(at) = known {
            let layer = self.layer_of(at);
            let of = if layer.is_empty() {
                String::new()
            } else {
                format!(" of the layer {layer:?}")
            };
            format!("is one channel{of} of {path}; wanted is {wanted}")
        } else {
            format!(
                "{path} has no such channel or layer (wanted: {wanted}); its channels are {}",
                self.all_names()
            )
        };
        Error::Setting {
            setting: Setting::Map,
            value: format!("{}={}", mapping.role.name(), mapping.target),
            problem,
        }
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

    /// The channels of a layer that are a motion vector by these axes.
    fn vector(&self, layer: &str, axes: Axes) -> Option<Vec<ChannelRef>> {
        let channels = self.names.components(0, layer, axes.components);
        channels.map(Vec::from)
    }

    /// The channels of a layer that a rule takes.
    fn ruled_channels(&self, rule: &Rule, layer: &str) -> Option<Vec<ChannelRef>> {
        match rule.role.components() {
            Components::Pair => self.vector(layer, rule.axes),
            components => self.layer(layer, components),
        }
    }

    pub(super) fn matched(
        &self,
        rule: &Rule,
        pattern: Pattern,
    ) -> Option<(Vec<ChannelRef>, String)> {
        let components = rule.role.components();
        match pattern {
            Pattern::Layer(wanted) => {
                let layer = self.find_layer(rule, wanted)?;
                Some((layer.1, describe_layer(&layer.0)))
            }
            Pattern::Prefixed(prefix) => {
                let mean = self.get(rule.role.mean()?)?;
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
    fn find_layer(&self, rule: &Rule, wanted: &str) -> Option<(String, Vec<ChannelRef>)> {
        let role = rule.role;
        let components = role.components();
        let prefix = match (role, &self.prefix) {
            (Role::Colour, prefix) => prefix.as_deref().unwrap_or_default(),
            _ => self.colour_prefix(),
        };
        let mut layers = self.names.layers(0);
        layers.retain(|layer| !layer.starts_with(MOMENT));
        if !prefix.is_empty() {
            let beside = |layer: &str| {
                layer
                    .strip_prefix(prefix)
                    .is_some_and(|own| !own.contains('.'))
            };
            layers.retain(|layer| beside(layer) || (role != Role::Colour && !layer.contains('.')));
        }
        let called = |layer: &str| layer == wanted || above(layer, wanted).is_some();
        let by_layer = layers
            .iter()
            .filter(|layer| called(layer))
            .find_map(|layer| Some(((*layer).to_owned(), self.ruled_channels(rule, layer)?)));
        if by_layer.is_some() || components != Components::Scalar {
            return by_layer;
        }
        // a scalar may also be a component of its own (`Z`, `dd.T`), but not that of a vector (`N.Z`) or of a noise (`ZVariance.Z`)
        layers.retain(|layer| role.mean().is_some() || !is_noise(layer));
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

    /// What stands before the layers of the pictures that are called as `colour` is: the view layers of a Blender file. `None` where a colour has
    /// nothing above it.
    pub(super) fn prefixes(&self, colour: &Assignment) -> Option<Vec<String>> {
        let layer = self.layer_of(colour.channels[0]);
        let own = layer.rsplit_once('.').filter(|_| !colour.by_user)?.1;
        let patterns = |preset: &Preset| {
            let rules = preset.rules.iter().filter(|rule| rule.role == Role::Colour);
            let patterns: Vec<Pattern> = rules.flat_map(|rule| rule.patterns).copied().collect();
            patterns
        };
        let presets = self.presets.iter().map(|(preset, _)| *preset);
        let mut presets = presets.filter(|preset| patterns(preset).iter().any(|p| p.is(own)));
        let preset = presets.next()?;
        let alike: Vec<Pattern> = match preset.shown {
            Some(_) => patterns(preset),
            None => patterns(preset).into_iter().filter(|p| p.is(own)).collect(),
        };
        let mut prefixes: Vec<String> = Vec::new();
        for layer in self.names.layers(0) {
            let found = alike.iter().find_map(|pattern| match pattern {
                Pattern::Layer(wanted) => above(layer, wanted),
                _ => None,
            });
            if let Some(prefix) = found
                && !prefixes.iter().any(|known| known == prefix)
                && self.layer(layer, Components::Colour).is_some()
            {
                prefixes.push(prefix.to_owned());
            }
        }
        (!prefixes.is_empty()).then_some(prefixes)
    }

    /// The layer that people look at beside the colour's, if the renderer has one and it is not that.
    pub(super) fn shown(&self, colour: ChannelRef) -> Option<([ChannelRef; 3], String)> {
        let assignment = self.get(Role::Colour).filter(|colour| !colour.by_user)?;
        let prefix = self.colour_prefix();
        let shown = self.presets.iter().find_map(|(preset, _)| preset.shown)?;
        let layer = format!("{prefix}{shown}");
        let channels = self
            .names
            .components(0, &layer, Components::Colour.triples())?;
        let part = |at: ChannelRef| &self.names.files()[at.file].parts()[at.part];
        let alike = channels
            .iter()
            .all(|&at| part(at).data_window() == part(colour).data_window());
        let other = channels[..] != assignment.channels[..];
        (alike && other && self.decodable(&channels)).then_some((channels, layer))
    }

    /// The alpha of the layer of these channels: a component of it in the same data window.
    pub(super) fn alpha_of(&self, layer: &str, colour: ChannelRef) -> Option<ChannelRef> {
        let mut inside = self.names.in_file(0).filter(|name| name.layer == layer);
        let alpha =
            inside.find(|name| ["a", "alpha"].contains(&&*name.component.to_lowercase()))?;
        let part = |at: ChannelRef| &self.names.files()[at.file].parts()[at.part];
        let alike = part(alpha.at).data_window() == part(colour).data_window();
        (alike && part(alpha.at).refusal.is_none()).then_some(alpha.at)
    }

    /// `ViewLayer.` for a colour in `ViewLayer.Combined`; empty where the colour has no layer above it.
    pub(super) fn colour_prefix(&self) -> &'a str {
        let Some(colour) = self.get(Role::Colour) else {
            return "";
        };
        let layer = self.layer_of(colour.channels[0]);
        layer.rfind('.').map_or("", |dot| &layer[..=dot])
    }

    pub(super) fn layer_of(&self, at: ChannelRef) -> &'a str {
        let name = self.names.in_file(0).find(|name| name.at == at);
        name.map_or("", |name| name.layer.as_str())
    }

    /// Whether the parts that these channels lie in can be decoded.
    pub(super) fn decodable(&self, channels: &[ChannelRef]) -> bool {
        self.undecodable(channels).is_none()
    }

    /// The first of these channels that cannot be decoded.
    pub(super) fn undecodable(&self, channels: &[ChannelRef]) -> Option<ChannelRef> {
        let part = |at: ChannelRef| &self.names.files()[at.file].parts()[at.part];
        let mut channels = channels.iter().copied();
        channels.find(|&at| part(at).refusal.is_some())
    }

    /// A colour that no rule names: a luminance, the only layer with red, green and blue, or the only channel.
    pub(super) fn only_colour(&self) -> Result<Assignment, Error> {
        self.refuse_colour_differences()?;
        let luminance = self.luminance().map(|at| vec![at]);
        if let Some(luminance) = luminance.filter(|at| self.decodable(at)) {
            return Ok(colour(luminance, "the luminance".into()));
        }
        let coloured = self.decodable_colours();
        if let [(name, channels)] = &coloured[..] {
            let rule = format!("the only layer with R G B: {}", describe_layer(name));
            return Ok(colour(channels.clone(), rule));
        }
        if let Some(only) = self.only_channel().filter(|at| self.decodable(at)) {
            return Ok(colour(only, "the only channel".into()));
        }
        Err(self.no_colour(&coloured))
    }

    /// A bare `Y` that is no component of a vector: no `X` stands beside it.
    fn luminance(&self) -> Option<ChannelRef> {
        let at = self.names.channel(0, "Y")?;
        let vector = self.names.in_file(0).any(|name| {
            (name.at.part, name.component.as_str()) == (at.part, "X") && name.layer.is_empty()
        });
        (!vector).then_some(at)
    }

    /// [`Error::Unsupported`] for a luminance with colour differences.
    fn refuse_colour_differences(&self) -> Result<(), Error> {
        if ["RY", "BY"]
            .iter()
            .all(|name| self.names.channel(0, name).is_none())
        {
            return Ok(());
        }
        let path = self.names.files()[0].path().display();
        Err(self.refused_part().unwrap_or_else(|| {
            Error::Unsupported(format!(
                "{path}: luminance with colour differences (channels Y, RY, BY) is not supported"
            ))
        }))
    }

    /// What stands in the way of the first part that cannot be decoded: the reason where nothing better is found.
    fn refused_part(&self) -> Option<Error> {
        let file = &self.names.files()[0];
        file.parts().iter().find_map(|part| {
            let (path, label) = (file.path().display(), part.label());
            let refusal = part.refusal.as_ref()?;
            Some(Error::Unsupported(format!("{path}: {label}: {refusal}")))
        })
    }

    /// Layers with red, green and blue that can be decoded.
    fn decodable_colours(&self) -> Vec<(&'a str, Vec<ChannelRef>)> {
        let layers = self.names.layers(0).into_iter();
        let coloured =
            layers.filter_map(|name| Some((name, self.layer(name, Components::Colour)?)));
        coloured
            .filter(|(name, channels)| self.decodable(channels) && !is_no_picture(name))
            .collect()
    }

    /// The channel of a file that has no other, unless its name says that it is no light.
    fn only_channel(&self) -> Option<Vec<ChannelRef>> {
        let parts = self.names.files()[0].parts().iter();
        let mut channels =
            parts.flat_map(|part| (0..part.header.channels.list.len()).map(|c| (part.index, c)));
        let (part, channel) = channels.next()?;
        let only = ChannelRef {
            file: 0,
            part,
            channel,
        };
        let alone = channels.next().is_none() && !is_no_light(&self.names.name(only));
        alone.then(|| vec![only])
    }

    /// Why there is no colour, among layers that may be it.
    fn no_colour(&self, coloured: &[(&str, Vec<ChannelRef>)]) -> Error {
        let path = self.names.files()[0].path().display();
        let names = self.all_names();
        if coloured.is_empty() {
            return self.refused_part().unwrap_or_else(|| {
                Error::Invalid(format!(
                    "{path}: no colour channels (R G B) found; its channels are {names}"
                ))
            });
        }
        let layers: Vec<String> = (coloured.iter())
            .map(|(layer, _)| format!("{layer:?}"))
            .collect();
        Error::Incomplete {
            problem: format!(
                "{path}: which layer is the colour? It may be {}; its channels are {names}",
                layers.join(", ")
            ),
            remedy: Remedy::Colour,
        }
    }
}

/// These channels as the colour.
fn colour(channels: Vec<ChannelRef>, rule: String) -> Assignment {
    Assignment {
        role: Role::Colour,
        channels,
        meaning: Meaning::OfMean,
        signs: Axes::OURS.signs,
        rule,
        by_user: false,
    }
}

fn describe_layer(layer: &str) -> String {
    if layer.is_empty() {
        "bare names".into()
    } else {
        format!("{layer:?}")
    }
}

/// What stands before `wanted` and a dot in the name of a layer.
pub(super) fn above<'b>(layer: &'b str, wanted: &str) -> Option<&'b str> {
    let prefix = layer.strip_suffix(wanted).filter(|_| !wanted.is_empty())?;
    prefix.ends_with('.').then_some(prefix)
}

/// Whether a channel of this name holds a depth, a position, an alpha, a variance or an identifier.
fn is_no_light(name: &str) -> bool {
    let component = name.rsplit('.').next().unwrap_or(name).to_ascii_lowercase();
    let other = [
        "z", "x", "t", "u", "v", "w", "a", "alpha", "zback", "depth", "zdepth", "mask",
    ];
    let layer = name.rsplit_once('.').map(|(layer, _)| layer);
    other.contains(&component.as_str())
        || is_noise(name)
        || is_identifier(name)
        || layer.is_some_and(is_no_picture)
}

/// Whether a layer is called as renderers call their variances.
pub(crate) fn is_noise(layer: &str) -> bool {
    let layer = layer.to_ascii_lowercase();
    ["variance", "mse"].iter().any(|word| layer.contains(word)) || layer.ends_with("_var")
}
