//! Arguments that will not do end in a sentence that says what will, before anything is read; what is said can be read by scripts as well.

use std::path::Path;

use linpred_tests::command::{Ran, linpred};
use linpred_tests::images::{colour, part, write};
use serde_json::Value;

/// Runs the command on words that hold no space.
fn typed(words: &str) -> Ran {
    linpred(words.split_whitespace())
}

/// Each line of standard error.
fn lines(ran: &Ran) -> Vec<Value> {
    let stderr = ran.stderr();
    let json = |line| serde_json::from_str(line).unwrap_or_else(|_| panic!("not JSON: {line}"));
    stderr.lines().map(json).collect()
}

#[test]
fn numbers_that_will_not_do_are_answered_with_those_that_will() {
    for number in ["0", "-1", "many", "99999999999999999999"] {
        typed(&format!("denoise in.exr -o out.exr --threads={number}"))
            .exits_with(2)
            .complains_about(&["--threads", number, "write 1 or more, or leave it out"]);
        typed(&format!("inspect in.exr --pixels --threads={number}"))
            .exits_with(2)
            .complains_about(&["--threads", number, "write 1 or more, or leave it out"]);
        typed(&format!("denoise in.exr -o out.exr --spp={number}"))
            .exits_with(2)
            .complains_about(&["--spp", number, "write 1 or more", "what the file states"]);
    }
    for number in ["0", "-1", "1025", "70000", "high"] {
        typed(&format!("denoise in.exr -o out.exr --coverage={number}"))
            .exits_with(2)
            .complains_about(&["--coverage", number, "write a number from 1 to 1024"]);
    }
}

#[test]
fn a_log_in_json_holds_for_arguments_that_are_not_understood() {
    for (words, sentence) in [
        ("denoise in.exr -o out.exr --threads 0", "write 1 or more"),
        ("denoise in.exr -o out.exr --thread 1", "'--threads'"),
        ("denoise in.exr", "--output <CLEAN.exr>"),
        ("dnoise in.exr", "'dnoise'"),
        ("denoise in.exr -o out.png", "out.png"),
    ] {
        let (first, rest) = words.split_once(' ').unwrap();
        for words in [
            format!("{words} --log-format json"),
            format!("--log-format=json {first} {rest}"),
        ] {
            let ran = typed(&words).exits_with(2);
            let lines = lines(&ran);
            assert_eq!((lines.len(), ran.stdout()), (1, String::new()), "{words}");
            assert_eq!(lines[0]["level"], "ERROR", "{words}");
            let message = lines[0]["message"].as_str().unwrap();
            assert!(message.contains(sentence), "{words}: {message}");
            assert!(!message.contains("Usage"), "{words}: {message}");
        }
    }
    // as text they are clap's, with the usage
    typed("denoise in.exr --log-format text")
        .exits_with(2)
        .complains_about(&["error: ", "--output <CLEAN.exr>", "Usage: "]);
}

#[test]
fn a_log_in_json_holds_for_errors_of_a_run() {
    let ran = typed("denoise no/such/in.exr -o out.exr --log-format json").exits_with(3);
    let lines = lines(&ran);
    assert_eq!(lines.len(), 1);
    assert_eq!(lines[0]["level"], "ERROR");
    let message = lines[0]["message"].as_str().unwrap();
    assert!(message.contains("no/such/in.exr"), "{message}");
}

#[test]
fn help_and_version_are_text_whatever_the_log() {
    for words in ["--help", "denoise --help", "--version"] {
        let plain = typed(words).succeeds();
        let json = typed(&format!("--log-format json {words}")).succeeds();
        assert_eq!(plain.stderr() + &json.stderr(), "", "{words}");
        assert_eq!(plain.stdout(), json.stdout(), "{words}");
        assert!(plain.stdout().contains("linpred"), "{words}");
    }
}

#[test]
fn help_says_what_scripts_and_layers_mean() {
    let codes = [
        "0 done",
        "2 usage",
        "3 input",
        "4 memory",
        "130 or 143",
        "1 anything",
    ];
    typed("--help").succeeds().prints(&codes);
    typed("denoise --help").succeeds().prints(&codes).prints(&[
        "mean squared error of each denoised pixel, mean over the channels, radiance squared",
        "its square root is a standard error",
        "file (the input), frame",
    ]);
}

#[test]
fn the_name_of_another_format_is_refused_before_anything_is_read() {
    for extension in [
        "png", "jpg", "jpeg", "tif", "TIFF", "hdr", "tga", "bmp", "webp", "pfm",
    ] {
        for words in [
            "denoise no/such/in.exr -o",
            "denoise no/such/in.exr --dry-run -o",
            "denoise no/such/in.####.exr -o #",
            "stitch no/such/1.exr no/such/2.exr -o",
        ] {
            typed(&format!("{words} clean.{extension}").replace("# ", "####."))
                .exits_with(2)
                .complains_about(&[
                    "is an OpenEXR file",
                    &format!("clean.{extension}"),
                    "clean.exr",
                ]);
        }
    }
}

#[test]
fn a_name_of_no_format_is_the_users_business() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write(&path("in.exr"), (8, 8), vec![part(colour(64))]);
    for name in ["out", "out.beauty", "out.0001", "out.EXR"] {
        linpred([
            Path::new("denoise"),
            &path("in.exr"),
            Path::new("-o"),
            &path(name),
        ])
        .succeeds();
        assert!(path(name).exists(), "{name}");
    }
}

#[test]
fn more_threads_than_processors_are_not_used_and_that_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    write(&input, (40, 40), vec![part(colour(1600))]);
    let run = |command: &str, options: &str| {
        let words = [command].into_iter().chain([input.to_str().unwrap()]);
        linpred(words.chain(options.split_whitespace())).succeeds()
    };
    let sentence = ["--threads 99999: ", " are used, one on each processor"];
    let plan = run("denoise", "-o out.exr --dry-run");
    let much = run("denoise", "-o out.exr --dry-run --threads 99999").complains_about(&sentence);
    assert_eq!(much.stdout(), plan.stdout());
    run("inspect", "--pixels --threads 99999").complains_about(&sentence);
    for options in ["--threads 1", "--threads 99999 -q"] {
        let ran = run("denoise", &format!("-o out.exr --dry-run {options}"));
        assert_eq!(ran.stderr(), "", "{options}");
    }
}
