//! What cannot be written is an error, and nothing half-written is left behind; a reader that went away is none.

#[cfg(unix)]
mod on_unix {
    use std::fs::File;
    use std::path::Path;
    use std::process::{Command, Output, Stdio};

    use linpred_tests::command::linpred_path;
    use linpred_tests::images::{colour, everything, part, write};

    /// Runs a command that prints, on a small image.
    fn print_to(stdout: impl Fn() -> Stdio, check: impl Fn(&str, Output)) {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("in.exr");
        write(&input, (8, 8), vec![part(colour(64))]);
        let input = input.to_str().unwrap();
        for words in [
            &["inspect", input][..],
            &["inspect", input, "--json"],
            &["denoise", input, "-o", "out.exr", "--dry-run"],
            &["--help"],
            &["--version"],
        ] {
            let ran = Command::new(linpred_path())
                .args(words)
                .stdout(stdout())
                .output()
                .unwrap();
            check(&words.join(" "), ran);
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn standard_output_on_a_full_disk() {
        let full = || {
            File::options()
                .write(true)
                .open("/dev/full")
                .unwrap()
                .into()
        };
        print_to(full, |words, ran| {
            let stderr = String::from_utf8_lossy(&ran.stderr);
            assert_eq!(ran.status.code(), Some(1), "{words}: {stderr}");
            let sentence = "cannot write to standard output: No space left on device";
            assert!(stderr.contains(sentence), "{words}: {stderr}");
        });
    }

    #[test]
    fn standard_output_that_nobody_reads() {
        let closed = || {
            let (reader, writer) = std::io::pipe().unwrap();
            drop(reader);
            writer.into()
        };
        print_to(closed, |words, ran| {
            let stderr = String::from_utf8_lossy(&ran.stderr);
            assert_eq!((ran.status.code(), &*stderr), (Some(0), ""), "{words}");
        });
    }

    #[test]
    fn a_file_that_may_not_grow_so_large() {
        let folder = tempfile::tempdir().unwrap();
        let (input, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
        // noise, of which no compression makes 16 KiB
        write(&input, (64, 64), vec![part(everything(64 * 64))]);
        let ran = Command::new("sh")
            .args(["-c", "ulimit -f 16 && exec \"$@\"", "sh"])
            .args([linpred_path(), Path::new("denoise"), &input])
            .args([Path::new("-o"), &output])
            .output()
            .unwrap();
        let stderr = String::from_utf8_lossy(&ran.stderr);
        assert_eq!(ran.status.code(), Some(1), "{:?}: {stderr}", ran.status);
        let sentence = "out.exr: File too large";
        assert!(stderr.contains(sentence), "{stderr}");
        let left = std::fs::read_dir(folder.path()).unwrap();
        let left: Vec<_> = left.map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(left, ["in.exr"]);
    }
}
