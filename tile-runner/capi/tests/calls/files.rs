//! A file is denoised as the library's job does it, and what is wrong with one is told.

use std::ffi::{CString, c_char, c_void};
use std::fs;
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::Arc;
use std::thread::ThreadId;

use exr::prelude::*;
use linpred::job::{self, FrameFiles, InputRequest, JobOptions, NeighbourFiles};
use linpred_c::linpred_status::*;
use linpred_c::{linpred_denoise_file, linpred_file_options, linpred_status};

use crate::host::{HEIGHT, Host, WIDTH, pixels};

pub(crate) fn write_noise(path: &Path) {
    let channels = ["R", "G", "B"]
        .iter()
        .enumerate()
        .map(|(seed, name)| AnyChannel::new(*name, FlatSamples::F32(pixels(seed, 1))));
    let channels = AnyChannels::sort(channels.collect());
    let layer = Layer::new(
        (WIDTH, HEIGHT),
        LayerAttributes::default(),
        Encoding::UNCOMPRESSED,
        channels,
    );
    Image::from_layer(layer).write().to_file(path).unwrap();
}

pub(crate) fn options() -> linpred_file_options {
    linpred_file_options {
        struct_size: size_of::<linpred_file_options>(),
        other_half: null(),
        error_layer: 0,
        models_layer: 0,
        samples_per_pixel: 0,
        feature_count: 0,
        before: null(),
        after: null(),
        before_count: 0,
        after_count: 0,
        features: null(),
        compression: null(),
    }
}

fn denoise(
    host: &Host,
    input: &Path,
    output: &Path,
    options: *const linpred_file_options,
) -> linpred_status {
    let [input, output] = [input, output].map(|path| CString::new(path.to_str().unwrap()).unwrap());
    // SAFETY: both end with a zero, and the options have the size that they state
    unsafe { linpred_denoise_file(host.0, input.as_ptr(), output.as_ptr(), options) }
}

pub(crate) fn message(host: &Host) -> String {
    // SAFETY: the text stays until the next call
    let text = unsafe { std::ffi::CStr::from_ptr(linpred_c::linpred_message(host.0)) };
    text.to_str().unwrap().to_owned()
}

/// In which threads a function was called, and how far the run was.
#[derive(Default)]
struct Seen(Vec<(ThreadId, usize, usize)>);

unsafe extern "C" fn sees(user: *mut c_void, rows: usize, of: usize) -> bool {
    // SAFETY: the test lends it
    let seen = unsafe { &mut *user.cast::<Seen>() };
    seen.0.push((std::thread::current().id(), rows, of));
    true
}

unsafe extern "C" fn stops(_user: *mut c_void, _rows: usize, _of: usize) -> bool {
    false
}

#[test]
fn a_file_with_output_layers_and_progress_in_this_thread() {
    let folder = tempfile::tempdir().unwrap();
    let (noisy, clean) = (
        folder.path().join("noisy.exr"),
        folder.path().join("clean.exr"),
    );
    write_noise(&noisy);
    let (host, mut seen) = (Host::new(), Seen::default());
    host.progress(Some(sees), (&raw mut seen).cast()).ok();
    let extra = linpred_file_options {
        error_layer: 1,
        models_layer: 1,
        ..options()
    };
    assert_eq!(
        denoise(&host, &noisy, &clean, &raw const extra),
        LINPRED_OK,
        "{}",
        message(&host)
    );
    let here = std::thread::current().id();
    let wanted: Vec<_> = (1..=HEIGHT).map(|rows| (here, rows, HEIGHT)).collect();
    assert_eq!(seen.0, wanted);
    let (told, report) = host.report();
    told.ok();
    assert_eq!(report.pixels, (WIDTH * HEIGHT) as u64);
    let image = read_first_flat_layer_from_file(&clean).unwrap();
    let names: Vec<String> = image
        .layer_data
        .channel_data
        .list
        .iter()
        .map(|c| c.name.to_string())
        .collect();
    for name in [
        "R",
        "G",
        "B",
        "linpred.error",
        "linpred.radius",
        "linpred.rank",
    ] {
        assert!(
            names.iter().any(|known| known == name),
            "{name} of {names:?}"
        );
    }

    // denoised once more, there is something to warn of
    let again = folder.path().join("again.exr");
    assert_eq!(denoise(&host, &clean, &again, null()), LINPRED_OK);
    assert!(message(&host).contains("linpred"), "{}", message(&host));
    host.progress(None, null_mut()).ok();
}

#[test]
fn frames_beside_an_image_help_as_in_the_job() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let names = ["a.exr", "b.exr", "c.exr"].map(path);
    names.iter().for_each(|name| write_noise(name));
    let [before, own, after] = &names;
    let c = |path: &Path| CString::new(path.to_str().unwrap()).unwrap();
    let (first, last, absent) = (c(before), c(after), c(&path("absent.exr")));
    let (befores, afters) = ([first.as_ptr()], [absent.as_ptr(), last.as_ptr()]);
    let host = Host::new();
    host.options(|options| options.quality = 0).ok();
    let with = linpred_file_options {
        before: befores.as_ptr(),
        before_count: 1,
        after: afters.as_ptr(),
        after_count: 2,
        ..options()
    };
    let clean = path("clean.exr");
    assert_eq!(denoise(&host, own, &clean, &raw const with), LINPRED_OK);
    assert!(
        message(&host).contains("absent.exr does not help"),
        "{}",
        message(&host)
    );

    let file = |path: &Path| FrameFiles {
        path: path.to_owned(),
        other_half: None,
    };
    let files = NeighbourFiles {
        before: vec![file(before)],
        after: Vec::new(),
    };
    let pictures = job::open_frame(&InputRequest::new(own), &files).unwrap();
    let (job, stop) = (path("job.exr"), Arc::default());
    job::denoise(&pictures, &job, &JobOptions::default(), &stop, &mut |_| ()).unwrap();
    assert!(fs::read(&clean).unwrap() == fs::read(&job).unwrap());

    for (wrong, words) in [
        (
            linpred_file_options {
                before: null(),
                ..with
            },
            "before is NULL, and before_count is 1",
        ),
        (
            linpred_file_options {
                after_count: 9,
                ..with
            },
            "after_count is 9; at most 8 frames help",
        ),
        (
            linpred_file_options {
                other_half: first.as_ptr(),
                ..with
            },
            "whose other halves are not known",
        ),
    ] {
        let is = denoise(&host, own, &clean, &raw const wrong);
        assert_eq!(is, LINPRED_ERROR_ARGUMENT);
        assert!(message(&host).contains(words), "{}", message(&host));
    }
}

#[test]
fn what_is_wrong_with_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (noisy, clean) = (path("noisy.exr"), path("clean.exr"));
    write_noise(&noisy);
    fs::write(path("text.exr"), "no image").unwrap();
    let host = Host::new();
    let fails =
        |input: &Path, output: &Path, options: &linpred_file_options, status, words: &str| {
            let is = denoise(&host, input, output, options);
            let message = message(&host);
            assert!(is == status && message.contains(words), "{is:?} {message}");
            assert!(!clean.exists());
        };
    let plain = options();
    fails(
        &noisy,
        &path("clean.png"),
        &plain,
        LINPRED_ERROR_ARGUMENT,
        "cannot be called",
    );
    fails(
        &path("none.exr"),
        &clean,
        &plain,
        LINPRED_ERROR_READ,
        "none.exr",
    );
    fails(
        &path("text.exr"),
        &clean,
        &plain,
        LINPRED_ERROR_INPUT,
        "text.exr",
    );
    fails(&noisy, &noisy, &plain, LINPRED_ERROR_ARGUMENT, "noisy.exr");
    fails(
        &noisy,
        &path("no/such/folder.exr"),
        &plain,
        LINPRED_ERROR_WRITE,
        "folder.exr",
    );
    let flag = linpred_file_options {
        models_layer: 2,
        ..options()
    };
    fails(
        &noisy,
        &clean,
        &flag,
        LINPRED_ERROR_ARGUMENT,
        "models_layer is 2, neither 0 nor 1",
    );
    let other: *const c_char = c"".as_ptr();
    let half = linpred_file_options {
        other_half: other,
        ..options()
    };
    fails(&noisy, &clean, &half, LINPRED_ERROR_READ, "");
    host.options(|options| options.memory_limit = 1).ok();
    fails(
        &noisy,
        &clean,
        &plain,
        LINPRED_ERROR_MEMORY,
        "of memory, the limit is 0.1 MiB",
    );
    host.options(|_| {}).ok();
    host.progress(Some(stops), null_mut()).ok();
    fails(
        &noisy,
        &clean,
        &plain,
        LINPRED_ERROR_CANCELLED,
        "stopped before the end",
    );
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        2,
        "left behind"
    );
    // SAFETY: NULL is told
    let status = unsafe { linpred_denoise_file(host.0, null(), null(), null()) };
    assert_eq!(
        (status, message(&host).as_str()),
        (LINPRED_ERROR_ARGUMENT, "input is NULL")
    );
}

unsafe extern "C" fn stops_at_the_last_row(_user: *mut c_void, rows: usize, of: usize) -> bool {
    rows < of
}

#[test]
fn a_stop_holds_even_at_the_last_row() {
    let folder = tempfile::tempdir().unwrap();
    let (noisy, clean) = (
        folder.path().join("noisy.exr"),
        folder.path().join("clean.exr"),
    );
    write_noise(&noisy);
    let host = Host::new();
    host.progress(Some(stops_at_the_last_row), null_mut()).ok();
    for _ in 0..20 {
        // an early version of the interface told the caller's function while the job went on, and small files were written in spite of it
        let status = denoise(&host, &noisy, &clean, null());
        assert_eq!(status, LINPRED_ERROR_CANCELLED);
        assert!(!clean.exists());
    }
}

#[test]
fn a_feature_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write_noise(&path("noisy.exr"));
    let host = Host::new();
    let with = |names: &[&CString]| {
        let features: Vec<*const c_char> = names.iter().map(|name| name.as_ptr()).collect();
        let options = linpred_file_options {
            features: features.as_ptr(),
            feature_count: features.len() as u32,
            ..options()
        };
        denoise(
            &host,
            &path("noisy.exr"),
            &path("clean.exr"),
            &raw const options,
        )
    };
    let unknown = c"nothing".to_owned();
    assert_eq!(with(&[&unknown]), LINPRED_ERROR_ARGUMENT);
    assert!(
        message(&host).contains("feature nothing: "),
        "{}",
        message(&host)
    );
    let auto = c"auto".to_owned();
    assert_eq!(with(&[&auto]), LINPRED_OK, "{}", message(&host));
    let missing = linpred_file_options {
        feature_count: 2,
        ..options()
    };
    let status = denoise(
        &host,
        &path("noisy.exr"),
        &path("clean.exr"),
        &raw const missing,
    );
    assert_eq!(status, LINPRED_ERROR_ARGUMENT);
    assert!(message(&host).contains("features is NULL, and feature_count is 2"));
}
