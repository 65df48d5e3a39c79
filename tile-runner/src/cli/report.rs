//! What `linpred denoise` did, for people and for scripts.

use std::path::Path;
use std::time::Duration;

use linpred::job::Summary;

use super::args::LogFormat;

/// Logs what became of an image that took so long.
pub(crate) fn report(summary: &Summary, took: Duration, format: LogFormat, output: &Path) {
    warn_of_losses(summary);
    let seconds = took.as_secs_f64();
    match format {
        LogFormat::Json => log_fields(summary, seconds, output),
        LogFormat::Text => {
            log_sentence(summary, seconds, output);
            log_skipped(summary);
        }
    }
}

/// Warns where the output is less than it could be.
fn warn_of_losses(summary: &Summary) {
    if summary.clamped > 0 {
        tracing::warn!(
            "{} samples are too large for half precision and were set to 65504; a float channel would hold them",
            summary.clamped
        );
    }
    if summary.layers_off > 0 {
        tracing::warn!(
            "the layers do not sum to the colour at {} of {} pixels, in the input already",
            summary.layers_off,
            summary.report.counts.pixels
        );
    }
}

fn log_fields(summary: &Summary, seconds: f64, output: &Path) {
    let done = &summary.report.counts;
    tracing::info!(
        output = %output.display(),
        pixels = done.pixels,
        models = summary.report.models,
        passed_through = done.passed_through,
        repaired = done.repaired,
        fireflies = done.fireflies,
        cells = done.cells,
        cells_skipped = done.cells_skipped,
        feature_blocks = done.feature_blocks,
        feature_blocks_skipped = done.feature_blocks_skipped,
        saved_thread_seconds = summary.report.saved().map(|time| time.as_secs_f64()),
        clamped = summary.clamped,
        peak_bytes = summary.peak_memory,
        seconds,
        "denoised"
    );
}

fn log_sentence(summary: &Summary, seconds: f64, output: &Path) {
    let done = &summary.report.counts;
    let peak = summary
        .peak_memory
        .map(|bytes| format!(", {} MiB", bytes >> 20));
    tracing::info!(
        "{}: {} pixels, models for {:.1} %, {:.1} % passed through, {} not finite and {} fireflies repaired, {seconds:.2} s{}",
        output.display(),
        done.pixels,
        percent(summary.report.models, done.pixels),
        percent(done.passed_through, done.pixels),
        done.repaired,
        done.fireflies,
        peak.unwrap_or_default()
    );
}

fn log_skipped(summary: &Summary) {
    let done = &summary.report.counts;
    if done.cells_skipped + done.feature_blocks_skipped == 0 {
        return;
    }
    let saved = summary.report.saved().map(|time| {
        let seconds = time.as_secs_f64();
        format!("; at the mean time of the other cells that saved {seconds:.2} s of one thread")
    });
    tracing::info!(
        "skipped, as they hold no noise: {:.1} % of the cells, {:.1} % of the feature blocks{}",
        percent(done.cells_skipped, done.cells),
        percent(done.feature_blocks_skipped, done.feature_blocks),
        saved.unwrap_or_default()
    );
}

fn percent(part: u64, whole: u64) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}
