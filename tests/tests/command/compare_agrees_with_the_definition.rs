//! `linpred compare` computes the figures that its help promises.

use exr::prelude::FlatSamples;
use linpred_tests::command::linpred;
use linpred_tests::images::{NamedSamples, colour, constant, float, noise, part, write};

const SIZE: (usize, usize) = (31, 17);
const PIXELS: usize = SIZE.0 * SIZE.1;

fn channel(name: &str, value: impl Fn(usize) -> f32) -> NamedSamples {
    (
        name.into(),
        FlatSamples::F32((0..PIXELS).map(value).collect()),
    )
}

fn compare(a: Vec<NamedSamples>, f: Vec<NamedSamples>, options: &[&str]) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let (image, reference) = (folder.path().join("a.exr"), folder.path().join("f.exr"));
    write(&image, SIZE, vec![part(a)]);
    write(&reference, SIZE, vec![part(f)]);
    let mut arguments = vec![
        "compare",
        image.to_str().unwrap(),
        reference.to_str().unwrap(),
        "--json",
    ];
    arguments.extend(options);
    serde_json::from_str(&linpred(arguments).succeeds().stdout()).unwrap()
}

/// rMSE, MSE and PSNR, from their definitions.
fn expected(
    a: impl Fn(u32, usize) -> f64,
    f: impl Fn(u32, usize) -> f64,
    var: f64,
) -> (f64, f64, f64) {
    let srgb = |x: f64| match x.clamp(0.0, 1.0) {
        x if x <= 0.0031308 => 12.92 * x,
        x => 1.055 * x.powf(1.0 / 2.4) - 0.055,
    };
    let mut sums = (0.0, 0.0, 0.0);
    for seed in 1..4 {
        for i in 0..PIXELS {
            let (a, f) = (a(seed, i), f(seed, i));
            sums.0 += ((a - f).powi(2) - var) / (f * f + 0.01);
            sums.1 += (a - f).powi(2);
            sums.2 += (srgb(a) - srgb(f)).powi(2);
        }
    }
    let n = 3.0 * PIXELS as f64;
    (sums.0 / n, sums.1 / n, -10.0 * (sums.2 / n).log10())
}

#[track_caller]
fn assert_close(actual: &serde_json::Value, expected: f64) {
    let actual = actual.as_f64().expect("a number");
    assert!(
        (actual - expected).abs() <= 1e-9 * expected.abs().max(1e-3),
        "{actual} {expected}"
    );
}

#[test]
fn the_references_own_variance_is_taken_off() {
    let image = ["R", "G", "B"]
        .iter()
        .zip(1..)
        .map(|(c, seed)| channel(c, move |i| 2.0 * noise(seed, i) - 0.1));
    let mut reference = colour(PIXELS);
    reference.extend(["R", "G", "B"].map(|c| constant(&format!("variance.{c}"), PIXELS, 0.015625)));
    let figures = compare(image.collect(), reference, &[]);
    let a = |seed, i| f64::from(2.0 * noise(seed, i) - 0.1);
    let (rmse, mse, psnr) = expected(a, |seed, i| f64::from(noise(seed, i)), 0.015625);
    assert_close(&figures["rmse"], rmse);
    assert_close(&figures["mse"], mse);
    assert_close(&figures["psnr_tonemapped"], psnr);
    assert_eq!(figures["reference_has_variance"], true);
}

#[test]
fn the_worst_pixel_is_where_it_was_put_and_what_is_not_a_number_is_counted() {
    let mut image = colour(PIXELS);
    image[0] = channel("R", |i| {
        if i == 5 * SIZE.0 + 7 {
            40.0
        } else {
            noise(1, i)
        }
    });
    image[1] = channel("G", |i| if i < 3 { f32::NAN } else { noise(2, i) });
    let figures = compare(image, colour(PIXELS), &[]);
    assert_eq!(
        (&figures["worst"][0]["x"], &figures["worst"][0]["y"]),
        (&7.into(), &5.into())
    );
    assert_eq!(figures["non_finite"], 3);
    assert!(figures["rmse"].as_f64().is_some_and(f64::is_finite));
}

#[test]
fn images_of_different_sizes_are_refused_with_both_sizes() {
    let folder = tempfile::tempdir().unwrap();
    let (image, reference) = (folder.path().join("a.exr"), folder.path().join("f.exr"));
    write(&image, SIZE, vec![part(colour(PIXELS))]);
    write(
        &reference,
        (SIZE.0, SIZE.1 - 1),
        vec![part(colour(SIZE.0 * (SIZE.1 - 1)))],
    );
    linpred(["compare".as_ref(), image.as_os_str(), reference.as_os_str()])
        .exits_with(3)
        .complains_about(&["31 x 17", "31 x 16"]);
}

#[test]
fn the_heatmap_is_a_picture_of_the_images_size() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("heat.png");
    compare(
        colour(PIXELS),
        vec![
            float("R", PIXELS, 7),
            float("G", PIXELS, 8),
            float("B", PIXELS, 9),
        ],
        &["--heatmap", picture.to_str().unwrap()],
    );
    let bytes = std::fs::read(&picture).unwrap();
    assert_eq!(&bytes[1..4], b"PNG");
    assert_eq!(bytes[16..24], [0, 0, 0, 31, 0, 0, 0, 17]);
}
