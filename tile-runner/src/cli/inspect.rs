//! `linpred inspect`.

use std::io::Write;
use std::process::ExitCode;

use linpred::error::Error;
use linpred::inspect::inspect;

use super::args::InspectArguments;
use super::denoise::request;
use super::exit;

/// Prints what a file holds. A file that cannot be denoised is described all the same, and ends in its exit code.
pub(crate) fn run(arguments: InspectArguments) -> Result<ExitCode, Error> {
    let (inspection, problem) = inspect(&request(arguments.input))?;
    let text = match arguments.json {
        true => format!("{:#}\n", serde_json::json!(inspection)),
        false => inspection.to_string(),
    };
    // nobody is left to be told when standard output is closed
    let _ = std::io::stdout().write_all(text.as_bytes());
    Ok(problem.map_or(ExitCode::SUCCESS, |error| {
        ExitCode::from(exit::code(&error))
    }))
}
