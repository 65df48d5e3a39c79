//! Which channel plays which role, by renderer: one table.

use linpred_core::Feature;

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

use Pattern::{Layer, Prefixed, PrefixedImage};

const fn rule(role: Role, patterns: &'static [Pattern]) -> Rule {
    variance(role, Meaning::OfMean, patterns)
}

const fn variance(role: Role, meaning: Meaning, patterns: &'static [Pattern]) -> Rule {
    Rule {
        role,
        patterns,
        meaning,
        axes: Axes::OURS,
    }
}

/// A role of motion vectors that are stored by these axes.
const fn vectors(role: Role, axes: Axes, patterns: &'static [Pattern]) -> Rule {
    Rule {
        role,
        patterns,
        meaning: Meaning::OfMean,
        axes,
    }
}

/// Cycles stores pixels to the right and up: in X and Y the place in the frame before less this one, in Z and W this one less the place in the frame after (kernel/geom/primitive.h,
/// and as rendered frames warp onto each other).
const CYCLES_BEFORE: Axes = Axes {
    components: &[["X", "Y"]],
    signs: [1.0, -1.0],
};
const CYCLES_AFTER: Axes = Axes {
    components: &[["Z", "W"]],
    signs: [-1.0, 1.0],
};

/// RenderMan's raster space has y down as ours has, and its vectors are colours or vectors of three components.
const RASTER: Axes = Axes {
    components: &[["X", "Y"], ["R", "G"]],
    signs: [1.0, 1.0],
};

/// The renderers, with the names that their users see in files.
const PRESETS: &[Preset] = &[
    Preset {
        name: "blender",
        signs: &[
            Sign::Attribute("BlenderMultiChannel"),
            Sign::Attribute("cycles."),
        ],
        shown: Some("Combined"),
        zero_is_unknown: false,
        rules: &[
            // with denoising on, Combined is already denoised and Noisy Image is what was rendered
            rule(Role::Colour, &[Layer("Noisy Image"), Layer("Combined")]),
            rule(
                Role::Albedo,
                &[
                    Layer("Denoising Albedo"),
                    Layer("Diffuse Color"),
                    Layer("DiffCol"),
                ],
            ),
            rule(Role::Normal, &[Layer("Denoising Normal"), Layer("Normal")]),
            rule(Role::Depth, &[Layer("Denoising Depth"), Layer("Depth")]),
            rule(Role::Variance, &[Layer("Denoising Variance")]),
            rule(Role::AlbedoVariance, &[Layer("Denoising Albedo Variance")]),
            rule(Role::NormalVariance, &[Layer("Denoising Normal Variance")]),
            rule(Role::DepthVariance, &[Layer("Denoising Depth Variance")]),
            rule(Role::Samples, &[Layer("Debug Sample Count")]),
            vectors(Role::Motion, CYCLES_BEFORE, &[Layer("Vector")]),
            vectors(Role::MotionForward, CYCLES_AFTER, &[Layer("Vector")]),
            rule(Role::Position, &[Layer("Position")]),
        ],
    },
    Preset {
        name: "mitsuba",
        signs: &[Sign::Value("generatedBy", "Mitsuba")],
        shown: None,
        zero_is_unknown: false,
        rules: &[
            rule(Role::Colour, &[Layer("")]),
            rule(Role::Albedo, &[Layer("albedo")]),
            rule(
                Role::Normal,
                &[
                    Layer("sh_normal"),
                    Layer("normal"),
                    Layer("normals"),
                    Layer("nn"),
                    Layer("n"),
                ],
            ),
            rule(Role::Depth, &[Layer("T"), Layer("depth")]),
            rule(
                Role::Position,
                &[Layer("position"), Layer("pos"), Layer("pp"), Layer("P")],
            ),
            variance(
                Role::Variance,
                Meaning::SecondMoment,
                &[Prefixed(MOMENT), PrefixedImage(MOMENT)],
            ),
            variance(
                Role::AlbedoVariance,
                Meaning::SecondMoment,
                &[Prefixed(MOMENT)],
            ),
            variance(
                Role::NormalVariance,
                Meaning::SecondMoment,
                &[Prefixed(MOMENT)],
            ),
            variance(
                Role::DepthVariance,
                Meaning::SecondMoment,
                &[Prefixed(MOMENT)],
            ),
        ],
    },
    Preset {
        name: "pbrt",
        signs: &[Sign::Attribute("samplesPerPixel")],
        shown: None,
        // film.cpp: the estimator is fed where a ray hit a surface, and stays at 0 in volumes and the sky
        zero_is_unknown: true,
        rules: &[
            rule(Role::Colour, &[Layer("")]),
            rule(Role::Albedo, &[Layer("Albedo")]),
            rule(Role::Normal, &[Layer("Ns"), Layer("N")]),
            rule(Role::Depth, &[Layer("Z")]),
            variance(Role::Variance, Meaning::OfSample, &[Layer("Variance")]),
            // as the film's "coordinatesystem" has it, which the file does not tell
            rule(Role::Position, &[Layer("P")]),
        ],
    },
    Preset {
        name: "renderman",
        signs: &[Sign::Attribute("rman"), Sign::Attribute("prman")],
        shown: None,
        zero_is_unknown: false,
        rules: &[
            rule(Role::Colour, &[Layer(""), Layer("Ci"), Layer("beauty")]),
            rule(Role::Albedo, &[Layer("albedo")]),
            rule(Role::Normal, &[Layer("normal"), Layer("Nn")]),
            rule(Role::Depth, &[Layer("zfiltered"), Layer("z")]),
            rule(Role::Variance, &[Layer("mse")]),
            // by Pixar's help, mse is the variance of the mean and var that of one sample
            rule(Role::AlbedoVariance, &[Layer("albedo_mse")]),
            variance(
                Role::AlbedoVariance,
                Meaning::OfSample,
                &[Layer("albedo_var")],
            ),
            rule(Role::NormalVariance, &[Layer("normal_mse")]),
            variance(
                Role::NormalVariance,
                Meaning::OfSample,
                &[Layer("normal_var")],
            ),
            rule(Role::DepthVariance, &[Layer("zfiltered_mse")]),
            variance(
                Role::DepthVariance,
                Meaning::OfSample,
                &[Layer("zfiltered_var")],
            ),
            rule(Role::Samples, &[Layer("sampleCount")]),
            vectors(Role::Motion, RASTER, &[Layer("backward")]),
            vectors(Role::MotionForward, RASTER, &[Layer("forward")]),
            // its P is in the space of the camera
            rule(Role::Position, &[Layer("__Pworld"), Layer("Pworld")]),
        ],
    },
    Preset {
        name: "arnold",
        signs: &[Sign::Attribute("arnold/")],
        shown: None,
        zero_is_unknown: false,
        rules: &[
            rule(Role::Colour, &[Layer(""), Layer("RGBA"), Layer("beauty")]),
            rule(
                Role::Albedo,
                &[
                    Layer("denoise_albedo"),
                    Layer("diffuse_albedo"),
                    Layer("albedo"),
                ],
            ),
            rule(Role::Normal, &[Layer("N")]),
            rule(Role::Depth, &[Layer("Z")]),
            rule(Role::Variance, &[Layer("variance")]),
            rule(Role::Position, &[Layer("P")]),
        ],
    },
    Preset {
        name: "vray",
        signs: &[Sign::Attribute("vray")],
        shown: None,
        zero_is_unknown: false,
        rules: &[
            rule(Role::Colour, &[Layer(""), Layer("RGB_color")]),
            rule(Role::Albedo, &[Layer("diffuse"), Layer("diffuseFilter")]),
            rule(
                Role::Normal,
                &[
                    Layer("bump_normals"),
                    Layer("BumpNormals"),
                    Layer("normals"),
                ],
            ),
            rule(Role::Depth, &[Layer("Z"), Layer("zDepth")]),
        ],
    },
    Preset {
        name: "tungsten",
        signs: &[],
        shown: None,
        zero_is_unknown: false,
        rules: &[
            rule(Role::Colour, &[Layer("")]),
            rule(Role::Albedo, &[Layer("albedo")]),
            rule(Role::Normal, &[Layer("normal")]),
            rule(Role::Depth, &[Layer("depth")]),
            rule(Role::Variance, &[Layer("variance")]),
        ],
    },
];

/// Names that are tried when no renderer is known, or when it does not have them.
pub(crate) const COMMON: Preset = Preset {
    name: "common names",
    signs: &[],
    shown: None,
    zero_is_unknown: false,
    rules: &[
        rule(
            Role::Colour,
            &[
                Layer(""),
                Layer("rgba"),
                Layer("RGBA"),
                Layer("beauty"),
                Layer("Beauty"),
                Layer("Combined"),
                Layer("Ci"),
                Layer("color"),
                Layer("Color"),
            ],
        ),
        rule(
            Role::Albedo,
            &[
                Layer("albedo"),
                Layer("Albedo"),
                Layer("denoise_albedo"),
                Layer("diffuse_albedo"),
                Layer("Denoising Albedo"),
            ],
        ),
        rule(
            Role::Normal,
            &[
                Layer("N"),
                Layer("Ns"),
                Layer("normal"),
                Layer("Normal"),
                Layer("normals"),
                Layer("sh_normal"),
                Layer("Denoising Normal"),
            ],
        ),
        rule(
            Role::Depth,
            &[
                Layer("Z"),
                Layer("depth"),
                Layer("Depth"),
                Layer("zfiltered"),
                Layer("Denoising Depth"),
            ],
        ),
        rule(Role::Variance, &[Layer("variance"), Layer("mse")]),
        variance(Role::Variance, Meaning::OfSample, &[Layer("Variance")]),
        rule(
            Role::AlbedoVariance,
            &[Layer("albedoVariance"), Layer("albedo_mse")],
        ),
        rule(
            Role::NormalVariance,
            &[Layer("NVariance"), Layer("normal_mse")],
        ),
        rule(
            Role::DepthVariance,
            &[Layer("ZVariance"), Layer("zfiltered_mse")],
        ),
        rule(Role::HalfA, &[Layer("halfA")]),
        rule(Role::HalfB, &[Layer("halfB")]),
        rule(Role::Samples, &[Layer("sampleCount")]),
        rule(Role::Motion, &[Layer("motion")]),
        rule(Role::MotionForward, &[Layer("motionForward")]),
        rule(
            Role::Position,
            &[Layer("P"), Layer("position"), Layer("Position")],
        ),
    ],
};
