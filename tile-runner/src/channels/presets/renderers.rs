//! The table: which names each renderer uses.

use super::Pattern::{self, Layer, Prefixed, PrefixedImage};
use super::{MOMENT, Preset, Role, Rule, Sign};
use crate::channels::motion::Axes;
use crate::channels::variance::Meaning;

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
pub(super) const PRESETS: &[Preset] = &[
    Preset {
        name: "blender",
        signs: &[
            Sign::Attribute("BlenderMultiChannel"),
            Sign::Attribute("cycles."),
        ],
        further: &[
            "Position",
            "Roughness",
            "Glossy Color",
            "GlossCol",
            "Transmission Color",
            "TransCol",
            "Ambient Occlusion",
            "AO",
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
        further: &["position", "pos", "pp", "P", "geo_normal", "uv"],
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
        further: &["P", "N"],
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
        further: &["__Pworld", "Pworld", "P", "__Nworld"],
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
        further: &["P", "specular_albedo", "coat_albedo", "transmission_albedo"],
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
        further: &[],
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
        further: &[],
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
    further: &[
        "P",
        "position",
        "Position",
        "worldPosition",
        "roughness",
        "Roughness",
        "specular_albedo",
        "specularAlbedo",
        "Ng",
    ],
};
