//! The render of `tests/data` comes out closer to its reference than it went in, at every quality, with and without variances.

use std::path::{Path, PathBuf};

use exr::image::write::WritableImage;
use linpred_tests::command::{denoise_file, linpred};
use linpred_tests::images::read;
use linpred_tests::tolerance::close;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("data")
        .join(name)
}

fn rmse(image: &Path) -> f64 {
    let reference = data("toasters_ref.exr");
    let ran = linpred([Path::new("compare"), image, &reference, Path::new("--json")]).succeeds();
    let figures: serde_json::Value = serde_json::from_str(&ran.stdout()).expect("JSON");
    figures["rmse"].as_f64().expect("a number")
}

/// rMSE of the input over that of the output.
fn gain(noisy: &Path, options: &[&str]) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let clean = folder.path().join("clean.exr");
    denoise_file(noisy, &clean, options).succeeds();
    rmse(noisy) / rmse(&clean)
}

/// Each gain is held from both sides: a tenth below what was measured is a loss of accuracy, and more than half above it on
/// an unchanged sample is a comparison that no longer measures. Platforms differ by nothing (the bits are the same), so the tenth
/// is room for changes of the method that win elsewhere and lose a little here.
#[track_caller]
fn assert_gain(gain: f64, measured: f64) {
    assert!(
        gain >= 0.9 * measured && gain <= 1.5 * measured,
        "gain {gain:.2}, measured when this test was written: {measured:.2}"
    );
}

/// A copy of the sample with only those channels that a renderer without variances writes.
fn without_variances(folder: &Path) -> PathBuf {
    let mut image = read(&data("toasters_16spp.exr"));
    let channels = &mut image.layer_data[0].channel_data.list;
    channels.retain(|channel| {
        let name = channel.name.to_string();
        !["ariance", "half"].iter().any(|part| name.contains(part))
    });
    assert_eq!(channels.len(), 10, "colour, albedo, normal, depth");
    let path = folder.join("plain.exr");
    image.write().non_parallel().to_file(&path).unwrap();
    path
}

#[test]
fn by_one_model_per_pixel() {
    let noisy = data("toasters_16spp.exr");
    assert_gain(gain(&noisy, &["--quality", "fast"]), 6.67);
}

#[test]
fn by_default() {
    assert_gain(gain(&data("toasters_16spp.exr"), &[]), 8.51);
}

#[test]
fn by_sixteen_models_per_pixel() {
    let noisy = data("toasters_16spp.exr");
    assert_gain(gain(&noisy, &["--quality", "high"]), 9.07);
}

#[test]
fn by_the_papers_formulas() {
    let noisy = data("toasters_16spp.exr");
    assert_gain(gain(&noisy, &["--formulas", "literal"]), 1.70);
}

#[test]
fn without_any_variance_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    assert_gain(gain(&without_variances(folder.path()), &[]), 7.59);
}

/// The measure itself, on numbers that no part of the method changes.
#[test]
fn the_noisy_sample_is_as_far_from_its_reference_as_it_always_was() {
    let rmse = rmse(&data("toasters_16spp.exr"));
    assert!(close(rmse, 0.068_560, 1e-6), "{rmse}");
}
