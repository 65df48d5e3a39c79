//! A model, from its features to the weights of its predictions, is what its formulas say.

use linpred_core::{
    CELL, Formulas, HALO, LayerTile, Params, PixelState, Quality, Sum, TILE, TILE_AREA,
};
use linpred_tests::cells::{Job, Tile, denoise_side_by_side};
use linpred_tests::definition::{Model, Window};
use linpred_tests::tolerance::{
    LITERAL_PREDICTION, MODEL_PREDICTION, MODEL_RISK, MODEL_WEIGHT, close,
};
use linpred_tests::windows::Random;
use proptest::prelude::{
    ProptestConfig, Strategy, TestCaseError, any, prop_assert, prop_assert_eq, proptest,
};
use proptest::sample::select;

/// A tile of which one pixel is open, so that it takes one model.
#[derive(Clone, Copy, Debug)]
struct Case {
    seed: u64,
    /// Of the cell.
    open: (usize, usize),
    /// Part of the pixels that are missing.
    missing: f64,
    /// Whether the centre is.
    centre_missing: bool,
    /// Features that are noise and say so.
    noisy_features: usize,
    /// Deviation of the radiance's noise.
    noise: f64,
    /// Strength of what no feature knows of: the larger, the smaller the window.
    unknown: f64,
    exposure: f32,
}

fn cases() -> impl Strategy<Value = Case> {
    (
        any::<u64>(),
        (0..CELL, 0..CELL),
        (select(vec![0.0, 0.1, 0.5]), any::<bool>()),
        select(vec![0usize, 0, 2, 5]),
        (
            select(vec![0.02, 0.2, 0.6]),
            select(vec![0.0, 0.05, 0.5, 3.0]),
        ),
        select(vec![1.0f32, 1e-3, 300.0]),
    )
        .prop_map(
            |(
                seed,
                open,
                (missing, centre_missing),
                noisy_features,
                (noise, unknown),
                exposure,
            )| {
                Case {
                    seed,
                    open,
                    missing,
                    centre_missing: centre_missing && missing > 0.0,
                    noisy_features,
                    noise,
                    unknown,
                    exposure,
                }
            },
        )
}

impl Case {
    fn centre(&self) -> usize {
        (self.open.1 + HALO) * TILE + self.open.0 + HALO
    }

    /// Pixels that are not open are clean or, as the papers' formulas know of no clean ones, outside.
    fn job(&self, formulas: Formulas) -> Job {
        let mut random = Random::new(self.seed);
        let mut tile = Box::new(Tile::EMPTY);
        let mut layer = LayerTile::BLACK;
        let slopes: Vec<f64> = (0..18).map(|_| random.normal() / 3.0).collect();
        for position in 0..TILE_AREA {
            self.pixel(&mut tile, position, &slopes, &mut random);
            let pixel = &mut tile.pixels[position];
            pixel.state = match formulas {
                _ if position == self.centre() => PixelState::Noisy,
                Formulas::Robust => PixelState::Clean,
                Formulas::Literal => PixelState::Outside,
                other => panic!("{other:?} has no definition"),
            };
            let colour = pixel.colour;
            layer.colour[position] = colour.map(|v| v * random.uniform() as f32);
        }
        Job::new(tile, vec![layer])
    }

    fn pixel(&self, tile: &mut Tile, position: usize, slopes: &[f64], random: &mut Random) {
        let (x, y) = ((position % TILE) as f64, (position / TILE) as f64);
        let edge = f64::from(u8::from(2.0 * x - y > 17.0));
        let mut features = [x, y, edge, 0.0, 0.0, 0.0, 0.0, 0.7, 0.0];
        features[3] = (x * 0.31).sin();
        features[4] = (y * 0.43 + x * 0.1).cos();
        for k in (3..7).chain([8]) {
            features[k] += 0.3 * random.normal();
        }
        let deviation = 0.2;
        for k in [8, 5, 6, 3, 4].into_iter().take(self.noisy_features) {
            features[k] = deviation * random.normal();
            tile.feature_variance[position][k] = (deviation * deviation) as f32;
        }
        let shadow = self.unknown * ((x * 0.9).sin() * (y * 0.7).cos());
        let pixel = &mut tile.pixels[position];
        pixel.features = features.map(|v| v as f32);
        for c in 0..3 {
            let known: f64 = (2..7).map(|k| slopes[6 * c + k - 2] * features[k]).sum();
            let value = 2.0 + 0.02 * x + known + shadow + self.noise * random.normal();
            pixel.colour[c] = self.exposure * value as f32;
        }
        let square = self.exposure * self.exposure;
        pixel.weight = (0.05 + random.uniform()) as f32 / square;
        let variance = 3.0 * self.noise * self.noise * (0.5 + random.uniform());
        pixel.variance = variance as f32 * square;
        pixel.tolerance = (variance * (1.0 + random.uniform()) + 1e-3) as f32 * square;
        let centre = position == self.centre();
        let missing = random.uniform() < self.missing;
        if if centre { self.centre_missing } else { missing } {
            pixel.weight = 0.0;
            pixel.colour = [0.0; 3];
            // What lies far from all others is predicted as if it lay near.
            pixel.features[4] *= 40.0;
        }
    }
}

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
