//! What WLR makes of a pixel is what its equations say, and what the paper says of them holds.

use linpred_core::{Params, TILE, Tile};
use linpred_tests::cells::{Job, denoise_side_by_side};
use linpred_tests::definition::Window;
use linpred_tests::one_window::{Case, cases};
use linpred_tests::tolerance::{WLR_ERROR, WLR_PREDICTION, close};
use proptest::prelude::{ProptestConfig, TestCaseError, prop_assert, prop_assert_eq, proptest};
use proptest::sample::select;

/// What core makes of the open pixel is what the definition does; whether its window could be compared.
fn is_the_definitions(case: &Case, mut job: Job, params: Params) -> Result<bool, TestCaseError> {
    let centre = case.centre();
    denoise_side_by_side::<1>(std::slice::from_mut(&mut job), &[0], &params);
    prop_assert_eq!(job.models, Some(1));
    let tiles = std::iter::once(&*job.tile).chain(job.frames.iter().map(|(tile, _)| tile));
    let tiles: Vec<_> = tiles.collect();
    let window = of_tiles(&tiles, centre, params);
    if window.clearance < 1.05 || window.gap < 0.02 {
        // Which directions there are is a matter of rounding.
        return Ok(false);
    }
    let sum = &job.predictions.sums[centre];
    let weight = f64::from(sum.confidence);
    prop_assert_eq!((sum.rank / sum.confidence).round() as usize, window.rank);
    let predicted = job.predictions.sums.iter();
    let predicted = predicted.filter(|sum| sum.confidence > 0.0).count();
    prop_assert_eq!(predicted, 1, "it predicts its centre alone");
    let regression = window.regression();
    let scale = window.largest_radiance();
    let rounded: Vec<_> = tiles.iter().copied().map(rounded).collect();
    let rounded: Vec<_> = rounded.iter().map(|tile| &**tile).collect();
    let moved = of_tiles(&rounded, centre, params).regression().colour;
    let moved = moved.iter().zip(&regression.colour);
    if moved
        .into_iter()
        .any(|(moved, exact)| !close(*moved, *exact, WLR_PREDICTION / 10.0 * scale))
    {
        // Nor does the definition know better than single precision what becomes of a pixel far from all that is fitted.
        return Ok(false);
    }
    let layers = job.frames.iter().map(|(_, layers)| &layers[0]);
    let layers: Vec<_> = std::iter::once(&job.layers[0]).chain(layers).collect();
    let exact = [regression.colour, regression.follow(&layers)];
    let ours = [sum.colour, job.layers[0].sums[centre]];
    for (ours, exact) in ours.iter().flatten().zip(exact.iter().flatten()) {
        let ours = f64::from(*ours) / weight;
        let same = close(ours, *exact, WLR_PREDICTION * scale);
        let (h, b) = (regression.shared, &regression.bandwidths);
        prop_assert!(same, "{ours} against {exact} by h = {h}, {b:?}");
    }
    let (error, exact) = (f64::from(sum.error) / weight, regression.error);
    let tolerance = WLR_ERROR * (exact + 1e-3 * scale * scale);
    prop_assert!(
        close(error, exact, tolerance),
        "error {error} against {exact}"
    );
    Ok(true)
}

/// The window of a tile, or of one and those of the frames around.
fn of_tiles(tiles: &[&Tile<9>], centre: usize, params: Params) -> Window {
    match tiles {
        [own] => Window::new(own, centre, params),
        all => Window::over_frames(all, centre, params),
    }
}

/// The tile with features that are off by a few roundings of `f32`, here up, there down.
fn rounded(tile: &Tile<9>) -> Box<Tile<9>> {
    let mut rounded = Box::new(tile.clone());
    for (at, pixel) in rounded.pixels.iter_mut().enumerate() {
        for (k, feature) in pixel.features.iter_mut().enumerate() {
            let sign = if (at * 31 + k * 17) % 5 < 2 {
                1.0
            } else {
                -1.0
            };
            *feature *= 1.0 + sign * 4.0 * f32::EPSILON;
        }
    }
    rounded
}

/// The same place in two other frames: other noise, and the number of the frame as a feature of all of them.
fn over_frames(case: &Case, params: &Params) -> Job {
    let mut job = case.job(params.formulas);
    for (k, seed) in [1, 2].into_iter().enumerate() {
        let other = Case {
            seed: case.seed.wrapping_add(seed),
            ..*case
        };
        let mut frame = other.job(params.formulas);
        for pixel in &mut frame.tile.pixels {
            pixel.features[FRAME] = k as f32 + 1.0;
        }
        job.frames.push((*frame.tile, frame.layers));
    }
    for pixel in &mut job.tile.pixels {
        pixel.features[FRAME] = 0.0;
    }
    job
}

/// A feature that is constant within a frame.
const FRAME: usize = 7;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn at_any_pixel(case in cases(), truncation in select(vec![2.0f32, 1.0, 0.0])) {
        let params = Params::wlr().with_truncation(truncation);
        is_the_definitions(&case, case.job(params.formulas), params)?;
    }

    #[test]
    fn over_several_frames(case in cases()) {
        let params = Params::wlr();
        is_the_definitions(&case, over_frames(&case, &params), params)?;
    }
}

/// Of the cases above most are not left out.
#[test]
fn most_windows_have_directions_of_their_own() {
    let compared = (0..24).filter(|seed| {
        let (case, params) = (plain(*seed), Params::wlr());
        let job = case.job(params.formulas);
        is_the_definitions(&case, job, params).expect("as above")
            && is_the_definitions(&case, over_frames(&case, &params), params).expect("as above")
    });
    assert!(compared.count() > 12);
}

/// A window like those of a render: noise, a shadow, features that know of the rest.
fn plain(seed: u64) -> Case {
    Case {
        seed,
        open: (9, 9),
        missing: 0.0,
        centre_missing: false,
        noisy_features: 0,
        noise: 0.2,
        unknown: 0.5,
        exposure: 1.0,
    }
}

/// A wall of radiance 1 with a strip of 30, three pixels wide, that no feature shows: what is made of a pixel `aside` of its middle, over
/// what is true there. Its noise is no stronger than the wall's: if it is, the weights of section 8 take the strip for outliers.
fn strip(aside: usize, noise: f32) -> f32 {
    let params = Params::wlr();
    let case = plain(1);
    let mut job = case.job(params.formulas);
    let middle = case.centre() % TILE - aside;
    let radiance = |x: usize| if x.abs_diff(middle) <= 1 { 30.0 } else { 1.0 };
    for (i, pixel) in job.tile.pixels.iter_mut().enumerate() {
        let (x, y) = (i % TILE, i / TILE);
        pixel.features = [x as f32, y as f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let random = ((i * 7919 + 13) % 101) as f32 / 50.0 - 1.0;
        pixel.colour = [radiance(x) + noise * random; 3];
        pixel.variance = noise * noise;
    }
    denoise_side_by_side::<1>(std::slice::from_mut(&mut job), &[0], &params);
    let sum = &job.predictions.sums[case.centre()];
    sum.colour[0] / sum.confidence / radiance(case.centre() % TILE)
}

/// "Our method preserves the strong highlights" (section 8): second derivatives find small bandwidths across them.
#[test]
fn a_highlight_that_no_feature_knows_of_stays() {
    let (on_it, off_it) = (strip(0, 0.1), strip(6, 0.1));
    assert!((0.9..1.1).contains(&on_it), "{on_it} of the highlight");
    assert!((0.9..1.1).contains(&off_it), "{off_it} of the wall");
}

/// Section 8: weights are divided by variances, so that a pixel of huge variance does not spread its energy.
#[test]
fn an_outlier_beside_it_hardly_moves_a_pixel() {
    let value = |spike: f32| {
        let params = Params::wlr();
        let mut job = plain(3).job(params.formulas);
        let centre = plain(3).centre();
        let outlier = &mut job.tile.pixels[centre + 2];
        outlier.colour = outlier.colour.map(|v| v + spike);
        outlier.variance += spike * spike;
        denoise_side_by_side::<1>(std::slice::from_mut(&mut job), &[0], &params);
        let sum = &job.predictions.sums[centre];
        sum.colour[0] / sum.confidence
    };
    let (without, with) = (value(0.0), value(1000.0));
    assert!((with - without).abs() < 0.3, "{without} becomes {with}");
}
