//! Lines that the workers of Open Job Description read from what a task writes: "How Jobs Are Run", Stdout/Stderr Messages, revision 2023-09.
//!
//! Workers read both streams. These lines go where all progress goes, to standard error, in order with the messages of the log.

use std::fmt::Display;
use std::io::Write;

/// How far the task is, in hundredths.
pub(crate) fn progress(percent: usize) {
    write("progress", &percent);
}

/// What the task is at.
pub(crate) fn status(text: &str) {
    write("status", &text);
}

/// Why the task failed.
pub(crate) fn fail(text: &str) {
    write("fail", &text);
}

/// A reader that went away does not stop the job.
fn write(kind: &str, value: &dyn Display) {
    let _ = writeln!(
        std::io::stderr(),
        "openjd_{kind}: {}",
        in_a_line(&value.to_string())
    );
}

/// A message is a line: names of files may hold more than that.
fn in_a_line(text: &str) -> String {
    text.replace(char::is_control, " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_stays_in_its_line() {
        let name = "a\nopenjd_env: PATH=b\r.exr";
        assert_eq!(in_a_line(name), "a openjd_env: PATH=b .exr");
    }
}
