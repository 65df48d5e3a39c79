//! How the command ends when its arguments ask for no job: help, the version, or an error in them.

use std::ffi::OsString;
use std::io::Write;

use super::args::{LogArguments, LogFormat};
use super::errors::DONE;
use super::{errors, log, openjd, stdout};

/// Prints what clap has to say: help and the version to standard output, an error to standard error, as a line of JSON if the log is one.
pub(crate) fn end(said: &clap::Error, arguments: &[OsString]) -> u8 {
    if !said.use_stderr() {
        let printed = said.print().and_then(|()| std::io::stdout().flush());
        return match stdout::written(printed) {
            Ok(()) => DONE,
            Err(error) => {
                log::start(&LogArguments::plain(asked_for(arguments)));
                errors::end(&error)
            }
        };
    }
    let in_a_line = in_a_line(&said.render().to_string());
    if asks_for(arguments, "--progress", "openjd") {
        openjd::fail(&in_a_line);
    }
    match asked_for(arguments) {
        LogFormat::Text => {
            // nobody is left to be told when standard error is closed
            let _ = said.print();
        }
        LogFormat::Json => {
            log::start(&LogArguments::plain(LogFormat::Json));
            tracing::error!("{in_a_line}");
        }
    }
    errors::USAGE
}

/// The format of the log that arguments ask for which as a whole are not understood.
fn asked_for(arguments: &[OsString]) -> LogFormat {
    match asks_for(arguments, "--log-format", "json") {
        true => LogFormat::Json,
        false => LogFormat::Text,
    }
}

/// Whether an option is among the arguments with this value.
fn asks_for(arguments: &[OsString], option: &str, value: &str) -> bool {
    let end = arguments.iter().position(|argument| argument == "--");
    let arguments = &arguments[..end.unwrap_or(arguments.len())];
    let apart = |pair: &[OsString]| pair[0] == option && pair[1] == value;
    let joined = format!("{option}={value}");
    arguments.windows(2).any(apart) || arguments.iter().any(|argument| *argument == *joined)
}

/// The error and its tips without the usage below them, in one line.
fn in_a_line(text: &str) -> String {
    let text = text.strip_prefix("error: ").unwrap_or(text);
    let paragraphs = text.split("\n\n").take_while(|paragraph| {
        !paragraph.starts_with("Usage:") && !paragraph.starts_with("For more information")
    });
    let lines = |paragraph: &str| {
        paragraph
            .lines()
            .map(str::trim)
            .collect::<Vec<_>>()
            .join(" ")
    };
    paragraphs.map(lines).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_put_into_one_line_with_its_tips() {
        let text = "error: unexpected argument '--quiet2' found\n\n  tip: a similar argument exists: '--quiet'\n\nUsage: linpred denoise\n\nFor more information, try '--help'.\n";
        assert_eq!(
            in_a_line(text),
            "unexpected argument '--quiet2' found; tip: a similar argument exists: '--quiet'"
        );
        let text = "error: these were not provided:\n  --output <CLEAN.exr>\n  <NOISY.exr>\n\nUsage: linpred";
        assert_eq!(
            in_a_line(text),
            "these were not provided: --output <CLEAN.exr> <NOISY.exr>"
        );
    }

    #[test]
    fn the_format_is_found_in_arguments_that_are_wrong() {
        let format = |words: &str| {
            let words: Vec<OsString> = words.split(' ').map(OsString::from).collect();
            asked_for(&words)
        };
        for words in ["x --log-format json", "--log-format=json x --nonsense"] {
            assert_eq!(format(words), LogFormat::Json, "{words}");
        }
        for words in ["json", "--log-format text json", "-- --log-format json"] {
            assert_eq!(format(words), LogFormat::Text, "{words}");
        }
    }
}
