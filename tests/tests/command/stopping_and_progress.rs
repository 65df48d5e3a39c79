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
fn the_progress_of_a_band_is_that_of_its_rows() {
    let folder = tempfile::tempdir().unwrap();
    // cut between chunks, of 16 rows
    for (band, rows) in [("1/2", 16), ("2/2", 24)] {
        let options = ["-q", "--progress", "json", "--band", band];
        let ran = denoise(folder.path(), (20, 40), &options);
        let last: Value = serde_json::from_str(ran.stderr().lines().last().unwrap()).unwrap();
        assert_eq!(
            (&last["rows"], &last["of"], &last["percent"]),
            (&rows.into(), &rows.into(), &100.into()),
            "{band}"
        );
    }
}

/// What a worker of Open Job Description reads: the hundredths, the last status and the failure. It reads nothing into other lines.
fn read_by_a_worker(ran: &Ran) -> (Vec<usize>, String, Option<String>) {
    let stderr = ran.stderr();
    let told = |kind: &str| -> Vec<String> {
        let lines = stderr.lines().filter_map(|line| line.strip_prefix(kind));
        lines.map(str::to_owned).collect()
    };
    let progress = told("openjd_progress: ");
    (
        progress.iter().map(|text| text.parse().unwrap()).collect(),
        told("openjd_status: ").pop().unwrap_or_default(),
        told("openjd_fail: ").pop(),
    )
}

fn sequence(folder: &Path, frames: &str, options: &[&str]) -> Ran {
    let options = [options, &["--progress", "openjd", "--frames", frames]].concat();
    let path = |name: &str| folder.join(name);
    command::denoise_file(&path("in.####.exr"), &path("out.####.exr"), &options)
}

fn write_frames(folder: &Path, frames: &[u32]) {
    for frame in frames {
        let name = folder.join(format!("in.{frame:04}.exr"));
        write(&name, (20, 40), vec![part(colour(800))]);
    }
}

#[test]
fn a_worker_of_open_job_description_reads_the_progress_of_all_frames() {
    let folder = tempfile::tempdir().unwrap();
    write_frames(folder.path(), &[1, 3, 5]);
    // frames as Open Job Description writes them
    let ran = sequence(folder.path(), "1-5:2", &["-q"]).succeeds();
    let (progress, status, failure) = read_by_a_worker(&ran);
    assert!(progress.is_sorted_by(|a, b| a < b), "{progress:?}");
    // every row of three times 40, but for those that share a hundredth
    assert_eq!((progress.len(), progress.last()), (100, Some(&100)));
    let last = folder.path().join("in.0005.exr");
    assert_eq!(status, format!("{} (3 of 3)", last.display()));
    assert_eq!(failure, None);

    let alone = denoise(folder.path(), (20, 40), &["-q", "--progress", "openjd"]);
    let (progress, status, failure) = read_by_a_worker(&alone);
    assert_eq!((progress.len(), progress.last()), (40, Some(&100)));
    assert_eq!(status, folder.path().join("in.exr").to_str().unwrap());
    assert_eq!(failure, None);
}

#[test]
fn frames_that_are_skipped_are_done_for_a_worker_of_open_job_description() {
    let folder = tempfile::tempdir().unwrap();
    write_frames(folder.path(), &[1, 2, 3, 4]);
    sequence(folder.path(), "1,2,4", &[]).succeeds();
    let ran = sequence(folder.path(), "1-4", &["--skip-existing"]).succeeds();
    let (progress, status, _) = read_by_a_worker(&ran);
    assert_eq!(progress[..2], [25, 50]);
    assert!(progress.is_sorted_by(|a, b| a < b), "{progress:?}");
    assert_eq!(progress[progress.len() - 2..], [75, 100]);
    assert!(status.ends_with("in.0003.exr (3 of 4)"), "{status}");
}

#[test]
fn a_worker_of_open_job_description_reads_why_a_command_failed() {
    let folder = tempfile::tempdir().unwrap();
    write_frames(folder.path(), &[1, 3]);
    let path = |name: &str| folder.path().join(name).display().to_string();
    let ran = sequence(folder.path(), "1-3", &["-q"]).exits_with(3);
    let (progress, _, failure) = read_by_a_worker(&ran);
    assert!(progress.is_sorted_by(|a, b| a < b), "{progress:?}");
    let sentence = format!(
        "1 of 3 frames failed: cannot read {}: ",
        path("in.0002.exr")
    );
    assert!(failure.unwrap().starts_with(&sentence));

    let (absent, noisy, clean) = (path("absent.exr"), path("in.0001.exr"), path("out.exr"));
    let told = ["--progress", "openjd"];
    for (arguments, code, words) in [
        (vec!["denoise", &absent, "-o", &clean], 3, "cannot read "),
        (vec!["denoise", &noisy], 2, "--output <CLEAN.exr>"),
        (
            vec!["denoise", &noisy, "-o", &clean, "--max-memory", "1M"],
            4,
            "--max-memory",
        ),
        (vec!["inspect", &absent, "--pixels"], 3, "cannot read "),
        (vec!["stitch", &noisy, "-o", &clean], 3, "is no band"),
    ] {
        let ran = command::linpred(arguments.iter().chain(&told)).exits_with(code);
        let (progress, _, failure) = read_by_a_worker(&ran);
        let failure = failure.expect("a failure");
        assert!(failure.contains(words), "{failure}");
        assert_eq!(progress, [0; 0], "{arguments:?}");
    }
}

#[test]
fn a_worker_of_open_job_description_reads_when_bands_are_stitched() {
    let folder = tempfile::tempdir().unwrap();
    write_frames(folder.path(), &[1]);
    let path = |name: &str| folder.path().join(name);
    let bands = ["1", "2"].map(|band| {
        let (name, band) = (path(&format!("b{band}.exr")), format!("{band}/2"));
        command::denoise_file(&path("in.0001.exr"), &name, &["--band", &band]).succeeds();
        name
    });
    let [first, second] = bands.each_ref().map(|name| name.to_str().unwrap());
    let output = path("out.exr");
    let arguments = ["stitch", first, second, "-o", output.to_str().unwrap()];
    let quiet = command::linpred(arguments.iter().chain(&["-q"])).succeeds();
    assert_eq!(quiet.stderr(), "");
    let told = command::linpred(arguments.iter().chain(&["-q", "--progress", "openjd"])).succeeds();
    let status = format!("{} of 2 bands", output.display());
    assert_eq!(read_by_a_worker(&told), (vec![100], status, None));
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
