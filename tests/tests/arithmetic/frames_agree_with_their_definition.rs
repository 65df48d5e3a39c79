//! The weights of neighbouring frames and their average, which the core works out in runs of columns, against their formulas in double precision, pixel by pixel.

use linpred_core::{
    Averaged, COMPARED_PLANES, DEPTH_CHANGE, FINISH_PADDING, FrameRow, MEASURED_PLANES,
    TEMPORAL_RADIUS, TEMPORAL_SPAN, average_frames, compare_frames, compare_own, finish_columns,
    measure_frame, weigh_frames,
};
use linpred_tests::images::noise;

const WIDTH: usize = 71;
const HEIGHT: usize = TEMPORAL_SPAN + 1;
/// The row whose weights are worked out: the one above has a row of its neighbourhood beyond the image.
const ROW: usize = TEMPORAL_RADIUS - 1;
const FRAMES: usize = 3;
/// The column of a pixel that frame 1 alone has bright.
const FIREFLY: usize = 50;

/// A pixel of a frame: radiance, variance, normal, albedo, depth.
#[derive(Clone, Copy)]
struct Pixel {
    colour: [f64; 3],
    variance: [f64; 3],
    normal: [f64; 3],
    albedo: [f64; 3],
    depth: f64,
    known: bool,
    /// See [`grain`].
    grain: f64,
}

impl Pixel {
    fn black(self) -> Self {
        Self {
            colour: [0.0; 3],
            known: true,
            ..self
        }
    }
}

/// Pixel (x, y) of a frame; frame 0 is the one that is helped. Light is off on the left of frame 2, depths grow from frame to frame, frame 1 lacks some pixels.
fn pixel(frame: usize, x: usize, y: usize) -> Pixel {
    let grain = |seed: u32| {
        let seed = seed + 40 * frame as u32;
        f64::from(noise(seed, y * WIDTH + x))
    };
    let edge = if x > 40 { 0.5 } else { 0.0 };
    let lit = if frame == 2 && x < 20 { 0.2 } else { 1.0 };
    let lit = match frame == 1 && (x, y) == (FIREFLY, ROW) {
        true => 30.0,
        false => lit,
    };
    let three = |first: u32, scale: f64| [0, 1, 2].map(|c| scale * grain(first + c));
    Pixel {
        colour: three(0, 0.3).map(|grain| lit * (0.4 + edge + grain)),
        variance: three(3, 0.02),
        normal: three(6, 0.1).map(|grain| grain + edge),
        albedo: three(9, 0.1).map(|grain| grain + 0.3),
        depth: (3.0 + edge + 0.02 * grain(12)) * (1.0 + 0.1 * frame as f64),
        known: frame != 1 || !(x + 2 * y).is_multiple_of(11),
        grain: 0.0,
    }
}

/// Planes of a row, 17 of them, and where pixels are known.
fn planes(frame: usize, y: usize) -> (Vec<Vec<f32>>, Vec<f32>) {
    let mut planes = vec![vec![0.0; finish_columns(WIDTH)]; 13];
    let mut known = vec![0.0; finish_columns(WIDTH)];
    for x in 0..WIDTH {
        let own = pixel(frame, x, y);
        let values = (own.colour.iter().chain(&own.variance)).chain(&own.normal);
        let values = values.chain(&own.albedo).chain([&own.depth]);
        for (plane, value) in planes.iter_mut().zip(values) {
            plane[FINISH_PADDING + x] = if own.known { *value as f32 } else { f32::NAN };
        }
        known[FINISH_PADDING + x] = f32::from(u8::from(own.known));
    }
    (planes, known)
}

fn row(planes: &[Vec<f32>], variances: bool) -> FrameRow<'_> {
    let three = |first: usize| [0, 1, 2].map(|c| planes[first + c].as_slice());
    FrameRow {
        colour: three(0),
        variance: if variances { three(3) } else { [&[]; 3] },
        normal: three(6),
        albedo: three(9),
        depth: &planes[12],
    }
}

/// What the core measures of a frame around the pixels of [`ROW`].
fn measured(frame: usize, variances: bool) -> Vec<Vec<f32>> {
    let empty = vec![vec![0.0; finish_columns(WIDTH)]; COMPARED_PLANES];
    let compared: Vec<_> = (0..HEIGHT)
        .map(|y| {
            let (own, (other, known)) = (planes(0, y).0, planes(frame, y));
            let mut output = empty.clone();
            let slots: Vec<&mut [f32]> = output.iter_mut().map(Vec::as_mut_slice).collect();
            let slots = slots.try_into().expect("as many planes");
            let (own, other) = (row(&own, variances), row(&other, variances));
            match frame {
                0 => compare_own(&own, &known, slots),
                _ => compare_frames(&own, &other, &known, slots),
            }
            for plane in &mut output {
                plane[..FINISH_PADDING].fill(0.0);
                plane[FINISH_PADDING + WIDTH..].fill(0.0);
            }
            output
        })
        .collect();
    let rows = std::array::from_fn(|plane| {
        std::array::from_fn(|k| match (ROW + k).checked_sub(TEMPORAL_RADIUS) {
            Some(y) => compared[y][plane].as_slice(),
            None => empty[plane].as_slice(),
        })
    });
    let mut output = vec![vec![0.0; finish_columns(WIDTH)]; MEASURED_PLANES];
    let slots: Vec<&mut [f32]> = output.iter_mut().map(Vec::as_mut_slice).collect();
    measure_frame(&rows, &mut slots.try_into().expect("as many planes"));
    output
}

/// The weights that the core gives to frames 1 and 2.
fn weights(variances: bool, alike: f32) -> Vec<Vec<f32>> {
    let all: Vec<_> = (0..FRAMES)
        .map(|frame| measured(frame, variances))
        .collect();
    let slices = |frame: usize| std::array::from_fn(|k| all[frame][k].as_slice());
    let mut weights = vec![vec![0.0; finish_columns(WIDTH)]; FRAMES - 1];
    let mut others: Vec<_> = (weights.iter_mut().enumerate())
        .map(|(k, weights)| (slices(k + 1), weights.as_mut_slice()))
        .collect();
    weigh_frames(&slices(0), &mut others, alike, variances);
    weights
}

/// The pixels of a frame within `radius` of (x, [`ROW`]) that are known, and those of the frame that is helped.
fn around(frame: usize, x: usize, radius: usize) -> Vec<(Pixel, Pixel)> {
    let mut pairs = Vec::new();
    for y in ROW.saturating_sub(radius)..=ROW + radius {
        for x in x.saturating_sub(radius)..=(x + radius).min(WIDTH - 1) {
            let (mut own, mut other) = (pixel(0, x, y), pixel(frame, x, y));
            (own.grain, other.grain) = (grain(0, x, y), grain(frame, x, y));
            if other.known {
                pairs.push((own, other));
            }
        }
    }
    pairs
}

fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.into_iter().collect();
    values.iter().sum::<f64>() / values.len() as f64
}

fn of_channels(values: [f64; 3]) -> f64 {
    values.iter().sum::<f64>() / 3.0
}

/// Mean over the channels of the squared difference.
fn square(a: [f64; 3], b: [f64; 3]) -> f64 {
    of_channels(std::array::from_fn(|c| (a[c] - b[c]) * (a[c] - b[c])))
}

/// What pixel (x, y) of a frame differs by from the mean of its neighbours left and right, as the variance of a pixel; 0 where one is missing. Beyond the image the test has zeros.
fn grain(frame: usize, x: usize, y: usize) -> f64 {
    let at = |x: usize| match x {
        1..=WIDTH => Some(pixel(frame, x - 1, y)).filter(|own| own.known),
        _ => Some(pixel(frame, 0, y).black()),
    };
    // columns from 1 on, so that there is one before the first
    let [Some(left), Some(own), Some(right)] = [x, x + 1, x + 2].map(at) else {
        return 0.0;
    };
    let beside = std::array::from_fn(|c| 0.5 * (left.colour[c] + right.colour[c]));
    square(own.colour, beside) / 1.5
}

/// The definition, as the module's documentation has it.
fn weight(frame: usize, x: usize, variances: bool, alike: f64) -> f64 {
    if !pixel(frame, x, ROW).known || (frame == 1 && x == FIREFLY) {
        return 0.0;
    }
    let noise_of = |pixel: &Pixel| of_channels(pixel.variance);
    let (mut near_variance, mut near_radiance) = (Vec::new(), Vec::new());
    for frame in 0..FRAMES {
        for (_, other) in around(frame, x, 1) {
            near_variance.push(noise_of(&other));
            near_radiance.push(of_channels(other.colour.map(f64::abs)));
        }
    }
    let differences = |frame: usize| {
        let pairs = around(frame, x, 7);
        mean(
            pairs
                .iter()
                .map(|(own, other)| square(own.colour, other.colour)),
        )
    };
    let variance = match variances {
        true => mean(near_variance),
        false => {
            let own = around(0, x, 7);
            let grain = mean(own.iter().map(|(own, _)| own.grain));
            grain.min(0.5 * differences(1).min(differences(2)))
        }
    };
    let radiance = mean(near_radiance);
    let (mut bias, mut similar) = (0.0_f64, 1.0);
    for radius in [1, 7] {
        let pairs = around(frame, x, radius);
        let shift = |c: usize| {
            mean(
                pairs
                    .iter()
                    .map(|(own, other)| other.colour[c] - own.colour[c]),
            )
        };
        let squared = of_channels([shift(0), shift(1), shift(2)].map(|shift| shift * shift));
        let noise = |pixel: &Pixel| match variances {
            true => noise_of(pixel),
            false => pixel.grain,
        };
        let own = mean(pairs.iter().map(|(own, _)| noise(own)));
        let other = mean(pairs.iter().map(|(_, other)| noise(other)));
        similar *= 4.0 * own * other / (own + other).powi(2);
        let both = if variances {
            own + other
        } else {
            2.0 * variance
        };
        bias = bias.max(squared - both / pairs.len() as f64);
        if radius == 7 && variances {
            bias = bias.max(differences(frame) - own - other);
        }
    }
    let change = mean(
        around(frame, x, 7)
            .iter()
            .map(|(own, other)| other.depth / own.depth - 1.0),
    );
    let mismatch = mean(around(frame, x, 1).iter().map(|(own, other)| {
        let albedo = of_channels(own.albedo);
        let depth = other.depth / own.depth - 1.0 - change;
        3.0 * square(own.normal, other.normal)
            + square(own.albedo, other.albedo) / (albedo * albedo + 0.01)
            + depth * depth
    }));
    similar * variance / (variance + alike * (bias + mismatch * radiance * radiance))
}

#[test]
fn weights_of_frames_are_those_of_their_definition() {
    for (variances, alike) in [(true, 1.0), (true, 2.0), (false, 1.0)] {
        let weights = weights(variances, alike);
        let (mut least, mut most) = (f64::MAX, 0.0_f64);
        for frame in 1..FRAMES {
            for x in 0..WIDTH {
                let defined = weight(frame, x, variances, f64::from(alike));
                let own = f64::from(weights[frame - 1][FINISH_PADDING + x]);
                assert!(
                    (own - defined).abs() <= 1e-3 * defined + 1e-5,
                    "frame {frame}, column {x}, variances {variances}: {own}, not {defined}"
                );
                (least, most) = (least.min(defined), most.max(defined));
            }
        }
        assert!(
            least < 0.01 && most > 0.3,
            "the weights say little: {least} to {most}"
        );
    }
}

#[test]
fn depths_of_a_frame_change_as_those_around_do() {
    let plane = &measured(2, true)[DEPTH_CHANGE];
    for x in 0..WIDTH {
        let pairs = around(2, x, 7);
        let defined = mean(
            pairs
                .iter()
                .map(|(own, other)| other.depth / own.depth - 1.0),
        );
        let change = f64::from(plane[FINISH_PADDING + x]);
        assert!(
            (change - defined).abs() < 1e-5,
            "column {x}: {change}, not {defined}"
        );
    }
}

#[test]
fn averages_of_frames_are_means_of_means_and_variances_of_those() {
    let columns = finish_columns(WIDTH);
    let plane = |seed: u32| -> Vec<f32> { (0..columns).map(|x| noise(seed, x)).collect() };
    let (own, mut values, weights) = (plane(1), [plane(2), plane(3)], [plane(4), plane(5)]);
    let mut weights = weights;
    // what weighs nothing may hold anything
    (weights[0][40], values[0][40]) = (0.0, f32::NAN);
    let others: Vec<_> = (weights.iter().zip(&values))
        .map(|(weights, values)| (weights.as_slice(), values.as_slice()))
        .collect();
    for (what, power) in [(Averaged::Means, 1), (Averaged::Variances, 2)] {
        let mut output = vec![0.0; columns];
        average_frames(&own, &others, what, &mut output);
        for x in FINISH_PADDING..FINISH_PADDING + WIDTH {
            let (mut sum, mut total) = (f64::from(own[x]), 1.0);
            for (weights, values) in weights.iter().zip(&values) {
                let weight = f64::from(weights[x]);
                total += weight;
                sum += if weight > 0.0 {
                    weight.powi(power) * f64::from(values[x])
                } else {
                    0.0
                };
            }
            let defined = sum / total.powi(power);
            assert!((f64::from(output[x]) - defined).abs() < 1e-6, "column {x}");
        }
    }
}

#[test]
fn a_frame_alone_keeps_its_bits() {
    let own: Vec<f32> = (0..finish_columns(WIDTH)).map(|x| noise(7, x)).collect();
    let (nothing, anything) = (vec![0.0; own.len()], vec![f32::INFINITY; own.len()]);
    let others = [(nothing.as_slice(), anything.as_slice())];
    for what in [Averaged::Means, Averaged::Variances] {
        let mut output = vec![0.0; own.len()];
        average_frames(&own, &others, what, &mut output);
        let image = FINISH_PADDING..FINISH_PADDING + WIDTH;
        assert_eq!(output[image.clone()], own[image]);
    }
}
