//! The map of a file lies where its picture does, and says what it is asked for.

use std::fs;
use std::path::Path;

use exr::prelude::*;
use linpred_tests::command::{Ran, denoise, linpred};
use linpred_tests::images::{
    TestPart, bits, channel_names, everything, exponential, part, plane, read, uint, values, write,
};
use serde_json::Value;

const SIZE: (usize, usize) = (60, 44);
const PIXELS: usize = SIZE.0 * SIZE.1;

/// A noisy wall whose pixels have so many samples each.
fn wall(samples: usize) -> TestPart {
    let mut channels = vec![plane("Z", SIZE, |_, _| 3.0)];
    for (seed, name) in (1..).zip(["R", "G", "B"]) {
        channels.push(plane(name, SIZE, |x, y| exponential(seed, y * SIZE.0 + x)));
        channels.push(plane(&format!("variance.{name}"), SIZE, |_, _| 1.0));
    }
    let mut part = part(channels);
    part.attributes
        .push(("spp", AttributeValue::I32(samples as i32)));
    part
}

/// Makes everything 0 in these pixels.
fn darken(picture: &mut TestPart, which: impl Fn(usize) -> bool) {
    for (_, samples) in &mut picture.channels {
        let FlatSamples::F32(samples) = samples else {
            panic!("floats")
        };
        for (i, sample) in samples.iter_mut().enumerate() {
            *sample *= f32::from(u8::from(!which(i)));
        }
    }
}

fn sample_map(folder: &Path, options: &[&str]) -> Ran {
    let (input, output) = (folder.join("in.exr"), folder.join("map.exr"));
    let files = [
        "sample-map",
        input.to_str().unwrap(),
        "-o",
        output.to_str().unwrap(),
    ];
    linpred(files.into_iter().chain(options.iter().copied()))
}

fn summary(ran: &Ran) -> Value {
    serde_json::from_str(&ran.stdout()).unwrap()
}

#[test]
fn a_map_has_the_window_of_its_picture_and_one_channel() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(&folder.join("in.exr"), SIZE, vec![wall(4)]);
    sample_map(folder, &["--budget", "8"])
        .succeeds()
        .prints(&["4.00 samples per pixel, 8.00 more", "predicted error"]);
    let map = read(&folder.join("map.exr"));
    let noisy = read(&folder.join("in.exr"));
    let window = |image: &FlatImage| {
        let layer = &image.layer_data[0];
        (
            layer.attributes.layer_position,
            layer.size,
            image.attributes.display_window,
        )
    };
    assert_eq!(window(&map), window(&noisy));
    assert_eq!(channel_names(&map, 0), ["samples"]);
    let samples = values(&folder.join("map.exr"), "samples");
    assert_eq!(samples.iter().sum::<f32>(), 8.0 * PIXELS as f32);
    assert!(samples.iter().all(|n| n.fract() == 0.0 && *n >= 0.0));
    // nothing is left beside it
    let mut names: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|f| f.unwrap().file_name())
        .collect();
    names.sort();
    assert_eq!(names, ["in.exr", "map.exr"]);
}

#[test]
fn a_map_has_the_same_bytes_on_any_number_of_threads_and_in_any_memory() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(&folder.join("in.exr"), SIZE, vec![wall(4)]);
    let bytes = |options: &[&str]| {
        sample_map(folder, &[&["--budget", "2.5"], options].concat()).succeeds();
        fs::read(folder.join("map.exr")).unwrap()
    };
    let one = bytes(&["--threads", "1"]);
    assert!(one == bytes(&["--threads", "2"]));
    assert!(one == bytes(&["--max-memory", "32M"]));
}

#[test]
fn samples_are_read_from_a_channel_an_attribute_or_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut counted = wall(7);
    counted.channels.push(plane(
        "sampleCount",
        SIZE,
        |x, _| if x < 30 { 2.0 } else { 0.0 },
    ));
    let mut silent = wall(7);
    silent.attributes.clear();
    let mut blender = wall(64);
    blender.attributes = vec![(
        "cycles.ViewLayer.samples",
        AttributeValue::Text("64".into()),
    )];
    let channels = std::mem::take(&mut blender.channels);
    let rename = |(name, samples): (String, FlatSamples)| match name.rsplit_once('.') {
        Some((_, component)) => (format!("ViewLayer.Denoising Variance.{component}"), samples),
        None if name == "Z" => ("ViewLayer.Depth.Z".to_owned(), samples),
        None => (format!("ViewLayer.Combined.{name}"), samples),
    };
    blender.channels = channels.into_iter().map(rename).collect();
    blender
        .channels
        .push(plane("ViewLayer.Debug Sample Count.X", SIZE, |_, _| 0.25));
    for (picture, options, mean) in [
        (wall(7), &[][..], 7.0),
        (counted, &[], 1.0),
        (silent.clone(), &["--spp", "3"], 3.0),
        (blender, &[], 16.0),
    ] {
        write(&folder.join("in.exr"), SIZE, vec![picture]);
        let ran = sample_map(folder, &[&["--budget", "4", "--json"], options].concat()).succeeds();
        let samples = summary(&ran)["samples"].as_f64().unwrap() / PIXELS as f64;
        assert_eq!(samples, mean);
    }
    write(&folder.join("in.exr"), SIZE, vec![silent]);
    fs::remove_file(folder.join("map.exr")).unwrap();
    sample_map(folder, &["--budget", "4"])
        .exits_with(3)
        .complains_about(&["in.exr", "samples", "--spp N"]);
    assert!(!folder.join("map.exr").exists());
}

#[test]
fn an_error_that_is_small_enough_already_is_an_exit_code_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(&folder.join("in.exr"), SIZE, vec![wall(4)]);
    sample_map(folder, &["--target-error", "100"]).exits_with(10);
    assert!(
        values(&folder.join("map.exr"), "samples")
            .iter()
            .all(|n| *n == 0.0)
    );
    let ran = sample_map(folder, &["--target-error", "1e-3", "--json"]).succeeds();
    let found = summary(&ran);
    let number = |name: &str| found[name].as_f64().unwrap();
    assert!(
        number("error") > 1e-3 && number("error_then") < 1.01e-3,
        "{found}"
    );
    let ran = sample_map(
        folder,
        &["--target-error", "1e-3", "--budget", "0.5", "--json"],
    )
    .succeeds();
    assert_eq!(summary(&ran)["added"], PIXELS / 2);
}

#[test]
fn what_was_not_rendered_gets_nothing_and_no_part_of_the_average() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut region = wall(4);
    darken(&mut region, |i| i % SIZE.0 < 20);
    write(&folder.join("in.exr"), SIZE, vec![region]);
    sample_map(folder, &["--budget", "6"]).succeeds();
    let samples = values(&folder.join("map.exr"), "samples");
    let left = (0..PIXELS).filter(|i| i % SIZE.0 < 20).map(|i| samples[i]);
    assert_eq!(left.sum::<f32>(), 0.0);
    assert_eq!(samples.iter().sum::<f32>(), 6.0 * (40 * SIZE.1) as f32);
}

#[test]
fn what_has_samples_was_rendered_however_dark_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut dark = wall(4);
    darken(&mut dark, |i| i % SIZE.0 < 20);
    dark.channels.push(plane("sampleCount", SIZE, |_, _| 4.0));
    write(&folder.join("in.exr"), SIZE, vec![dark]);
    let ran = sample_map(folder, &["--budget", "6", "--json"]).succeeds();
    assert_eq!(summary(&ran)["pixels"], PIXELS);
    let samples = values(&folder.join("map.exr"), "samples");
    assert_eq!(samples.iter().sum::<f32>(), 6.0 * PIXELS as f32);
}

#[test]
fn pixels_without_samples_are_predicted_and_get_some() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let inside = |i: usize| (25..37).contains(&(i % SIZE.0)) && (15..27).contains(&(i / SIZE.0));
    let mut hole = wall(4);
    darken(&mut hole, inside);
    let count = |x: usize, y: usize| if inside(y * SIZE.0 + x) { 0.0 } else { 4.0 };
    hole.channels.push(plane("sampleCount", SIZE, count));
    write(&folder.join("in.exr"), SIZE, vec![hole]);
    sample_map(folder, &["--budget", "6"]).succeeds();
    let mean = |of: &[f32], hole: bool| {
        let own: Vec<f32> = (0..PIXELS)
            .filter(|i| inside(*i) == hole)
            .map(|i| of[i])
            .collect();
        own.iter().sum::<f32>() / own.len() as f32
    };
    let samples = values(&folder.join("map.exr"), "samples");
    let (own, others) = (mean(&samples, true), mean(&samples, false));
    assert!(own > others, "{own} {others}");
    denoise(folder, "clean.exr", &["--quality", "fast"])
        .succeeds()
        .complains_about(&["144 not finite"]);
    let green = values(&folder.join("clean.exr"), "G");
    let (own, others) = (mean(&green, true), mean(&green, false));
    assert!((own - others).abs() < 0.25, "{own} {others}");
}

#[test]
fn a_variance_that_is_not_known_is_not_taken_for_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let error = |variance: f32, options: &[&str]| {
        let mut picture = wall(1);
        let channels = &mut picture.channels;
        channels.retain(|(name, _)| !name.starts_with("variance"));
        for name in ["variance.R", "variance.G", "variance.B"] {
            channels.push(plane(name, SIZE, |_, _| variance));
        }
        write(&folder.join("in.exr"), SIZE, vec![picture]);
        let options = [&["--budget", "1", "--json"], options].concat();
        let ran = sample_map(folder, &options).succeeds();
        summary(&ran)["error"].as_f64().unwrap()
    };
    let estimated = error(1.0, &["--map", "variance=none"]);
    assert!(estimated > 0.01, "{estimated}");
    for unknown in [f32::NAN, f32::INFINITY, -1.0, 0.0] {
        let ratio = error(unknown, &[]) / estimated;
        assert!((0.3..3.0).contains(&ratio), "{unknown}: {ratio}");
    }
}

#[test]
fn a_picture_of_the_map_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(&folder.join("in.exr"), SIZE, vec![wall(4)]);
    let picture = folder.join("map.png");
    sample_map(
        folder,
        &["--budget", "6", "--picture", picture.to_str().unwrap()],
    )
    .succeeds();
    let file = std::io::BufReader::new(fs::File::open(&picture).unwrap());
    let info = png::Decoder::new(file).read_info().unwrap();
    assert_eq!(
        (info.info().width as usize, info.info().height as usize),
        SIZE
    );
}

#[test]
fn what_makes_no_sense_gets_a_sentence_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(&folder.join("in.exr"), SIZE, vec![wall(4)]);
    let map = folder.join("map.exr").display().to_string();
    for (options, code, words) in [
        (&[][..], 2, &["--budget", "--target-error"][..]),
        (&["--budget", "0"], 2, &["budget", "above 0"]),
        (&["--budget", "many"], 2, &["such as 8"]),
        (&["--target-error", "nan"], 2, &["target error"]),
        (&["--budget", "8", "--layers", "A"], 2, &["--layers"]),
        (
            &["--budget", "8", "--max-memory", "1M"],
            4,
            &["--max-memory"],
        ),
        (&["--budget", "16777216"], 2, &["a smaller budget"]),
        (
            &["--budget", "8", "--map", "samples=nothing"],
            2,
            &["nothing"],
        ),
        (
            &["--budget", "8", "--picture", &map],
            2,
            &["cannot both be"],
        ),
    ] {
        sample_map(folder, options)
            .exits_with(code)
            .complains_about(words);
        assert!(!folder.join("map.exr").exists(), "{options:?}");
    }
    let whole = fs::read(folder.join("in.exr")).unwrap();
    fs::write(folder.join("in.exr"), &whole[..whole.len() / 2]).unwrap();
    sample_map(folder, &["--budget", "8"])
        .exits_with(3)
        .complains_about(&["in.exr"]);
    assert!(!folder.join("map.exr").exists());
    let (one, other) = (everything(PIXELS), everything(PIXELS));
    let views = [("left", one), ("right", other)].map(|(view, channels)| TestPart {
        name: Some(view),
        attributes: vec![("view", AttributeValue::Text(view.into()))],
        ..part(channels)
    });
    write(&folder.join("in.exr"), SIZE, views.into());
    sample_map(folder, &["--budget", "8"])
        .exits_with(3)
        .complains_about(&["2 pictures", "left", "right"]);
}

#[test]
fn integers_and_halves_count_as_samples_too() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut counted = wall(4);
    counted.channels.push(uint("sampleCount", PIXELS));
    write(&folder.join("in.exr"), SIZE, vec![counted]);
    let ran = sample_map(folder, &["--budget", "4", "--json"]).succeeds();
    let all: u64 = (0..PIXELS as u64).sum();
    assert_eq!(summary(&ran)["samples"], all);
    // and a file with a map in it is denoised like any other
    denoise(folder, "clean.exr", &["--quality", "fast"]).succeeds();
    let (noisy, clean) = (
        read(&folder.join("in.exr")),
        read(&folder.join("clean.exr")),
    );
    assert_eq!(
        bits(&noisy, 0, "sampleCount"),
        bits(&clean, 0, "sampleCount")
    );
}
