//! Every byte that the examples made the library take is given back, by its own threads too.

use std::process::Command;

use crate::installed::{Library, build, is_there, run};

fn nothing_leaks(example: &str, name: &str) {
    if !is_there("valgrind", &format!("leaks of {example}")) {
        return;
    }
    if let Some(program) = build(example, Library::Shared, &[], name) {
        let mut valgrind = Command::new("valgrind");
        valgrind.args([
            "--quiet",
            "--leak-check=full",
            "--errors-for-leak-kinds=definite,indirect,possible",
        ]);
        run(valgrind.arg("--error-exitcode=9").arg(program));
    }
}

#[test]
fn of_a_frame() {
    nothing_leaks("frame.c", "frame-leaks");
}

#[test]
fn of_rows() {
    nothing_leaks("rows.c", "rows-leaks");
}
