//! Damaged and unusual files of the OpenEXR project end in a picture or in a clear error, within 512 MiB.

use std::ffi::OsStr;
use std::io::Write as _;
use std::path::Path;

use linpred_tests::command::linpred;
#[cfg(target_os = "linux")]
use linpred_tests::command::linpred_within;

/// Memory that a file may take, whatever it claims to hold.
#[cfg(target_os = "linux")]
const MEMORY: u64 = 512 << 20;

/// The corpus, if there is one, lies beside the repository: it is not ours to copy.
const CORPUS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/exr-corpus");

#[test]
fn every_file_of_the_corpus_ends_in_a_picture_or_in_a_sentence() {
    if !Path::new(CORPUS).exists() {
        // not eprintln: the harness would hide it
        writeln!(
            std::io::stderr(),
            "NOT TESTED: the corpus of damaged files is absent ({CORPUS})"
        )
        .unwrap();
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.exr");
    let mut tried = 0;
    for kind in ["damaged", "unusual"] {
        for entry in std::fs::read_dir(Path::new(CORPUS).join(kind)).unwrap() {
            let path = entry.unwrap().path();
            let arguments = [Path::new("denoise"), &path, Path::new("-o"), &output]
                .map(Path::as_os_str)
                .into_iter()
                .chain(["--threads", "2"].map(OsStr::new));
            let ran = linpred(arguments.clone());
            let stderr = ran.stderr();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            assert!(!stderr.contains("panicked"), "{name}: {stderr}");
            let code = ran.code();
            assert!(
                matches!(code, Some(0 | 3 | 4)),
                "{name}: exit {code:?}: {stderr}"
            );
            if code != Some(0) {
                assert!(
                    stderr.contains("ERROR") && !output.exists(),
                    "{name}: {stderr}"
                );
            }
            #[cfg(target_os = "linux")]
            {
                // A run that ends alike within this address space took no more memory without the limit.
                let bytes = std::fs::read(&output).ok();
                let _ = std::fs::remove_file(&output);
                let bounded = linpred_within(MEMORY >> 10, arguments);
                assert_eq!(
                    (bounded.code(), std::fs::read(&output).ok()),
                    (code, bytes),
                    "{name}: {}",
                    bounded.stderr()
                );
            }
            let _ = std::fs::remove_file(&output);
            tried += 1;
        }
    }
    assert!(tried > 100, "only {tried} files");
}
