//! Threads, crops and where the image begins are how a frame is computed, not what: its bits do not depend on them.

use linpred_core::{Params, Quality};
use linpred_tests::frames::{CELL, REACH, Scene, scenes};
use proptest::prelude::{ProptestConfig, prop_assert, prop_assert_eq, proptest};
use proptest::sample::select;

const QUALITIES: [Quality; 3] = [Quality::Fast, Quality::Balanced, Quality::High];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_number_of_threads_gives_the_same_bits(scene in scenes(), threads in 2usize..=4, quality in select(&QUALITIES[..2])) {
        let frame = scene.render();
        let params = Params::new(quality);
        let (one, many) = (frame.denoise(params), frame.denoise_on(threads, params));
        prop_assert!(one.all_bits() == many.all_bits());
        prop_assert_eq!(one.report.counts, many.report.counts);
        prop_assert_eq!(one.report.models, many.report.models);
    }
}

/// Two frames of the same scene, the second of which begins `shift` columns and rows of cells later.
fn moved(size: (usize, usize), shift: (usize, usize), variances: bool) {
    let scene = Scene {
        variances,
        layers: 1,
        ..Scene::new(size.0, size.1)
    };
    let later = Scene {
        origin: (shift.0 * CELL, shift.1 * CELL),
        ..scene
    };
    let params = Params::new(Quality::Fast);
    let (first, second) = (
        scene.render().denoise(params),
        later.render().denoise(params),
    );
    // Along the axis of the shift, what no border reaches; across it, everything.
    let inside = |length: usize, shift: usize| match shift {
        0 => (0..length, 0..length),
        _ => (
            REACH + shift * CELL..length - REACH,
            REACH..length - REACH - shift * CELL,
        ),
    };
    let (columns, rows) = (inside(size.0, shift.0), inside(size.1, shift.1));
    assert!(!columns.0.is_empty() && !rows.0.is_empty());
    assert!(first.bits(rows.0, columns.0) == second.bits(rows.1, columns.1));
}

#[test]
fn a_frame_that_begins_cells_later_has_the_same_bits_where_no_border_reaches() {
    for variances in [true, false] {
        for cells in [1, 2] {
            moved((2 * REACH + cells * CELL + 21, 23), (cells, 0), variances);
            moved((23, 2 * REACH + cells * CELL + 21), (0, cells), variances);
        }
    }
}

/// Rows `band` from rows that begin `margin` or more above it, on a row of cells, and end `margin` below it.
fn from_a_crop(margin: usize, band: std::ops::Range<usize>, variances: bool) -> bool {
    let scene = Scene {
        variances,
        ..Scene::new(26, 260)
    };
    let mut frame = scene.render();
    for y in 0..frame.height() {
        // some seven rows apart, so that whatever is cut, one is near
        if y % 7 == 3 {
            frame.add_firefly((11 * y % 26, y), 300.0);
        }
    }
    let params = Params::new(Quality::Fast);
    let first = band.start.saturating_sub(margin) / CELL * CELL;
    let last = (band.end + margin).min(frame.height());
    let crop = frame.crop(first..last).denoise(params);
    let whole = frame.denoise(params);
    whole.bits(band.clone(), 0..26) == crop.bits(band.start - first..band.end - first, 0..26)
}

#[test]
fn a_crop_with_the_reach_around_it_has_the_bits_of_the_frame() {
    for variances in [true, false] {
        for start in [0, 110, 114, 123, 128, 132] {
            assert!(from_a_crop(REACH, start..start + 13, variances), "{start}");
        }
        assert!(from_a_crop(REACH, 230..260, variances));
    }
    // Two fifths of that are too small a margin for some band, or this test sees nothing.
    assert!(!(108..133).all(|start| from_a_crop(2 * REACH / 5, start..start + 13, false)));
}
