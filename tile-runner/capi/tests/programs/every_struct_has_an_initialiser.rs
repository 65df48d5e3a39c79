//! Each struct that a caller makes has an initialiser, which sets every member in C and in C++.

use std::fs;
use std::process::Command;

use crate::installed::{folder, is_there, prefix, run};

#[test]
fn every_struct_has_an_initialiser() {
    let header = fs::read_to_string(prefix().join("include/linpred.h")).unwrap();
    let structs = [
        "options",
        "report",
        "layout",
        "step",
        "row_functions",
        "file_options",
        "sample_goal",
        "sample_summary",
    ];
    // those that the library makes
    let made = ["input_row", "output_row", "denoiser"];
    for line in header
        .lines()
        .filter(|line| line.starts_with("typedef struct linpred_"))
    {
        let name = line
            .trim_start_matches("typedef struct linpred_")
            .split(' ')
            .next()
            .unwrap();
        assert!(
            structs.contains(&name) || made.contains(&name),
            "{name} is not tested"
        );
    }
    let source = structs.map(|name| {
        let constant = name.to_uppercase();
        format!("linpred_{name} {name} = LINPRED_{constant}_INIT;\n")
    });
    let source = format!("#include <linpred.h>\n{}", source.concat());
    let folder = folder("initialisers");
    for (compiler, standard, name) in [
        ("cc", "-std=c11", "all.c"),
        ("c++", "-std=c++11", "all.cpp"),
    ] {
        if is_there(compiler, "initialisers") {
            let file = folder.join(name);
            fs::write(&file, &source).unwrap();
            let mut command = Command::new(compiler);
            command.args([
                standard,
                "-Wall",
                "-Wextra",
                "-Wpedantic",
                "-Werror",
                "-fsyntax-only",
            ]);
            run(command.arg("-I").arg(prefix().join("include")).arg(file));
        }
    }
}
