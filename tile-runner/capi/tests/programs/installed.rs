//! The installed interface, and programs built against it.

use std::env::current_exe;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The package.
pub(crate) fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A folder of the tests' own, empty at first.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("linpred-capi")
        .join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// Says that a test could not be made. Not eprintln: the harness would hide it.
pub(crate) fn say(what: &str) {
    let mut stderr = std::io::stderr();
    writeln!(stderr, "{what}").unwrap();
}

/// Whether there is such a program; says so if there is not.
pub(crate) fn is_there(program: &str, what: &str) -> bool {
    let is_there = Command::new(program)
        .arg("--version")
        .output()
        .is_ok_and(|ran| ran.status.success());
    if !is_there {
        say(&format!(
            "NOT TESTED: {what}: this machine has no {program}"
        ));
    }
    is_there
}

/// What a command printed, if it succeeded.
pub(crate) fn run(command: &mut Command) -> String {
    let Output {
        status,
        stdout,
        stderr,
    } = command.output().unwrap();
    let stderr = String::from_utf8_lossy(&stderr);
    assert!(
        status.success(),
        "{command:?}: {status}\n{stderr}{}",
        String::from_utf8_lossy(&stdout)
    );
    String::from_utf8(stdout).unwrap()
}

/// Where everything is installed: by install.sh, of the libraries that cargo made for this test.
pub(crate) fn prefix() -> &'static Path {
    static PREFIX: OnceLock<PathBuf> = OnceLock::new();
    PREFIX.get_or_init(|| {
        let prefix = folder("prefix");
        let test = current_exe().unwrap();
        let built = test.parent().unwrap();
        run(Command::new(package().join("install.sh"))
            .arg(&prefix)
            .arg(built));
        prefix
    })
}

/// Which library a program takes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Library {
    Shared,
    Static,
}

/// Builds a source file of the package, with every warning an error. `None`, aloud, if there is no such compiler.
pub(crate) fn build(source: &str, library: Library, flags: &[&str], name: &str) -> Option<PathBuf> {
    let (compiler, standard) = match source.ends_with(".cpp") {
        true => ("c++", "-std=c++11"),
        false => ("cc", "-std=c11"),
    };
    if !is_there(compiler, source) {
        return None;
    }
    let program = folder(name).join("program");
    let (include, libraries) = (prefix().join("include"), prefix().join("lib"));
    let mut command = Command::new(compiler);
    command.args([
        standard,
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Wundef",
        "-Werror",
        "-g",
    ]);
    command.args(flags).arg("-I").arg(include);
    command.arg(package().join(source)).arg("-o").arg(&program);
    match library {
        Library::Shared => {
            let path = libraries.to_str().unwrap();
            command
                .arg(format!("-Wl,-rpath,{path}"))
                .arg("-L")
                .arg(path)
                .arg("-llinpred_c")
        }
        Library::Static => command.arg(libraries.join("liblinpred_c.a")).args([
            "-lgcc_s",
            "-lpthread",
            "-lm",
            "-ldl",
        ]),
    };
    run(&mut command);
    Some(program)
}
