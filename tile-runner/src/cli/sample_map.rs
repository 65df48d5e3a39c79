//! `linpred sample-map`.

use std::path::Path;
use std::time::Instant;

use crate::exr_file::output::check_output;
use crate::job::{self, Input, InputRequest, JobOptions, rows_to_measure};
use crate::sampling::{Goal, SampleMap, Summary};
use crate::{Error, Options};
use linpred_core::Params;

use super::args::SampleMapArguments;
use super::denoise::{print_plan, quality, request};
use super::errors::DONE;
use super::heatmap::ramp;
use super::png_rows::PngRows;
use super::progress::{Place, Progress};
use super::{log, stdout, stop, threads};

/// The exit code where nothing is left to be rendered.
const REACHED: u8 = 10;

/// Writes the map of an image, and says what it gives.
pub(crate) fn run(arguments: SampleMapArguments) -> Result<u8, Error> {
    let started = Instant::now();
    let goal = Goal::of(arguments.budget, arguments.target_error)?;
    let options = options(&arguments);
    let request = request(arguments.input).with_memory_limit(arguments.max_memory);
    let input = open(&request)?;
    if let Some(picture) = &arguments.picture {
        if *picture == arguments.output {
            return Err(Error::Usage(format!(
                "the map and its picture cannot both be {}",
                picture.display()
            )));
        }
        check_output(picture, &[&request.path])?;
    }
    if arguments.dry_run {
        let (schedule, plan) = job::plan_map(&input, &options)?;
        print_plan(std::slice::from_ref(&input), schedule, &plan)?;
        return plan.check(options.memory_limit).map(|()| DONE);
    }
    input.remarks().iter().for_each(log::remark);
    let (rows, style) = (rows_to_measure(&input), arguments.progress);
    let mut progress = Progress::new(style, rows, &request.path, Place::ALONE, started);
    let mut told = |rows| progress.set(rows);
    let stop = stop::on_signals();
    let map = job::sample_map(&input, &arguments.output, goal, &options, &stop, &mut told);
    progress.end();
    let mut map = map?;
    if let Some(picture) = &arguments.picture {
        draw(&mut map, picture)?;
    }
    let summary = map.summary();
    let text = match arguments.json {
        true => format!("{:#}\n", serde_json::json!(summary)),
        false => in_words(&summary, &arguments.output),
    };
    stdout::print(&text)?;
    Ok(if summary.added == 0 { REACHED } else { DONE })
}

fn options(arguments: &SampleMapArguments) -> JobOptions {
    let params = Params::new(quality(arguments.quality));
    let threads = threads::to_use(arguments.threads);
    let options = JobOptions::new(Options::new(params).with_threads(threads));
    match arguments.max_memory {
        Some(limit) => options.with_memory_limit(limit),
        None => options,
    }
}

/// The one picture of a file.
fn open(request: &InputRequest) -> Result<Input, Error> {
    if !request.layers.is_empty() {
        return Err(Error::Usage(
            "a map is made of the colour: leave out --layers".into(),
        ));
    }
    job::only_picture(request)
}

/// Draws a picture of the map.
fn draw(map: &mut SampleMap, path: &Path) -> Result<(), Error> {
    let (size, most) = (map.size(), map.summary().most.max(1));
    let mut rows = PngRows::create(path, size.width(), size.height())?;
    let mut samples = vec![0; size.width()];
    for y in 0..size.height() {
        map.read_row(y, &mut samples)?;
        let place = |more: u32| (more as f32).ln_1p() / (most as f32).ln_1p();
        let row: Vec<[u8; 3]> = samples.iter().map(|&more| ramp(place(more))).collect();
        rows.row(&row)?;
    }
    rows.finish()
}

fn in_words(summary: &Summary, output: &Path) -> String {
    let per_pixel = |samples: u64| samples as f64 / summary.pixels as f64;
    format!(
        "{}: {:.2} samples per pixel, {:.2} more, {} at most; predicted error {:.5}, {:.5} with them\n",
        output.display(),
        per_pixel(summary.samples),
        per_pixel(summary.added),
        summary.most,
        summary.error,
        summary.error_then,
    )
}
