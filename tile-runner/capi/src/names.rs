//! What images are called.

use std::fmt;

use linpred::Feature;

/// What an image that is read holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Input {
    Colour,
    Variance,
    HalfA,
    HalfB,
    Feature(Feature),
    FeatureVariance(Feature),
    /// A feature beside those.
    Further(String),
    FurtherVariance(String),
    Alpha,
    Samples,
    Layer(String),
    Scalar(String),
}

/// What an image that is written will hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Output {
    Colour,
    Error,
    Radius,
    Rank,
    Alpha,
    Layer(String),
    Scalar(String),
}

/// A layer's name, behind what such names begin with.
fn behind(start: &str, name: &str) -> Option<String> {
    let rest = name.strip_prefix(start)?;
    (!rest.is_empty()).then(|| rest.to_owned())
}

impl Input {
    pub(crate) fn parse(name: &str) -> Option<Self> {
        let feature = |name: &str| Feature::ALL.into_iter().find(|known| known.name() == name);
        Some(match name {
            "colour" | "color" => Self::Colour,
            "variance" => Self::Variance,
            "half_a" => Self::HalfA,
            "half_b" => Self::HalfB,
            "alpha" => Self::Alpha,
            "samples" => Self::Samples,
            _ => {
                let of_feature = name.strip_suffix("_variance").and_then(feature);
                return feature(name)
                    .map(Self::Feature)
                    .or_else(|| of_feature.map(Self::FeatureVariance))
                    .or_else(|| behind("feature.", name).map(Self::Further))
                    .or_else(|| behind("feature_variance.", name).map(Self::FurtherVariance))
                    .or_else(|| behind("layer.", name).map(Self::Layer))
                    .or_else(|| behind("scalar.", name).map(Self::Scalar));
            }
        })
    }

    /// Channels of its pixels; `None` where the caller says.
    pub(crate) fn channels(&self) -> Option<usize> {
        match self {
            Self::Feature(feature) | Self::FeatureVariance(feature) => Some(feature.range().len()),
            Self::Further(_) | Self::FurtherVariance(_) => None,
            Self::Alpha | Self::Samples | Self::Scalar(_) => Some(1),
            _ => Some(3),
        }
    }
}

impl Output {
    pub(crate) fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "colour" | "color" | "output" => Self::Colour,
            "error" => Self::Error,
            "radius" => Self::Radius,
            "rank" => Self::Rank,
            "alpha" => Self::Alpha,
            _ => {
                let layer = behind("layer.", name).map(Self::Layer);
                return layer.or_else(|| behind("scalar.", name).map(Self::Scalar));
            }
        })
    }

    pub(crate) fn channels(&self) -> usize {
        match self {
            Self::Colour | Self::Layer(_) => 3,
            _ => 1,
        }
    }

    /// What must be read that this can be written.
    pub(crate) fn input(&self) -> Input {
        match self {
            Self::Alpha => Input::Alpha,
            Self::Layer(name) => Input::Layer(name.clone()),
            Self::Scalar(name) => Input::Scalar(name.clone()),
            _ => Input::Colour,
        }
    }
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Colour => write!(f, "colour"),
            Self::Variance => write!(f, "variance"),
            Self::HalfA => write!(f, "half_a"),
            Self::HalfB => write!(f, "half_b"),
            Self::Feature(feature) => write!(f, "{}", feature.name()),
            Self::FeatureVariance(feature) => write!(f, "{}_variance", feature.name()),
            Self::Further(name) => write!(f, "feature.{name}"),
            Self::FurtherVariance(name) => write!(f, "feature_variance.{name}"),
            Self::Alpha => write!(f, "alpha"),
            Self::Samples => write!(f, "samples"),
            Self::Layer(name) => write!(f, "layer.{name}"),
            Self::Scalar(name) => write!(f, "scalar.{name}"),
        }
    }
}

impl fmt::Display for Output {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Error => write!(f, "error"),
            Self::Radius => write!(f, "radius"),
            Self::Rank => write!(f, "rank"),
            _ => self.input().fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_written_is_read() {
        let features = Feature::ALL.into_iter();
        let features = features.flat_map(|f| [Input::Feature(f), Input::FeatureVariance(f)]);
        let layers = [
            Input::Layer("a b".into()),
            Input::Scalar("variance".into()),
            Input::Further("a_variance".into()),
            Input::FurtherVariance("b".into()),
        ];
        let own = [
            Input::Colour,
            Input::Variance,
            Input::HalfA,
            Input::HalfB,
            Input::Alpha,
            Input::Samples,
        ];
        for input in own.into_iter().chain(features).chain(layers) {
            assert_eq!(Input::parse(&input.to_string()), Some(input));
        }
        for name in [
            "",
            "layer.",
            "scalar.",
            "feature.",
            "beauty",
            "alpha_variance",
            "Colour",
        ] {
            assert_eq!(
                (Input::parse(name), Output::parse(name)),
                (None, None),
                "{name}"
            );
        }
        let layer = Output::Layer("x".into());
        for output in [
            Output::Colour,
            Output::Error,
            Output::Radius,
            Output::Rank,
            layer,
        ] {
            assert_eq!(Output::parse(&output.to_string()), Some(output));
        }
    }
}
