//! A role given to a channel by the user: `role=channel`.

use crate::channels::presets::Role;
use crate::channels::variance::Meaning;
use crate::error::Error;

/// One `role=channel`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mapping {
    /// The role.
    pub role: Role,
    /// What a variance layer holds; [`Meaning::OfMean`] for other roles.
    pub meaning: Meaning,
    /// A layer, a channel, two or three channels joined by commas, or `none`. Before a component of a motion vector a minus turns it round.
    pub target: String,
}

impl Mapping {
    /// Parses `role=target`. `sample-variance` and `second-moment` are the role `variance` with that meaning, with
    /// `albedo-`, `normal-` or `depth-` before them those of a feature. [`Error::Usage`] otherwise.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let usage = || {
            let roles: Vec<&str> = Role::ALL.iter().map(|role| role.name()).collect();
            Error::Usage(format!(
                "{text:?}: expected role=channel, where role is one of {} (or sample-variance, second-moment)",
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
