//! A feature beside normal, albedo and depth, as it is asked for: `NAME[:CHANNELS][=VARIANCE]`.

use std::fmt;

use crate::error::Error;

/// A further feature that is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FeatureRequest {
    /// All that the renderer is known to write beside normal, albedo and depth, as far as they are there and there is room.
    Auto,
    /// A layer or a channel.
    Named(NamedFeature),
}

/// A layer or a channel that is asked for as a feature.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct NamedFeature {
    /// Its name, with or without the view layer's before it.
    pub name: String,
    /// The channels of the layer that are wanted, by what stands after its name; all, without its alpha, if empty.
    pub channels: Vec<String>,
    /// The layer, or the channels joined by commas, that hold the variance of its mean; looked for beside it if `None`.
    pub variance: Option<String>,
}

impl NamedFeature {
    /// What was typed as names that hold the characters between its pieces, the longest first.
    pub(crate) fn whole_names(&self) -> Vec<Self> {
        let before = Self {
            variance: None,
            ..self.clone()
        };
        let whole = |name: String, variance: Option<String>| Self {
            name,
            channels: Vec::new(),
            variance,
        };
        let mut names = Vec::new();
        if self.variance.is_some() {
            names.push(whole(self.to_string(), None));
        }
        if !self.channels.is_empty() {
            names.push(whole(before.to_string(), self.variance.clone()));
        }
        names
    }
}

impl fmt::Display for NamedFeature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        if !self.channels.is_empty() {
            write!(f, ":{}", self.channels.join(","))?;
        }
        match &self.variance {
            Some(variance) => write!(f, "={variance}"),
            None => Ok(()),
        }
    }
}

impl FeatureRequest {
    /// A layer or a channel of this name, all of it.
    pub fn named(name: impl Into<String>) -> Self {
        Self::Named(NamedFeature {
            name: name.into(),
            channels: Vec::new(),
            variance: None,
        })
    }

    /// Parses `NAME[:CHANNELS][=VARIANCE]` (`P`, `P:X,Z`, `P=PVariance`) or `auto`. [`Error::Usage`] otherwise.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let usage = || {
            Error::Usage(format!(
                "{text:?}: expected NAME, NAME:CHANNELS, either with =VARIANCE after it, or auto"
            ))
        };
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let (feature, variance) = match text.split_once('=') {
            Some((feature, variance)) => (feature, Some(variance.trim().to_owned())),
            None => (text, None),
        };
        let (name, channels) = match feature.rsplit_once(':') {
            Some((name, channels)) => (name, channels.split(',').collect()),
            None => (feature, Vec::new()),
        };
        let channels: Vec<String> = channels.iter().map(|own| own.trim().to_owned()).collect();
        let name = name.trim().to_owned();
        let empty = |text: &String| text.is_empty();
        if empty(&name) || channels.iter().any(empty) || variance.as_ref().is_some_and(empty) {
            return Err(usage());
        }
        Ok(Self::Named(NamedFeature {
            name,
            channels,
            variance,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str, channels: &[&str], variance: Option<&str>) -> FeatureRequest {
        FeatureRequest::Named(NamedFeature {
            name: name.into(),
            channels: channels.iter().map(|own| (*own).to_owned()).collect(),
            variance: variance.map(str::to_owned),
        })
    }

    #[test]
    fn what_was_typed_is_a_name_its_channels_and_a_variance() {
        let parsed = |text| FeatureRequest::parse(text).unwrap();
        assert_eq!(parsed("auto"), FeatureRequest::Auto);
        assert_eq!(parsed("P"), named("P", &[], None));
        assert_eq!(
            parsed("View Layer.P: X,Z =PVariance"),
            named("View Layer.P", &["X", "Z"], Some("PVariance"))
        );
        assert_eq!(parsed("r=m.X,m.Y"), named("r", &[], Some("m.X,m.Y")));
        for text in ["", ":X", "P:", "P:X,,Y", "P=", "=P"] {
            assert!(
                matches!(FeatureRequest::parse(text), Err(Error::Usage(_))),
                "{text:?}"
            );
        }
    }
}
