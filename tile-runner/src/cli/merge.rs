//! `linpred merge`.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::Error;
use crate::channels::{Preset, RoleRequest};
use crate::job::{DEFAULT_MEMORY_LIMIT, MergeRequest, Merged, Merging};

use super::args::{LogFormat, MergeArguments};
use super::errors::DONE;
use super::progress::{Place, Progress};
use super::{log, stdout, stop};

/// Merges the passes of an image.
pub(crate) fn run(arguments: MergeArguments, format: LogFormat) -> Result<u8, Error> {
    let started = Instant::now();
    let output = arguments.output;
    crate::job::check_output_name(&output)?;
    let roles = RoleRequest {
        preset: Preset::named(&arguments.preset),
        map: arguments.map,
        features: Vec::new(),
        spp: arguments.spp.map(|spp| spp.get()),
        other_half: None,
    };
    let limit = arguments.max_memory.unwrap_or(DEFAULT_MEMORY_LIMIT);
    let request = MergeRequest::new(arguments.passes)
        .with_roles(roles)
        .with_memory_limit(limit);
    let merging = Merging::open(&request)?;
    if arguments.dry_run {
        let plan = merging.plan();
        stdout::print(&format!("memory:\n{plan}\n"))?;
        return plan.check(limit).map(|()| DONE);
    }
    merging.remarks().iter().for_each(log::remark);
    let (rows, place) = (merging.height(), Place::ALONE);
    let mut progress = Progress::new(arguments.progress, rows, &output, place, started);
    let stop = stop::on_signals();
    let merged = merging.write(&output, &stop, &mut |rows| progress.set(rows));
    progress.end();
    report(&merged?, &output, started.elapsed(), format);
    Ok(DONE)
}

/// Logs what came of it, which took so long.
fn report(merged: &Merged, output: &Path, took: Duration, format: LogFormat) {
    let seconds = took.as_secs_f64();
    let output = output.display();
    if merged.lost > 0 {
        tracing::warn!(
            "{} pixels of the passes are not finite: they took no part, and their samples are not counted",
            merged.lost
        );
    }
    match format {
        LogFormat::Json => tracing::info!(
            output = %output,
            passes = merged.passes,
            pixels = merged.pixels,
            samples = merged.samples,
            fewest = merged.fewest,
            most = merged.most,
            lost = merged.lost,
            peak_bytes = merged.peak_memory,
            seconds,
            "merged"
        ),
        LogFormat::Text => {
            let peak = merged
                .peak_memory
                .map(|bytes| format!(", {} MiB", bytes >> 20));
            let passes = match merged.passes {
                1 => "1 pass".to_owned(),
                many => format!("{many} passes"),
            };
            tracing::info!(
                "{output}: merged from {passes}, {:.1} samples per pixel ({} to {}), {seconds:.2} s{}",
                merged.samples,
                merged.fewest,
                merged.most,
                peak.unwrap_or_default()
            );
        }
    }
}
