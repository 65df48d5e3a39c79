//! Every byte that a program made the library take is given back, by its own threads too.

use std::path::Path;
use std::process::Command;

use crate::installed::{Library, build, is_there, run};

/// What valgrind says of a program, in which nothing is lost for good and no memory is misused.
///
/// Memory that is "possibly lost" counts in the last test alone: the standard library's note of a thread, and crossbeam's of one that steals work, are
/// reached by pointers to their middle as long as the process lives.
fn valgrind(program: &Path, argument: Option<&str>) -> String {
    let log = program.with_extension("log");
    let mut valgrind = Command::new("valgrind");
    valgrind.args([
        "--leak-check=full",
        "--errors-for-leak-kinds=definite,indirect",
        "--error-exitcode=9",
    ]);
    valgrind
        .arg(format!("--log-file={}", log.display()))
        .arg(program)
        .args(argument);
    run(&mut valgrind);
    std::fs::read_to_string(log).unwrap()
}

fn nothing_leaks(example: &str, name: &str) {
    if !is_there("valgrind", &format!("leaks of {example}")) {
        return;
    }
    if let Some(program) = build(&format!("examples/{example}"), Library::Shared, &[], name) {
        valgrind(&program, None);
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

#[test]
fn of_a_map() {
    nothing_leaks("adaptive.c", "adaptive-leaks");
}

/// Bytes that are there at the end, lost or not.
fn left(log: &str) -> u64 {
    let line = log
        .lines()
        .find(|line| line.contains("in use at exit:"))
        .unwrap();
    let number = line
        .split("in use at exit:")
        .nth(1)
        .and_then(|rest| rest.split(" bytes").next());
    number.unwrap().trim().replace(',', "").parse().unwrap()
}

#[test]
fn and_many_runs_leave_no_more_than_few() {
    if !is_there("valgrind", "what runs leave behind") {
        return;
    }
    let Some(program) = build("tests/programs/runs.c", Library::Shared, &[], "runs") else {
        return;
    };
    let [few, many] = ["2", "22"].map(|runs| left(&valgrind(&program, Some(runs))));
    // crossbeam frees its notes of threads that have ended, of 2304 bytes each, when others get to it: 20 more runs would leave 120 of them
    assert!(
        many <= few + 10 * 2304,
        "{few} bytes after 2 runs, {many} after 22"
    );
}
