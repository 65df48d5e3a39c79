//! However many threads compute, the output file is the same to the byte.

use std::path::Path;

use linpred_tests::command::denoise_file;

#[test]
fn of_the_sample() {
    let noisy = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/toasters_16spp.exr");
    let folder = tempfile::tempdir().unwrap();
    let by = |threads: &str| {
        let clean = folder.path().join(format!("{threads}.exr"));
        let options = ["--threads", threads, "--error-layer", "--models-layer"];
        denoise_file(&noisy, &clean, &options).succeeds();
        std::fs::read(clean).unwrap()
    };
    let one = by("1");
    // more threads than cells of a row as well
    for threads in ["2", "3", "11"] {
        assert!(
            by(threads) == one,
            "{threads} threads write other bytes than one"
        );
    }
}
