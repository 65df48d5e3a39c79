//! The map of a file is the one that the command `linpred sample-map` writes, and what is wrong with one is told.

use std::ffi::{CString, c_void};
use std::fs;
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use linpred::Options;
use linpred::channels::RoleRequest;
use linpred::job::{InputRequest, JobOptions, only_picture, sample_map};
use linpred::sampling::{Goal, Summary};
use linpred_c::linpred_status::*;
use linpred_c::{
    linpred_file_options, linpred_sample_goal, linpred_sample_map_file, linpred_sample_summary,
    linpred_status,
};

use crate::files::{message, options, write_noise};
use crate::host::{HEIGHT, Host, WIDTH, goal, no_summary};

fn map(
    host: &Host,
    [input, output]: [&Path; 2],
    goal: *const linpred_sample_goal,
    options: *const linpred_file_options,
    summary: *mut linpred_sample_summary,
) -> linpred_status {
    let [input, output] = [input, output].map(|path| CString::new(path.to_str().unwrap()).unwrap());
    // SAFETY: paths end with a zero, and structs have the sizes that they state
    unsafe {
        linpred_sample_map_file(
            host.0,
            input.as_ptr(),
            output.as_ptr(),
            goal,
            options,
            summary,
        )
    }
}

/// What the command does.
fn by_the_job(input: &Path, output: &Path) -> Summary {
    let roles = RoleRequest {
        spp: Some(4),
        ..RoleRequest::default()
    };
    let picture = only_picture(&InputRequest::new(input).with_roles(roles)).unwrap();
    let goal = Goal::budget(8.0).unwrap();
    let options = JobOptions::new(Options::for_sampling());
    let stop = Arc::new(AtomicBool::new(false));
    let map = sample_map(&picture, output, goal, &options, &stop, &mut |_| {});
    map.unwrap().summary()
}

fn with_samples() -> linpred_file_options {
    linpred_file_options {
        samples_per_pixel: 4,
        ..options()
    }
}

unsafe extern "C" fn counts(user: *mut c_void, rows: usize, of: usize) -> bool {
    // SAFETY: the test lends a number
    let last = unsafe { &mut *user.cast::<usize>() };
    assert!(rows == *last + 1 && of == HEIGHT, "{rows} of {of}");
    *last = rows;
    true
}

#[test]
fn the_bytes_are_those_of_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let [noisy, own, wanted] = ["noisy.exr", "own.exr", "wanted.exr"].map(path);
    write_noise(&noisy);
    let should = by_the_job(&noisy, &wanted);
    let (host, mut summary, mut last) = (Host::new(), no_summary(), 0_usize);
    host.options(|_| {}).ok();
    host.progress(Some(counts), (&raw mut last).cast()).ok();
    let status = map(
        &host,
        [&noisy, &own],
        &goal(8.0, 0.0),
        &with_samples(),
        &raw mut summary,
    );
    assert_eq!(status, LINPRED_OK, "{}", message(&host));
    // its colour alone: nothing is known of the noise, and it is denoised once
    assert_eq!(last, HEIGHT);
    assert!(fs::read(own).unwrap() == fs::read(wanted).unwrap());
    let is = (summary.samples, summary.added, summary.most);
    assert_eq!(is, (should.samples, should.added, should.most));
    assert_eq!(summary.added, 8 * (WIDTH * HEIGHT) as u64);
    assert_eq!(summary.error_then.to_bits(), should.error_then.to_bits());
    host.progress(None, null_mut()).ok();
}

unsafe extern "C" fn stops(_user: *mut c_void, rows: usize, of: usize) -> bool {
    rows < of
}

#[test]
fn what_is_wrong_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let [noisy, more] = ["noisy.exr", "more.exr"].map(path);
    write_noise(&noisy);
    let (host, eight) = (Host::new(), goal(8.0, 0.0));
    let fails = |output: &Path, goal, options: &linpred_file_options, status, words: &str| {
        let is = map(&host, [&noisy, output], goal, options, null_mut());
        let message = message(&host);
        assert!(is == status && message.contains(words), "{is:?} {message}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "{words}");
    };
    let good = with_samples();
    let advice = "how many samples pixels have; set samples_per_pixel of linpred_file_options";
    fails(&more, &eight, &options(), LINPRED_ERROR_INPUT, advice);
    let no_goal: *const linpred_sample_goal = null();
    fails(
        &more,
        no_goal,
        &good,
        LINPRED_ERROR_ARGUMENT,
        "linpred_sample_goal is NULL",
    );
    fails(
        &more,
        &goal(0.0, 0.0),
        &good,
        LINPRED_ERROR_ARGUMENT,
        "a map needs a budget",
    );
    fails(&noisy, &eight, &good, LINPRED_ERROR_ARGUMENT, "noisy.exr");
    let layers = linpred_file_options {
        error_layer: 1,
        ..good
    };
    fails(
        &more,
        &eight,
        &layers,
        LINPRED_ERROR_ARGUMENT,
        "a map of samples has no layers beside it",
    );
    host.options(|options| options.memory_limit = 1).ok();
    fails(
        &more,
        &eight,
        &good,
        LINPRED_ERROR_MEMORY,
        "the limit is 0.1 MiB",
    );
    host.options(|_| {}).ok();
    host.progress(Some(stops), null_mut()).ok();
    fails(
        &more,
        &eight,
        &good,
        LINPRED_ERROR_CANCELLED,
        "stopped before the end",
    );
}
