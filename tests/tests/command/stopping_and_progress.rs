//! A job tells how far it is, and stops when it is told to, leaving nothing behind.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};

use linpred_tests::command::{self, Ran, linpred_path};
use linpred_tests::images::{colour, everything, part, write};
use serde_json::Value;

fn denoise(folder: &Path, size: (usize, usize), options: &[&str]) -> Ran {
    write(
        &folder.join("in.exr"),
        size,
        vec![part(colour(size.0 * size.1))],
    );
    command::denoise(folder, "out.exr", options).succeeds()
}

#[test]
fn nothing_is_shown_on_a_pipe_unless_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let quiet = denoise(folder.path(), (20, 40), &["-q"]);
    assert_eq!(
        (quiet.stderr(), quiet.stdout()),
        (String::new(), String::new())
    );
    let plain = denoise(folder.path(), (20, 40), &["-q", "--progress", "plain"]);
    assert_eq!(plain.stderr().lines().count(), 10, "{}", plain.stderr());
    assert!(plain.stderr().ends_with("100 % (40 of 40 rows)\n"));
    let json = denoise(folder.path(), (20, 40), &["-q", "--progress", "json"]);
    let last: Value = serde_json::from_str(json.stderr().lines().last().unwrap()).unwrap();
    assert_eq!(
        (&last["rows"], &last["of"], &last["percent"]),
        (&40.into(), &40.into(), &100.into())
    );
}

#[test]
fn progress_says_of_which_file_and_frame_it_is_and_since_when() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    // valid JSON whatever the name
    let names = [7, 8].map(|frame| path(&format!("a \"b\".{frame:04}.exr")));
    for name in &names {
        write(name, (20, 40), vec![part(colour(800))]);
    }
    let options = ["-q", "--progress", "json"];
    let lines = |input: &Path, output: &Path| -> Vec<Value> {
        let ran = command::denoise_file(input, output, &options).succeeds();
        let json = |line| serde_json::from_str(line).unwrap();
        ran.stderr().lines().map(json).collect()
    };
    let alone = lines(&names[0], &path("out.exr"));
    let sequence = lines(&path("a \"b\".####.exr"), &path("out.####.exr"));
    assert_eq!(sequence.len(), 2 * alone.len());
    let second = &sequence[alone.len()..];
    for (lines, name, frame) in [
        (&alone[..], &names[0], Value::Null),
        (&sequence[..alone.len()], &names[0], 7.into()),
        (second, &names[1], 8.into()),
    ] {
        let mut since = 0.0;
        for line in lines {
            assert_eq!(line["file"], name.to_str().unwrap());
            assert_eq!(line["frame"], frame);
            let seconds = line["seconds"].as_f64().unwrap();
            assert!((since..60.0).contains(&seconds), "{seconds} after {since}");
            since = seconds;
        }
    }
}

#[test]
fn the_report_counts_what_was_done() {
    let folder = tempfile::tempdir().unwrap();
    denoise(folder.path(), (20, 40), &[])
        .complains_about(&["out.exr: the colour denoised, 800 pixels", "repaired"]);
    let json = denoise(folder.path(), (20, 40), &["--log-format", "json"]);
    let report = json.report();
    assert_eq!(
        (&report["message"], &report["pixels"]),
        (&"denoised".into(), &800.into())
    );
}

#[cfg(unix)]
#[test]
fn a_signal_ends_the_job_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    // large enough that a signal sent at the first sign of progress finds it still at work
    let size = (1200, 1600);
    write(&input, size, vec![part(everything(size.0 * size.1))]);
    // what a shell makes of a process that the signal ended
    for (signal, code) in [("-HUP", 129), ("-INT", 130), ("-TERM", 143)] {
        let mut child = Command::new(linpred_path())
            .args([
                "denoise".as_ref(),
                input.as_os_str(),
                "-o".as_ref(),
                output.as_os_str(),
            ])
            .args(["--progress", "json", "--quiet"])
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        let mut first = String::new();
        stderr.read_line(&mut first).unwrap();
        assert!(first.contains("\"percent\":1,"), "{first}");
        assert!(folder.path().join("out.exr.part").exists());
        Command::new("kill")
            .args([signal, &child.id().to_string()])
            .status()
            .unwrap();
        let mut rest = String::new();
        stderr.read_to_string(&mut rest).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(code), "{signal}: {rest}");
        assert!(rest.contains("stopped before the end"), "{signal}: {rest}");
        let left: Vec<_> = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect();
        assert_eq!(left, ["in.exr"], "{signal}");
    }
}

#[test]
fn a_dry_run_prints_the_plan_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    denoise(folder.path(), (20, 40), &["--dry-run"]).prints(&["colour", "memory:", "in all"]);
    assert!(!folder.path().join("out.exr").exists());
}
