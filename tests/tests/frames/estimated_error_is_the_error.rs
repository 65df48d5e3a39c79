//! The error layer says, on average over a frame, what the error is.

use linpred_core::{Params, Quality};
use linpred_tests::frames::Scene;
use linpred_tests::tolerance::ERROR_ESTIMATE;

#[test]
fn on_average_over_a_frame() {
    for quality in [Quality::Fast, Quality::Balanced, Quality::High] {
        for noise in [0.1, 0.3, 1.0] {
            for variances in [true, false] {
                let frame = Scene {
                    noise,
                    variances,
                    ..Scene::new(90, 70)
                }
                .render();
                let output = frame.denoise(Params::new(quality));
                let (mut error, mut estimate) = (0.0, 0.0);
                for (ours, truth) in output.colours().iter().zip(&frame.truth) {
                    let squares = ours.iter().zip(truth).map(|(a, b)| (a - b) * (a - b));
                    error += f64::from(squares.sum::<f32>() / 3.0);
                }
                for row in &output.rows {
                    estimate += row.error.iter().copied().map(f64::from).sum::<f64>();
                }
                let ratio = estimate / error;
                assert!(
                    ERROR_ESTIMATE.contains(&ratio),
                    "{quality:?}, noise {noise}: estimated {estimate}, is {error}"
                );
            }
        }
    }
}
