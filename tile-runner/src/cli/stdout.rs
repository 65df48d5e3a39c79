//! Standard output.

use std::io::{ErrorKind, Write};

use crate::Error;

/// Prints a text. [`Error::Write`] if it cannot be written; nobody is left to be told when a pipe was closed at its other end.
pub(crate) fn print(text: &str) -> Result<(), Error> {
    let mut stdout = std::io::stdout().lock();
    written(
        stdout
            .write_all(text.as_bytes())
            .and_then(|()| stdout.flush()),
    )
}

/// What became of an attempt to print, as [`print`] says it.
pub(crate) fn written(result: std::io::Result<()>) -> Result<(), Error> {
    match result {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => Err(Error::Write {
            context: "cannot write to standard output".into(),
            source,
        }),
        _ => Ok(()),
    }
}
