//! The `linpred` command, run as a user runs it, and what is expected of it in sentences.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use serde_json::Value;

/// The path of the command, built for the profile that the tests were built for.
///
/// `cargo test` builds the binaries of a package only for that package's own integration tests, so it is asked here: for the whole
/// workspace, or crates would get other features than from `cargo test --workspace` and be built a second time.
pub fn linpred_path() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| {
        let mut build = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        build.args(["build", "--quiet", "--workspace", "--bin", "linpred"]);
        if !cfg!(debug_assertions) {
            build.arg("--release");
        }
        let built = build.status().expect("cargo runs");
        assert!(built.success(), "linpred does not build");
        let test = std::env::current_exe().expect("a test has a path");
        let profile = test
            .ancestors()
            .nth(2)
            .expect("target/<profile>/deps/<test>");
        profile
            .join("linpred")
            .with_extension(std::env::consts::EXE_EXTENSION)
    })
}

/// Runs `linpred` with these arguments.
pub fn linpred<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Ran {
    let output = Command::new(linpred_path())
        .args(arguments)
        .output()
        .expect("linpred runs");
    Ran { output }
}

/// Denoises `in.exr` of `folder` to `output` beside it.
pub fn denoise(folder: &Path, output: &str, options: &[&str]) -> Ran {
    denoise_file(&folder.join("in.exr"), &folder.join(output), options)
}

/// Denoises `input` to `output`.
pub fn denoise_file(input: &Path, output: &Path, options: &[&str]) -> Ran {
    let files = [
        OsStr::new("denoise"),
        input.as_os_str(),
        OsStr::new("-o"),
        output.as_os_str(),
    ];
    linpred(files.into_iter().chain(options.iter().map(OsStr::new)))
}

/// Runs `linpred` with these arguments in so many KiB of address space, which bounds the memory that it can have in use.
#[cfg(target_os = "linux")]
pub fn linpred_within<A: AsRef<OsStr>>(
    kibibytes: u64,
    arguments: impl IntoIterator<Item = A>,
) -> Ran {
    let output = Command::new("sh")
        .args(["-c", "ulimit -v \"$1\" && shift && exec \"$@\"", "sh"])
        .arg(kibibytes.to_string())
        .arg(linpred_path())
        .args(arguments)
        .output()
        .expect("linpred runs");
    Ran { output }
}

/// A finished run.
#[derive(Debug)]
pub struct Ran {
    output: Output,
}

impl Ran {
    /// Standard output.
    pub fn stdout(&self) -> String {
        String::from_utf8_lossy(&self.output.stdout).into_owned()
    }

    /// Standard error.
    pub fn stderr(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    /// The exit code; `None` if a signal ended it.
    pub fn code(&self) -> Option<i32> {
        self.output.status.code()
    }

    /// It ended with exit code 0.
    #[track_caller]
    pub fn succeeds(self) -> Self {
        self.exits_with(0)
    }

    /// It ended with this exit code.
    #[track_caller]
    pub fn exits_with(self, code: i32) -> Self {
        assert_eq!(
            self.output.status.code(),
            Some(code),
            "standard error:\n{}",
            self.stderr()
        );
        self
    }

    /// What a run with `--log-format json` says once it is done.
    #[track_caller]
    pub fn report(&self) -> Value {
        let log = self.stderr();
        let line = log.lines().find(|line| line.contains("\"denoised\""));
        serde_json::from_str(line.expect("a report")).expect("JSON")
    }

    /// The bytes that the plan of a `--dry-run` comes to; plans are printed to a tenth of a mebibyte.
    #[track_caller]
    pub fn planned_bytes(&self) -> u64 {
        let stdout = self.stdout();
        let total = stdout.lines().find(|line| line.ends_with("in all"));
        let number = total.and_then(|line| line.split_whitespace().next());
        let mebibytes: f64 = number.expect("a plan").parse().expect("a number");
        (mebibytes * f64::from(1 << 20)) as u64
    }

    /// Standard error contains each of these.
    #[track_caller]
    pub fn complains_about(self, words: &[&str]) -> Self {
        let stderr = self.stderr();
        for word in words {
            assert!(
                stderr.contains(word),
                "no {word:?} in standard error:\n{stderr}"
            );
        }
        self
    }

    /// Standard output contains each of these.
    #[track_caller]
    pub fn prints(self, words: &[&str]) -> Self {
        let stdout = self.stdout();
        for word in words {
            assert!(
                stdout.contains(word),
                "no {word:?} in standard output:\n{stdout}"
            );
        }
        self
    }
}
