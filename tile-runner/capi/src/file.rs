//! EXR files.

use std::ffi::c_char;
use std::path::PathBuf;
use std::ptr::null;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;

use linpred::channels::{FeatureRequest, RoleRequest};
use linpred::image::{OutputCompression, OutputOptions};
use linpred::job::{self, FrameFiles, Input, InputRequest, JobOptions, NeighbourFiles, Remark};
use linpred::sampling::{Goal, Summary};
use linpred::{Error, FURTHER, Options, Report};

use crate::handle::{Denoiser, call, linpred_denoiser};
use crate::report::Done;
use crate::sample_map::{Told, linpred_sample_goal, linpred_sample_summary};
use crate::status::{Failure, linpred_status};
use crate::text::{path, utf8};
use crate::versioned::{self, Versioned};

/// What else there is to say of a file. LINPRED_FILE_OPTIONS_INIT sets the size and every default; 0 is the default
/// of each member.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct linpred_file_options {
    /// sizeof(linpred_file_options).
    pub struct_size: usize,
    /// The path of the image from the other half of the samples, if the input is from one half; else NULL.
    pub other_half: *const c_char,
    /// 1 writes the estimated squared error of each pixel beside the colour.
    pub error_layer: i32,
    /// 1 writes radius and rank of the models beside the colour.
    pub models_layer: i32,
    /// How many samples each pixel has, whatever the file says; 0 leaves it to the file.
    pub samples_per_pixel: u32,
    /// How many strings `features` has.
    pub feature_count: u32,
    /// If the image is a frame of a sequence, paths of `before_count` frames before it that help, so that it does not
    /// flicker: the nearest first, at most 8. One that does not exist or cannot help is warned of and left out, with
    /// those beyond it. May be NULL if the count is 0; without a frame on either side the image is denoised alone.
    pub before: *const *const c_char,
    /// Likewise those after it.
    pub after: *const *const c_char,
    /// How many paths `before` has.
    pub before_count: u32,
    /// How many paths `after` has.
    pub after_count: u32,
    /// Features beside normal, albedo and depth that light may follow, `feature_count` strings as the command's
    /// --feature has them: a layer or channel, "P", "P:X,Z" for some of its channels, "P=PVariance" where its variance
    /// has a name of its own; or "auto" for those that the renderer is known to write. 1 to 3 channels each, 6 in all.
    /// May be NULL if the count is 0.
    pub features: *const *const c_char,
    /// How what is denoised is stored, as the command's --compression has it: "keep", "zip", "zips", "rle", "piz",
    /// "dwaa" or "none". NULL is "keep": as in the input, but with zip where that would lose data of what is added or
    /// kept.
    pub compression: *const c_char,
}

// SAFETY: the size first, then pointers and numbers
unsafe impl Versioned for linpred_file_options {
    const NAME: &'static str = "linpred_file_options";
}

/// What a call asks for.
struct Request {
    input: InputRequest,
    /// The frames beside it, if there are any to help it.
    neighbours: Option<NeighbourFiles>,
    output: PathBuf,
    options: JobOptions,
}

/// # Safety
/// The paths and those of the options are NULL or end with a zero; `options` is NULL or can be read over its size, and so can its lists over their counts.
unsafe fn request(
    limit: u64,
    compute: Options,
    input: *const c_char,
    output: *const c_char,
    options: *const linpred_file_options,
) -> Result<Request, Failure> {
    // SAFETY: the caller's promise
    let (input, output) = unsafe { (path("input", input)?, path("output", output)?) };
    let given = match options.is_null() {
        true => linpred_file_options {
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
        },
        // SAFETY: the caller's promise
        false => unsafe { versioned::read(options) }?,
    };
    let other_half = match given.other_half.is_null() {
        true => None,
        // SAFETY: the caller's promise
        false => Some(unsafe { path("other_half", given.other_half) }?),
    };
    // SAFETY: the caller's promise
    let (before, after) = unsafe {
        (
            frames("before", given.before, given.before_count)?,
            frames("after", given.after, given.after_count)?,
        )
    };
    let neighbours = NeighbourFiles { before, after };
    if other_half.is_some() && neighbours != NeighbourFiles::default() {
        return Err(Failure::argument(
            "before or after has frames, whose other halves are not known: leave out other_half, or the frames",
        ));
    }
    let roles = RoleRequest {
        spp: (given.samples_per_pixel > 0).then_some(given.samples_per_pixel),
        // SAFETY: the caller's promise
        features: unsafe { features(given.features, given.feature_count) }?,
        ..RoleRequest::default()
    };
    let compression = match given.compression.is_null() {
        true => OutputCompression::default(),
        // SAFETY: the caller's promise
        false => OutputCompression::parse(unsafe { utf8("compression", given.compression) }?)?,
    };
    Ok(Request {
        input: InputRequest::new(input)
            .with_other_half(other_half)
            .with_roles(roles)
            .with_memory_limit(Some(limit)),
        neighbours: Some(neighbours).filter(|files| *files != NeighbourFiles::default()),
        output,
        options: JobOptions::new(compute)
            .with_memory_limit(limit)
            .with_output(OutputOptions {
                error: flag("error_layer", given.error_layer)?,
                models: flag("models_layer", given.models_layer)?,
                compression,
            }),
    })
}

/// The files of other frames.
///
/// # Safety
/// `paths` is NULL or can be read over its count; each path is NULL or ends with a zero.
unsafe fn frames(
    name: &str,
    paths: *const *const c_char,
    count: u32,
) -> Result<Vec<FrameFiles>, Failure> {
    if paths.is_null() && count > 0 {
        return Err(Failure::argument(format!(
            "{name} is NULL, and {name}_count is {count}"
        )));
    }
    if count as usize > job::MOST_REACH.get() {
        return Err(Failure::argument(format!(
            "{name}_count is {count}; at most {} frames help",
            job::MOST_REACH
        )));
    }
    let files = (0..count as usize).map(|n| {
        // SAFETY: the caller's promise, within the count
        let path = unsafe { path(name, paths.add(n).read_unaligned()) }?;
        Ok(FrameFiles {
            path,
            other_half: None,
        })
    });
    files.collect()
}

/// The features beside those that are known by their names.
///
/// # Safety
/// `features` is NULL or can be read over its count; each string is NULL or ends with a zero.
unsafe fn features(
    features: *const *const c_char,
    count: u32,
) -> Result<Vec<FeatureRequest>, Failure> {
    if features.is_null() && count > 0 {
        return Err(Failure::argument(format!(
            "features is NULL, and feature_count is {count}"
        )));
    }
    if count as usize > FURTHER {
        return Err(Failure::argument(format!(
            "feature_count is {count}; there is room for {FURTHER} channels"
        )));
    }
    let requests = (0..count as usize).map(|n| {
        // SAFETY: the caller's promise, within the count
        let text = unsafe { utf8("features", features.add(n).read_unaligned()) }?;
        Ok(FeatureRequest::parse(text)?)
    });
    requests.collect()
}

fn flag(name: &str, value: i32) -> Result<bool, Failure> {
    match value {
        0 => Ok(false),
        1 => Ok(true),
        other => Err(Failure::argument(format!(
            "{name} is {other}, neither 0 nor 1"
        ))),
    }
}

fn denoise(denoiser: &mut Denoiser, request: &Request) -> Result<(), Failure> {
    let pictures = match &request.neighbours {
        None => Input::open_all(&request.input)?,
        Some(files) => job::open_frame(&request.input, files)?,
    };
    let remarks = job::remarks(&pictures, request.options.output)?.into_iter();
    let warnings = remarks.filter_map(|remark| match remark {
        Remark::Warning(warning) => Some(warning),
        Remark::Note(_) => None,
    });
    let mut notes: Vec<String> = warnings.collect();
    let height = pictures.first().map_or(0, Input::height);
    let (output, options) = (&request.output, &request.options);
    let summary = run(denoiser, height, |stop, progress| {
        job::denoise(&pictures, output, options, stop, progress)
    })?;
    let mut report = Report::default();
    for picture in &summary.reports {
        report.add(picture);
    }
    denoiser.done = Done::new(report, summary.clamped);
    // a frame may turn out on the way to be damaged
    let unused = summary.unused.iter().map(ToString::to_string);
    let unused: Vec<String> = unused.filter(|text| !notes.contains(text)).collect();
    notes.extend(unused);
    denoiser.notes = notes.join("\n");
    Ok(())
}

fn sample_map(denoiser: &mut Denoiser, request: &Request, goal: Goal) -> Result<Summary, Failure> {
    let (output, options) = (&request.output, &request.options);
    if options.output != OutputOptions::default() {
        return Err(Failure::argument(
            "error_layer or models_layer is 1, or there is a compression, but a map of samples has no layers beside it and is stored with zip",
        ));
    }
    if request.neighbours.is_some() {
        return Err(Failure::argument(
            "before or after has frames, but a map of samples is of one frame alone",
        ));
    }
    let picture = job::only_picture(&request.input)?;
    let rows = job::rows_to_measure(&picture);
    let summary = run(denoiser, rows, |stop, progress| {
        let map = job::sample_map(&picture, output, goal, options, stop, progress)?;
        Ok(map.summary())
    })?;
    denoiser.notes = picture.roles.warnings.join("\n");
    Ok(summary)
}

/// Runs a job in another thread, since it tells of its progress in any, and the caller's function is to be called in the caller's. The job waits for
/// what that says: however small the image, a stop comes before the next row.
fn run<T: Send>(
    denoiser: &Denoiser,
    of: usize,
    job: impl FnOnce(&Arc<AtomicBool>, &mut (dyn FnMut(usize) + Send)) -> Result<T, Error> + Send,
) -> Result<T, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let (sender, rows) = channel();
    let (seen, was_seen) = channel();
    std::thread::scope(|scope| {
        let to_stop = &stop;
        let job = move || {
            let mut progress = move |rows| {
                // after a stop nobody listens
                if sender.send(rows).is_ok() {
                    let _ = was_seen.recv();
                }
            };
            job(to_stop, &mut progress)
        };
        let job = std::thread::Builder::new()
            .spawn_scoped(scope, job)
            .map_err(|error| {
                let message = format!("can't start a thread: {error}");
                Failure::new(linpred_status::LINPRED_ERROR_MEMORY, message)
            })?;
        for rows in rows {
            if denoiser.progress.tell(rows, of).is_break() {
                stop.store(true, Ordering::Relaxed);
                break;
            }
            // a job that has ended says how below
            let _ = seen.send(());
        }
        drop(seen);
        match job.join() {
            Ok(result) => Ok(result?),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

/// Denoises an EXR file into another, as the command `linpred denoise` does; `options` may be NULL. The output
/// appears whole or not at all. After LINPRED_OK linpred_message() has the warnings about the input, a line each, or
/// "no error". Paths are the system's bytes, on Windows UTF-8.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; paths are NULL or end with a zero; `options` is NULL or can
/// be read over its size, and its lists over their counts.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_denoise_file(
    denoiser: *mut linpred_denoiser,
    input: *const c_char,
    output: *const c_char,
    options: *const linpred_file_options,
) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            denoiser.check_idle()?;
            let settings = denoiser.settings;
            let request = request(
                settings.memory_limit,
                settings.options,
                input,
                output,
                options,
            )?;
            self::denoise(denoiser, &request)
        })
    }
}

/// Makes the map of samples of an EXR file into another, as the command `linpred sample-map` does: its channel
/// "samples" says how many more each pixel should get. The file states how many samples its pixels have, or
/// `samples_per_pixel` of the options does, which have no layers for a map; `options` and `summary` may be NULL. The
/// output appears whole or not at all. After LINPRED_OK linpred_message() has the warnings about the input, a line
/// each, or "no error". Paths are the system's bytes, on Windows UTF-8.
///
/// # Safety
/// `denoiser` is NULL, or of linpred_new() and not freed; paths are NULL or end with a zero; `goal`, `options` and
/// `summary` are NULL or can be read, `summary` also written, over their sizes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn linpred_sample_map_file(
    denoiser: *mut linpred_denoiser,
    input: *const c_char,
    output: *const c_char,
    goal: *const linpred_sample_goal,
    options: *const linpred_file_options,
    summary: *mut linpred_sample_summary,
) -> linpred_status {
    // SAFETY: the caller's promise
    unsafe {
        call(denoiser, |denoiser| {
            denoiser.check_idle()?;
            let (limit, compute) = (
                denoiser.settings.memory_limit,
                denoiser.settings.for_sampling,
            );
            let request = request(limit, compute, input, output, options)?;
            let goal = versioned::read(goal)?.goal()?;
            let told = Told::new(summary)?;
            told.tell(sample_map(denoiser, &request, goal)?)
        })
    }
}
