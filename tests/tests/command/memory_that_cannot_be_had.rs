//! Where the system gives less memory than planned, a run ends in a sentence before it begins, or does its work.

#![cfg(target_os = "linux")]

use std::fs;
use std::path::Path;

use exr::prelude::{Blocks, Compression};
use linpred_tests::command::linpred_within;
use linpred_tests::images::{everything, part, write};

#[test]
fn whatever_the_limit_the_run_ends_in_a_sentence_or_in_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let size = (1200, 64);
    let noisy = part(everything(size.0 * size.1)).stored(Compression::PIZ, Blocks::ScanLines);
    write(&folder.path().join("in.exr"), size, vec![noisy]);
    let (input, output, ample) = (path("in.exr"), path("out.exr"), path("ample.exr"));
    let denoise = |limit, output: &str| {
        let options = ["--quality", "fast", "--threads", "3"];
        linpred_within(
            limit,
            [&["denoise", &input, "-o", output], &options[..]].concat(),
        )
    };
    assert!(denoise(4 << 20, &ample).code() == Some(0));
    // from 16 MiB, with which the process can start and look at its input
    let limits = std::iter::successors(Some(16 << 10), |limit| Some(limit * 11 / 10));
    let (mut refused, mut done) = (0, 0);
    for limit in limits.take_while(|limit| *limit < 1 << 19) {
        let ran = denoise(limit, &output);
        let stderr = ran.stderr();
        match ran.code() {
            Some(0) => {
                assert_eq!(fs::read(&output).unwrap(), fs::read(&ample).unwrap());
                fs::remove_file(&output).unwrap();
                done += 1;
            }
            Some(4) => {
                assert!(
                    stderr.contains("memory") || stderr.contains("thread"),
                    "{stderr}"
                );
                refused += 1;
            }
            other => panic!("{limit} KiB: {other:?}: {stderr}"),
        }
        let left = [&output, &format!("{output}.part")];
        assert!(
            left.iter().all(|name| !Path::new(name).exists()),
            "{limit} KiB: {stderr}"
        );
    }
    assert!(refused > 3 && done > 3, "{refused} refused, {done} done");
}
