//! With `--temporal` the frames of a sequence help each other. Whichever command makes a frame, its bytes are those of the whole run; a neighbour that cannot help is
//! named, and the frame is made without it.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use exr::prelude::FlatSamples;
use linpred_tests::command::{Ran, denoise_file, linpred_path};
use linpred_tests::images::{
    NamedSamples, channel_names, constant, everything, float, part, read, values, write,
};
use serde_json::Value;

const SIZE: (usize, usize) = (40, 40);

/// What a renderer writes of a still wall, with noise of its own in each frame.
fn channels(number: u32, size: (usize, usize)) -> Vec<NamedSamples> {
    let pixels = size.0 * size.1;
    let mut channels: Vec<NamedSamples> = everything(pixels)
        .into_iter()
        .filter(|(name, _)| !["R", "G", "B"].contains(&name.as_str()))
        .collect();
    for (seed, name) in (1000 * number..).zip(["R", "G", "B"]) {
        channels.push(float(name, pixels, seed));
    }
    channels
}

fn frame(folder: &Path, number: u32) -> PathBuf {
    folder.join(format!("shot.{number:04}.exr"))
}

fn write_frame(folder: &Path, number: u32, size: (usize, usize)) {
    write(
        &frame(folder, number),
        size,
        vec![part(channels(number, size))],
    );
}

/// A folder with the frames of these numbers.
fn shot(numbers: &[u32]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for number in numbers {
        write_frame(folder.path(), *number, SIZE);
    }
    folder
}

fn denoise(folder: &Path, input: &str, output: &str, options: &[&str]) -> Ran {
    denoise_file(&folder.join(input), &folder.join(output), options)
}

fn run(folder: &Path, output: &str, options: &[&str]) -> Ran {
    let options = [&["--temporal"], options].concat();
    denoise(folder, "shot.####.exr", output, &options)
}

/// What a run with `--log-format json` says of each frame's help, by the number of the frame.
fn helped(ran: &Ran) -> Vec<Value> {
    let lines = ran.stderr();
    let events = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap());
    events
        .filter(|event: &Value| event["message"] == "helped")
        .collect()
}

fn counts(events: &[Value]) -> Vec<(u64, u64)> {
    let count = |event: &Value, side: &str| event[side].as_u64().unwrap();
    events
        .iter()
        .map(|event| (count(event, "before"), count(event, "after")))
        .collect()
}

#[test]
fn each_frame_is_helped_by_those_beside_it_as_far_as_the_shot_goes() {
    let folder = shot(&[7, 8, 9, 10, 11]);
    let json = ["--log-format", "json"];
    let ran = run(folder.path(), "out.####.exr", &json).succeeds();
    let all = [(0, 3), (1, 3), (2, 2), (3, 1), (3, 0)];
    assert_eq!(counts(&helped(&ran)), all);
    // the shot ends there: nothing is missing
    assert!(!ran.stderr().contains("does not help"), "{}", ran.stderr());

    let only = ["--log-format", "json", "--frames", "8,10"];
    let ran = run(folder.path(), "some.####.exr", &only).succeeds();
    assert_eq!(counts(&helped(&ran)), [(1, 3), (3, 1)]);
    let one = ["--temporal=1", "--log-format", "json"];
    let ran = denoise(folder.path(), "shot.####.exr", "one.####.exr", &one).succeeds();
    assert_eq!(
        counts(&helped(&ran)),
        [(0, 1), (1, 1), (1, 1), (1, 1), (1, 0)]
    );
}

#[test]
fn a_shot_that_tells_nothing_of_motion_is_spoken_of_once() {
    let folder = shot(&[1, 2]);
    let said = run(folder.path(), "out.####.exr", &[]).succeeds().stderr();
    let words = "neither motion vectors nor positions";
    assert_eq!(said.matches(words).count(), 1, "{said}");
    // a frame alone does not ask for any
    let alone = denoise(folder.path(), "shot.0001.exr", "alone.exr", &[]);
    assert!(!alone.succeeds().stderr().contains(words));
    for number in [1, 2] {
        let pixels = SIZE.0 * SIZE.1;
        let mut channels = channels(number, SIZE);
        channels.extend(["motion.X", "motion.Y"].map(|name| constant(name, pixels, 0.0)));
        write(&frame(folder.path(), number), SIZE, vec![part(channels)]);
    }
    let said = run(folder.path(), "again.####.exr", &[])
        .succeeds()
        .stderr();
    let words = "motion vectors are all 0";
    assert_eq!(said.matches(words).count(), 1, "{said}");
}

#[test]
fn a_frame_on_a_farm_has_the_bytes_of_the_whole_run() {
    let folder = shot(&[1, 2, 3, 4, 5]);
    run(folder.path(), "out.####.exr", &[]).succeeds();
    let whole = fs::read(folder.path().join("out.0003.exr")).unwrap();
    let pattern = folder.path().join("shot.####.exr");
    let pattern = pattern.to_str().unwrap();
    let by_pattern = ["--temporal", "--before", pattern, "--after", pattern];
    denoise(folder.path(), "shot.0003.exr", "farm.exr", &by_pattern).succeeds();
    assert_eq!(fs::read(folder.path().join("farm.exr")).unwrap(), whole);

    // on a node of its own, under another name
    let copy = folder.path().join("node/beauty_v2.0003.exr");
    fs::create_dir(folder.path().join("node")).unwrap();
    fs::copy(frame(folder.path(), 3), &copy).unwrap();
    let alone = folder.path().join("alone.exr");
    denoise_file(&copy, &alone, &by_pattern).succeeds();
    assert_eq!(fs::read(&alone).unwrap(), whole);

    let names = [2, 1, 4, 5].map(|number| frame(folder.path(), number));
    let [two, one, four, five] = names.each_ref().map(|name| name.to_str().unwrap());
    let by_name = [
        "--temporal",
        "--before",
        two,
        "--before",
        one,
        "--after",
        four,
        "--after",
        five,
    ];
    denoise(folder.path(), "shot.0003.exr", "named.exr", &by_name).succeeds();
    assert_eq!(fs::read(folder.path().join("named.exr")).unwrap(), whole);
    // nothing is asked of a side that is not named
    let one_sided = ["--temporal", "--after", pattern, "--log-format", "json"];
    let ran = denoise(folder.path(), "shot.0003.exr", "sided.exr", &one_sided).succeeds();
    assert_eq!(counts(&helped(&ran)), [(0, 2)]);
}

#[test]
fn a_neighbour_that_cannot_help_is_named_and_the_frame_is_made_without_it() {
    type Spoil = fn(&Path);
    let spoils: [(Spoil, &str); 5] = [
        (
            |path| fs::write(path, "not a picture").unwrap(),
            "not an EXR",
        ),
        (
            |path| write(path, (39, 40), vec![part(channels(4, (39, 40)))]),
            "its data window is 39 x 40 pixels at (3, -5), not 40 x 40 pixels at (3, -5)",
        ),
        (
            |path| {
                let mut channels = channels(4, SIZE);
                channels.retain(|(name, _)| name != "Z");
                write(path, SIZE, vec![part(channels)]);
            },
            "it has no depth",
        ),
        (
            |path| {
                let mut channels = channels(4, SIZE);
                channels.retain(|(name, _)| !name.starts_with("variance"));
                write(path, SIZE, vec![part(channels)]);
            },
            "another kind of variance",
        ),
        (
            |path| {
                let bytes = fs::read(path).unwrap();
                fs::write(path, &bytes[..bytes.len() - 2000]).unwrap();
            },
            "cut off",
        ),
    ];
    for (spoil, why) in spoils {
        let folder = shot(&[1, 2, 3, 4, 5, 6]);
        let path = folder.path();
        spoil(&frame(path, 4));
        let options = ["--frames", "2,3,6", "--log-format", "json"];
        let ran = run(path, "out.####.exr", &options).succeeds();
        let events = helped(&ran);
        // nothing is followed through it
        assert_eq!(counts(&events), [(1, 1), (2, 0), (1, 0)], "{why}");
        let warned = ran.stderr();
        let warned = warned.lines().filter(|line| line.contains("WARN"));
        let warned: Vec<&str> = warned.filter(|line| line.contains("shot.0004")).collect();
        assert_eq!(warned.len(), 1, "{why}: {warned:?}");
        assert!(warned[0].contains(why), "{why}: {}", warned[0]);
        for event in &events {
            let unused = event["unused"].as_str().unwrap();
            assert!(unused.contains("shot.0004.exr does not help"), "{unused}");
        }
        // as if it were not there
        let out = fs::read(path.join("out.0003.exr")).unwrap();
        fs::remove_file(frame(path, 4)).unwrap();
        run(path, "gap.####.exr", &["--frames", "3"])
            .succeeds()
            .complains_about(&["shot.0004.exr does not help", "it does not exist"]);
        assert_eq!(fs::read(path.join("gap.0003.exr")).unwrap(), out, "{why}");
    }
}

#[test]
fn where_the_picture_is_another_a_cut_is_asked_about() {
    let folder = shot(&[1, 2]);
    // brighter by far than the noise of the others
    let mut other = channels(3, SIZE);
    for (name, samples) in &mut other {
        if let ("R" | "G" | "B", FlatSamples::F32(values)) = (name.as_str(), samples) {
            values.iter_mut().for_each(|value| *value += 50.0);
        }
    }
    write(&frame(folder.path(), 3), SIZE, vec![part(other)]);
    let options = ["--log-format", "json"];
    let ran = run(folder.path(), "out.####.exr", &options).succeeds();
    let asked: Vec<Value> = (ran.stderr().lines())
        .map(|line| serde_json::from_str(line).unwrap())
        .filter(|event: &Value| {
            event["message"]
                .as_str()
                .unwrap()
                .contains("is there a cut")
        })
        .collect();
    // by both frames beside it, and by no other
    assert_eq!(asked.len(), 2, "{asked:?}");
    for event in asked {
        let words = event["message"].as_str().unwrap();
        assert!(words.contains("shot.0002.exr") && words.contains("shot.0003.exr"));
    }
    let weights: Vec<Value> = helped(&ran)
        .iter()
        .map(|event| event["weight_after"].clone())
        .collect();
    assert!(weights[0].as_f64().unwrap() > 0.5 && weights[1].as_f64().unwrap() < 0.1);
}

#[test]
fn an_output_may_replace_nothing_that_a_frame_is_made_of() {
    let folder = shot(&[1, 2, 3]);
    let before = fs::read(frame(folder.path(), 1)).unwrap();
    run(folder.path(), "shot.####.exr", &[])
        .exits_with(2)
        .complains_about(&["the output", "is the input"]);
    // the last output is the first frame by another name: told before the first is written
    fs::hard_link(frame(folder.path(), 1), folder.path().join("out.0003.exr")).unwrap();
    run(folder.path(), "out.####.exr", &[])
        .exits_with(2)
        .complains_about(&["out.0003.exr", "shot.0001.exr"]);
    assert!(!folder.path().join("out.0001.exr").exists());
    let pattern = folder.path().join("shot.####.exr");
    let options = ["--temporal", "--before", pattern.to_str().unwrap()];
    denoise(folder.path(), "shot.0003.exr", "shot.0002.exr", &options)
        .exits_with(2)
        .complains_about(&["shot.0002.exr"]);
    assert_eq!(fs::read(frame(folder.path(), 1)).unwrap(), before);
}

#[test]
fn what_cannot_be_meant_is_answered_with_what_can() {
    let folder = shot(&[1, 2]);
    let path = folder.path();
    let two = frame(path, 2);
    let two = two.to_str().unwrap();
    let pattern = path.join("shot.####.exr");
    let pattern = pattern.to_str().unwrap();
    fs::copy(frame(path, 1), path.join("beauty.exr")).unwrap();
    for (input, options, words) in [
        ("shot.0001.exr", vec!["--temporal"], "--before and --after"),
        ("shot.0001.exr", vec!["--before", two], "--temporal"),
        ("shot.0001.exr", vec!["--temporal=0"], "from 1 to 8"),
        ("shot.0001.exr", vec!["--temporal=9"], "from 1 to 8"),
        (
            "shot.####.exr",
            vec!["--temporal", "--before", two],
            "for a single image",
        ),
        (
            "beauty.exr",
            vec!["--temporal", "--after", pattern],
            "beauty.exr has no number in its name",
        ),
        (
            "shot.0001.exr",
            vec!["--temporal=1", "--after", two, "--after", two],
            "2 frames are given where up to 1 may help",
        ),
        (
            "shot.0001.exr",
            vec!["--temporal", "--after", two, "--before", two],
            "are one file",
        ),
        (
            "shot.0002.exr",
            vec!["--temporal", "--after", two],
            "are one file",
        ),
    ] {
        let output = if input.contains('#') {
            "out.####.exr"
        } else {
            "out.exr"
        };
        denoise(path, input, output, &options)
            .exits_with(2)
            .complains_about(&[words]);
    }
}

#[test]
fn a_header_says_which_frames_helped_and_only_then() {
    let folder = shot(&[1, 2, 3]);
    let mark = |name: &str| {
        let image = read(&folder.path().join(name));
        let attributes = &image.layer_data[0].attributes.other;
        let mark = attributes.get("linpredNeighbours".as_bytes()).cloned();
        mark.map(|mark| format!("{mark:?}"))
    };
    run(folder.path(), "out.####.exr", &[]).succeeds();
    let [first, second] = ["out.0001.exr", "out.0002.exr"].map(|name| mark(name).unwrap());
    assert!(first.contains("0 before; 2 after: "), "{first}");
    assert!(second.contains("1 before: "), "{second}");
    denoise(folder.path(), "shot.0002.exr", "alone.exr", &[]).succeeds();
    assert_eq!(mark("alone.exr"), None);
}

#[test]
fn the_layer_of_frames_comes_with_the_models_layer_of_a_sequence() {
    let folder = shot(&[1, 2, 9]);
    let models = ["--models-layer"];
    run(folder.path(), "out.####.exr", &models).succeeds();
    denoise(folder.path(), "shot.0001.exr", "alone.exr", &models).succeeds();
    let names = |name: &str| channel_names(&read(&folder.path().join(name)), 0);
    for name in ["out.0001.exr", "out.0009.exr"] {
        assert!(names(name).contains(&"linpred.frames".to_owned()), "{name}");
    }
    assert!(!names("alone.exr").contains(&"linpred.frames".to_owned()));
    let frames = values(&folder.path().join("out.0009.exr"), "linpred.frames");
    assert!(frames.iter().all(|frames| *frames == 1.0), "{frames:?}");
}

#[test]
fn a_dry_run_shows_what_the_frames_beside_take() {
    let folder = shot(&[1, 2, 3]);
    let alone = denoise(folder.path(), "shot.0002.exr", "out.exr", &["--dry-run"]).succeeds();
    assert!(!alone.stdout().contains("frames before"));
    let options = ["--dry-run", "--frames", "2"];
    let ran = run(folder.path(), "out.####.exr", &options).succeeds();
    let reads = |ran: &Ran| ran.stdout().matches("  reading ").count();
    assert_eq!(reads(&ran), 3 * reads(&alone));
    ran.prints(&["following pixels through 1 frames before and 1 after"]);
}

/// Bytes of every frame of a shot.
fn outputs(folder: &Path, frames: u32) -> Vec<Vec<u8>> {
    let path = |number| folder.join(format!("out.{number:04}.exr"));
    (1..=frames)
        .map(|number| fs::read(path(number)).unwrap())
        .collect()
}

#[cfg(unix)]
#[test]
fn a_run_that_was_killed_goes_on_to_the_same_bytes() {
    let size = (200, 400);
    let folder = tempfile::tempdir().unwrap();
    for number in 1..=3 {
        write_frame(folder.path(), number, size);
    }
    run(folder.path(), "out.####.exr", &[]).succeeds();
    let whole = outputs(folder.path(), 3);
    (1..=3).for_each(|n| fs::remove_file(folder.path().join(format!("out.{n:04}.exr"))).unwrap());
    let path = |name: &str| folder.path().join(name);
    let mut child = Command::new(linpred_path())
        .arg("denoise")
        .args([path("shot.####.exr"), "-o".into(), path("out.####.exr")])
        .args(["--temporal", "--progress", "json", "--quiet"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // in the middle of the second frame
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(lines.any(|line| line.unwrap().contains("\"frame\":2,")));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(path("out.0001.exr").exists() && !path("out.0003.exr").exists());
    run(folder.path(), "out.####.exr", &["--skip-existing"])
        .succeeds()
        .complains_about(&["out.0001.exr exists, skipped"]);
    assert!(outputs(folder.path(), 3) == whole);
}

#[test]
fn bands_and_threads_change_no_bit_of_frames_that_are_helped() {
    let folder = shot(&[1, 2, 3]);
    let options = ["--frames", "2"];
    run(folder.path(), "out.####.exr", &options).succeeds();
    let whole = fs::read(folder.path().join("out.0002.exr")).unwrap();
    run(
        folder.path(),
        "one.####.exr",
        &["--frames", "2", "--threads", "1"],
    )
    .succeeds();
    assert!(fs::read(folder.path().join("one.0002.exr")).unwrap() == whole);
    let bands = ["1/2", "2/2"].map(|band| {
        let name = format!("band{}.####.exr", &band[..1]);
        run(folder.path(), &name, &["--frames", "2", "--band", band]).succeeds();
        folder.path().join(name.replace("####", "0002"))
    });
    let stitched = folder.path().join("stitched.exr");
    let [first, second] = bands.each_ref().map(|name| name.to_str().unwrap());
    linpred_tests::command::linpred(["stitch", first, second, "-o", stitched.to_str().unwrap()])
        .succeeds();
    assert!(fs::read(&stitched).unwrap() == whole);
}
