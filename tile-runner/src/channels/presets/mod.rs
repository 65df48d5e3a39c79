//! Which channel plays which role, by renderer: the words of the table in [`renderers`].

mod renderers;

use linpred_core::Feature;

pub(crate) use renderers::COMMON;
use renderers::PRESETS;

use crate::channels::motion::Axes;
use crate::channels::variance::Meaning;

/// A role that a layer can play.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// The radiance to denoise.
    Colour,
    /// Its alpha, by which it is premultiplied.
    Alpha,
    /// Surface albedo.
    Albedo,
    /// Surface normal.
    Normal,
    /// Distance from the camera.
    Depth,
    /// Noise of the colour.
    Variance,
    /// Noise of the albedo.
    AlbedoVariance,
    /// Noise of the normal.
    NormalVariance,
    /// Noise of the depth.
    DepthVariance,
    /// Colour from one half of the samples.
    HalfA,
    /// Colour from the other half.
    HalfB,
    /// Samples per pixel.
    Samples,
    /// Where a surface was in the frame before.
    Motion,
    /// Where it is in the frame after.
    MotionForward,
    /// Where in the world it is.
    Position,
}

impl Role {
    /// Every role.
    pub const ALL: [Self; 15] = [
        Self::Colour,
        Self::Alpha,
        Self::Albedo,
        Self::Normal,
        Self::Depth,
        Self::Variance,
        Self::AlbedoVariance,
        Self::NormalVariance,
        Self::DepthVariance,
        Self::HalfA,
        Self::HalfB,
        Self::Samples,
        Self::Motion,
        Self::MotionForward,
        Self::Position,
    ];

    /// Its name, in requests and descriptions.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Colour => "colour",
            Self::Alpha => "alpha",
            Self::Albedo => "albedo",
            Self::Normal => "normal",
            Self::Depth => "depth",
            Self::Variance => "variance",
            Self::AlbedoVariance => "albedo-variance",
            Self::NormalVariance => "normal-variance",
            Self::DepthVariance => "depth-variance",
            Self::HalfA => "half-a",
            Self::HalfB => "half-b",
            Self::Samples => "samples",
            Self::Motion => "motion",
            Self::MotionForward => "motion-forward",
            Self::Position => "position",
        }
    }

    /// The role of a feature, and that of its noise.
    pub const fn of(feature: Feature) -> [Self; 2] {
        match feature {
            Feature::Normal => [Self::Normal, Self::NormalVariance],
            Feature::Albedo => [Self::Albedo, Self::AlbedoVariance],
            Feature::Depth => [Self::Depth, Self::DepthVariance],
        }
    }

    /// The role whose noise this one is.
    pub(crate) fn mean(self) -> Option<Self> {
        if self == Self::Variance {
            return Some(Self::Colour);
        }
        let features = Feature::ALL.into_iter().map(Self::of);
        let mut means = features.filter(|[_, noise]| *noise == self);
        means.next().map(|[mean, _]| mean)
    }

    /// Whether it tells where surfaces are in other frames, which only a sequence asks: a frame alone leaves its channels unread.
    pub const fn is_of_motion(self) -> bool {
        matches!(self, Self::Motion | Self::MotionForward | Self::Position)
    }

    /// The components that its layer has, best first.
    pub(crate) const fn components(self) -> Components {
        match self {
            Self::Colour
            | Self::Albedo
            | Self::Variance
            | Self::AlbedoVariance
            | Self::HalfA
            | Self::HalfB => Components::Colour,
            Self::Normal | Self::NormalVariance | Self::Position => Components::Vector,
            Self::Motion | Self::MotionForward => Components::Pair,
            Self::Alpha | Self::Depth | Self::DepthVariance | Self::Samples => Components::Scalar,
        }
    }
}

/// What the channels of a layer are called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Components {
    Colour,
    Vector,
    Pair,
    Scalar,
}

impl Components {
    /// The spellings of three components, best first; empty for what has fewer.
    pub(crate) const fn triples(self) -> &'static [[&'static str; 3]] {
        match self {
            Self::Colour => &[["R", "G", "B"], ["red", "green", "blue"]],
            Self::Vector => &[["X", "Y", "Z"], ["R", "G", "B"], ["red", "green", "blue"]],
            Self::Pair | Self::Scalar => &[],
        }
    }
}

/// How a rule finds its layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pattern {
    /// A layer of this name, after any prefix (`ViewLayer.`); the empty name is the bare channels `R G B`.
    Layer(&'static str),
    /// The layer that the role's mean was found in, with this before it.
    Prefixed(&'static str),
    /// The first layer with this prefix whose unprefixed layer has R G B A: for bare `R G B`, which have no layer
    /// of their own but copy the first image below them.
    PrefixedImage(&'static str),
}

impl Pattern {
    /// Whether it names this layer.
    pub(crate) fn is(self, layer: &str) -> bool {
        matches!(self, Self::Layer(own) if own == layer)
    }
}

/// One line of the table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rule {
    pub(crate) role: Role,
    pub(crate) patterns: &'static [Pattern],
    /// What the numbers are, for the roles that are variances.
    pub(crate) meaning: Meaning,
    /// Which components are the motion and how it becomes ours, for the roles that are motion vectors.
    pub(crate) axes: Axes,
}

/// The names that one renderer uses.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Name on the command line.
    pub name: &'static str,
    /// Attributes (or their beginnings) that only this renderer writes.
    signs: &'static [Sign],
    /// The layer that people look at, into which the renderer's own denoiser writes: a result goes there, wherever the noisy colour came from.
    pub(crate) shown: Option<&'static str>,
    /// Whether a variance of 0 says that no sample was counted, and nothing of noise.
    pub(crate) zero_is_unknown: bool,
    pub(crate) rules: &'static [Rule],
    /// Layers and channels beside those of the rules that light may follow, after any prefix, those that tell most first. None whose noise is that of the
    /// colour's samples (a light group, a shadow, an indirect light): a fit on those would keep the noise.
    pub(crate) further: &'static [&'static str],
}

/// What gives a renderer away.
#[derive(Clone, Copy, Debug)]
enum Sign {
    /// An attribute whose name begins so.
    Attribute(&'static str),
    /// A string attribute whose value begins so.
    Value(&'static str, &'static str),
}

impl Preset {
    /// The preset of this name; `None` for `auto` and for names that are none.
    pub fn named(name: &str) -> Option<&'static Self> {
        PRESETS.iter().find(|preset| preset.name == name)
    }

    /// The preset of the renderer that wrote these attributes, if one gives itself away.
    pub fn detect(attributes: &crate::exr_file::attributes::Attributes) -> Option<&'static Self> {
        PRESETS.iter().find(|preset| {
            preset.signs.iter().any(|sign| match *sign {
                Sign::Attribute(start) => attributes
                    .iter()
                    .any(|a| a.name.starts_with(start.as_bytes())),
                Sign::Value(name, start) => attributes
                    .string(name)
                    .is_some_and(|v| v.starts_with(start)),
            })
        })
    }
}

/// Names on the command line, `auto` first.
pub const PRESET_NAMES: [&str; 8] = [
    "auto",
    "blender",
    "mitsuba",
    "pbrt",
    "renderman",
    "arnold",
    "vray",
    "tungsten",
];

/// What Mitsuba's `moment` integrator puts before the name of a layer of second moments. Such a layer is never a mean,
/// although its name ends like that of one.
pub(crate) const MOMENT: &str = "m2_";
