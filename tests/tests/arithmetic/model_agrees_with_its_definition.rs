//! A model, from its features to the weights of its predictions, is what its formulas say.

use linpred_core::{Formulas, Params, Quality, Sum};
use linpred_tests::cells::{Job, denoise_side_by_side};
use linpred_tests::definition::{Model, Window};
use linpred_tests::one_window::{Case, cases};
use linpred_tests::tolerance::{
    LITERAL_PREDICTION, MODEL_PREDICTION, MODEL_RISK, MODEL_WEIGHT, close,
};
use proptest::prelude::{ProptestConfig, TestCaseError, prop_assert, prop_assert_eq, proptest};
use proptest::sample::select;

fn is_the_definitions(case: &Case, params: Params) -> Result<(), TestCaseError> {
    let mut jobs = [case.job(params.formulas)];
    denoise_side_by_side::<1>(&mut jobs, &[0], &params);
    let [job] = &jobs;
    prop_assert_eq!(job.models, Some(1));
    let window = Window::new(&job.tile, case.centre(), params);
    if window.clearance < 1.05 {
        return Ok(());
    }
    let models = window.models();
    // All predictions are of one model; a negative one has no confidence.
    let predicted = |sum: &&Sum| sum.confidence > 0.0;
    let Some(sum) = job.predictions.sums.iter().find(predicted) else {
        return Ok(());
    };
    let radius = (sum.radius / sum.confidence).round() as usize;
    let chosen = models.iter().find(|model| model.radius == radius);
    let Some(chosen) = chosen else {
        // The papers have no answer where the 3 x 3 around the centre have no valid pixel: their error is a sum over nothing.
        prop_assert!(params.formulas == Formulas::Literal && radius < models[1].radius);
        return Ok(());
    };
    let least = models
        .iter()
        .map(|model| model.risk)
        .fold(f64::INFINITY, f64::min);
    prop_assert_eq!(rank(sum), expected_rank(&window, chosen));
    if window.truncated {
        // Kept directions are independent of dropped ones only to a correlation of 0.05, which tells in a small window.
        return Ok(());
    }
    prop_assert!(
        chosen.risk <= least + MODEL_RISK * least.abs(),
        "radius {radius} at a risk of {} where {least} is had",
        chosen.risk
    );
    predicts(job, &window, chosen, params.formulas)
}

/// What a prediction says.
fn rank(sum: &Sum) -> usize {
    (sum.rank / sum.confidence).round() as usize
}

fn expected_rank(window: &Window, model: &Model) -> usize {
    if model.is_of_full_rank() {
        window.rank
    } else {
        0
    }
}

fn predicts(
    job: &Job,
    window: &Window,
    model: &Model,
    formulas: Formulas,
) -> Result<(), TestCaseError> {
    let prediction = match formulas {
        Formulas::Robust => MODEL_PREDICTION,
        Formulas::Literal => LITERAL_PREDICTION,
        other => panic!("{other:?} has no definition"),
    } * window.largest_radiance();
    let layer = window.follow(model, &job.layers[0]);
    let predictions = window.predictions(model);
    let mut count = 0;
    for (exact, exact_layer) in predictions.iter().zip(&layer) {
        let sum = &job.predictions.sums[exact.position];
        let weight = f64::from(sum.confidence);
        prop_assert!(
            close(weight, exact.weight, MODEL_WEIGHT * exact.weight),
            "weight {weight} against {}",
            exact.weight
        );
        if exact.weight == 0.0 {
            continue;
        }
        let error = f64::from(sum.error) / weight;
        prop_assert!(
            close(error, exact.error, MODEL_WEIGHT * exact.error),
            "error {error} against {}",
            exact.error
        );
        let of_layer = job.layers[0].sums[exact.position];
        let beauty = sum.colour.iter().zip(&exact.colour);
        for (ours, exact) in beauty.chain(of_layer.iter().zip(exact_layer)) {
            let ours = f64::from(*ours) / weight;
            prop_assert!(close(ours, *exact, prediction), "{ours} against {exact}");
        }
        prop_assert!(close(
            f64::from(sum.rank) / weight,
            expected_rank(window, model) as f64,
            1e-3
        ));
        prop_assert!(close(
            f64::from(sum.radius) / weight,
            model.radius as f64,
            1e-3
        ));
        count += 1;
    }
    let predicted = job
        .predictions
        .sums
        .iter()
        .filter(|sum| sum.confidence > 0.0);
    prop_assert_eq!(predicted.count(), count);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn of_the_robust_formulas(case in cases(), truncation in select(vec![0.75f32, 0.0])) {
        is_the_definitions(&case, Params::new(Quality::Fast).with_truncation(truncation))?;
    }

    #[test]
    fn of_the_papers_formulas(case in cases()) {
        is_the_definitions(&case, Params::literal())?;
    }
}
