//! Arbitrary bytes as a file: `inspect` and `denoise` end in a picture or in an error, within the memory that they may use.

#![no_main]

use std::io::Write;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use libfuzzer_sys::fuzz_target;
use linpred::Options;
use linpred::job::{denoise, inspect, Input, InputRequest, JobOptions};
use linpred_core::{Params, Quality};

/// Bytes of memory that a file may ask for.
const MEMORY: u64 = 32 << 20;
/// Pixels beyond which a picture takes longer than a fuzzer should wait.
const PIXELS: usize = 1 << 12;

fuzz_target!(|data: &[u8]| {
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    file.write_all(data).expect("a temporary file takes bytes");
    let request = InputRequest::new(file.path());
    let described = inspect(&request).is_ok();
    let Ok(input) = Input::open(&request) else {
        return;
    };
    assert!(described, "what can be opened can be described");
    if input.width().saturating_mul(input.height()) > PIXELS {
        return;
    }
    let pipeline = Options::new(Params::new(Quality::Fast)).with_threads(NonZeroUsize::MIN);
    let options = JobOptions::new(pipeline).with_memory_limit(MEMORY);
    let output = file.path().with_extension("out.exr");
    let stop = Arc::new(AtomicBool::new(false));
    let result = denoise(&input, &output, &options, &stop, &mut |_| ());
    let written = output.exists();
    if written {
        std::fs::remove_file(&output).expect("it was there");
    }
    assert_eq!(result.is_ok(), written, "{result:?}");
});
