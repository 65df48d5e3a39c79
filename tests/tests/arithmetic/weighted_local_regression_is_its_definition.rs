//! What WLR makes of a pixel is what its equations say, and what the paper says of them holds.

use linpred_core::{Params, TILE};
use linpred_tests::cells::{Job, denoise_side_by_side};
use linpred_tests::definition::Window;
use linpred_tests::one_window::{Case, cases};
use linpred_tests::tolerance::{WLR_ERROR, WLR_PREDICTION, close};
use proptest::prelude::{ProptestConfig, TestCaseError, prop_assert, prop_assert_eq, proptest};
use proptest::sample::select;

/// What core makes of the open pixel: colour, error, layer.
fn denoised(case: &Case, params: &Params) -> (Job, [f64; 3], f64, [f64; 3]) {
    let mut jobs = [case.job(params.formulas)];
    denoise_side_by_side::<1>(&mut jobs, &[0], params);
    let [job] = jobs;
    let sum = &job.predictions.sums[case.centre()];
    let weight = f64::from(sum.confidence);
    let colour = sum.colour.map(|v| f64::from(v) / weight);
    let layer = job.layers[0].sums[case.centre()].map(|v| f64::from(v) / weight);
    let error = f64::from(sum.error) / weight;
    (job, colour, error, layer)
}

fn is_the_definitions(case: &Case, params: Params) -> Result<bool, TestCaseError> {
    let (job, colour, error, layer) = denoised(case, &params);
    prop_assert_eq!(job.models, Some(1));
    let window = Window::new(&job.tile, case.centre(), params);
    if window.clearance < 1.05 || window.gap < 0.02 {
        // Which directions there are is a matter of rounding.
        return Ok(false);
    }
    let sum = &job.predictions.sums[case.centre()];
    prop_assert_eq!((sum.rank / sum.confidence).round() as usize, window.rank);
    let predicted = job
        .predictions
        .sums
        .iter()
        .filter(|sum| sum.confidence > 0.0);
    prop_assert_eq!(predicted.count(), 1, "it predicts its centre alone");
    let regression = window.regression();
    let scale = window.largest_radiance();
    let exact = regression
        .colour
        .iter()
        .chain(&regression.follow(&job.layers[0]))
        .copied()
        .collect::<Vec<_>>();
    for (ours, exact) in colour.iter().chain(&layer).zip(exact) {
        prop_assert!(
            close(*ours, exact, WLR_PREDICTION * scale),
            "{ours} against {exact} by h = {}, {:?}",
            regression.shared,
            regression.bandwidths
        );
    }
    let of_error = regression.error + 1e-3 * scale * scale;
    prop_assert!(
        close(error, regression.error, WLR_ERROR * of_error),
        "error {error} against {}",
        regression.error
    );
    Ok(true)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn at_any_pixel(case in cases(), truncation in select(vec![2.0f32, 1.0, 0.0])) {
        is_the_definitions(&case, Params::wlr().with_truncation(truncation))?;
    }
}

/// Of the cases above most are not left out.
#[test]
fn most_windows_have_directions_of_their_own() {
    let compared = (0..24).filter(|seed| {
        let case = plain(*seed);
        is_the_definitions(&case, Params::wlr()).expect("as above")
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
