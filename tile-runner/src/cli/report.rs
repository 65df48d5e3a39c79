//! What `linpred denoise` did, for people and for scripts.

use std::path::Path;
use std::time::Duration;

use crate::Report;
use crate::job::{Input, Summary};

use super::args::LogFormat;

/// Logs what became of the pictures of a file, which took so long.
pub(crate) fn report(
    summary: &Summary,
    pictures: &[Input],
    took: Duration,
    format: LogFormat,
    output: &Path,
) {
    let total = total(&summary.reports);
    warn(summary, pictures, &total);
    say_of_changes(summary, pictures);
    let seconds = took.as_secs_f64();
    match format {
        LogFormat::Json => {
            log_fields(summary, &total, pictures, seconds, output);
            log_help_fields(summary, pictures, output);
        }
        LogFormat::Text => {
            log_sentence(summary, &total, pictures, seconds, output);
            log_help(summary, pictures, output);
            log_skipped(&total);
        }
    }
}

/// All pictures together.
fn total(reports: &[Report]) -> Report {
    let mut total = Report::default();
    for report in reports {
        total.add(report);
    }
    total
}

/// The layers that were written, for people.
fn written(pictures: &[Input]) -> String {
    let layers = pictures.iter().map(|picture| {
        let name = picture.names.name(picture.roles.target[0]);
        let layer = name.rsplit_once('.').map(|(layer, _)| layer.to_owned());
        let layer = layer.filter(|layer| !layer.is_empty());
        let label = picture.roles.label();
        match (layer, label.is_empty() || !picture.roles.prefix.is_empty()) {
            (Some(layer), true) => layer,
            (Some(layer), false) => format!("{layer} ({label})"),
            (None, true) => "the colour".to_owned(),
            (None, false) => label,
        }
    });
    layers.collect::<Vec<_>>().join(", ")
}

/// Warns where the output is less than it could be.
fn warn(summary: &Summary, pictures: &[Input], total: &Report) {
    let counts = &total.counts;
    if summary.clamped > 0 {
        tracing::warn!(
            "{} samples are too large for half precision and were set to 65504; a float channel would hold them",
            summary.clamped
        );
    }
    let reports = summary.reports.iter().zip(&summary.layers_off);
    for (picture, (report, &off)) in pictures.iter().zip(reports) {
        warn_of_layers(picture, off, report.counts.pixels);
    }
    if counts.estimated > 0 {
        tracing::warn!(
            "{} of {} pixels ({:.1} %) have no variance that is known: it was estimated from the picture",
            counts.estimated,
            counts.pixels,
            percent(counts.estimated, counts.pixels)
        );
    }
    let stated = pictures
        .iter()
        .any(|picture| picture.roles.variance.is_known());
    if counts.pixels > 0 && counts.passed_through == counts.pixels {
        tracing::warn!(
            "no pixel was changed: {}",
            match stated {
                true =>
                    "by the variances in the file none has any noise; --map variance=none estimates it from the picture",
                false => "no noise was found in the colour",
            }
        );
    }
}

/// Says where the layers of a picture do not sum to its colour. Those that sum to most of it claim to sum to all of it.
fn warn_of_layers(picture: &Input, off: u64, pixels: u64) {
    let layers = picture.layers.iter().filter(|layer| layer.is_light);
    let names: Vec<&str> = layers.map(|layer| layer.name.as_str()).collect();
    if off > pixels / 2 {
        tracing::info!(
            "the layers {} are not parts of the colour: they do not sum to it in the input",
            names.join(" ")
        );
    } else if off > 0 {
        tracing::warn!(
            "the layers {} do not sum to the colour at {off} of {pixels} pixels, in the input already",
            names.join(" ")
        );
    }
}

/// Below this mean weight of the pixels of the next frame the picture is another.
const CHANGE: f64 = 0.1;

/// Says where the picture is another in the next frame, as at a cut: what is beyond does not help.
fn say_of_changes(summary: &Summary, pictures: &[Input]) {
    for (picture, help) in pictures.iter().zip(&summary.help) {
        let Some(of) = &picture.neighbours else {
            continue;
        };
        let sides = [(&of.before, &help.before), (&of.after, &help.after)];
        for (frames, weights) in sides {
            if let (Some(next), Some(&weight)) = (frames.first(), weights.first())
                && weight < CHANGE
            {
                tracing::info!(
                    "{} and {} have little in common (mean weight {weight:.3}): is there a cut between them?",
                    picture.path().display(),
                    next.path().display()
                );
            }
        }
    }
}

/// Says how many frames helped.
fn log_help(summary: &Summary, pictures: &[Input], output: &Path) {
    for (picture, help) in pictures.iter().zip(&summary.help) {
        let label = match picture.roles.label() {
            label if label.is_empty() => label,
            label => format!("{label}: "),
        };
        tracing::info!(
            "{}: {label}made of {:.1} frames on average, with {} before and {} after{}",
            output.display(),
            help.frames,
            help.before.len(),
            help.after.len(),
            unused(summary)
        );
    }
}

/// The same for scripts: an event for each picture of a frame of a sequence.
fn log_help_fields(summary: &Summary, pictures: &[Input], output: &Path) {
    let unused: Vec<String> = summary.unused.iter().map(|of| of.to_string()).collect();
    for (picture, help) in pictures.iter().zip(&summary.help) {
        let label = Some(picture.roles.label()).filter(|label| !label.is_empty());
        tracing::info!(
            output = %output.display(),
            picture = label,
            frames = help.frames,
            before = help.before.len(),
            after = help.after.len(),
            weight_before = help.before.first(),
            weight_after = help.after.first(),
            unused = Some(unused.join("; ")).filter(|words| !words.is_empty()),
            "helped"
        );
    }
}

/// The frames that did not help, in words.
fn unused(summary: &Summary) -> String {
    let names = summary
        .unused
        .iter()
        .map(|of| of.path.display().to_string());
    match names.collect::<Vec<_>>() {
        names if names.is_empty() => String::new(),
        names => format!("; of no use: {}", names.join(", ")),
    }
}

fn log_fields(summary: &Summary, total: &Report, pictures: &[Input], seconds: f64, output: &Path) {
    let done = &total.counts;
    tracing::info!(
        output = %output.display(),
        layers = written(pictures),
        pixels = done.pixels,
        models = total.models,
        passed_through = done.passed_through,
        repaired = done.repaired,
        fireflies = done.fireflies,
        estimated = done.estimated,
        cells = done.cells,
        cells_skipped = done.cells_skipped,
        feature_blocks = done.feature_blocks,
        feature_blocks_skipped = done.feature_blocks_skipped,
        saved_thread_seconds = total.saved().map(|time| time.as_secs_f64()),
        clamped = summary.clamped,
        peak_bytes = summary.peak_memory,
        seconds,
        "denoised"
    );
}

fn log_sentence(
    summary: &Summary,
    total: &Report,
    pictures: &[Input],
    seconds: f64,
    output: &Path,
) {
    let done = &total.counts;
    let peak = summary
        .peak_memory
        .map(|bytes| format!(", {} MiB", bytes >> 20));
    tracing::info!(
        "{}: {} denoised, {} pixels, models for {:.1} %, {:.1} % passed through, {} not finite and {} fireflies repaired, {seconds:.2} s{}",
        output.display(),
        written(pictures),
        done.pixels,
        percent(total.models, done.pixels),
        percent(done.passed_through, done.pixels),
        done.repaired,
        done.fireflies,
        peak.unwrap_or_default()
    );
}

fn log_skipped(total: &Report) {
    let done = &total.counts;
    if done.cells_skipped + done.feature_blocks_skipped == 0 {
        return;
    }
    let saved = total.saved().map(|time| {
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
