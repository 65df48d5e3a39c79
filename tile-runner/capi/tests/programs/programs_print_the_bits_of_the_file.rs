//! A frame that a C or C++ program denoises has the bits of the file that the command line writes: through either library, in whole or by rows, under
//! the sanitisers for addresses and undefined behaviour.

use std::process::Command;

use crate::adaptive_by_the_library::checksum_by_the_library;
use crate::frame_in_a_file::checksum_of_the_file;
use crate::installed::{Library, build, run};

const SANITISERS: [&str; 2] = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

fn prints_the_bits(example: &str, lines: usize, name: &str) {
    let wanted = checksum_of_the_file(&format!("{name}-file")).repeat(lines);
    prints(example, &wanted, name);
}

fn prints(example: &str, wanted: &str, name: &str) {
    for library in [Library::Shared, Library::Static] {
        let Some(program) = build(
            example,
            library,
            &SANITISERS,
            &format!("{name}-{library:?}"),
        ) else {
            return;
        };
        assert_eq!(
            run(&mut Command::new(program)),
            wanted,
            "{example}, {library:?}"
        );
    }
}

#[test]
fn frame_in_c() {
    prints_the_bits("examples/frame.c", 1, "frame");
}

#[test]
fn frame_in_cpp() {
    prints_the_bits("examples/frame.cpp", 1, "frame-cpp");
}

#[test]
fn rows_in_c() {
    prints_the_bits("examples/rows.c", 2, "rows");
}

#[test]
fn a_map_in_c_and_what_is_rendered_by_it() {
    prints(
        "examples/adaptive.c",
        &checksum_by_the_library(),
        "adaptive",
    );
}
