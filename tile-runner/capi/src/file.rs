//! EXR files.

use std::ffi::c_char;
use std::path::PathBuf;
use std::ptr::null;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;

use linpred::Report;
use linpred::image::ExtraLayers;
use linpred::job::{self, Input, InputRequest, JobOptions, Remark, Summary};

use crate::handle::{Denoiser, call, linpred_denoiser};
use crate::report::Done;
use crate::status::{Failure, linpred_status};
use crate::text::path;
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
}

// SAFETY: the size first, then a pointer and numbers
unsafe impl Versioned for linpred_file_options {
    const NAME: &'static str = "linpred_file_options";
}

/// What a call asks for.
struct Request {
    input: InputRequest,
    output: PathBuf,
    options: JobOptions,
}

/// # Safety
/// The paths and that of the options are NULL or end with a zero; `options` is NULL or can be read over its size.
unsafe fn request(
    denoiser: &Denoiser,
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
        },
        // SAFETY: the caller's promise
        false => unsafe { versioned::read(options) }?,
    };
    let other_half = match given.other_half.is_null() {
        true => None,
        // SAFETY: the caller's promise
        false => Some(unsafe { path("other_half", given.other_half) }?),
    };
    let limit = denoiser.settings.memory_limit;
    Ok(Request {
        input: InputRequest::new(input)
            .with_other_half(other_half)
            .with_memory_limit(Some(limit)),
        output,
        options: JobOptions::new(denoiser.settings.options)
            .with_memory_limit(limit)
            .with_extra(ExtraLayers {
                error: flag("error_layer", given.error_layer)?,
                models: flag("models_layer", given.models_layer)?,
            }),
    })
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
    denoiser.check_idle()?;
    let pictures = Input::open_all(&request.input)?;
    let remarks = job::remarks(&pictures, request.options.extra)?.into_iter();
    let warnings = remarks.filter_map(|remark| match remark {
        Remark::Warning(warning) => Some(warning),
        Remark::Note(_) => None,
    });
    let notes = warnings.collect::<Vec<_>>().join("\n");
    let summary = run(denoiser, &pictures, request)?;
    let mut report = Report::default();
    for picture in &summary.reports {
        report.add(picture);
    }
    denoiser.done = Done::new(report, summary.clamped);
    denoiser.notes = notes;
    Ok(())
}

/// Runs the job in another thread, since it tells of its progress in any, and the caller's function is to be called in the caller's. The job waits for
/// what that says: however small the image, a stop comes before the next row.
fn run(denoiser: &Denoiser, pictures: &[Input], request: &Request) -> Result<Summary, Failure> {
    let height = pictures.first().map_or(0, Input::height);
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
            let (output, options) = (&request.output, &request.options);
            job::denoise(pictures, output, options, to_stop, &mut progress)
        };
        let job = std::thread::Builder::new()
            .spawn_scoped(scope, job)
            .map_err(|error| {
                let message = format!("can't start a thread: {error}");
                Failure::new(linpred_status::LINPRED_ERROR_MEMORY, message)
            })?;
        for rows in rows {
            if denoiser.progress.tell(rows, height).is_break() {
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
/// be read over its size.
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
            let request = request(denoiser, input, output, options)?;
            self::denoise(denoiser, &request)
        })
    }
}
