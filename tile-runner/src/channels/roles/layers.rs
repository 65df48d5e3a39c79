//! Layers that are denoised with the models of the colour, chosen by name.

use wildmatch::WildMatch;

use crate::channels::identifiers::{Cryptomattes, is_identifier, is_integer};
use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::presets::Components;
use crate::channels::roles::search::is_noise;
use crate::channels::roles::{Roles, other_window};
use crate::channels::variance::Variance;
use crate::error::{Error, Setting};

/// A layer to denoise.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Its name.
    pub name: String,
    /// Red, green, blue; or the channels of a layer that is no light (a depth, a mask, a vector), each on its own.
    pub channels: Vec<ChannelRef>,
    /// Whether it is light, which follows the colour in all that is done to it.
    pub is_light: bool,
    /// Its own variance is not used; only [`Variance::OtherFile`] matters, for the average of the halves.
    pub variance: Variance,
}

/// The layers of file 0 that match `pattern` (`*` any text, `?` any letter), with or without what stands before
/// the layer's last dot; of a picture that is not `alone` in its file those of its own view layer. A pattern with a wildcard is for light, and passes over the
/// colour itself, channels in other roles, noise and identifiers; a name alone may be that of a channel, or of a layer that is no light. `None` if the
/// picture has no such layer; the alpha's name gives nothing, for it is denoised in any case.
///
/// [`Error::Setting`] for an identifier, [`Error::Invalid`] for a layer of another data window.
pub(crate) fn select(
    names: &ChannelNames,
    roles: &Roles,
    pattern: &str,
    alone: bool,
) -> Result<Option<Vec<Layer>>, Error> {
    let mut found = match pattern.contains(['*', '?']) {
        true => matching(names, roles, pattern),
        false => named(names, roles, pattern)?,
    };
    let own = |name: &str| match name.strip_prefix(roles.prefix.as_str()) {
        Some(rest) => alone || !rest.contains('.'),
        None => alone,
    };
    found.retain(|layer| own(&layer.name));
    for layer in &found {
        check_window(names, roles, layer)?;
    }
    let is_alpha = roles
        .alpha
        .is_some_and(|at| names.channel(0, pattern) == Some(at));
    Ok((is_alpha || !found.is_empty()).then_some(found))
}

/// The layers of every picture that match the patterns, each once.
///
/// [`Error::Setting`] for a pattern that matches nothing in any of them; for others as for [`select`].
pub(crate) fn select_all(
    pictures: &[(ChannelNames, Roles)],
    patterns: &[String],
) -> Result<Vec<Vec<Layer>>, Error> {
    let alone = pictures.len() == 1;
    let mut chosen: Vec<Vec<Layer>> = vec![Vec::new(); pictures.len()];
    for pattern in patterns {
        let mut matched = false;
        for ((names, roles), chosen) in pictures.iter().zip(&mut chosen) {
            let found = select(names, roles, pattern, alone)?;
            matched |= found.is_some();
            for layer in found.into_iter().flatten() {
                let already =
                    |known: &Layer| layer.channels.iter().any(|at| known.channels.contains(at));
                if !chosen.iter().any(already) {
                    chosen.push(layer);
                }
            }
        }
        if let Some((names, _)) = pictures.first().filter(|_| !matched) {
            let path = names.files()[0].path().display();
            let problem = format!("{path} has no such layer beside its colour");
            return Err(wrong(pattern, problem));
        }
    }
    Ok(chosen)
}

/// The light that matches a pattern with wildcards.
fn matching(names: &ChannelNames, roles: &Roles, pattern: &str) -> Vec<Layer> {
    let glob = WildMatch::new(pattern);
    let file = &names.files()[0];
    let cryptomattes = Cryptomattes::of(file);
    let mut found = Vec::new();
    for name in names.layers(0) {
        let last = name.rsplit('.').next().unwrap_or(name);
        if name.is_empty() || !(glob.matches(name) || glob.matches(last)) {
            continue;
        }
        let untouched = cryptomattes.has(name) || is_identifier(name) || is_noise(name);
        let Some(channels) = names.components(0, name, Components::Colour.triples()) else {
            continue;
        };
        let integers = channels.iter().any(|at| is_integer(file, *at));
        let part = |at: &ChannelRef| &file.parts()[at.part];
        let refused = channels.iter().any(|at| part(at).refusal.is_some());
        if untouched || integers || refused || has_a_role(roles, &channels) {
            continue;
        }
        found.extend(layer(names, roles, name, channels.to_vec(), true).ok());
    }
    found
}

/// The layers, or else the channel, of this name.
fn named(names: &ChannelNames, roles: &Roles, wanted: &str) -> Result<Vec<Layer>, Error> {
    let cryptomattes = Cryptomattes::of(&names.files()[0]);
    let mut found: Vec<Layer> = Vec::new();
    for name in names.layers(0) {
        let last = name.rsplit('.').next().unwrap_or(name);
        if name.is_empty() || (name != wanted && last != wanted) {
            continue;
        }
        if cryptomattes.has(name) || is_identifier(name) {
            return Err(kept(wanted, "identifiers"));
        }
        let light = names.components(0, name, Components::Colour.triples());
        let is_light = light.is_some();
        let inside = names.in_file(0).filter(|own| own.layer == name);
        let channels = light.map_or_else(|| inside.map(|own| own.at).collect(), Vec::from);
        let is_colour = channels
            .iter()
            .any(|at| roles.colour.contains(at) || roles.target.contains(at));
        if !is_colour {
            found.push(layer(names, roles, name, channels, is_light)?);
        }
    }
    let channel = names
        .channel(0, wanted)
        .filter(|at| !roles.colour.contains(at));
    if let Some(at) = channel.filter(|_| found.is_empty()) {
        if is_identifier(wanted) {
            return Err(kept(wanted, "identifiers"));
        }
        found.push(layer(names, roles, wanted, vec![at], false)?);
    }
    found.retain(|layer| !layer.channels.iter().any(|at| roles.alpha == Some(*at)));
    let integers = found.iter().flat_map(|layer| &layer.channels);
    match integers
        .into_iter()
        .find(|at| is_integer(&names.files()[0], **at))
    {
        None => Ok(found),
        Some(_) => Err(kept(wanted, "integers")),
    }
}

/// A layer that no arithmetic may touch.
fn kept(wanted: &str, what: &str) -> Error {
    wrong(wanted, format!("holds {what}, which are kept as they are"))
}

fn wrong(pattern: &str, problem: String) -> Error {
    Error::Setting {
        setting: Setting::Layers,
        value: pattern.to_owned(),
        problem,
    }
}

/// Whether one of the channels has a role already, or is written to.
fn has_a_role(roles: &Roles, channels: &[ChannelRef; 3]) -> bool {
    let assigned = roles.assignments.iter().flat_map(|a| &a.channels);
    let mut taken = assigned.chain(&roles.target).chain(&roles.alpha_target);
    taken.any(|at| channels.contains(at))
}

fn check_window(names: &ChannelNames, roles: &Roles, layer: &Layer) -> Result<(), Error> {
    let window = |at: ChannelRef| names.files()[at.file].parts()[at.part].data_window();
    let colour = window(roles.colour[0]);
    match layer.channels.iter().find(|at| window(**at) != colour) {
        None => Ok(()),
        Some(odd) => Err(Error::Invalid(other_window(names, *odd, colour))),
    }
}

fn layer(
    names: &ChannelNames,
    roles: &Roles,
    name: &str,
    channels: Vec<ChannelRef>,
    is_light: bool,
) -> Result<Layer, Error> {
    let variance = match &roles.variance {
        Variance::OtherFile(twins) => {
            let other = twins[0].file;
            let twins = channels.iter().map(|at| names.twin(*at, other));
            Variance::OtherFile(twins.collect::<Result<_, Error>>()?)
        }
        _ => Variance::None,
    };
    Ok(Layer {
        name: name.to_owned(),
        channels,
        is_light,
        variance,
    })
}
