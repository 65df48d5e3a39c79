//! Each renderer's files are understood by the names that it writes.

use std::path::Path;

use exr::prelude::{AttributeValue, FlatSamples};
use linpred::channels::{Count, Mapping, Meaning, Preset, Role, RoleRequest, Variance};
use linpred::job::{Input, InputRequest};
use linpred::{Error, Feature, InputRow, Remedy, RowSource};
use linpred_tests::images::{TestPart, constant, float, half, part, write};

const SIZE: (usize, usize) = (4, 3);
const PIXELS: usize = 12;

/// An image of float channels of these names.
fn image(names: &[&str], attributes: Vec<(&'static str, AttributeValue)>) -> TestPart {
    let mut image = part(names.iter().map(|name| float(name, PIXELS, 1)).collect());
    image.attributes = attributes;
    image
}

/// `layer` with each of `components`.
fn layer(layer: &str, components: &[&str]) -> Vec<String> {
    components
        .iter()
        .map(|component| format!("{layer}.{component}"))
        .collect()
}

fn open(parts: Vec<TestPart>, roles: RoleRequest) -> Result<Input, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    write(&path, SIZE, parts);
    Input::open(&InputRequest::new(path).with_roles(roles))
}

fn auto(parts: Vec<TestPart>) -> Input {
    open(parts, RoleRequest::default()).unwrap()
}

/// The names of the channels in a role.
#[track_caller]
fn played_by(input: &Input, role: Role) -> Vec<String> {
    let assignment = input
        .roles
        .assignment(role)
        .unwrap_or_else(|| panic!("no {}", role.name()));
    assignment
        .channels
        .iter()
        .map(|&at| input.names.name(at))
        .collect()
}

fn strings(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

fn text(value: &str) -> AttributeValue {
    AttributeValue::Text(value.into())
}

#[test]
fn blender_with_denoising_data_takes_the_noisy_image_and_the_denoising_passes() {
    let mut names = Vec::new();
    for (pass, components) in [
        ("Combined", &["R", "G", "B", "A"][..]),
        ("Noisy Image", &["R", "G", "B", "A"]),
        ("Denoising Albedo", &["R", "G", "B"]),
        ("Denoising Normal", &["X", "Y", "Z"]),
        ("Denoising Depth", &["Z"]),
        ("Depth", &["Z"]),
        ("Normal", &["X", "Y", "Z"]),
        ("Debug Sample Count", &["X"]),
    ] {
        names.extend(layer(&format!("My Layer.{pass}"), components));
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let input = auto(vec![image(
        &names,
        vec![("cycles.My Layer.samples", text("64"))],
    )]);
    assert_eq!(
        played_by(&input, Role::Colour),
        layer("My Layer.Noisy Image", &["R", "G", "B"])
    );
    assert_eq!(
        played_by(&input, Role::Albedo),
        layer("My Layer.Denoising Albedo", &["R", "G", "B"])
    );
    assert_eq!(
        played_by(&input, Role::Normal),
        layer("My Layer.Denoising Normal", &["X", "Y", "Z"])
    );
    assert_eq!(
        played_by(&input, Role::Depth),
        ["My Layer.Denoising Depth.Z"]
    );
    assert_eq!(input.roles.variance, Variance::None);
    let samples = input.roles.samples.clone().unwrap();
    assert!(
        matches!(samples.count, Count::Channel { scale: 64.0, .. }),
        "{samples:?}"
    );
    assert!(input.roles.assignments[0].rule.contains("preset blender"));
}

#[test]
fn blender_in_many_parts_is_the_same_as_in_one() {
    let passes = [
        ("VL.Combined", &["R", "G", "B", "A"][..]),
        ("VL.Denoising Normal", &["X", "Y", "Z"]),
        ("VL.Depth", &["Z"]),
    ];
    let parts = passes.map(|(pass, components)| {
        let names = layer(pass, components);
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        TestPart {
            name: Some(pass),
            ..image(&names, vec![("BlenderMultiChannel", text("yes"))])
        }
    });
    let input = auto(parts.to_vec());
    assert_eq!(
        played_by(&input, Role::Colour),
        layer("VL.Combined", &["R", "G", "B"])
    );
    assert_eq!(
        played_by(&input, Role::Normal),
        layer("VL.Denoising Normal", &["X", "Y", "Z"])
    );
    assert_eq!(played_by(&input, Role::Depth), ["VL.Depth.Z"]);
}

#[test]
fn another_view_layers_features_are_not_mixed_in() {
    let mut names = layer("Front.Combined", &["R", "G", "B"]);
    names.extend(layer("Rear.Denoising Albedo", &["R", "G", "B"]));
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let input = auto(vec![image(
        &names,
        vec![("cycles.Front.samples", text("4"))],
    )]);
    assert!(input.roles.feature(Feature::Albedo).is_none());
}

#[test]
fn parts_may_hold_the_layer_in_their_own_name() {
    let named = |name, channels: &[&str]| TestPart {
        name: Some(name),
        ..image(channels, vec![])
    };
    let input = auto(vec![
        named("rgba", &["R", "G", "B", "A"]),
        named("albedo", &["R", "G", "B"]),
        named("N", &["X", "Y", "Z"]),
        named("depth", &["Z"]),
    ]);
    assert_eq!(input.roles.colour.map(|at| at.part), [0; 3]);
    assert_eq!(
        played_by(&input, Role::Albedo),
        layer("albedo", &["R", "G", "B"])
    );
    assert_eq!(
        played_by(&input, Role::Normal),
        layer("N", &["X", "Y", "Z"])
    );
    assert_eq!(played_by(&input, Role::Depth), ["depth.Z"]);
}

#[test]
fn mitsuba_moments_belong_to_the_image_below_the_bare_names() {
    let mut names = strings(&["R", "G", "B"]);
    for prefix in ["", "m2_"] {
        names.extend(layer(&format!("{prefix}nested"), &["X", "Y", "Z"]));
        names.extend(layer(&format!("{prefix}nested.albedo"), &["R", "G", "B"]));
        names.extend(layer(&format!("{prefix}nested.img"), &["R", "G", "B", "A"]));
        names.extend(layer(&format!("{prefix}nested.nn"), &["X", "Y", "Z"]));
        names.extend(layer(&format!("{prefix}nested.dd"), &["T"]));
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mitsuba = vec![("generatedBy", text("Mitsuba version 3.9.1"))];
    let request = RoleRequest {
        spp: Some(32),
        ..RoleRequest::default()
    };
    let input = open(vec![image(&names, mitsuba.clone())], request).unwrap();
    assert_eq!(played_by(&input, Role::Colour), ["R", "G", "B"]);
    assert_eq!(
        played_by(&input, Role::Variance),
        layer("m2_nested.img", &["R", "G", "B"])
    );
    assert_eq!(
        played_by(&input, Role::AlbedoVariance),
        layer("m2_nested.albedo", &["R", "G", "B"])
    );
    assert_eq!(
        played_by(&input, Role::Normal),
        layer("nested.nn", &["X", "Y", "Z"])
    );
    assert_eq!(played_by(&input, Role::Depth), ["nested.dd.T"]);
    let Variance::Given { meaning, count, .. } = input.roles.variance else {
        panic!("{:?}", input.roles.variance)
    };
    assert_eq!(
        (meaning, count),
        (Meaning::SecondMoment, Some(Count::Fixed(32.0)))
    );
    // the file does not say how many samples they are from
    let error = open(vec![image(&names, mitsuba)], RoleRequest::default()).unwrap_err();
    let remedy = Remedy::SamplesOrNoVariance;
    assert!(
        matches!(error, Error::Incomplete { remedy: r, .. } if r == remedy),
        "{error}"
    );
}

#[test]
fn pbrt_holds_the_variance_of_one_sample() {
    let names = [
        "R",
        "G",
        "B",
        "Albedo.R",
        "Albedo.G",
        "Albedo.B",
        "Ns.X",
        "Ns.Y",
        "Ns.Z",
        "N.X",
        "N.Y",
        "N.Z",
        "Variance.R",
        "Variance.G",
        "Variance.B",
        "u",
        "v",
    ];
    let input = auto(vec![image(
        &names,
        vec![("samplesPerPixel", AttributeValue::I32(128))],
    )]);
    assert_eq!(
        played_by(&input, Role::Normal),
        layer("Ns", &["X", "Y", "Z"])
    );
    let Variance::Given { meaning, count, .. } = input.roles.variance else {
        panic!("{:?}", input.roles.variance)
    };
    assert_eq!(
        (meaning, count),
        (Meaning::OfSample, Some(Count::Fixed(128.0)))
    );
    let old = ["R", "G", "B", "Nsx", "Nsy", "Nsz"];
    let input = auto(vec![image(
        &old,
        vec![("samplesPerPixel", AttributeValue::I32(1))],
    )]);
    assert_eq!(played_by(&input, Role::Normal), ["Nsx", "Nsy", "Nsz"]);
}

#[test]
fn renderman_arnold_vray_and_tungsten_names_are_known_to_their_presets() {
    for (preset, names, albedo, normal) in [
        (
            "renderman",
            &[
                "Ci.r",
                "Ci.g",
                "Ci.b",
                "albedo.r",
                "albedo.g",
                "albedo.b",
                "normal.x",
                "normal.y",
                "normal.z",
                "zfiltered",
                "mse.r",
                "mse.g",
                "mse.b",
            ][..],
            "albedo.r",
            "normal.x",
        ),
        (
            "arnold",
            &[
                "R",
                "G",
                "B",
                "A",
                "denoise_albedo.R",
                "denoise_albedo.G",
                "denoise_albedo.B",
                "N.X",
                "N.Y",
                "N.Z",
                "Z",
                "variance.R",
                "variance.G",
                "variance.B",
            ],
            "denoise_albedo.R",
            "N.X",
        ),
        (
            "vray",
            &[
                "R",
                "G",
                "B",
                "diffuse.red",
                "diffuse.green",
                "diffuse.blue",
                "bump_normals.X",
                "bump_normals.Y",
                "bump_normals.Z",
                "other.noiseLevel",
            ],
            "diffuse.red",
            "bump_normals.X",
        ),
        (
            "tungsten",
            &[
                "R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y",
                "normal.Z",
            ],
            "albedo.R",
            "normal.X",
        ),
    ] {
        let request = RoleRequest {
            preset: Preset::named(preset),
            ..RoleRequest::default()
        };
        let input = open(vec![image(names, vec![])], request).unwrap();
        assert_eq!(played_by(&input, Role::Albedo)[0], albedo, "{preset}");
        assert_eq!(played_by(&input, Role::Normal)[0], normal, "{preset}");
        assert!(input.roles.assignments[0].rule.contains(preset), "{preset}");
    }
}

#[test]
fn a_component_of_a_vector_is_not_a_depth() {
    let input = auto(vec![image(&["R", "G", "B", "P.X", "P.Y", "P.Z"], vec![])]);
    assert!(
        input.roles.feature(Feature::Depth).is_none(),
        "{:?}",
        input.roles.features
    );
}

#[test]
fn given_variance_is_preferred_to_half_buffers_and_the_user_to_both() {
    let mut names = strings(&["R", "G", "B"]);
    for group in ["halfA", "halfB", "variance"] {
        names.extend(layer(group, &["R", "G", "B"]));
    }
    let all: Vec<&str> = names.iter().map(String::as_str).collect();
    let input = auto(vec![image(&all, vec![])]);
    assert!(matches!(
        input.roles.variance,
        Variance::Given {
            meaning: Meaning::OfMean,
            ..
        }
    ));
    assert!(
        input
            .roles
            .notes
            .iter()
            .any(|note| note.contains("half buffers not used"))
    );
    let input = auto(vec![image(&all[..9], vec![])]);
    assert!(matches!(input.roles.variance, Variance::Halves { .. }));
    let mapped = |maps: &[&str]| {
        let map = maps
            .iter()
            .map(|map| Mapping::parse(map).unwrap())
            .collect();
        open(
            vec![image(&all, vec![])],
            RoleRequest {
                map,
                ..RoleRequest::default()
            },
        )
        .unwrap()
    };
    assert_eq!(mapped(&["variance=none"]).roles.variance, Variance::None);
    let halves = mapped(&["half-a=halfB", "half-b=halfA"]);
    assert!(matches!(halves.roles.variance, Variance::Halves { .. }));
    assert_eq!(
        played_by(&mapped(&["albedo=halfA.R,halfA.G,halfB.B"]), Role::Albedo),
        ["halfA.R", "halfA.G", "halfB.B"]
    );
}

#[test]
fn a_feature_of_another_window_is_used_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let colours = part(["R", "G", "B"].map(|c| half(c, PIXELS, 1)).to_vec());
    let small = part(["R", "G", "B"].map(|c| constant(c, PIXELS, 0.5)).to_vec());
    // both parts are written at one size, then the header of the second is made to tell another
    write(
        &path,
        SIZE,
        vec![
            TestPart {
                name: Some("rgba"),
                ..colours
            },
            TestPart {
                name: Some("albedo"),
                ..small
            },
        ],
    );
    shift_second_part(&path, 1);
    let request = |map| {
        let roles = RoleRequest {
            map,
            ..RoleRequest::default()
        };
        InputRequest::new(&path).with_roles(roles)
    };
    let input = Input::open(&request(vec![])).unwrap();
    let [warning] = &input.roles.warnings[..] else {
        panic!("{:?}", input.roles.warnings)
    };
    assert!(
        warning.contains("albedo is not known everywhere"),
        "{warning}"
    );
    assert!(warning.contains("4 x 3 pixels at (4, -5)"), "{warning}");
    let mut source = input.source(1 << 30).unwrap();
    let mut row = InputRow::new(&source.layout());
    source.read_row(0, &mut row).unwrap();
    let albedo = row.feature_mut(Feature::Albedo);
    assert!(
        albedo[0][0].is_nan() && albedo[0][1] == 0.5,
        "{:?}",
        albedo[0]
    );

    shift_second_part(&path, SIZE.0 as i32);
    let input = Input::open(&request(vec![])).unwrap();
    assert!(input.roles.feature(Feature::Albedo).is_none());
    assert!(input.roles.warnings[0].contains("albedo not used"));
    let error = Input::open(&request(vec![Mapping::parse("albedo=albedo").unwrap()])).unwrap_err();
    assert!(matches!(error, Error::Invalid(_)), "{error}");
}

/// Moves the data window of the second part to the right.
fn shift_second_part(path: &Path, columns: i32) {
    use linpred::exr_file::attributes::RawHeader;
    let bytes = std::fs::read(path).unwrap();
    let mut header = RawHeader::parse(&bytes).unwrap().unwrap();
    let mut window = header.parts[1]
        .value("dataWindow", "box2i")
        .unwrap()
        .to_vec();
    for at in [0, 8] {
        let x = i32::from_le_bytes(window[at..at + 4].try_into().unwrap()) + columns;
        window[at..at + 4].copy_from_slice(&x.to_le_bytes());
    }
    header.parts[1].set("dataWindow", "box2i", window);
    let mut patched = RawHeader::encode(header.version, &header.parts);
    patched.extend_from_slice(&bytes[header.length..]);
    std::fs::write(path, patched).unwrap();
}

#[test]
fn a_channel_may_say_how_many_samples_each_pixel_took() {
    let mut channels: Vec<_> = ["R", "G", "B"].map(|c| constant(c, PIXELS, 1.0)).to_vec();
    channels.extend(["R", "G", "B"].map(|c| constant(&format!("Variance.{c}"), PIXELS, 6.0)));
    let counts = (0..PIXELS).map(|i| (i + 1) as f32).collect();
    channels.push(("sampleCount".into(), FlatSamples::F32(counts)));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    write(&path, SIZE, vec![part(channels)]);
    let input = Input::open(&InputRequest::new(path)).unwrap();
    let mut source = input.source(1 << 30).unwrap();
    let mut row = InputRow::new(&source.layout());
    source.read_row(1, &mut row).unwrap();
    assert_eq!(
        row.variance[2],
        [6.0 / 5.0, 6.0 / 6.0, 6.0 / 7.0, 6.0 / 8.0]
    );
}

/// `Z` of the first layer that has one was once taken for the depth: with a part per layer that was the depth's variance.
#[test]
fn a_depth_beside_the_colour_of_a_part_is_not_its_variance() {
    let names = [
        "ZVariance.Z",
        "beauty.R",
        "beauty.G",
        "beauty.B",
        "beauty.Z",
    ];
    let input = auto(vec![image(&names, vec![])]);
    assert_eq!(played_by(&input, Role::Depth), strings(&["beauty.Z"]));
    assert_eq!(
        played_by(&input, Role::DepthVariance),
        strings(&["ZVariance.Z"])
    );
}

#[test]
fn a_y_beside_an_x_is_no_luminance_and_a_depth_alone_no_colour() {
    let vector = |name| TestPart {
        name: Some(name),
        ..image(&["X", "Y", "Z"], vec![])
    };
    let main = TestPart {
        name: Some("main"),
        ..image(&["R", "G", "B"], vec![])
    };
    let input = auto(vec![vector("N"), main]);
    assert_eq!(input.roles.colour.map(|at| at.part), [1; 3]);
    let input = auto(vec![image(&["X", "Y", "Z", "C.R", "C.G", "C.B"], vec![])]);
    assert_eq!(
        played_by(&input, Role::Colour),
        layer("C", &["R", "G", "B"])
    );
    for alone in [
        "Z",
        "depth.Z",
        "depth.Y",
        "A",
        "id",
        "N.X",
        "noise.variance",
    ] {
        let error = open(vec![image(&[alone], vec![])], RoleRequest::default()).unwrap_err();
        assert!(matches!(error, Error::Invalid(_)), "{alone}: {error}");
    }
    let input = auto(vec![image(&["Y"], vec![])]);
    assert!(input.roles.mono());
}

#[test]
fn layers_are_told_by_the_ends_of_their_names_however_they_are_put() {
    for (names, role, expected) in [
        (
            &["albedo.red", "albedo.green", "albedo.blue"][..],
            Role::Albedo,
            3,
        ),
        (&["albedo_r", "albedo_g", "albedo_b"], Role::Albedo, 3),
        (&["AlbedoRed", "AlbedoGreen", "AlbedoBlue"], Role::Albedo, 3),
        (&["N.red", "N.green", "N.blue"], Role::Normal, 3),
        (&["Nx", "Ny", "Nz"], Role::Normal, 3),
        (&["normal_X", "normal_Y", "normal_Z"], Role::Normal, 3),
        (&["depth.Z"], Role::Depth, 1),
    ] {
        let mut all = vec!["rgba.red", "rgba.green", "rgba.blue", "rgba.alpha"];
        all.extend(names);
        let input = auto(vec![image(&all, vec![])]);
        assert_eq!(
            played_by(&input, Role::Colour),
            layer("rgba", &["red", "green", "blue"])
        );
        assert_eq!(played_by(&input, Role::Alpha), strings(&["rgba.alpha"]));
        assert_eq!(played_by(&input, role).len(), expected, "{names:?}");
        assert_eq!(played_by(&input, role), strings(names), "{names:?}");
    }
}

#[test]
fn a_name_is_accepted_as_inspect_prints_it() {
    let map = |text| RoleRequest {
        map: vec![Mapping::parse(text).unwrap()],
        ..RoleRequest::default()
    };
    let names = [".R", ".G", ".B", ".depth"];
    let input = open(vec![image(&names, vec![])], map("depth=.depth")).unwrap();
    assert_eq!(played_by(&input, Role::Depth), strings(&[".depth"]));
    let names = ["R", "G", "B", "kd.R", "kd.G", "kd.B"];
    for (text, words) in [
        ("depth=kd", "is a layer of"),
        ("albedo=kd.R,kd.G", "no such channel or layer"),
        ("normal=R", "is one channel of"),
    ] {
        let error = open(vec![image(&names, vec![])], map(text)).unwrap_err();
        assert!(error.to_string().contains(words), "{text}: {error}");
    }
}

/// Found by fuzzing: such a layer has an empty name after its last dot, which is that of bare channels.
#[test]
fn a_name_of_dots_alone_is_a_name() {
    assert!(auto(vec![image(&[".."], vec![])]).roles.mono());
}

/// Found by fuzzing.
#[test]
fn a_colour_is_not_its_own_alpha() {
    let map = |text| RoleRequest {
        map: vec![Mapping::parse(text).unwrap()],
        ..RoleRequest::default()
    };
    let input = open(vec![image(&["a", "b"], vec![])], map("colour=a")).unwrap();
    assert_eq!(input.roles.alpha, None);
    let error = open(vec![image(&["R", "G", "B"], vec![])], map("alpha=G")).unwrap_err();
    assert!(
        error.to_string().contains("channel of the colour"),
        "{error}"
    );
}

#[test]
fn the_picture_is_told_by_its_parts_name_wherever_it_stands() {
    let named = |name, components: &[&str]| TestPart {
        name: Some(name),
        ..image(components, vec![])
    };
    let rgb = ["R", "G", "B"];
    let features = [
        named("diffuse", &rgb),
        named("albedo", &rgb),
        named("variance", &rgb),
        named("N", &["X", "Y", "Z"]),
        named("depth", &["Z"]),
    ];
    for place in 0..=features.len() {
        let mut parts = features.to_vec();
        parts.insert(place, named("rgba", &rgb));
        let input = auto(parts);
        assert_eq!(input.roles.colour.map(|at| at.part), [place; 3]);
        let part_of = |role| input.roles.assignment(role).map(|a| a.channels[0].part);
        let after = |index: usize| Some(index + usize::from(index >= place));
        assert_eq!(part_of(Role::Albedo), after(1));
        assert_eq!(part_of(Role::Variance), after(2));
        assert_eq!(part_of(Role::Normal), after(3));
        assert_eq!(part_of(Role::Depth), after(4));
    }
    for layer in ["N", "variance", "Denoising Albedo"] {
        let alone = ["R", "G", "B"].map(|c| format!("{layer}.{c}"));
        let alone: Vec<&str> = alone.iter().map(String::as_str).collect();
        assert!(
            open(vec![image(&alone, vec![])], RoleRequest::default()).is_err(),
            "{layer}"
        );
    }
}

/// A file that has lost its attributes in a tool.
#[test]
fn blenders_passes_are_told_by_their_names_too() {
    let mut names = layer("VL.Noisy Image", &["R", "G", "B"]);
    names.extend(layer("VL.Combined", &["R", "G", "B"]));
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let input = auto(vec![image(&names, vec![])]);
    assert_eq!(
        played_by(&input, Role::Colour),
        layer("VL.Noisy Image", &["R", "G", "B"])
    );
    assert_ne!(input.roles.target, input.roles.colour);
}
