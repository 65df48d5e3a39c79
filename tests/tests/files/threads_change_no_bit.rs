//! However many threads compute, the output file is the same to the byte.

use std::num::NonZeroUsize;
use std::path::Path;

use linpred::image::OutputOptions;
use linpred::job::{Input, InputRequest, JobOptions, denoise};
use linpred::{Options, Params, Quality};

/// By the library, for the command uses no more threads than there are processors.
#[test]
fn of_the_sample() {
    let noisy = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/toasters_16spp.exr");
    let folder = tempfile::tempdir().unwrap();
    let by = |threads: usize| {
        let clean = folder.path().join(format!("{threads}.exr"));
        let input = Input::open(&InputRequest::new(&noisy)).unwrap();
        let pipeline = Options::new(Params::new(Quality::Balanced));
        let pipeline = pipeline.with_threads(NonZeroUsize::new(threads).unwrap());
        let options = JobOptions::new(pipeline).with_output(OutputOptions {
            error: true,
            models: true,
            ..OutputOptions::default()
        });
        denoise(
            std::slice::from_ref(&input),
            &clean,
            &options,
            &Default::default(),
            &mut |_| {},
        )
        .unwrap();
        std::fs::read(clean).unwrap()
    };
    let one = by(1);
    // more threads than cells of a row as well
    for threads in [2, 3, 11] {
        assert!(
            by(threads) == one,
            "{threads} threads write other bytes than one"
        );
    }
}
