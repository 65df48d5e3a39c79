//! A panorama goes on over its ends, and a render region is a picture of its own.

use std::path::Path;

use exr::meta::attribute::EnvironmentMap;
use exr::prelude::*;
use linpred_tests::command;
use linpred_tests::images::{TestPart, exponential, noise, part, plane, values, write};

const WIDTH: usize = 96;
const HEIGHT: usize = 48;
const SIZE: (usize, usize) = (WIDTH, HEIGHT);
const SAMPLES: usize = 8;

type Pixel<'a> = dyn Fn(usize, usize) -> f32 + 'a;

fn image(
    size: (usize, usize),
    colour: &Pixel<'_>,
    variance: &Pixel<'_>,
    depth: &Pixel<'_>,
) -> TestPart {
    let mut channels = vec![plane("Z", size, depth)];
    for name in ["R", "G", "B"] {
        channels.push(plane(name, size, colour));
        channels.push(plane(&format!("variance.{name}"), size, variance));
    }
    part(channels)
}

fn environment(mut picture: TestPart) -> TestPart {
    picture.attributes.push((
        "envmap",
        AttributeValue::EnvironmentMap(EnvironmentMap::LatitudeLongitude),
    ));
    picture
}

/// The light of a panorama, which goes on over its ends.
fn light(x: usize, y: usize) -> f32 {
    let angle = std::f32::consts::TAU * x as f32 / WIDTH as f32;
    1.5 + 0.6 * angle.cos() + 0.3 * (3.0 * angle + y as f32 / 20.0).cos()
}

/// It with noise, turned by so many columns.
fn panorama(turned: usize) -> TestPart {
    let colour = move |x: usize, y: usize| {
        let x = (x + turned) % WIDTH;
        let index = |k| (y * WIDTH + x) * SAMPLES + k;
        let samples = (0..SAMPLES).map(|k| exponential(1, index(k)));
        light(x, y) * samples.sum::<f32>() / SAMPLES as f32
    };
    let variance =
        move |x: usize, y: usize| light((x + turned) % WIDTH, y).powi(2) / SAMPLES as f32;
    image(SIZE, &colour, &variance, &|_, _| 3.0)
}

fn green(path: &Path) -> Vec<f32> {
    values(path, "G")
}

/// The mean step from the last column to the first, in mean steps of the columns beside.
fn seam(values: &[f32]) -> f32 {
    let step = |a: usize, b: usize| {
        let steps = (0..HEIGHT).map(|y| (values[y * WIDTH + a] - values[y * WIDTH + b]).abs());
        steps.sum::<f32>()
    };
    let beside: f32 = (1..WIDTH).map(|x| step(x - 1, x)).sum();
    step(WIDTH - 1, 0) / (beside / (WIDTH - 1) as f32)
}

#[test]
fn a_panorama_has_no_seam() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    let mut seams = Vec::new();
    for (picture, options) in [
        (environment(panorama(0)), &[][..]),
        (panorama(0), &[]),
        (panorama(0), &["--wrap", "x"]),
        (environment(panorama(0)), &["--wrap", "none"]),
    ] {
        write(&input, SIZE, vec![picture]);
        command::denoise(folder.path(), "out.exr", options).succeeds();
        seams.push(seam(&green(&output)));
    }
    // the truth has 1.1; without wrapping both sides are on their own
    assert!(seams[..3].iter().all(|seam| *seam < 1.6), "{seams:?}");
    assert!(seams[3] > 1.5 * seams[0], "{seams:?}");
}

#[test]
fn a_wrapped_picture_has_the_same_bits_in_bands_and_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(&folder.join("in.exr"), SIZE, vec![environment(panorama(0))]);
    command::denoise(folder, "out.exr", &["--threads", "2"]).succeeds();
    let whole = green(&folder.join("out.exr"));
    let mut rows = Vec::new();
    for band in ["1/3", "2/3", "3/3"] {
        command::denoise(folder, "band.exr", &["--band", band, "--threads", "1"]).succeeds();
        rows.extend(green(&folder.join("band.exr")));
    }
    assert_eq!(whole, rows);
}

/// Twice as wide as high, but its ends have nothing to do with each other.
#[test]
fn a_wide_picture_is_no_panorama() {
    let folder = tempfile::tempdir().unwrap();
    let colour = |x: usize, y: usize| x as f32 * 0.1 + noise(1, y * WIDTH + x);
    let picture = image(SIZE, &colour, &|_, _| 1.0 / 12.0, &|_, _| 3.0);
    write(&folder.path().join("in.exr"), SIZE, vec![picture]);
    let run = command::denoise(folder.path(), "out.exr", &[]).succeeds();
    assert!(!run.stderr().contains("wrap"), "{}", run.stderr());
    let never = command::denoise(folder.path(), "never.exr", &["--wrap", "none"]);
    never.succeeds();
    let outputs = ["out.exr", "never.exr"].map(|name| green(&folder.path().join(name)));
    assert_eq!(outputs[0], outputs[1]);
}

#[test]
fn a_render_region_comes_out_as_its_cropped_file_does() {
    const LEFT: usize = 21;
    const TOP: usize = 10;
    const REGION: (usize, usize) = (50, 30);
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let colour = |x: usize, y: usize| 0.1 + exponential(1, y * WIDTH + x);
    let depth = |x: usize, _: usize| 1.0 + x as f32;
    let inside = |x: usize, y: usize| {
        (LEFT..LEFT + REGION.0).contains(&x) && (TOP..TOP + REGION.1).contains(&y)
    };
    let only = |value: f32, x: usize, y: usize| if inside(x, y) { value } else { 0.0 };
    let frame = image(
        SIZE,
        &|x, y| only(colour(x, y), x, y),
        &|x, y| only(1.0, x, y),
        &|x, y| only(depth(x, y), x, y),
    );
    let crop = image(
        REGION,
        &|x, y| colour(x + LEFT, y + TOP),
        &|_, _| 1.0,
        &|x, y| depth(x + LEFT, y + TOP),
    );
    write(&folder.join("in.exr"), SIZE, vec![frame]);
    write(&folder.join("crop.exr"), REGION, vec![crop]);
    let options = ["--quality", "high", "--error-layer"];
    command::denoise(folder, "out.exr", &options)
        .succeeds()
        .complains_about(&["only 50 x 30 pixels at (21, 10)"]);
    command::denoise_file(
        &folder.join("crop.exr"),
        &folder.join("cropped.exr"),
        &options,
    )
    .succeeds();
    let mut banded = Vec::new();
    for band in ["1/3", "2/3", "3/3"] {
        command::denoise(folder, "band.exr", &["--quality", "high", "--band", band]).succeeds();
        banded.extend(green(&folder.join("band.exr")));
    }
    let (frame, crop) = (
        green(&folder.join("out.exr")),
        green(&folder.join("cropped.exr")),
    );
    for (i, value) in frame.iter().enumerate() {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let wanted = match inside(x, y) {
            true => crop[(y - TOP) * REGION.0 + x - LEFT],
            false => 0.0,
        };
        assert_eq!(value.to_bits(), wanted.to_bits(), "{x}, {y}");
    }
    assert_eq!(frame, banded);
}
