//! A variance that says nothing is estimated from the picture, and the run says so.

use std::path::Path;

use linpred_tests::command::{self, Ran};
use linpred_tests::images::{NamedSamples, exponential, noise, part, plane, values, write};

const SIDE: usize = 64;
const SIZE: (usize, usize) = (SIDE, SIDE);
const SAMPLES: usize = 16;

/// The mean of so many samples of mean 1 and variance 1.
fn mean(seed: u32, samples: usize, x: usize, y: usize) -> f32 {
    let index = |k| (y * SIDE + x) * samples + k;
    (0..samples)
        .map(|k| exponential(seed, index(k)))
        .sum::<f32>()
        / samples as f32
}

fn rgb(value: impl Fn(usize, usize) -> f32) -> Vec<NamedSamples> {
    ["R", "G", "B"]
        .map(|name| plane(name, SIZE, &value))
        .to_vec()
}

fn variances(value: impl Fn(usize, usize) -> f32) -> Vec<NamedSamples> {
    ["R", "G", "B"]
        .map(|name| plane(&format!("variance.{name}"), SIZE, &value))
        .to_vec()
}

fn noisy(variance: impl Fn(usize, usize) -> f32) -> Vec<NamedSamples> {
    let mut channels = rgb(|x, y| mean(1, SAMPLES, x, y));
    channels.extend(variances(variance));
    channels
}

fn denoise(folder: &Path, channels: Vec<NamedSamples>, options: &[&str]) -> Ran {
    write(&folder.join("in.exr"), SIZE, vec![part(channels)]);
    command::denoise(folder, "out.exr", options)
}

/// Mean squared distance of the green of some columns from 1.
fn error(path: &Path, columns: std::ops::Range<usize>) -> f32 {
    let green = values(path, "G");
    let pixels = green
        .iter()
        .enumerate()
        .filter(|(i, _)| columns.contains(&(i % SIDE)));
    let squares: Vec<f32> = pixels.map(|(_, v)| (v - 1.0).powi(2)).collect();
    squares.iter().sum::<f32>() / squares.len() as f32
}

#[test]
fn variances_that_are_nowhere_any_are_estimated_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    for value in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        denoise(folder.path(), noisy(|_, _| value), &[])
            .succeeds()
            .complains_about(&[
                "WARN",
                "4096 of 4096 pixels (100.0 %) have no variance that is known",
            ]);
        let (before, after) = ("in.exr", "out.exr");
        let [before, after] = [before, after].map(|f| error(&folder.path().join(f), 0..SIDE));
        assert!(after < 0.1 * before, "{value}: {before} {after}");
    }
}

/// pbrt counts the samples that hit a surface: in volumes and the sky the variance stays 0.
#[test]
fn a_zero_where_the_picture_has_noise_says_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let half = |x: usize, _| {
        if x < SIDE / 2 {
            0.0
        } else {
            1.0 / SAMPLES as f32
        }
    };
    denoise(folder.path(), noisy(half), &[])
        .succeeds()
        .complains_about(&[
            "variance.R variance.G variance.B: 0 at 50 %",
            "2048 of 4096 pixels",
        ]);
    let errors = [0..SIDE / 2 - 6, SIDE / 2 + 6..SIDE]
        .map(|columns| error(&folder.path().join("out.exr"), columns));
    assert!(errors[0] < 3.0 * errors[1] + 1e-3, "{errors:?}");
}

#[test]
fn a_clean_background_is_still_believed() {
    let folder = tempfile::tempdir().unwrap();
    let clean = |x: usize, y: usize| x < SIDE / 2 || y < 8;
    // a slope with some structure and stars, without noise
    let star = |x: usize, y: usize| {
        if (7 * x + 13 * y).is_multiple_of(41) {
            20.0
        } else {
            0.0
        }
    };
    let slope = |x: usize, y: usize| 1.0 + 0.01 * x as f32 + 0.3 * (0.4 * y as f32).sin();
    let slope = |x, y| slope(x, y) + if clean(x, y) { star(x, y) } else { 0.0 };
    let value = |x: usize, y: usize| match clean(x, y) {
        true => slope(x, y),
        false => slope(x, y) * mean(1, SAMPLES, x, y),
    };
    let mut channels = rgb(value);
    channels.extend(variances(|x, y| {
        if clean(x, y) {
            0.0
        } else {
            slope(x, y).powi(2) / 16.0
        }
    }));
    let run = denoise(folder.path(), channels, &[]).succeeds();
    assert!(!run.stderr().contains("WARN"), "{}", run.stderr());
    let green = values(&folder.path().join("out.exr"), "G");
    for y in 0..SIDE {
        for x in 0..SIDE / 2 - 1 {
            assert_eq!(green[y * SIDE + x], slope(x, y), "{x}, {y}");
        }
    }
}

/// A file of halves and the run on both.
fn halves(folder: &Path, first: Vec<NamedSamples>, second: Vec<NamedSamples>) -> Ran {
    write(&folder.join("in.exr"), SIZE, vec![part(first)]);
    write(&folder.join("other.exr"), SIZE, vec![part(second)]);
    let other = folder.join("other.exr");
    command::denoise(
        folder,
        "out.exr",
        &["--other-half", other.to_str().unwrap()],
    )
}

#[test]
fn halves_must_be_two_of_one_picture() {
    let folder = tempfile::tempdir().unwrap();
    let half = |seed: u32, samples: usize| rgb(move |x, y| mean(seed, samples, x, y));
    let run = halves(folder.path(), half(1, 8), half(2, 8)).succeeds();
    assert!(!run.stderr().contains("WARN"), "{}", run.stderr());

    halves(folder.path(), half(1, 8), half(1, 8))
        .succeeds()
        .complains_about(&["WARN", "the same picture", "4096 of 4096 pixels"]);
    assert!(error(&folder.path().join("out.exr"), 0..SIDE) < 0.02);

    halves(folder.path(), half(1, 4), half(2, 32))
        .succeeds()
        .complains_about(&["WARN", "another number of samples"]);

    let other = |x: usize, y: usize| mean(2, 8, x, y) * (1.0 + (0.1 * (x + y) as f32).sin());
    std::fs::remove_file(folder.path().join("out.exr")).unwrap();
    halves(folder.path(), half(1, 8), rgb(other))
        .exits_with(2)
        .complains_about(&["--other-half", "not of the same picture"]);
    assert!(!folder.path().join("out.exr").exists());
}

#[test]
fn a_run_that_changes_nothing_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = rgb(|x, y| 1.0 + 0.01 * (x * y) as f32);
    channels.extend(variances(|_, _| 0.0));
    denoise(folder.path(), channels, &[])
        .succeeds()
        .complains_about(&["WARN", "no pixel was changed"]);
}

/// A filter of three pixels across over independent noise; its stated variance is that of one sample by their number, as a renderer that splats counts it.
#[test]
fn pixels_that_share_samples_are_told_by_their_noise() {
    let folder = tempfile::tempdir().unwrap();
    let value = |x: usize, y: usize| {
        let taps = [(0, 0.25), (1, 0.5), (2, 0.25)];
        taps.iter()
            .map(|(dx, w)| w * noise(5, (x + dx) + 2 * SIDE * y))
            .sum::<f32>()
    };
    let mut channels = rgb(value);
    channels.extend(variances(|_, _| 1.0 / 12.0));
    denoise(folder.path(), channels, &[])
        .succeeds()
        .complains_about(&["WARN", "share samples", "box filter"]);
    let mut channels = rgb(|x, y| noise(5, x + 2 * SIDE * y) + 0.02 * x as f32);
    channels.extend(variances(|_, _| 1.0 / 12.0));
    let run = denoise(folder.path(), channels, &[]).succeeds();
    assert!(!run.stderr().contains("WARN"), "{}", run.stderr());
}

#[test]
fn a_second_run_on_an_output_is_warned_of_and_does_not_use_the_old_variances() {
    let folder = tempfile::tempdir().unwrap();
    denoise(folder.path(), noisy(|_, _| 1.0 / SAMPLES as f32), &[]).succeeds();
    let (first, second) = (
        folder.path().join("out.exr"),
        folder.path().join("again.exr"),
    );
    command::denoise_file(&first, &second, &[])
        .succeeds()
        .complains_about(&[
            "WARN",
            "denoised by linpred",
            "variance.R variance.G variance.B are not used",
        ]);
    command::linpred(["inspect".as_ref(), first.as_os_str()])
        .succeeds()
        .prints(&["variance from     estimated"]);
}
