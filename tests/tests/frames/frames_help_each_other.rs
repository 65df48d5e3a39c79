//! Frames of a sequence that take over what their neighbours show of the same surfaces.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred::temporal::Temporal;
use linpred::{Error, InputRow, Motion, Options, OutputRow, Params, RowLayout, RowSource, denoise};
use linpred_tests::frames::{AnyRow, Frame, Output, Scene};

const SIDE: usize = 64;

const BACKWARD: Motion = Motion {
    backward: true,
    forward: false,
    position: false,
};

/// Frames of a shot that moves by `step` pixels from one to the next, each with noise of its own.
fn shot(count: usize, step: (usize, usize), scene: Scene, motion: Motion) -> Vec<Frame> {
    let frame = |k: usize| {
        let scene = Scene {
            origin: (k * step.0, k * step.1),
            seed: 1 + k as u32,
            ..scene
        };
        let mut frame = scene.render();
        frame.layout = frame.layout.with_motion(motion);
        let layout = frame.layout;
        for (y, row) in frame.rows.iter_mut().enumerate() {
            let mut whole = InputRow::new(&layout);
            let (right, down) = (step.0 as f32, step.1 as f32);
            for (plane, value) in whole.backward.iter_mut().zip([right, down]) {
                plane.fill(value);
            }
            for (plane, value) in whole.forward.iter_mut().zip([-right, -down]) {
                plane.fill(value);
            }
            for (x, place) in whole.position[0].iter_mut().enumerate() {
                *place = (x + scene.origin.0) as f32;
            }
            whole.position[1].fill((y + scene.origin.1) as f32);
            (row.backward, row.forward, row.position) =
                (whole.backward, whole.forward, whole.position);
        }
        frame
    };
    (0..count).map(frame).collect()
}

/// Frame `k` helped by up to two frames on either side.
fn beside(frames: &[Frame], k: usize, threads: usize) -> Temporal<AnyRow<'_>> {
    let before = frames[k.saturating_sub(2)..k].iter().rev().map(AnyRow);
    let after = frames[k + 1..].iter().take(2).map(AnyRow);
    let threads = NonZeroUsize::new(threads).expect("at least one");
    let temporal = Temporal::new(
        AnyRow(&frames[k]),
        before.collect(),
        after.collect(),
        threads,
    );
    temporal.expect("the frames are alike")
}

fn run(source: &mut dyn RowSource) -> Vec<OutputRow> {
    let mut rows = Vec::new();
    let mut sink = |_: usize, row: &OutputRow| {
        rows.push(row.clone());
        Ok(())
    };
    let go_on = &mut |_| ControlFlow::Continue(());
    denoise(source, &mut sink, &Options::default(), go_on).expect("memory does not fail");
    rows
}

fn helped(frames: &[Frame], k: usize) -> Vec<OutputRow> {
    run(&mut beside(frames, k, 2))
}

/// The frame without the others.
fn alone(frame: &Frame) -> Output {
    let mut own = frame.clone();
    own.layout = own.layout.with_motion(Motion::default());
    for row in &mut own.rows {
        (row.backward, row.forward, row.position) = Default::default();
    }
    own.denoise(Params::default())
}

/// Mean squared error over the pixels.
fn error(rows: &[OutputRow], truth: &[[f32; 3]]) -> f64 {
    let width = rows[0].error.len();
    let of_pixel = |(i, truth): (usize, &[f32; 3])| -> f64 {
        let row = &rows[i / width];
        let channels = row.colour.iter().zip(truth);
        channels
            .map(|(plane, truth)| f64::from(plane[i % width] - truth).powi(2))
            .sum()
    };
    truth.iter().enumerate().map(of_pixel).sum::<f64>() / truth.len() as f64
}

fn mean_frames(rows: &[OutputRow]) -> f64 {
    let all: Vec<f32> = rows.iter().flat_map(|row| row.frames.clone()).collect();
    all.iter().map(|frames| f64::from(*frames)).sum::<f64>() / all.len() as f64
}

fn colour_bits(rows: &[OutputRow]) -> Vec<u32> {
    let planes = rows
        .iter()
        .flat_map(|row| row.colour.iter().chain(row.layers.iter().flatten()));
    planes.flatten().map(|value| value.to_bits()).collect()
}

#[test]
fn surfaces_that_move_are_found_by_vectors_either_way_and_by_position() {
    let forward = Motion {
        backward: false,
        forward: true,
        position: false,
    };
    let both = Motion {
        backward: true,
        forward: true,
        position: false,
    };
    let position = Motion {
        backward: false,
        forward: false,
        position: true,
    };
    for motion in [BACKWARD, forward, both, position] {
        let frames = shot(5, (3, 2), Scene::new(SIDE, SIDE), motion);
        for k in [0, 2, 4] {
            let rows = helped(&frames, k);
            let [own, help] =
                [&alone(&frames[k]).rows, &rows].map(|rows| error(rows, &frames[k].truth));
            assert!(
                help < 0.7 * own,
                "{motion:?}, frame {k}: {help} with help, {own} without"
            );
            let least = if k == 2 { 3.0 } else { 2.0 };
            let frames = mean_frames(&rows);
            assert!(frames > least, "{motion:?}, frame {k}: {frames} frames");
        }
    }
}

#[test]
fn a_frame_that_stands_still_needs_no_motion() {
    let frames = shot(5, (0, 0), Scene::new(SIDE, SIDE), Motion::default());
    let [own, help] =
        [&alone(&frames[2]).rows, &helped(&frames, 2)].map(|rows| error(rows, &frames[2].truth));
    assert!(help < 0.6 * own, "{help} with help, {own} without");
}

#[test]
fn motion_that_nobody_tells_does_little_harm() {
    let frames = shot(5, (3, 2), Scene::new(SIDE, SIDE), Motion::default());
    let [own, help] =
        [&alone(&frames[2]).rows, &helped(&frames, 2)].map(|rows| error(rows, &frames[2].truth));
    assert!(help < 1.15 * own, "{help} with help, {own} without");
}

#[test]
fn a_light_that_is_switched_leaves_no_ghost() {
    for factor in [0.25, 3.0] {
        let mut frames = shot(4, (3, 2), Scene::new(SIDE, SIDE), BACKWARD);
        for frame in &mut frames[2..] {
            for row in &mut frame.rows {
                row.colour
                    .iter_mut()
                    .flatten()
                    .for_each(|value| *value *= factor);
                let square = factor * factor;
                row.variance
                    .iter_mut()
                    .flatten()
                    .for_each(|value| *value *= square);
            }
            frame
                .truth
                .iter_mut()
                .flatten()
                .for_each(|value| *value *= factor);
        }
        for k in [1, 2] {
            let [own, help] = [&alone(&frames[k]).rows, &helped(&frames, k)]
                .map(|rows| error(rows, &frames[k].truth));
            assert!(
                help < 1.05 * own,
                "x {factor}, frame {k}: {help} with help, {own} without"
            );
        }
    }
}

#[test]
fn where_neither_motion_nor_noise_is_told_a_frame_is_denoised_alone() {
    let scene = Scene {
        variances: false,
        features: false,
        ..Scene::new(SIDE, SIDE)
    };
    for step in [(0, 0), (3, 2)] {
        let frames = shot(3, step, scene, Motion::default());
        let (rows, own) = (helped(&frames, 1), alone(&frames[1]).rows);
        assert!(colour_bits(&rows) == colour_bits(&own), "moved by {step:?}");
    }
}

/// The light of the output over that of the truth.
fn energy(rows: &[OutputRow], truth: &[[f32; 3]]) -> f64 {
    let sum = |values: Vec<f32>| values.into_iter().map(f64::from).sum::<f64>();
    let colours = rows.iter().flat_map(|row| row.colour.concat()).collect();
    sum(colours) / sum(truth.concat())
}

#[test]
fn a_flash_keeps_its_light_whether_variances_are_known_or_not() {
    for variances in [true, false] {
        let scene = Scene {
            variances,
            ..Scene::new(SIDE, SIDE)
        };
        let mut frames = shot(5, (3, 2), scene, BACKWARD);
        for row in &mut frames[2].rows {
            row.colour
                .iter_mut()
                .flatten()
                .for_each(|value| *value *= 10.0);
            row.variance
                .iter_mut()
                .flatten()
                .for_each(|value| *value *= 100.0);
        }
        frames[2]
            .truth
            .iter_mut()
            .flatten()
            .for_each(|value| *value *= 10.0);
        let (rows, own) = (helped(&frames, 2), alone(&frames[2]).rows);
        let [light, before] = [&rows, &own].map(|rows| energy(rows, &frames[2].truth));
        assert!(
            (light - before).abs() < 0.02,
            "variances {variances}: {light} of the light, {before} alone"
        );
        let [help, own] = [&rows, &own].map(|rows| error(rows, &frames[2].truth));
        assert!(
            help < 1.05 * own,
            "variances {variances}: {help} with help, {own} without"
        );
    }
}

#[test]
fn fireflies_of_neighbours_stay_with_them() {
    let mut frames = shot(5, (0, 0), Scene::new(SIDE, SIDE), BACKWARD);
    // one in each frame, beside those of the others: their variances are alike
    for (k, frame) in frames.iter_mut().enumerate() {
        for c in 0..3 {
            frame.rows[30].colour[c][30 + k] = 1e4;
            frame.rows[30].variance[c][30 + k] = 1e8;
        }
    }
    let rows = helped(&frames, 2);
    let brightest = rows
        .iter()
        .flat_map(|row| row.colour.concat())
        .fold(0.0, f32::max);
    assert!(brightest < 10.0, "{brightest} is left");
}

#[test]
fn a_camera_that_rolls_reads_no_row_twice() {
    struct Counted<'a>(AnyRow<'a>, &'a std::sync::atomic::AtomicUsize);
    impl RowSource for Counted<'_> {
        fn layout(&self) -> RowLayout {
            self.0.layout()
        }
        fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
            self.1.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            self.0.read_row(y, row)
        }
    }
    let mut frames = shot(2, (0, 0), Scene::new(160, 160), BACKWARD);
    let angle = 0.3_f32;
    for (y, row) in frames[1].rows.iter_mut().enumerate() {
        for x in 0..160 {
            let (dx, dy) = (x as f32 - 80.0, y as f32 - 80.0);
            row.backward[0][x] = dx * angle.cos() - dy * angle.sin() - dx;
            row.backward[1][x] = dx * angle.sin() + dy * angle.cos() - dy;
        }
    }
    let (own, other) = (Default::default(), Default::default());
    let [of_own, of_other] = [&own, &other];
    let made = Temporal::new(
        Counted(AnyRow(&frames[1]), of_own),
        vec![Counted(AnyRow(&frames[0]), of_other)],
        Vec::new(),
        NonZeroUsize::MIN,
    );
    run(&mut made.expect("the frames are alike"));
    let read = other.load(std::sync::atomic::Ordering::Relaxed);
    assert!((100..=160).contains(&read), "{read} rows of 160 were read");
}

#[test]
fn fewer_held_rows_change_no_bit() {
    let frames = shot(3, (1, 20), Scene::new(SIDE, 150), BACKWARD);
    let few = beside(&frames, 1, 1).holding(2);
    let bits = |mut source: Temporal<AnyRow<'_>>| colour_bits(&run(&mut source));
    assert!(bits(few) == bits(beside(&frames, 1, 1)));
}

#[test]
fn what_a_cut_separates_does_not_help() {
    let mut frames = shot(2, (0, 0), Scene::new(SIDE, SIDE), BACKWARD);
    // the next frame shows another part of the scene, and says that it stands still
    let jump = shot(2, (317, 523), Scene::new(SIDE, SIDE), BACKWARD);
    frames.extend(jump.into_iter().skip(1));
    for row in &mut frames[2].rows {
        row.backward.iter_mut().for_each(|plane| plane.fill(0.0));
    }
    let mut rows = beside(&frames, 1, 1);
    run(&mut rows);
    let [before, after] = rows.weights();
    assert!(
        before[0] > 0.5 && after[0] < 0.1,
        "weights {before:?} before the cut, {after:?} after it"
    );
}

#[test]
fn motion_that_leads_nowhere_leaves_the_frame_as_it_would_be_alone() {
    for nowhere in [f32::NAN, f32::INFINITY, 1e9, -1000.0] {
        let mut frames = shot(
            3,
            (0, 0),
            Scene::new(SIDE, SIDE),
            Motion {
                forward: true,
                ..BACKWARD
            },
        );
        for frame in &mut frames {
            for row in &mut frame.rows {
                let vectors = row.backward.iter_mut().chain(&mut row.forward);
                vectors.for_each(|plane| plane.fill(nowhere));
            }
        }
        let rows = helped(&frames, 1);
        let own = alone(&frames[1]).rows;
        assert!(
            colour_bits(&rows) == colour_bits(&own),
            "the colours differ for {nowhere}"
        );
        assert!(
            rows.iter()
                .all(|row| row.frames.iter().all(|frames| *frames == 1.0))
        );
    }
}

#[test]
fn a_frame_without_neighbours_is_denoised_as_ever() {
    let frames = shot(1, (0, 0), Scene::new(SIDE, SIDE), BACKWARD);
    let (rows, own) = (helped(&frames, 0), alone(&frames[0]).rows);
    // thousands of numbers would tell nobody anything
    assert!(
        colour_bits(&rows) == colour_bits(&own),
        "the colours differ"
    );
    let errors = |rows: &[OutputRow]| {
        rows.iter()
            .flat_map(|row| row.error.clone())
            .collect::<Vec<_>>()
    };
    assert!(errors(&rows) == errors(&own), "the errors differ");
}

#[test]
fn threads_and_the_row_that_is_read_first_change_no_bit() {
    let frames = shot(
        5,
        (3, 2),
        Scene {
            layers: 2,
            ..Scene::new(SIDE, SIDE)
        },
        BACKWARD,
    );
    let read = |threads: usize, first: usize| {
        let mut source = beside(&frames, 2, threads);
        let layout = source.layout();
        let rows = (first..SIDE).map(|y| {
            let mut row = InputRow::new(&layout);
            source.read_row(y, &mut row).expect("memory does not fail");
            row
        });
        rows.collect::<Vec<_>>()
    };
    let whole = read(1, 0);
    assert!(
        whole
            .iter()
            .any(|row| row.frames.iter().any(|frames| *frames > 2.0))
    );
    assert!(read(3, 0) == whole, "threads change bits");
    for first in [1, 6, 7, 8, 30] {
        assert!(
            read(2, first) == whole[first..],
            "bits differ from row {first} on"
        );
    }
}

#[test]
fn layers_of_an_average_sum_to_its_colour() {
    let frames = shot(
        5,
        (3, 2),
        Scene {
            layers: 3,
            ..Scene::new(SIDE, SIDE)
        },
        BACKWARD,
    );
    let mut source = beside(&frames, 2, 1);
    let mut row = InputRow::new(&source.layout());
    for y in 0..SIDE {
        source.read_row(y, &mut row).expect("memory does not fail");
        for (c, plane) in row.colour.iter().enumerate() {
            for (x, colour) in plane.iter().enumerate() {
                let sum: f32 = row.layers.iter().map(|layer| layer[c][x]).sum();
                assert!(
                    (sum - colour).abs() <= 1e-5 * (1.0 + colour.abs()),
                    "({x}, {y}): {sum}, not {colour}"
                );
            }
        }
    }
}

#[test]
fn pixels_without_noise_stay_as_they_are() {
    let mut frames = shot(3, (0, 0), Scene::new(SIDE, SIDE), BACKWARD);
    frames[1].calm(20..44, 20..44);
    let rows = helped(&frames, 1);
    for row in &rows[22..42] {
        assert!(
            row.colour
                .iter()
                .all(|plane| plane[22..42].iter().all(|value| *value == 0.5))
        );
        assert!(row.frames[22..42].iter().all(|frames| *frames == 1.0));
    }
}

#[test]
fn a_neighbour_of_another_size_is_refused() {
    let frames = [
        Scene::new(SIDE, SIDE).render(),
        Scene::new(SIDE, SIDE - 1).render(),
    ];
    let made = Temporal::new(
        AnyRow(&frames[0]),
        vec![AnyRow(&frames[1])],
        Vec::new(),
        NonZeroUsize::MIN,
    );
    assert!(matches!(made, Err(Error::Usage(_))));
}
