//! What an error says on the command line, and the exit code it ends in: 0 done, 2 usage, 3 input, 4 memory budget, 128 and more stopped by a
//! signal, 1 anything else.

use crate::{Error, Remedy};

use super::stop;

/// The exit code of a command that did what was asked for.
pub(crate) const DONE: u8 = 0;

/// The exit code of arguments that ask for nothing that can be done.
pub(crate) const USAGE: u8 = 2;

/// Says what went wrong, last of all.
pub(crate) fn end(error: &Error) -> u8 {
    tracing::error!("{}", in_words(error));
    code(error)
}

/// The exit code that an error ends the process with.
pub(crate) fn code(error: &Error) -> u8 {
    match error {
        Error::Usage(_) | Error::Setting { .. } => USAGE,
        Error::Unsupported(_)
        | Error::Invalid(_)
        | Error::Incomplete { .. }
        | Error::Read { .. } => 3,
        Error::Budget(_) | Error::OverLimit { .. } => 4,
        Error::Cancelled => stop::exit_code(),
        _ => 1,
    }
}

/// An error with its causes, and with the options that would mend it.
pub(crate) fn in_words(error: &Error) -> String {
    let words = match error {
        // settings are called as their options are
        Error::Setting { .. } => format!("--{error}"),
        Error::Incomplete { remedy, .. } => format!("{error}{}", advice(*remedy)),
        Error::OverLimit { .. } => error.to_string().replacen("the limit", "--max-memory", 1),
        _ => error.to_string(),
    };
    words + &error.causes()
}

fn advice(remedy: Remedy) -> &'static str {
    match remedy {
        Remedy::Colour => "; say --map colour=LAYER",
        Remedy::SamplesOrNoVariance => {
            "; add --spp N, or --map variance=none to estimate the variance from the picture"
        }
        Remedy::NoVariance => {
            ", or add --map variance=none to estimate the variance from the picture"
        }
        Remedy::Samples => "; say --spp N, or --map samples=CHANNEL",
    }
}

#[cfg(test)]
mod tests {
    use crate::Setting;

    use super::*;

    #[test]
    fn an_error_names_the_option_and_each_cause_once() {
        let read = Error::Read {
            context: "cannot read in.exr".into(),
            source: std::io::Error::other("the disk is on fire"),
        };
        assert_eq!(in_words(&read), "cannot read in.exr: the disk is on fire");
        let band = Error::Setting {
            setting: Setting::Band,
            value: "1/9".into(),
            problem: "is empty".into(),
        };
        assert_eq!(in_words(&band), "--band 1/9: is empty");
        let memory = Error::OverLimit {
            needed: 3 << 20,
            limit: 2 << 20,
            most: "computing: 2.5 MiB".into(),
        };
        assert_eq!(
            in_words(&memory),
            "needs 3.0 MiB of memory, --max-memory is 2.0 MiB; most of it is computing: 2.5 MiB"
        );
    }
}
