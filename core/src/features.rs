//! The features: which there are, in which order, and which channels belong together. Said here and nowhere else.
//!
//! A feature is what a renderer writes beside the radiance, in one channel or three that are filtered together. A pixel of a tile has its
//! position first ([`POSITION`]), then the channels of [`Feature::ALL`], and then up to [`FURTHER`] channels of further features, of which nothing is known but that
//! light may follow them: positions in the world, roughness, what another denoiser made. A feature that is known by its name is another line of [`Feature`] and its
//! functions; whoever reads files then has to say which of their channels it is.

use core::ops::Range;

use crate::cell::feature_space::MAX_TERMS;

/// Features of a pixel that are its position in the tile: x, y.
pub const POSITION: usize = 2;

/// What a renderer writes beside the radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Feature {
    /// Surface normal.
    Normal,
    /// Surface albedo.
    Albedo,
    /// Distance from the camera.
    Depth,
}

impl Feature {
    /// Every feature, in the order of their channels.
    pub const ALL: [Self; 3] = [Self::Normal, Self::Albedo, Self::Depth];

    /// What it is called.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Albedo => "albedo",
            Self::Depth => "depth",
        }
    }

    /// What its channels are called, one or three.
    pub const fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Normal => &["normal x", "normal y", "normal z"],
            Self::Albedo => &["albedo red", "albedo green", "albedo blue"],
            Self::Depth => &["depth"],
        }
    }

    /// Whether it is a distance, which is endless where a ray leaves the scene.
    pub const fn is_distance(self) -> bool {
        matches!(self, Self::Depth)
    }

    /// Its channels among the [`FEATURES`] of a pixel.
    pub const fn range(self) -> Range<usize> {
        let start = channels_before(self as usize);
        start..start + self.channels().len()
    }
}

/// Channels of all features that are known by their names.
pub const FEATURES: usize = channels_before(Feature::ALL.len());

/// Channels of further features that a pixel can have beside those, in groups of one to three that belong together.
pub const FURTHER: usize = MAX_FEATURES - FEATURES;

/// Channels of all features that a pixel can have beside its position, the further ones last: with the position and an intercept they fill the largest model.
pub const MAX_FEATURES: usize = MAX_TERMS - 1 - POSITION;

/// What the channels of [`Feature::ALL`] are called, in their order.
pub const FEATURE_NAMES: [&str; FEATURES] = {
    let mut names = [""; FEATURES];
    let mut feature = 0;
    while feature < Feature::ALL.len() {
        let channels = Feature::ALL[feature].channels();
        let start = channels_before(feature);
        let mut k = 0;
        while k < channels.len() {
            names[start + k] = channels[k];
            k += 1;
        }
        feature += 1;
    }
    names
};

/// Features of a pixel of a tile: its position and the channels that are known by their names.
pub const TILE_FEATURES: usize = POSITION + FEATURES;

/// Features of a pixel of a tile that has further ones.
pub const WIDE_TILE_FEATURES: usize = POSITION + MAX_FEATURES;

/// Channels of the first `count` features.
const fn channels_before(count: usize) -> usize {
    let (mut channels, mut feature) = (0, 0);
    while feature < count {
        channels += Feature::ALL[feature].channels().len();
        feature += 1;
    }
    channels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_channels_of_all_features_follow_one_another() {
        let mut next = 0;
        for (place, feature) in Feature::ALL.into_iter().enumerate() {
            assert_eq!((feature as usize, feature.range().start), (place, next));
            assert_eq!(&FEATURE_NAMES[feature.range()], feature.channels());
            next = feature.range().end;
        }
        assert_eq!(next, FEATURES);
    }
}
