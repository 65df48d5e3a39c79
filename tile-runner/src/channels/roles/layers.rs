//! Colour layers that are denoised with the models of the colour, chosen by name.

use wildmatch::WildMatch;

use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::presets::{Components, Role};
use crate::channels::roles::Roles;
use crate::channels::variance::Variance;
use crate::error::{Error, Setting};

/// A layer to denoise.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Its name.
    pub name: String,
    /// Red, green, blue.
    pub channels: [ChannelRef; 3],
    /// Its own variance is not used; only [`Variance::OtherFile`] matters, for the average of the halves.
    pub variance: Variance,
}

/// The layers of file 0 that match one of `patterns` (`*` any text, `?` any letter), with or without what stands before
/// the layer's last dot. The colour itself and channels in other roles are passed over where a pattern has a wildcard.
///
/// [`Error::Setting`] for a pattern that matches nothing, [`Error::Invalid`] for a layer of another data window.
pub(crate) fn select(
    names: &ChannelNames,
    roles: &Roles,
    patterns: &[String],
) -> Result<Vec<Layer>, Error> {
    let mut chosen: Vec<Layer> = Vec::new();
    for pattern in patterns {
        let glob = WildMatch::new(pattern);
        let wild = pattern.contains(['*', '?']);
        let before = chosen.len();
        let mut repeated = false;
        for name in names.layers(0) {
            let last = name.rsplit('.').next().unwrap_or(name);
            if name.is_empty() || !(glob.matches(name) || glob.matches(last)) {
                continue;
            }
            let Some(channels) = names.components(0, name, Components::Colour.triples()) else {
                continue;
            };
            let already = chosen.iter().any(|layer| layer.channels == channels);
            repeated |= already;
            if channels == roles.colour || already || (wild && in_a_role(roles, &channels)) {
                continue;
            }
            chosen.push(layer(names, roles, name, channels)?);
        }
        if chosen.len() == before && !repeated {
            return Err(Error::Setting {
                setting: Setting::Layers,
                value: pattern.clone(),
                problem: format!(
                    "{} has no such layer with channels R G B beside its colour",
                    names.files()[0].path().display()
                ),
            });
        }
    }
    Ok(chosen)
}

fn in_a_role(roles: &Roles, channels: &[ChannelRef; 3]) -> bool {
    let others = roles.assignments.iter().filter(|a| a.role != Role::Colour);
    others
        .flat_map(|a| &a.channels)
        .any(|at| channels.contains(at))
}

fn layer(
    names: &ChannelNames,
    roles: &Roles,
    name: &str,
    channels: [ChannelRef; 3],
) -> Result<Layer, Error> {
    let window = |at: ChannelRef| names.files()[at.file].parts()[at.part].data_window();
    if let Some(odd) = channels
        .iter()
        .find(|at| window(**at) != window(roles.colour[0]))
    {
        return Err(Error::Invalid(format!(
            "{}: its data window {:?} is not the colour's, {:?}",
            names.place(*odd),
            window(*odd),
            window(roles.colour[0])
        )));
    }
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
        variance,
    })
}
