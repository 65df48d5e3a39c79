//! What `inspect --pixels` says of an image is what a run then counts, and what is in the image.

use std::path::{Path, PathBuf};

use exr::prelude::FlatSamples;
use linpred::{FEATURE_NAMES, InputRow};
use linpred_core::{Params, Quality};
use linpred_tests::command::{denoise, linpred};
use linpred_tests::frames::{Frame, Scene, scenes};
use linpred_tests::images::{NamedSamples, constant, everything, part, write};
use proptest::prelude::{ProptestConfig, Strategy, any, prop_assert, prop_assert_eq, proptest};
use serde_json::Value;

/// A scene with a calm part, some pixels that are not numbers, and some fireflies.
fn frames() -> impl Strategy<Value = Frame> {
    let span = || (0.0..1.0f64, 0.0..1.0f64);
    let bad = proptest::collection::vec((any::<u16>(), any::<u16>(), 0..5usize), 0..6);
    (scenes(), span(), span(), bad).prop_map(|(scene, columns, rows, bad)| {
        let mut frame = scene.render();
        let (width, height) = scene.size;
        let of = |length: usize, (from, span): (f64, f64)| {
            let from = (from * length as f64) as usize;
            from..length.min(from + (2.0 * span * length as f64) as usize)
        };
        frame.calm(of(width, columns), of(height, rows));
        for (x, y, plane) in bad {
            if plane == 4 {
                frame.add_firefly((usize::from(x) % width, usize::from(y) % height), 500.0);
                continue;
            }
            let (x, row) = (
                usize::from(x) % width,
                &mut frame.rows[usize::from(y) % height],
            );
            match plane {
                3 => row.features[6]
                    .iter_mut()
                    .skip(x)
                    .take(1)
                    .for_each(|v| *v = f32::NAN),
                plane => row.colour[plane][x] = f32::INFINITY,
            }
        }
        frame
    })
}

fn is_bad(row: &InputRow, x: usize) -> bool {
    row.colour.iter().any(|plane| !plane[x].is_finite())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_survey_counts_what_a_run_counts(frame in frames(), threads in 1usize..=3) {
        let surveyed = frame.survey_on(threads);
        let run = frame.denoise(Params::new(Quality::Fast));
        prop_assert_eq!(surveyed.counts, run.report.counts);
    }

    #[test]
    fn its_ranges_are_those_of_the_image(frame in frames()) {
        let survey = frame.survey_on(1);
        let mut colours = Vec::new();
        let (mut first, mut first_firefly, mut missing) = (None, None, 0);
        let fireflies = frame.fireflies();
        for (y, row) in frame.rows.iter().enumerate() {
            for x in 0..frame.width() {
                match (is_bad(row, x), fireflies[y * frame.width() + x]) {
                    (true, _) => { first.get_or_insert([x, y]); }
                    (_, true) => { first_firefly.get_or_insert([x, y]); }
                    _ => colours.extend(row.colour.iter().map(|plane| plane[x])),
                }
                missing += u64::from(row.features.iter().any(|f| f.get(x).is_some_and(|v| v.is_nan())));
            }
        }
        colours.sort_by(f32::total_cmp);
        let ends = colours.first().zip(colours.last()).map(|(a, b)| [*a, *b]);
        prop_assert_eq!(survey.radiance, ends);
        prop_assert_eq!(survey.first_repaired, first);
        prop_assert_eq!(survey.first_firefly, first_firefly);
        prop_assert_eq!(survey.features_missing, missing);
        let varies = |k: usize| {
            let values: Vec<f32> = frame.rows.iter().flat_map(|row| &row.features[k]).copied().filter(|v| !v.is_nan()).collect();
            values.iter().any(|v| *v != values[0])
        };
        for (k, name) in FEATURE_NAMES.iter().enumerate() {
            let constant = frame.layout.features[k] && !varies(k);
            let told = survey.constant_features.iter().any(|told| told == name);
            prop_assert_eq!(told, constant, "{}", name);
        }
        prop_assert!(survey.variance.is_none_or(|[least, most]| 0.0 <= least && least <= most));
    }
}

#[test]
fn a_scene_counted_by_hand() {
    let mut frame = Scene::new(60, 50).render();
    frame.calm(0..38, 0..50);
    for row in &mut frame.rows {
        row.features[2].fill(0.25);
        row.variance.iter_mut().for_each(|plane| plane[50] = 7.0);
    }
    let survey = frame.survey_on(2);
    // two of four columns of cells, but the second is beside noise; three rows of them
    assert_eq!((survey.counts.cells, survey.counts.cells_skipped), (12, 3));
    assert_eq!(survey.counts.passed_through, 37 * 50);
    assert_eq!(survey.constant_features, ["normal z"]);
    assert_eq!(survey.variance, Some([0.0, 21.0]));
    assert!(!survey.grey);
    for row in &mut frame.rows {
        let [red, others @ ..] = &mut row.colour;
        others.iter_mut().for_each(|plane| plane.clone_from(red));
    }
    assert!(frame.survey_on(1).grey);
    frame.rows[40].colour[2][3] += 0.5;
    assert!(!frame.survey_on(1).grey);
}

const COUNTS: [&str; 8] = [
    "pixels",
    "passed_through",
    "repaired",
    "fireflies",
    "cells",
    "cells_skipped",
    "feature_blocks",
    "feature_blocks_skipped",
];

fn inspected(folder: &Path, options: &[&str]) -> Value {
    let input = folder.join("in.exr");
    let arguments = ["inspect", input.to_str().unwrap(), "--pixels", "--json"];
    let ran = linpred(arguments.iter().chain(options)).succeeds();
    serde_json::from_str(&ran.stdout()).expect("JSON")
}

/// The counts of `inspect --pixels` and those of the log of a run that follows it.
#[track_caller]
fn assert_counts_agree(folder: &Path, options: &[&str]) -> Value {
    let said = inspected(folder, options);
    let log = ["--quality", "fast", "--log-format", "json"];
    let ran = denoise(folder, "out.exr", &[&log, options].concat());
    let done = ran.succeeds().report();
    for count in COUNTS {
        assert!(done[count].is_u64(), "{count} in {done}");
        assert_eq!(said["pixels"][count], done[count], "{count}");
    }
    // where nothing is skipped, or nothing else is done, nothing is said of what that saved
    let (cells, skipped) = (done["cells"].as_u64(), done["cells_skipped"].as_u64());
    let known = skipped > Some(0) && skipped < cells;
    assert_eq!(
        done["saved_thread_seconds"]
            .as_f64()
            .is_some_and(|s| s > 0.0),
        known
    );
    said
}

/// `calm` of 83 rows without noise, and one pixel that is not a number.
fn channels(width: usize, calm: usize) -> Vec<NamedSamples> {
    let mut channels = everything(width * 83);
    for (name, samples) in &mut channels {
        let FlatSamples::F32(values) = samples else {
            continue;
        };
        let still = values.iter_mut().take(calm * width);
        match name.as_str() {
            "variance.R" | "variance.G" | "variance.B" => still.for_each(|v| *v = 0.0),
            // without noise is also without what looks like it
            "R" | "G" | "B" => still
                .zip(0..)
                .for_each(|(v, i)| *v = 1.0 + (i % width) as f32),
            _ => {}
        }
        if name == "G" {
            values[60 * width + 11] = f32::NAN;
        }
    }
    channels
}

#[test]
fn the_command_says_what_a_run_then_reports() {
    let folder = tempfile::tempdir().unwrap();
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/toasters_16spp.exr");
    std::fs::copy(sample, folder.path().join("in.exr")).unwrap();
    assert_counts_agree(folder.path(), &[]);
    assert_counts_agree(folder.path(), &["--map", "variance=none", "--threads", "1"]);
    write(
        &folder.path().join("in.exr"),
        (70, 83),
        vec![part(channels(70, 45))],
    );
    let said = assert_counts_agree(folder.path(), &[]);
    assert_eq!(
        said["pixels"]["first_repaired"],
        serde_json::json!([11, 60])
    );
    // of 45 rows without noise one is beside noise
    assert_eq!(said["pixels"]["passed_through"], 44 * 70);
    assert_eq!(said["pixels"]["cells_skipped"], 2 * 4);
}

#[test]
fn in_words_too() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    let mut channels = channels(70, 45);
    channels.retain(|(name, _)| name != "Z");
    channels.push(constant("Z", 70 * 83, 3.0));
    write(&input, (70, 83), vec![part(channels)]);
    linpred(["inspect", input.to_str().unwrap(), "--pixels"])
        .succeeds()
        .prints(&[
            "5810, 53.0 % without noise pass through",
            "1 pixels, the first at x 11, y 60",
            "40.0 % of 20 cells",
            "never vary        depth",
        ]);
    denoise(folder.path(), "out.exr", &[])
        .succeeds()
        .complains_about(&[
            "40.0 % of the cells",
            "at the mean time of the other cells that saved",
        ]);
    let plain = linpred(["inspect", input.to_str().unwrap()]).succeeds();
    assert!(
        !plain.stdout().contains("pass through"),
        "{}",
        plain.stdout()
    );
}

#[test]
fn what_needs_the_pixels_is_refused_without_them() {
    for option in [
        ["--threads", "2"],
        ["--max-memory", "64M"],
        ["--progress", "plain"],
    ] {
        linpred(["inspect", "any.exr"].iter().chain(&option))
            .exits_with(2)
            .complains_about(&["--pixels"]);
    }
}

/// The file of 70 x 83 pixels in `folder`, its last block made unreadable.
fn damaged(folder: &Path) -> PathBuf {
    let input = folder.join("in.exr");
    write(&input, (70, 83), vec![part(everything(70 * 83))]);
    let mut bytes = std::fs::read(&input).unwrap();
    let end = bytes.len();
    bytes[end - 2000..].fill(0xAA);
    std::fs::write(&input, bytes).unwrap();
    input
}

#[test]
fn a_file_whose_pixels_cannot_be_read_is_described_and_refused() {
    let folder = tempfile::tempdir().unwrap();
    let input = damaged(folder.path());
    let arguments = ["inspect", input.to_str().unwrap()];
    linpred(arguments).succeeds();
    let ran = linpred(arguments.iter().chain(&["--pixels"])).exits_with(3);
    ran.prints(&["colour", "cannot be denoised", "in.exr", "rows 80 to 82"]);
}

#[test]
fn a_survey_keeps_to_its_memory_and_shows_how_far_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    write(&input, (70, 83), vec![part(everything(70 * 83))]);
    let survey = |options: &[&str]| {
        let arguments = ["inspect", input.to_str().unwrap(), "--pixels"];
        linpred(arguments.iter().chain(options))
    };
    survey(&["--max-memory", "8M"])
        .exits_with(4)
        .complains_about(&["--max-memory is 8.0 MiB"]);
    let plain = survey(&["--progress", "plain"]).succeeds();
    assert!(
        plain.stderr().ends_with("100 % (83 of 83 rows)\n"),
        "{}",
        plain.stderr()
    );
}
