//! A resolved pixel is the weighted mean of its predictions and of its own radiance.

use linpred_core::{Formulas, Pixel, PixelState, Sum, resolve, resolve_layer, resolve_scalar};
use linpred_tests::tolerance::{RESOLVED, close};
use proptest::prelude::{Strategy, prop_assert, prop_assert_eq, proptest};
use proptest::sample::select;

/// One model's prediction.
#[derive(Clone, Copy, Debug)]
struct Prediction {
    colour: [f32; 3],
    layer: [f32; 3],
    weight: f32,
    error: f32,
    radius: u8,
    rank: u8,
}

impl Prediction {
    fn sum(&self) -> Sum {
        let mut sum = Sum::NONE;
        sum.colour = self.colour.map(|v| v * self.weight);
        sum.confidence = self.weight;
        sum.error = self.error * self.weight;
        sum.radius = f32::from(self.radius) * self.weight;
        sum.rank = f32::from(self.rank) * self.weight;
        sum
    }
}

fn predictions() -> impl Strategy<Value = Vec<Prediction>> {
    let one = (
        proptest::array::uniform3(-1.0f32..9.0),
        proptest::array::uniform3(-1.0f32..9.0),
        (1e-6f32..3.0, 0.0f32..2.0),
        (0u8..=9, 0u8..=9),
    );
    let one = one.prop_map(
        |(colour, layer, (weight, error), (radius, rank))| Prediction {
            colour,
            layer,
            weight,
            error,
            radius,
            rank,
        },
    );
    proptest::collection::vec(one, 0..40)
}

fn pixels() -> impl Strategy<Value = Pixel<0>> {
    use PixelState::{Bad, Clean, Noisy, Outside};
    let state = select(vec![Noisy, Noisy, Noisy, Bad, Clean, Outside]);
    let values = (proptest::array::uniform3(0.0f32..9.0), 0.0f32..5.0);
    (state, values).prop_map(|(state, (colour, variance))| Pixel {
        colour: if state == Bad { [0.0; 3] } else { colour },
        variance: if state == Clean { 0.0 } else { variance },
        weight: 1.0,
        state,
        ..Pixel::OUTSIDE
    })
}

/// What the pixel's own radiance weighs beside predictions of `others`.
fn own_weight(state: PixelState, formulas: Formulas, others: f64) -> f64 {
    match (state, formulas) {
        (PixelState::Outside | PixelState::Bad, _) => 0.0,
        (PixelState::Clean, _) => f64::INFINITY,
        // A part of a prediction that is as far off as the noise: (1 + 0.5)^-1.5.
        (PixelState::Noisy, Formulas::Robust) => 0.3 * 1.5f64.powf(-1.5),
        (PixelState::Noisy, _) if others > 0.0 => 0.0,
        (PixelState::Noisy, _) => 1.0,
    }
}

/// Weighted sum of a channel of the layers' predictions, added up in their order.
fn sum_of(predictions: &[Prediction], c: usize) -> f32 {
    predictions
        .iter()
        .fold(0.0, |sum, p| sum + p.layer[c] * p.weight)
}

proptest! {
    #[test]
    fn with_their_weights(
        pixel in pixels(), predictions in predictions(), own_layer in proptest::array::uniform3(-1.0f32..9.0), formulas in select(vec![Formulas::Robust, Formulas::Literal, Formulas::Wlr]),
    ) {
        let literal = formulas.are_published();
        let (mut sum, mut layer) = (Sum::NONE, [0.0; 3]);
        for prediction in &predictions {
            sum.add(&prediction.sum());
            for (layer, value) in layer.iter_mut().zip(prediction.layer) {
                *layer += value * prediction.weight;
            }
        }
        let ours = resolve(&pixel, &sum, formulas);
        let ours_layer = resolve_layer(&pixel, &sum, formulas, &layer, &own_layer);

        let weights = || predictions.iter().map(|p| f64::from(p.weight));
        let others: f64 = weights().sum();
        let own = own_weight(pixel.state, formulas, others);
        let mean = |values: Vec<f64>, own_value: f64| {
            let sum: f64 = values.iter().zip(weights()).map(|(v, w)| v * w).sum();
            if own.is_infinite() {
                own_value
            } else if others + own > 0.0 {
                (sum + own * own_value) / (others + own)
            } else {
                0.0
            }
        };
        let of = |value: fn(&Prediction) -> f32| predictions.iter().map(|p| f64::from(value(p))).collect::<Vec<f64>>();
        for c in 0..3 {
            let values = predictions.iter().map(|p| f64::from(p.colour[c])).collect();
            let colour = mean(values, f64::from(pixel.colour[c]));
            let values = predictions.iter().map(|p| f64::from(p.layer[c])).collect();
            let layer = mean(values, f64::from(own_layer[c]));
            // No pixel here is negative, and by the robust formulas none becomes so: its layers sum to 0, too.
            let (colour, layer) = if colour < 0.0 && !literal { (0.0, 0.0) } else { (colour, layer) };
            prop_assert!(close(f64::from(ours.colour[c]), colour, RESOLVED * 9.0), "{} against {colour}", ours.colour[c]);
            // Rounding decides where the colour is all but 0.
            if literal || colour == 0.0 || colour > RESOLVED * 9.0 {
                prop_assert!(close(f64::from(ours_layer[c]), layer, RESOLVED * 9.0), "{} against {layer}", ours_layer[c]);
            }
            // What is no light does not follow the colour to 0, but becomes no more negative than it was.
            let scalar = resolve_scalar(&pixel, &sum, formulas, sum_of(&predictions, c), own_layer[c]);
            let values = predictions.iter().map(|p| f64::from(p.layer[c])).collect();
            let exact = mean(values, f64::from(own_layer[c]));
            let exact = if exact < 0.0 && own_layer[c] >= 0.0 && !literal { 0.0 } else { exact };
            prop_assert!(close(f64::from(scalar), exact, RESOLVED * 9.0), "{scalar} against {exact}");
        }
        let exact = [
            // Summed over the channels in the pixel, a mean over them in what comes out.
            mean(of(|p| p.error), f64::from(pixel.variance) / 3.0),
            mean(of(|p| f32::from(p.radius)), 0.0),
            mean(of(|p| f32::from(p.rank)), 0.0),
        ];
        for (ours, exact) in [ours.error, ours.radius, ours.rank].into_iter().zip(exact) {
            prop_assert!(close(f64::from(ours), exact, RESOLVED * 9.0), "{ours} against {exact}");
        }
        if pixel.state == PixelState::Clean {
            prop_assert_eq!(ours.colour.map(f32::to_bits), pixel.colour.map(f32::to_bits));
            prop_assert_eq!(ours_layer.map(f32::to_bits), own_layer.map(f32::to_bits));
        }
    }
}
