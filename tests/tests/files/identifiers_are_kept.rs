//! Numbers of things are never taken for light, and layers that are no parts of the colour are not blamed for it.

use linpred_tests::command;
use linpred_tests::images::{bits, colour, float, part, read, uint, write};

use exr::prelude::*;

const SIZE: (usize, usize) = (30, 25);
const PIXELS: usize = SIZE.0 * SIZE.1;

#[test]
fn a_wildcard_passes_over_identifiers_and_noise() {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = colour(PIXELS);
    let kept = [
        "CryptoObject00",
        "ids.material",
        "objectId",
        "fooVariance",
        "IndexOB",
    ];
    for (layer, seed) in kept.into_iter().zip(10..) {
        channels.extend(["R", "G", "B"].map(|c| float(&format!("{layer}.{c}"), PIXELS, seed)));
    }
    channels.extend(["R", "G", "B"].map(|c| uint(&format!("mask.{c}"), PIXELS)));
    channels.extend(["R", "G", "B"].map(|c| float(&format!("diffuse.{c}"), PIXELS, 50)));
    channels.extend(["R", "G", "B"].map(|c| float(&format!("assets.{c}"), PIXELS, 60)));
    let mut image = part(channels);
    let name = AttributeValue::Text("assets".into());
    image.attributes.push(("cryptomatte/f834d0a/name", name));
    write(&folder.path().join("in.exr"), SIZE, vec![image]);
    let run = command::denoise(folder.path(), "out.exr", &["--layers", "*"]).succeeds();
    assert!(!run.stderr().contains("WARN"), "{}", run.stderr());
    let [before, after] = ["in.exr", "out.exr"].map(|name| read(&folder.path().join(name)));
    let same = |name: &str| bits(&before, 0, name) == bits(&after, 0, name);
    for layer in kept.into_iter().chain(["mask", "assets"]) {
        assert!(same(&format!("{layer}.R")), "{layer}");
    }
    assert!(!same("diffuse.R"));
    for layer in ["assets", "objectId", "mask"] {
        command::denoise(folder.path(), "none.exr", &["--layers", layer])
            .exits_with(2)
            .complains_about(&[&format!("--layers {layer}"), "kept as they are"]);
    }
}

#[test]
fn layers_that_sum_to_most_of_the_colour_are_warned_of_where_they_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let values = |scale: f32, off: usize| {
        let value =
            |i: usize| scale * (1.0 + linpred_tests::images::noise(3, i)) + f32::from(i < off);
        FlatSamples::F32((0..PIXELS).map(value).collect())
    };
    for (off, warned) in [(0, false), (40, true), (PIXELS, false)] {
        let mut channels = Vec::new();
        for c in ["R", "G", "B"] {
            channels.push((c.to_owned(), values(1.0, 0)));
            channels.push((format!("direct.{c}"), values(0.75, off)));
            channels.push((format!("indirect.{c}"), values(0.25, 0)));
        }
        write(&folder.path().join("in.exr"), SIZE, vec![part(channels)]);
        let options = ["--layers", "direct,indirect"];
        let run = command::denoise(folder.path(), "out.exr", &options).succeeds();
        assert_eq!(
            run.stderr().contains("do not sum to the colour at"),
            warned,
            "{off}: {}",
            run.stderr()
        );
    }
}

/// Each layer comes with light that is nowhere negative, and so it leaves; their sum stays that of the colour.
#[test]
fn no_layer_becomes_negative_and_they_still_sum_to_the_colour() {
    let folder = tempfile::tempdir().unwrap();
    let size = (57, 57);
    let pixels = size.0 * size.1;
    // sparse and steep, so that planes overshoot
    let spot = |i: usize| {
        let (x, y) = (i % size.0, i / size.0);
        let lit = linpred_tests::images::exponential(1, i).powi(3);
        if (x / 9 + y / 9) % 2 == 0 {
            5.0 * lit
        } else {
            0.01 * lit
        }
    };
    let rest = |i: usize| linpred_tests::images::exponential(2, i) * ((i % size.0) as f32) / 20.0;
    let mut channels = Vec::new();
    let mut add = |name: String, value: &dyn Fn(usize) -> f32| {
        channels.push((name, FlatSamples::F32((0..pixels).map(value).collect())));
    };
    for c in ["R", "G", "B"] {
        add(c.to_owned(), &|i| spot(i) + rest(i));
        add(format!("spot.{c}"), &spot);
        add(format!("rest.{c}"), &rest);
    }
    write(&folder.path().join("in.exr"), size, vec![part(channels)]);
    for quality in ["fast", "high"] {
        let options = ["--layers", "spot,rest", "--quality", quality];
        command::denoise(folder.path(), "out.exr", &options).succeeds();
        let image = read(&folder.path().join("out.exr"));
        let values = |name: &str| -> Vec<f32> {
            bits(&image, 0, name)
                .into_iter()
                .map(f32::from_bits)
                .collect()
        };
        let (sum, spot, rest) = (values("G"), values("spot.G"), values("rest.G"));
        for i in 0..pixels {
            assert!(
                spot[i] >= 0.0 && rest[i] >= 0.0,
                "{quality}: {} {}",
                spot[i],
                rest[i]
            );
            let off = (spot[i] + rest[i] - sum[i]).abs();
            assert!(
                off <= 2e-3 * sum[i].abs() + 1e-4,
                "{quality}, {i}: {off} of {}",
                sum[i]
            );
        }
    }
}
