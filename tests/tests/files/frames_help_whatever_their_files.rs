//! Frames help each other whatever else their files hold: views, two halves, layers that are no light, the ends of a panorama.

use std::fs;
use std::path::{Path, PathBuf};

use exr::prelude::*;
use linpred::job::{
    FrameFiles, Input, InputRequest, JobOptions, NeighbourFiles, Summary, denoise, open_frame,
};
use linpred_tests::command::{denoise_file, linpred};
use linpred_tests::images::{NamedSamples, TestPart, bits, everything, float, part, read, write};

const SIZE: (usize, usize) = (44, 40);
const PIXELS: usize = SIZE.0 * SIZE.1;

/// The colour of frame `number`, with these components.
fn noise(components: [&str; 3], number: u32) -> Vec<NamedSamples> {
    let named = components.iter().zip(1000 * number..);
    named
        .map(|(name, seed)| float(name, PIXELS, seed))
        .collect()
}

/// What a renderer writes of frame `number`.
fn all(number: u32) -> Vec<NamedSamples> {
    let mut channels = everything(PIXELS);
    channels.retain(|(name, _)| !["R", "G", "B"].contains(&name.as_str()));
    channels.extend(noise(["R", "G", "B"], number));
    channels
}

fn path(folder: &Path, name: &str, number: u32) -> PathBuf {
    folder.join(format!("{name}.{number:04}.exr"))
}

/// A shot of three frames, each of what `frame` makes of its number.
fn shot(frame: impl Fn(u32) -> Vec<TestPart>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for number in 1..=3 {
        write(&path(folder.path(), "shot", number), SIZE, frame(number));
    }
    folder
}

/// Denoises the shot, and its second frame alone with the names of the others: both come out with the same bytes.
fn whole_and_alone(folder: &Path, options: &[&str]) -> Vec<u8> {
    let whole = [&["--temporal"], options].concat();
    let pattern = folder.join("shot.####.exr");
    denoise_file(&pattern, &folder.join("whole.####.exr"), &whole).succeeds();
    let pattern = pattern.to_str().unwrap();
    let alone = [&whole[..], &["--before", pattern, "--after", pattern]].concat();
    let out = path(folder, "alone", 2);
    denoise_file(&path(folder, "shot", 2), &out, &alone).succeeds();
    let bytes = fs::read(out).unwrap();
    assert!(bytes == fs::read(path(folder, "whole", 2)).unwrap());
    bytes
}

/// What the library makes of the second frame with the help of the first.
fn helped(folder: &Path, request: &InputRequest) -> Summary {
    let files = NeighbourFiles {
        before: vec![FrameFiles {
            path: path(folder, "shot", 1),
            other_half: None,
        }],
        after: Vec::new(),
    };
    let pictures = open_frame(request, &files).unwrap();
    let (out, stop) = (folder.join("helped.exr"), Default::default());
    let options = JobOptions::default();
    denoise(&pictures, &out, &options, &stop, &mut |_| ()).unwrap()
}

#[test]
fn each_view_is_helped_by_the_same_view_of_other_frames() {
    let views = |number: u32| {
        let mut own = part(all(number));
        own.channels
            .extend(noise(["left.R", "left.G", "left.B"], 10 + number));
        let names = ["right", "left"].map(Text::new_or_panic).to_vec();
        own.attributes
            .push(("multiView", AttributeValue::TextVector(names)));
        vec![own]
    };
    let folder = shot(views);
    let request = InputRequest::new(path(folder.path(), "shot", 2));
    assert_eq!(Input::open_all(&request).unwrap().len(), 2);
    whole_and_alone(folder.path(), &[]);
    let done = helped(folder.path(), &request);
    assert_eq!(done.help.len(), 2);
    for help in &done.help {
        assert!((1.0..=2.0).contains(&help.frames), "{help:?}");
        assert_eq!((help.before.len(), help.after.len()), (1, 0));
    }

    // a frame that lacks one of them helps neither
    write(&path(folder.path(), "shot", 1), SIZE, vec![part(all(1))]);
    let done = helped(folder.path(), &request);
    assert!(done.help.iter().all(|help| help.frames == 1.0));
    assert!(
        done.unused[0].why.contains("other pictures"),
        "{:?}",
        done.unused
    );
}

#[test]
fn other_halves_are_found_by_the_number_of_their_frame() {
    let half = |number| vec![part(noise(["R", "G", "B"], number))];
    let folder = shot(half);
    for number in 1..=3 {
        write(
            &path(folder.path(), "half", number),
            SIZE,
            half(20 + number),
        );
    }
    let halves = |name: &str| folder.path().join(name).display().to_string();
    let all = halves("half.####.exr");
    let whole = ["--temporal", "--other-half", &all];
    let pattern = folder.path().join("shot.####.exr");
    denoise_file(&pattern, &folder.path().join("whole.####.exr"), &whole).succeeds();
    let (own, pattern) = (halves("half.0002.exr"), pattern.to_str().unwrap());
    let beside = ["--before", pattern, "--after", pattern];
    let alone = [&["--temporal", "--other-half", &own], &beside[..]].concat();
    let out = path(folder.path(), "alone", 2);
    denoise_file(&path(folder.path(), "shot", 2), &out, &alone).succeeds();
    assert!(fs::read(out).unwrap() == fs::read(path(folder.path(), "whole", 2)).unwrap());
    // names alone do not tell where they are
    let before = path(folder.path(), "shot", 1);
    let named = ["--temporal", "--other-half", &own, "--before"];
    let named = [&named[..], &[before.to_str().unwrap()]].concat();
    let out = folder.path().join("named.exr");
    denoise_file(&path(folder.path(), "shot", 2), &out, &named)
        .exits_with(2)
        .complains_about(&["has another half"]);
}

#[test]
fn layers_that_are_no_light_are_those_of_the_frame_itself() {
    let with_mask = |number, seed| {
        let mut channels = all(number);
        channels.push(float("mask", PIXELS, seed));
        vec![part(channels)]
    };
    let folder = shot(|number| with_mask(number, number));
    let mask = ["--layers", "mask"];
    let first = whole_and_alone(folder.path(), &mask);
    // what the others hold there takes no part
    for number in [1, 3] {
        let other = with_mask(number, 50 + number);
        write(&path(folder.path(), "shot", number), SIZE, other);
    }
    let again = whole_and_alone(folder.path(), &mask);
    let planes = [first, again].map(|bytes| {
        let copy = folder.path().join("copy.exr");
        fs::write(&copy, bytes).unwrap();
        let image = read(&copy);
        ["R", "G", "B", "mask"].map(|name| bits(&image, 0, name))
    });
    assert!(planes[0] == planes[1]);
}

#[test]
fn a_frame_that_tells_nothing_of_motion_helps_one_that_does() {
    // as where things begin to move
    let folder = shot(|number| {
        let mut channels = all(number);
        if number > 1 {
            channels.extend(["motion.X", "motion.Y"].map(|name| float(name, PIXELS, 7)));
        }
        vec![part(channels)]
    });
    let request = InputRequest::new(path(folder.path(), "shot", 2));
    assert!(Input::open(&request).unwrap().motion().backward);
    let done = helped(folder.path(), &request);
    assert_eq!((done.help[0].before.len(), done.unused.len()), (1, 0));
    whole_and_alone(folder.path(), &[]);
}

#[test]
fn a_frame_that_nothing_helps_is_denoised_as_without_a_sequence() {
    let folder = tempfile::tempdir().unwrap();
    write(&path(folder.path(), "shot", 1), SIZE, vec![part(all(1))]);
    let (alone, shot) = (
        folder.path().join("alone.exr"),
        folder.path().join("out.####.exr"),
    );
    denoise_file(&path(folder.path(), "shot", 1), &alone, &[]).succeeds();
    let pattern = folder.path().join("shot.####.exr");
    denoise_file(&pattern, &shot, &["--temporal"]).succeeds();
    let (alone, shot) = (read(&alone), read(&path(folder.path(), "out", 1)));
    for name in ["R", "G", "B", "A", "Z"] {
        assert_eq!(bits(&shot, 0, name), bits(&alone, 0, name), "{name}");
    }
}

#[test]
fn a_panorama_of_a_sequence_is_stitched_of_its_bands() {
    let folder = shot(|number| vec![part(all(number))]);
    let wraps = ["--wrap", "x", "--error-layer", "--models-layer"];
    let whole = whole_and_alone(folder.path(), &wraps);
    let pattern = folder.path().join("shot.####.exr");
    let mut arguments = vec!["stitch".to_owned()];
    for band in ["1/3", "2/3", "3/3"] {
        let name = folder.path().join(format!("band{}.####.exr", &band[..1]));
        let options = [
            "--temporal",
            "--frames",
            "2",
            "--band",
            band,
            "--threads",
            "1",
        ];
        denoise_file(&pattern, &name, &[&options[..], &wraps].concat()).succeeds();
        arguments.push(name.display().to_string().replace("####", "0002"));
    }
    let out = folder.path().join("stitched.exr");
    arguments.extend(["-o".to_owned(), out.display().to_string()]);
    linpred(&arguments).succeeds();
    assert!(fs::read(&out).unwrap() == whole);
}
