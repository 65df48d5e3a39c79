//! Features beside normal, albedo and depth are found by the names that are asked for, used with the noise that stands beside them, and refused in a sentence
//! where they cannot be any.

use std::path::Path;

use exr::prelude::{AttributeValue, Vec2};
use linpred::channels::{FeatureRequest, Meaning, RoleRequest, Variance};
use linpred::job::{Input, InputRequest, describe};
use linpred::{Error, Setting};
use linpred_tests::command::{Ran, denoise, linpred};
use linpred_tests::images::{
    NamedSamples, TestPart, bits, channel_names, colour, constant, everything, float, noise, part,
    plane, read, uint, values, write,
};

const SIZE: (usize, usize) = (60, 70);
const PIXELS: usize = SIZE.0 * SIZE.1;

/// Channels that no preset has a role for.
fn others() -> Vec<NamedSamples> {
    let names = [
        "P.X",
        "P.Y",
        "P.Z",
        "PVariance.X",
        "PVariance.Y",
        "PVariance.Z",
        "rough",
        "rough_mse",
        "spec.R",
        "spec.G",
        "spec.B",
        "spec.A",
        "m.a",
        "m.b",
        "m.c",
        "m.d",
        "noiseOfSpec.B",
        "noiseOfSpec.G",
        "noiseOfSpec.R",
    ];
    let named = names.into_iter().zip(100..);
    named
        .map(|(name, seed)| float(name, PIXELS, seed))
        .collect()
}

fn open_channels(channels: Vec<NamedSamples>, features: &[&str]) -> Result<Input, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    write(&path, SIZE, vec![part(channels)]);
    open_file(&path, features)
}

fn open_file(path: &Path, features: &[&str]) -> Result<Input, Error> {
    let features = features.iter().map(|text| FeatureRequest::parse(text));
    let roles = RoleRequest {
        features: features.collect::<Result<_, Error>>().unwrap(),
        ..RoleRequest::default()
    };
    Input::open(&InputRequest::new(path).with_roles(roles))
}

fn open(features: &[&str]) -> Result<Input, Error> {
    open_channels(
        everything(PIXELS).into_iter().chain(others()).collect(),
        features,
    )
}

/// Of each feature its channels and those of its variance.
fn found(input: &Input) -> Vec<(Vec<String>, Vec<String>)> {
    let names = |channels: &[_]| channels.iter().map(|at| input.names.name(*at)).collect();
    let further = input.roles.further.iter();
    further
        .map(|own| (names(&own.channels), names(&own.variance.channels())))
        .collect()
}

fn strings(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

#[test]
fn a_layer_a_channel_and_some_channels_of_a_layer() {
    let input = open(&["P", "rough", "spec:B"]).unwrap();
    let variance = strings(&["PVariance.X", "PVariance.Y", "PVariance.Z"]);
    assert_eq!(
        found(&input),
        [
            (strings(&["P.X", "P.Y", "P.Z"]), variance),
            (strings(&["rough"]), strings(&["rough_mse"])),
            (strings(&["spec.B"]), vec![]),
        ]
    );
    // an alpha is none of the channels of a colour
    let input = open(&["spec=noiseOfSpec", "m.b=m.c"]).unwrap();
    let channels = strings(&["spec.R", "spec.G", "spec.B"]);
    let variance = strings(&["noiseOfSpec.R", "noiseOfSpec.G", "noiseOfSpec.B"]);
    assert_eq!(
        found(&input),
        [(channels, variance), (strings(&["m.b"]), strings(&["m.c"]))]
    );
    let input = open(&["P:Z,X"]).unwrap();
    let variance = strings(&["PVariance.Z", "PVariance.X"]);
    assert_eq!(found(&input), [(strings(&["P.Z", "P.X"]), variance)]);
}

#[test]
fn the_variance_of_one_sample_is_divided_by_their_number() {
    let mut channels = colour(PIXELS);
    for name in ["r", "r_var", "s", "m2_s"] {
        channels.push(float(name, PIXELS, 5));
    }
    let meaning = |input: &Input, n: usize| match input.roles.further[n].variance {
        Variance::Given { meaning, .. } => Some(meaning),
        _ => None,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let mut image = part(channels);
    write(&path, SIZE, vec![image.clone()]);
    let input = open_file(&path, &["r", "s"]).unwrap();
    assert_eq!((meaning(&input, 0), meaning(&input, 1)), (None, None));
    let said = |word: &str| input.roles.warnings.iter().any(|said| said.contains(word));
    assert!(
        said("r_var not used") && said("m2_s not used"),
        "{:?}",
        input.roles.warnings
    );
    image.attributes = vec![("spp", AttributeValue::I32(16))];
    write(&path, SIZE, vec![image]);
    let input = open_file(&path, &["r", "s"]).unwrap();
    assert_eq!(meaning(&input, 0), Some(Meaning::OfSample));
    assert_eq!(meaning(&input, 1), Some(Meaning::SecondMoment));
}

#[test]
fn what_cannot_be_a_feature_is_refused_in_a_sentence() {
    for (features, words) in [
        (&["Q"][..], "has no such layer or channel; it has"),
        (
            &["m"],
            "has 4 channels (m.a, m.b, m.c, m.d), and a feature 3 at most: choose some of them, as in m:a",
        ),
        (&["P:W"], "has no channel \"W\"; it has P.X, P.Y, P.Z"),
        (&["P:X,X"], "names a channel twice"),
        (
            &["P", "spec", "rough"],
            "does not fit beside P, spec: further features of 7 channels: there is room for 6",
        ),
        (&["P", "P.X"], "P.X is a feature already: name it once"),
        (&["R"], "R is the colour itself"),
        (&["N"], "N.X is the normal already: leave it out"),
        (&["Z"], "Z is the depth already"),
        (
            &["variance"],
            "variance.R is the variance of the colour and has its noise",
        ),
        (&["SPEC"], "(did you mean spec?); it has"),
        (
            &["P,rough"],
            "(one layer or channel for each time that the option is given)",
        ),
        (&["objectId"], "objectId holds identifiers"),
        (
            &["P=rough"],
            "has no rough of 3 channels, as many as P.X, P.Y, P.Z, whose variance it is to be",
        ),
    ] {
        let error = open(features).unwrap_err();
        let is_of_feature = matches!(
            error,
            Error::Setting {
                setting: Setting::Feature,
                ..
            }
        );
        assert!(
            is_of_feature && error.to_string().contains(words),
            "{error}"
        );
    }
}

#[test]
fn what_the_renderer_is_known_to_write_is_offered_and_taken_if_asked_for() {
    let position = |text: &str| format!("ViewLayer.{text}");
    let mut channels = Vec::new();
    for (pass, components) in [
        ("Combined", "RGB"),
        ("Depth", "Z"),
        ("Normal", "XYZ"),
        ("Position", "XYZ"),
        ("Glossy Color", "RGB"),
        ("Roughness", "X"),
        ("Mist", "Z"),
    ] {
        for component in components.chars() {
            let name = position(&format!("{pass}.{component}"));
            channels.push(float(&name, PIXELS, 7));
        }
    }
    let image = TestPart {
        attributes: vec![("cycles.ViewLayer.samples", AttributeValue::Text("4".into()))],
        ..part(channels)
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    write(&path, SIZE, vec![image]);
    let all = ["Position", "Roughness", "Glossy Color"].map(position);
    let input = open_file(&path, &[]).unwrap();
    assert_eq!(describe(std::slice::from_ref(&input)).offered, all);
    assert!(input.roles.further.is_empty());
    let input = open_file(&path, &["auto"]).unwrap();
    let names: Vec<&str> = input
        .roles
        .further
        .iter()
        .map(|own| own.name.as_str())
        .collect();
    assert_eq!(names, all.each_ref().map(String::as_str)[..2]);
    let note = &input.roles.notes;
    assert!(
        note.iter()
            .any(|note| note.contains("Glossy Color: does not fit")),
        "{note:?}"
    );
    // by its name alone, or with the view layer's
    for name in ["Position", "ViewLayer.Position"] {
        assert_eq!(open_file(&path, &[name]).unwrap().roles.further.len(), 1);
    }
    let described = describe(&[open_file(&path, &["Position"]).unwrap()]);
    assert_eq!(described.offered, all[1..]);
    assert!(
        !described
            .untouched
            .iter()
            .any(|name| name.contains("Position"))
    );
}

/// What stands in a part of its own has the part's name before its own, which is no view layer's.
#[test]
fn a_layer_of_another_part_is_found_by_its_own_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let named = |name, channels| TestPart {
        name: Some(name),
        ..part(channels)
    };
    let of_part = |names: &[&str]| -> Vec<NamedSamples> {
        names.iter().map(|name| float(name, PIXELS, 9)).collect()
    };
    let parts = vec![
        named("main", colour(PIXELS)),
        named("pos", of_part(&["P.X", "P.Y", "P.Z"])),
        named("noise", of_part(&["PV.X", "PV.Y", "PV.Z"])),
    ];
    write(&path, SIZE, parts);
    for asked in ["P", "pos.P", "auto"] {
        let input = open_file(&path, &[asked]).unwrap();
        let [(channels, _)] = &found(&input)[..] else {
            panic!("{asked}: {:?}", found(&input));
        };
        assert!(channels[0].ends_with("P.X"), "{asked}: {channels:?}");
    }
    let [(_, variance)] = &found(&open_file(&path, &["P=PV"]).unwrap())[..] else {
        panic!("no feature");
    };
    assert!(variance[2].ends_with("PV.Z"), "{variance:?}");
}

#[test]
fn a_name_may_hold_what_stands_between_names() {
    let names = ["light:key", "a=b", "c:d=e"];
    let mut channels = colour(PIXELS);
    channels.extend(names.map(|name| float(name, PIXELS, 3)));
    let input = open_channels(channels, &["light:key=a=b", "c:d=e"]).unwrap();
    assert_eq!(
        found(&input),
        [
            (strings(&["light:key"]), strings(&["a=b"])),
            (strings(&["c:d=e"]), vec![])
        ]
    );
}

#[test]
fn what_is_known_and_asked_for_as_well_is_taken_once_and_nothing_known_is_said() {
    let notes = |input: &Input| input.roles.notes.join("; ");
    let input = open(&["P", "auto"]).unwrap();
    assert_eq!(found(&input).len(), 1);
    assert!(!notes(&input).contains("feature"), "{}", notes(&input));
    let input = open_channels(colour(PIXELS), &["auto"]).unwrap();
    assert!(notes(&input).contains("nothing that the presets know"));
}

/// Writes a grey picture whose light is a pattern, with that in `hint` and noise beside it; of each `render` its own noise.
fn picture(path: &Path, render: u32) {
    let pattern = |x: usize, y: usize| {
        if (x * x / 7 + y * y / 5).is_multiple_of(3) {
            0.9
        } else {
            0.2
        }
    };
    let mut channels = Vec::new();
    for (seed, name) in (1 + 3 * render..).zip(["R", "G", "B"]) {
        channels.push(plane(name, SIZE, |x, y| {
            pattern(x, y) * (0.5 + noise(seed, y * 99 + x))
        }));
        channels.push(plane(&format!("variance.{name}"), SIZE, |x, y| {
            pattern(x, y).powi(2) / 12.0
        }));
    }
    channels.push(plane("hint", SIZE, pattern));
    // a pattern as fine as noise would be taken for noise
    channels.push(constant("hintVariance", PIXELS, 0.0));
    channels.push(plane("truth", SIZE, pattern));
    channels.push(float("useless.X", PIXELS, 50));
    channels.push(constant("useless.Y", PIXELS, 1.0));
    write(path, SIZE, vec![part(channels)]);
}

fn error(path: &Path) -> f32 {
    let (green, truth) = (values(path, "G"), values(path, "truth"));
    let squares = green
        .iter()
        .zip(&truth)
        .map(|(own, truth)| (own - truth).powi(2));
    squares.sum::<f32>() / PIXELS as f32
}

#[test]
fn a_named_feature_is_used_in_whole_files_in_bands_and_in_frames_that_help_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    picture(&folder.join("in.exr"), 0);
    denoise(folder, "without.exr", &[]).succeeds();
    let options = ["--feature", "hint", "--feature", "useless"];
    denoise(folder, "with.exr", &options).succeeds();
    let (with, without) = (
        error(&folder.join("with.exr")),
        error(&folder.join("without.exr")),
    );
    assert!(with < 0.3 * without, "{with} of {without}");
    let kept = read(&folder.join("with.exr"));
    let original = read(&folder.join("in.exr"));
    assert_eq!(bits(&kept, 0, "hint"), bits(&original, 0, "hint"));
    for (name, band) in [("b1.exr", "1/2"), ("b2.exr", "2/2")] {
        denoise(folder, name, &[&options[..], &["--band", band]].concat()).succeeds();
    }
    let file = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let stitched = [
        "stitch".to_owned(),
        file("b1.exr"),
        file("b2.exr"),
        "-o".to_owned(),
        file("stitched.exr"),
    ];
    linpred(stitched).succeeds();
    let stitched = read(&folder.join("stitched.exr"));
    assert_eq!(stitched.layer_data[0].size, Vec2(SIZE.0, SIZE.1));
    for name in channel_names(&kept, 0) {
        assert_eq!(bits(&stitched, 0, &name), bits(&kept, 0, &name), "{name}");
    }
    picture(&folder.join("before.exr"), 1);
    let before = file("before.exr");
    let helped = [&options[..], &["--temporal", "--before", &before]].concat();
    denoise(folder, "helped.exr", &helped).succeeds();
    let helped = error(&folder.join("helped.exr"));
    assert!(helped < 0.3 * without, "{helped} of {without}");
}

#[test]
fn bands_with_other_features_or_other_noise_of_them_do_not_make_a_frame() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    picture(&folder.join("in.exr"), 0);
    denoise(folder, "b1.exr", &["--band", "1/2", "--feature", "hint"]).succeeds();
    let file = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    for other in [&[][..], &["--feature", "hint=useless.Y"]] {
        denoise(folder, "b2.exr", &[&["--band", "2/2"], other].concat()).succeeds();
        let ran: Ran = linpred([
            "stitch".to_owned(),
            file("b1.exr"),
            file("b2.exr"),
            "-o".to_owned(),
            file("out.exr"),
        ]);
        ran.exits_with(3);
    }
}

#[test]
fn a_plan_counts_what_features_take() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    picture(&folder.join("in.exr"), 0);
    let plan = |options: &[&str]| {
        let options = [options, &["--dry-run"]].concat();
        denoise(folder, "out.exr", &options)
            .succeeds()
            .planned_bytes()
    };
    let (without, with) = (plan(&[]), plan(&["--feature", "hint"]));
    assert!(with > without + (1 << 20), "{with} {without}");
}

#[test]
fn the_command_names_the_option_and_inspect_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut channels = everything(PIXELS);
    channels.extend(others());
    channels.push(uint("cryptoId", PIXELS));
    write(&folder.join("in.exr"), SIZE, vec![part(channels)]);
    denoise(folder, "out.exr", &["--feature", "nothing"])
        .exits_with(2)
        .complains_about(&["--feature nothing: ", "has no such layer or channel"]);
    denoise(folder, "out.exr", &["--feature", "P:"])
        .exits_with(2)
        .complains_about(&["NAME:CHANNELS"]);
    let file = folder.join("in.exr");
    let inspect = |options: &[&str]| {
        let file = file.to_str().unwrap();
        linpred([&["inspect", file], options].concat()).succeeds()
    };
    inspect(&[]).prints(&["more features     P (used if asked for)"]);
    inspect(&["--feature", "P", "--feature", "rough"]).prints(&[
        "feature          P.X P.Y P.Z  [asked for as a feature, its variance from PVariance.X PVariance.Y PVariance.Z]",
        "feature          rough  [asked for as a feature, its variance from rough_mse]",
    ]);
    picture(&folder.join("constant.exr"), 0);
    let file = folder.join("constant.exr");
    linpred([
        "inspect",
        file.to_str().unwrap(),
        "--pixels",
        "--feature",
        "useless",
    ])
    .succeeds()
    .prints(&["never vary        useless.Y"]);
}
