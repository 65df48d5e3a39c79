//! Alpha, and channels that are no light, are denoised with the models of the colour.

use std::path::Path;

use linpred_tests::command;
use linpred_tests::images::{NamedSamples, exponential, noise, part, plane, values, write};

const SIDE: usize = 64;
const SIZE: (usize, usize) = (SIDE, SIDE);
const SAMPLES: usize = 16;

/// How much of a pixel a disc with a blurred edge covers.
fn cover(x: usize, y: usize) -> f32 {
    let distance = (x as f32 - 32.0).hypot(y as f32 - 32.0);
    ((24.0 - distance) / 16.0 + 0.5).clamp(0.0, 1.0)
}

/// Mean alpha, mean radiance of white and its variance of the mean, of samples that hit the disc or do not.
fn sampled(x: usize, y: usize) -> [f32; 3] {
    let (mut alpha, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for k in 0..SAMPLES {
        let index = (y * SIDE + x) * SAMPLES + k;
        let hit = noise(1, index) < cover(x, y);
        let value = if hit { exponential(2, index) } else { 0.0 };
        alpha += f32::from(hit);
        sum += value;
        squares += value * value;
    }
    let n = SAMPLES as f32;
    let mean = sum / n;
    [
        alpha / n,
        mean,
        ((squares / n - mean * mean) / (n - 1.0)).max(0.0),
    ]
}

const ALBEDO: [f32; 3] = [0.8, 0.4, 0.2];

/// A disc over nothing, with or without its variances.
fn disc(variances: bool) -> Vec<NamedSamples> {
    let mut channels = vec![plane("A", SIZE, |x, y| sampled(x, y)[0])];
    for (name, albedo) in ["R", "G", "B"].into_iter().zip(ALBEDO) {
        channels.push(plane(name, SIZE, |x, y| albedo * sampled(x, y)[1]));
        if variances {
            let name = format!("variance.{name}");
            channels.push(plane(&name, SIZE, |x, y| {
                albedo * albedo * sampled(x, y)[2]
            }));
        }
    }
    channels
}

/// Mean squared errors over the blurred edge: over white, and of the colour divided by alpha.
fn errors(path: &Path) -> [f32; 2] {
    let colour = values(path, "R");
    let alpha = values(path, "A");
    let (mut over, mut straight, mut count) = (0.0, 0.0, 0.0);
    for i in 0..SIDE * SIDE {
        let (x, y) = (i % SIDE, i / SIDE);
        let (cover, hits) = (cover(x, y), sampled(x, y)[0]);
        if (0.05..0.95).contains(&cover) && hits > 0.0 {
            let truth = ALBEDO[0] * cover + (1.0 - cover);
            over += (colour[i] + (1.0 - alpha[i]) - truth).powi(2);
            straight += (colour[i] / alpha[i].max(1e-9) - ALBEDO[0]).powi(2);
            count += 1.0;
        }
    }
    [over / count, straight / count]
}

#[test]
fn a_blurred_edge_is_better_over_white_and_without_its_alpha_than_it_came() {
    let folder = tempfile::tempdir().unwrap();
    for variances in [true, false] {
        write(
            &folder.path().join("in.exr"),
            SIZE,
            vec![part(disc(variances))],
        );
        let before = errors(&folder.path().join("in.exr"));
        for quality in ["fast", "high"] {
            command::denoise(folder.path(), "out.exr", &["--quality", quality]).succeeds();
            let output = folder.path().join("out.exr");
            let after = errors(&output);
            // seen: an eighth and less
            assert!(
                after[0] < 0.3 * before[0] && after[1] < 0.3 * before[1],
                "{quality}: {before:?} {after:?}"
            );
            let alpha = values(&output, "A");
            assert!(alpha.iter().all(|alpha| (0.0..=1.0).contains(alpha)));
        }
    }
}

#[test]
fn what_is_opaque_or_empty_stays_exactly_so() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("in.exr"), SIZE, vec![part(disc(true))]);
    command::denoise(folder.path(), "out.exr", &[]).succeeds();
    let alpha = values(&folder.path().join("out.exr"), "A");
    for (i, alpha) in alpha.into_iter().enumerate() {
        let distance = (i % SIDE) as f32 - 32.0;
        let distance = distance.hypot((i / SIDE) as f32 - 32.0);
        // farther from the edge than windows and the stages after them reach together
        if distance < 4.0 {
            assert_eq!(alpha, 1.0, "pixel {i}");
        }
    }
    let opaque = disc(true)
        .into_iter()
        .map(|(name, samples)| match name.as_str() {
            "A" => plane("A", SIZE, |_, _| 1.0),
            _ => (name, samples),
        });
    write(
        &folder.path().join("in.exr"),
        SIZE,
        vec![part(opaque.collect())],
    );
    for quality in ["fast", "high"] {
        command::denoise(folder.path(), "out.exr", &["--quality", quality]).succeeds();
        let alpha = values(&folder.path().join("out.exr"), "A");
        assert!(alpha.iter().all(|alpha| *alpha == 1.0), "{quality}");
    }
}

/// The features say that nothing is there: no light may spill over.
#[test]
fn black_pixels_where_nothing_is_stay_black_beside_noisy_ones() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |x: usize, y: usize| f32::from((x as f32 - 32.0).hypot(y as f32 - 32.0) < 20.0);
    let mut channels = vec![plane("A", SIZE, inside)];
    for (name, seed) in ["R", "G", "B"].into_iter().zip(3..) {
        channels.push(plane(name, SIZE, |x, y| {
            2.0 * inside(x, y) * exponential(seed, y * SIDE + x)
        }));
        channels.push(plane(&format!("variance.{name}"), SIZE, |x, y| {
            4.0 * inside(x, y)
        }));
    }
    for (name, value) in [("N.X", 0.0), ("N.Y", 0.0), ("N.Z", 1.0)] {
        channels.push(plane(name, SIZE, |x, y| value * inside(x, y)));
    }
    channels.push(plane("Z", SIZE, |x, y| {
        if inside(x, y) > 0.0 { 5.0 } else { 1e10 }
    }));
    write(&folder.path().join("in.exr"), SIZE, vec![part(channels)]);
    command::denoise(folder.path(), "out.exr", &[]).succeeds();
    let green = values(&folder.path().join("out.exr"), "G");
    for (i, green) in green.into_iter().enumerate() {
        let lit = inside(i % SIDE, i / SIDE) > 0.0;
        assert!(
            if lit { green > 0.0 } else { green == 0.0 },
            "pixel {i}: {green}"
        );
    }
}

#[test]
fn channels_that_are_no_light_are_denoised_where_they_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let step = |x: usize| if x < SIDE / 2 { 1.0 } else { 3.0 };
    let mut channels = disc(true);
    channels.push(plane("depth.Z", SIZE, |x, y| {
        step(x) * (0.5 + noise(7, y * SIDE + x))
    }));
    channels.push(plane("motion.u", SIZE, |x, y| {
        -2.0 + noise(8, y * SIDE + x)
    }));
    channels.push(plane("motion.v", SIZE, |x, y| noise(9, y * SIDE + x)));
    write(&folder.path().join("in.exr"), SIZE, vec![part(channels)]);
    let layers = ["--layers", "depth,motion", "--map", "depth=none"];
    command::denoise(folder.path(), "out.exr", &layers).succeeds();
    let (input, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    for (name, mean) in [("motion.u", -1.5), ("motion.v", 0.5)] {
        let error = |path: &Path| {
            let values = values(path, name);
            let squares = values.iter().map(|v| (v - mean) * (v - mean));
            squares.sum::<f32>() / values.len() as f32
        };
        let (before, after) = (error(&input), error(&output));
        assert!(after < 0.2 * before, "{name}: {before} {after}");
    }
    assert_ne!(values(&input, "depth.Z"), values(&output, "depth.Z"));

    command::denoise(folder.path(), "out.exr", &["--map", "alpha=none"]).succeeds();
    assert_eq!(values(&input, "A"), values(&output, "A"));
    assert_eq!(values(&input, "motion.u"), values(&output, "motion.u"));
    // the alpha by its name is what is done in any case
    command::denoise(folder.path(), "named.exr", &["--layers", "A"]).succeeds();
    assert_ne!(
        values(&input, "A"),
        values(&folder.path().join("named.exr"), "A")
    );
}
