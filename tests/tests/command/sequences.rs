//! A sequence is denoised frame by frame, and one bad frame does not stop the rest.

use std::fs;
use std::path::Path;

use linpred_tests::command::{Ran, denoise_file};
use linpred_tests::images::{colour, everything, half, part, write};

const SIZE: (usize, usize) = (8, 8);

fn frames(folder: &Path, numbers: &[u32]) {
    for number in numbers {
        write(
            &folder.join(format!("shot.{number:04}.exr")),
            SIZE,
            vec![part(colour(64))],
        );
    }
}

fn denoise(folder: &Path, input: &str, output: &str, options: &[&str]) -> Ran {
    denoise_file(&folder.join(input), &folder.join(output), options)
}

fn written(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| name.starts_with("out")).collect();
    names.sort();
    names
}

#[test]
fn frames_are_chosen_by_number_or_found() {
    let folder = tempfile::tempdir().unwrap();
    frames(folder.path(), &[1, 2, 3, 4, 5]);
    denoise(
        folder.path(),
        "shot.####.exr",
        "out.%04d.exr",
        &["--frames", "1-5x2"],
    )
    .succeeds();
    assert_eq!(
        written(folder.path()),
        ["out.0001.exr", "out.0003.exr", "out.0005.exr"]
    );
    denoise(folder.path(), "shot.$F4.exr", "out.####.exr", &[]).succeeds();
    assert_eq!(written(folder.path()).len(), 5);
}

#[test]
fn a_bad_frame_is_reported_and_the_rest_go_on() {
    let folder = tempfile::tempdir().unwrap();
    frames(folder.path(), &[1, 2, 3]);
    fs::write(folder.path().join("shot.0002.exr"), "not a picture").unwrap();
    denoise(
        folder.path(),
        "shot.####.exr",
        "out.####.exr",
        &["--frames", "1-4"],
    )
    .exits_with(3)
    .complains_about(&[
        "shot.0002.exr",
        "not an EXR",
        "shot.0004.exr",
        "2 of 4 frames failed",
    ]);
    assert_eq!(written(folder.path()), ["out.0001.exr", "out.0003.exr"]);
}

#[test]
fn existing_outputs_are_skipped_only_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    frames(folder.path(), &[1, 2]);
    let old = folder.path().join("out.0001.exr");
    fs::write(&old, "an earlier result").unwrap();
    denoise(
        folder.path(),
        "shot.####.exr",
        "out.####.exr",
        &["--skip-existing"],
    )
    .succeeds()
    .complains_about(&["out.0001.exr exists, skipped"]);
    assert_eq!(fs::read_to_string(&old).unwrap(), "an earlier result");
    denoise(folder.path(), "shot.####.exr", "out.####.exr", &[]).succeeds();
    assert_ne!(fs::read(&old).unwrap(), b"an earlier result");
}

#[test]
fn names_without_a_place_for_the_number_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    frames(folder.path(), &[1]);
    denoise(folder.path(), "shot.####.exr", "out.exr", &[])
        .exits_with(2)
        .complains_about(&["out.exr", "####"]);
    denoise(
        folder.path(),
        "shot.0001.exr",
        "out.exr",
        &["--frames", "1-2"],
    )
    .exits_with(2);
    denoise(folder.path(), "nothing.####.exr", "out.####.exr", &[])
        .exits_with(3)
        .complains_about(&["no such frames"]);
}

#[test]
fn what_is_the_same_for_every_frame_is_said_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = everything(64);
    for name in ["halfA", "halfB"] {
        channels.extend(["R", "G", "B"].map(|c| half(&format!("{name}.{c}"), 64, 5)));
    }
    for number in 1..=3 {
        let path = folder.path().join(format!("shot.{number:04}.exr"));
        write(&path, SIZE, vec![part(channels.clone())]);
    }
    let ran = denoise(folder.path(), "shot.####.exr", "out.####.exr", &[]).succeeds();
    let notes = ran.stderr().matches("half buffers not used").count();
    assert_eq!(notes, 1, "{}", ran.stderr());
}
