//! `linpred inspect`.

use std::ops::ControlFlow;
use std::time::Instant;

use crate::Error;
use crate::job::{DEFAULT_MEMORY_LIMIT, Input, inspect_with};
use crate::survey::Survey;

use super::args::{InspectArguments, ProgressStyle, SurveyArguments};
use super::denoise::request;
use super::errors::DONE;
use super::progress::{Place, Progress};
use super::{errors, stdout, threads};

/// Prints what a file holds. A file that cannot be denoised is described all the same, and ends in its exit code.
pub(crate) fn run(arguments: InspectArguments) -> Result<u8, Error> {
    let request = request(arguments.input).with_memory_limit(arguments.survey.max_memory);
    let (mut inspection, problem) =
        inspect_with(&request, |input| survey(input, &arguments.survey))?;
    inspection.problem = problem.as_ref().map(errors::in_words);
    let text = match arguments.json {
        true => format!("{:#}\n", serde_json::json!(inspection)),
        false => inspection.to_string(),
    };
    stdout::print(&text)?;
    Ok(problem.map_or(DONE, |error| errors::code(&error)))
}

/// Reads the pixels, if that is asked for.
fn survey(input: &Input, arguments: &SurveyArguments) -> Result<Option<Survey>, Error> {
    if !arguments.pixels {
        return Ok(None);
    }
    let threads = threads::to_use(arguments.threads);
    let limit = arguments.max_memory.unwrap_or(DEFAULT_MEMORY_LIMIT);
    let style = arguments.progress.unwrap_or(ProgressStyle::Auto);
    let started = Instant::now();
    let mut progress = Progress::new(style, input.height(), input.path(), Place::ALONE, started);
    let found = crate::job::survey(input, threads, limit, &mut |rows| {
        progress.set(rows);
        ControlFlow::Continue(())
    });
    progress.end();
    found.map(Some)
}
