//! The views of a stereo file and the view layers of a Blender file are denoised in one run, each by its own features.

use std::path::Path;

use exr::prelude::*;
use linpred::channels::{FeatureRequest, Role, RoleRequest};
use linpred::job::{Input, InputRequest};
use linpred_tests::command;
use linpred_tests::images::{
    NamedSamples, TestPart, bits, channel_names, constant, float, part, read, write,
};

const SIZE: (usize, usize) = (45, 50);
const PIXELS: usize = SIZE.0 * SIZE.1;

fn of(prefix: &str, components: &[&str], seed: u32) -> Vec<NamedSamples> {
    let named = components.iter().zip(seed..);
    named
        .map(|(c, seed)| float(&format!("{prefix}{c}"), PIXELS, seed))
        .collect()
}

fn rgb(seed: u32) -> Vec<NamedSamples> {
    of("", &["R", "G", "B"], seed)
}

/// With the layer's name before its components, or without.
fn normal(layer: &str, seed: u32) -> Vec<NamedSamples> {
    of(layer, &["X", "Y", "Z"], seed)
}

fn with_views(mut part: TestPart, views: &[&str]) -> TestPart {
    let views = views.iter().map(|view| Text::new_or_panic(*view)).collect();
    part.attributes
        .push(("multiView", AttributeValue::TextVector(views)));
    part
}

fn of_view(name: &'static str, view: &str, channels: Vec<NamedSamples>) -> TestPart {
    let view = AttributeValue::Text(view.into());
    TestPart {
        name: Some(name),
        attributes: vec![("view", view)],
        ..part(channels)
    }
}

fn pictures(path: &Path) -> Vec<Input> {
    Input::open_all(&InputRequest::new(path).with_roles(RoleRequest::default())).unwrap()
}

#[track_caller]
fn names(input: &Input, role: Role) -> Vec<String> {
    let assignment = input.roles.assignment(role);
    let channels = assignment.map_or(&[][..], |a| a.channels.as_slice());
    channels.iter().map(|at| input.names.name(*at)).collect()
}

/// Left and right in one part, as OpenEXR's `multiView` has it, with features of each.
fn one_part() -> Vec<NamedSamples> {
    let mut channels = of("", &["R", "G", "B"], 1);
    channels.extend(of("right.", &["R", "G", "B"], 10));
    channels.extend(of("N.", &["X", "Y", "Z"], 20));
    channels.extend(of("N.right.", &["X", "Y", "Z"], 30));
    channels
}

/// One eye with it and one without would look otherwise.
#[test]
fn a_feature_that_a_view_lacks_is_refused_with_the_views_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let open = |name: &str| {
        let roles = RoleRequest {
            features: vec![FeatureRequest::named(name)],
            ..RoleRequest::default()
        };
        Input::open_all(&InputRequest::new(&path).with_roles(roles))
    };
    let mut channels = one_part();
    channels.extend(of("P.", &["X", "Y", "Z"], 40));
    channels.extend(of("Q.", &["X", "Y", "Z"], 50));
    channels.extend(of("Q.right.", &["X", "Y", "Z"], 60));
    let image = with_views(part(channels), &["left", "right"]);
    write(&path, SIZE, vec![image]);
    let error = open("P").unwrap_err().to_string();
    assert!(error.contains("in view \"right\" "), "{error}");
    assert_eq!(open("Q").unwrap().len(), 2);
}

#[test]
fn views_of_one_part_have_their_own_features_and_are_both_denoised() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    write(
        &path,
        SIZE,
        vec![with_views(part(one_part()), &["left", "right"])],
    );
    let [left, right] = &pictures(&path)[..] else {
        panic!("two views")
    };
    assert_eq!(names(left, Role::Normal), ["N.X", "N.Y", "N.Z"]);
    assert_eq!(
        names(right, Role::Colour),
        ["right.R", "right.G", "right.B"]
    );
    assert_eq!(
        names(right, Role::Normal),
        ["N.right.X", "N.right.Y", "N.right.Z"]
    );

    let run = command::denoise(folder.path(), "out.exr", &["--error-layer"]).succeeds();
    run.complains_about(&["right"]);
    let (before, after) = (read(&path), read(&folder.path().join("out.exr")));
    for name in ["R", "right.R"] {
        assert_ne!(bits(&before, 0, name), bits(&after, 0, name), "{name}");
    }
    for name in ["N.X", "N.right.X"] {
        assert_eq!(bits(&before, 0, name), bits(&after, 0, name), "{name}");
    }
    let added = channel_names(&after, 0);
    for name in ["left.linpred.error", "right.linpred.error"] {
        assert!(added.iter().any(|own| own == name), "{name} in {added:?}");
    }
}

#[test]
fn a_view_comes_out_as_it_does_alone_whatever_the_bands_and_threads() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(
        &folder.join("in.exr"),
        SIZE,
        vec![with_views(part(one_part()), &["left", "right"])],
    );
    command::denoise(folder, "out.exr", &["--threads", "2"]).succeeds();
    let both = read(&folder.join("out.exr"));
    let alone = |name: &str, seed: u32, normals: u32| {
        let mut channels = of("", &["R", "G", "B"], seed);
        channels.extend(of("N.", &["X", "Y", "Z"], normals));
        write(&folder.join(name), SIZE, vec![part(channels)]);
        let output = folder.join(format!("out_{name}"));
        command::denoise_file(&folder.join(name), &output, &["--threads", "1"]).succeeds();
        bits(&read(&output), 0, "G")
    };
    assert_eq!(bits(&both, 0, "G"), alone("left.exr", 1, 20));
    assert_eq!(bits(&both, 0, "right.G"), alone("right.exr", 10, 30));
    for band in ["1/2", "2/2"] {
        let output = format!("band{}.exr", &band[..1]);
        command::denoise(folder, &output, &["--band", band, "--threads", "3"]).succeeds();
    }
    let stitch = ["stitch", "band1.exr", "band2.exr", "-o", "stitched.exr"];
    let paths = stitch.map(|word| match word.ends_with(".exr") {
        true => folder.join(word).to_str().unwrap().to_owned(),
        false => word.to_owned(),
    });
    command::linpred(paths).succeeds();
    let stitched = read(&folder.join("stitched.exr"));
    for name in ["R", "right.B"] {
        assert_eq!(bits(&both, 0, name), bits(&stitched, 0, name), "{name}");
    }
}

#[test]
fn views_of_parts_are_told_by_their_attributes_and_names_in_any_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let parts = vec![
        of_view("rgba_left", "left", rgb(1)),
        of_view("right.rgba", "right", rgb(4)),
        of_view("N_right", "right", normal("N.", 7)),
        of_view("N_left", "left", normal("N.", 10)),
    ];
    write(&path, SIZE, parts);
    let [left, right] = &pictures(&path)[..] else {
        panic!("two views")
    };
    let part_of = |input: &Input, role| input.roles.assignment(role).unwrap().channels[0].part;
    assert_eq!(
        (part_of(left, Role::Colour), part_of(left, Role::Normal)),
        (0, 3)
    );
    assert_eq!(
        (part_of(right, Role::Colour), part_of(right, Role::Normal)),
        (1, 2)
    );
}

#[test]
fn a_view_is_found_whatever_stands_before_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let parts = vec![
        of_view("N_left", "left", normal("", 7)),
        of_view("rgba_left", "left", rgb(1)),
        TestPart {
            name: Some("matte"),
            ..part(rgb(20))
        },
        of_view("N_right", "right", normal("", 10)),
        of_view("rgba_right", "right", rgb(4)),
    ];
    write(&path, SIZE, parts);
    let parts: Vec<_> = (pictures(&path).iter())
        .map(|input| input.roles.colour[0].part)
        .collect();
    assert_eq!(parts, [1, 4]);

    // the right eye alone has a name
    write(&path, SIZE, vec![part(one_part())]);
    let [left, right] = &pictures(&path)[..] else {
        panic!("two views")
    };
    assert_eq!(names(left, Role::Normal), ["N.X", "N.Y", "N.Z"]);
    assert_eq!(
        names(right, Role::Colour),
        ["right.R", "right.G", "right.B"]
    );
}

#[test]
fn every_view_layer_of_a_blender_file_is_denoised_by_its_own_passes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let mut channels = Vec::new();
    for (n, layer) in (0..).zip(["ViewLayer", "ViewLayer.001"]) {
        channels.extend(of(
            &format!("{layer}.Combined."),
            &["R", "G", "B", "A"],
            40 * n + 1,
        ));
        channels.extend(of(
            &format!("{layer}.Diffuse Direct."),
            &["R", "G", "B"],
            40 * n + 21,
        ));
        channels.extend(of(
            &format!("{layer}.Denoising Albedo."),
            &["R", "G", "B"],
            40 * n + 11,
        ));
    }
    let mut image = part(channels);
    image.attributes = vec![(
        "BlenderMultiChannel",
        AttributeValue::Text("V2.55.1".into()),
    )];
    write(&path, SIZE, vec![image]);
    let pictures = pictures(&path);
    let layers = |picture: &Input| picture.layers.len();
    let request = InputRequest::new(&path).with_layers(vec!["Diffuse*".into()]);
    let chosen = Input::open_all(&request).unwrap();
    assert!(chosen.iter().all(|picture| layers(picture) == 1));
    let albedos: Vec<_> = pictures
        .iter()
        .map(|picture| names(picture, Role::Albedo)[0].clone())
        .collect();
    // in the order of the file, which sorts names
    assert_eq!(
        albedos,
        [
            "ViewLayer.001.Denoising Albedo.R",
            "ViewLayer.Denoising Albedo.R"
        ]
    );
    command::denoise(folder.path(), "out.exr", &["--layers", "Diffuse*"])
        .succeeds()
        .complains_about(&["ViewLayer.001.Combined, ViewLayer.Combined denoised"]);
    let (before, after) = (read(&path), read(&folder.path().join("out.exr")));
    for name in [
        "ViewLayer.Combined.G",
        "ViewLayer.001.Combined.G",
        "ViewLayer.Diffuse Direct.G",
        "ViewLayer.001.Diffuse Direct.G",
    ] {
        assert_ne!(bits(&before, 0, name), bits(&after, 0, name), "{name}");
    }
}

/// `Combined` is what people look at; while Blender's own denoiser is on, it holds what that made.
#[test]
fn the_result_of_a_noisy_image_goes_where_blender_shows_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let mut channels = of("VL.Noisy Image.", &["R", "G", "B", "A"], 1);
    channels
        .extend(["R", "G", "B", "A"].map(|c| constant(&format!("VL.Combined.{c}"), PIXELS, 0.5)));
    write(&path, SIZE, vec![part(channels)]);
    command::denoise(folder.path(), "out.exr", &["--preset", "blender"])
        .succeeds()
        .complains_about(&["VL.Combined denoised"]);
    let (before, after) = (read(&path), read(&folder.path().join("out.exr")));
    for component in ["R", "A"] {
        let (noisy, shown) = (
            format!("VL.Noisy Image.{component}"),
            format!("VL.Combined.{component}"),
        );
        assert_eq!(bits(&before, 0, &noisy), bits(&after, 0, &noisy));
        assert_ne!(bits(&before, 0, &shown), bits(&after, 0, &shown));
    }
}
