//! A map of samples has the bits that the library makes of the same numbers, wherever it lies; and what is asked for wrongly is told.

use std::ffi::c_void;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::ptr::{null, null_mut};

use linpred::image::{Frame, Interleaved};
use linpred::sampling::{Goal, Scratch, Summary, measure};
use linpred::{Feature, ImageSize, Options};
use linpred_c::linpred_status::*;
use linpred_c::{linpred_sample_map, linpred_sample_summary};

use crate::host::{
    At, FLOAT, FLOAT3, HALF3, HEIGHT, Host, Told, WIDTH, goal, layout, no_summary, pixels,
};

const SIZE: (usize, usize) = (WIDTH, HEIGHT);
const PIXELS: usize = WIDTH * HEIGHT;

/// Pixels of a colour, its variance, an albedo and a number of samples.
struct Scene {
    colour: Vec<f32>,
    variance: Vec<f32>,
    albedo: Vec<f32>,
    samples: Vec<f32>,
}

/// The right half is noisy; one pixel has a single sample, and one none.
fn scene() -> Scene {
    let noise = pixels(2, 3);
    let is_noisy = |n: usize| n / 3 % WIDTH > WIDTH / 2;
    let variance = noise.iter().enumerate();
    let mut samples: Vec<f32> = (0..PIXELS).map(|n| (2 + n % 7) as f32).collect();
    (samples[100], samples[200]) = (1.0, 0.0);
    Scene {
        colour: pixels(1, 3),
        variance: variance
            .map(|(n, noise)| if is_noisy(n) { *noise } else { 0.001 })
            .collect(),
        albedo: pixels(3, 3),
        samples,
    }
}

impl Scene {
    fn host(&self) -> Host {
        let host = Host::new();
        host.image("colour", &self.colour, FLOAT3).ok();
        host.image("variance", &self.variance, FLOAT3).ok();
        host.image("albedo", &self.albedo, FLOAT3).ok();
        host.image("samples", &self.samples, FLOAT).ok();
        host
    }

    /// What the library makes of it.
    fn by_the_library(&self, goal: Goal) -> (Vec<u32>, Summary) {
        let size = ImageSize::new(WIDTH, HEIGHT).unwrap();
        let three = |values| Interleaved::<3>::new(size, <[f32]>::as_chunks(values).0).unwrap();
        let samples = Interleaved::<1>::new(size, self.samples.as_chunks().0).unwrap();
        let mut frame = Frame::new(three(&self.colour))
            .and_then(|frame| frame.with_variance(three(&self.variance)))
            .and_then(|frame| frame.with_feature(Feature::Albedo, three(&self.albedo)))
            .and_then(|frame| frame.with_samples(samples))
            .unwrap();
        let options = Options::for_sampling().with_threads(NonZeroUsize::MIN);
        let go_on = &mut |_| ControlFlow::Continue(());
        let mut measured = measure(&mut frame, &options, &Scratch::Memory, go_on).unwrap();
        let mut map = measured.plan(goal).unwrap();
        let mut samples = vec![0; PIXELS];
        for (y, row) in samples.chunks_exact_mut(WIDTH).enumerate() {
            map.read_row(y, row).unwrap();
        }
        (samples, map.summary())
    }
}

fn same(is: &linpred_sample_summary, should: Summary) {
    let whole = (is.pixels, is.samples, is.added, is.most);
    let Summary {
        pixels,
        samples,
        added,
        most,
        ..
    } = should;
    assert_eq!(whole, (pixels, samples, added, most));
    let errors = (is.error.to_bits(), is.error_then.to_bits());
    assert_eq!(
        errors,
        (should.error.to_bits(), should.error_then.to_bits())
    );
}

#[test]
fn a_budget_is_spent_to_the_last_sample_as_by_the_library() {
    let scene = scene();
    let (wanted, should) = scene.by_the_library(Goal::budget(2.5).unwrap());
    let (host, mut map) = (scene.host(), vec![u32::MAX; PIXELS]);
    // the defaults are those for maps, and what else is denoised plays no part
    host.options(|_| {}).ok();
    host.image("layer.direct", &scene.albedo, FLOAT3).ok();
    let (told, summary) = host.sample_map(&goal(2.5, 0.0), &mut map);
    told.ok();
    assert!(map == wanted);
    same(&summary, should);
    let sum: u64 = map.iter().map(|more| u64::from(*more)).sum();
    assert_eq!(sum, (2.5 * PIXELS as f64).round() as u64);
    assert_eq!(summary.added, sum);
    host.report()
        .0
        .fails(LINPRED_ERROR_OPERATION, "no run of this denoiser");
}

#[test]
fn a_target_takes_what_it_takes_and_nothing_once_it_is_met() {
    let scene = scene();
    let (host, mut map) = (scene.host(), vec![0; PIXELS]);
    let (told, now) = host.sample_map(&goal(1.0, 0.0), &mut map);
    told.ok();
    let (told, summary) = host.sample_map(&goal(0.0, now.error / 2.0), &mut map);
    told.ok();
    let (wanted, should) = scene.by_the_library(Goal::error(now.error / 2.0).unwrap());
    assert!(map == wanted);
    same(&summary, should);
    assert!(summary.error_then < 0.51 * now.error && summary.added > 0);
    // both: no more than the budget
    let (told, both) = host.sample_map(&goal(0.25, now.error / 2.0), &mut map);
    told.ok();
    assert_eq!(both.added, (0.25 * PIXELS as f64).round() as u64);

    let (told, met) = host.sample_map(&goal(8.0, 2.0 * now.error), &mut map);
    told.ok();
    assert_eq!((met.added, met.most), (0, 0));
    assert!(map == vec![0; PIXELS]);
}

#[test]
fn options_say_how_it_is_denoised() {
    let scene = scene();
    let (host, mut fast, mut high) = (scene.host(), vec![0; PIXELS], vec![0; PIXELS]);
    host.sample_map(&goal(8.0, 0.0), &mut fast).0.ok();
    host.options(|options| options.quality = 6).ok();
    host.sample_map(&goal(8.0, 0.0), &mut high).0.ok();
    assert!(fast != high);
}

/// A pixel of a renderer's own, of which nothing but `more` is to be written.
#[derive(Clone, Copy, PartialEq)]
#[repr(C, packed)]
struct Pixel {
    before: u8,
    more: u32,
    behind: u16,
}

#[test]
fn it_lies_anywhere_and_nothing_else_is_written() {
    let mut scene = scene();
    let (wanted, _) = scene.by_the_library(Goal::budget(3.0).unwrap());
    let blank = Pixel {
        before: 0xEE,
        more: 0xEEEE_EEEE,
        behind: 0xEEEE,
    };
    let (host, mut map) = (scene.host(), vec![blank; (WIDTH + 2) * HEIGHT]);
    let at = At {
        byte_offset: 1,
        pixel_stride: size_of::<Pixel>(),
        row_stride: size_of::<Pixel>() * (WIDTH + 2),
    };
    let mut summary = no_summary();
    host.sample_map_to(
        &goal(3.0, 0.0),
        map.as_mut_ptr().cast(),
        SIZE,
        at,
        &mut summary,
    )
    .ok();
    let mut should = vec![blank; map.len()];
    for (n, more) in wanted.iter().enumerate() {
        should[n / WIDTH * (WIDTH + 2) + n % WIDTH].more = *more;
    }
    assert!(map == should);

    // in the place of what is read
    let in_place = scene.samples.as_mut_ptr().cast();
    host.sample_map_to(&goal(3.0, 0.0), in_place, SIZE, At::default(), null_mut())
        .ok();
    let map: Vec<u32> = scene.samples.iter().map(|value| value.to_bits()).collect();
    assert!(map == wanted);
}

#[test]
fn what_is_missing_or_out_of_range() {
    let scene = scene();
    let (host, untouched) = (scene.host(), vec![7; PIXELS]);
    let mut map = untouched.clone();
    let mut bad = |host: &Host, budget: f64, error: f64, words: &str| {
        let (told, _) = host.sample_map(&goal(budget, error), &mut map);
        told.fails(LINPRED_ERROR_ARGUMENT, words);
        assert!(map == untouched);
    };
    bad(
        &host,
        0.0,
        0.0,
        "a map needs a budget, a target error, or both",
    );
    bad(&host, -1.0, 0.0, "a budget of -1 samples per pixel");
    bad(&host, 2e7, 0.0, "16777216 or less");
    bad(&host, f64::NAN, 0.0, "a budget of NaN");
    bad(&host, 8.0, f64::INFINITY, "a target error of inf");
    bad(&host, 0.0, -0.5, "a target error of -0.5");
    host.set(
        "samples",
        scene.samples.as_ptr().cast(),
        FLOAT,
        (WIDTH, HEIGHT - 1),
        At::default(),
    )
    .ok();
    bad(
        &host,
        8.0,
        0.0,
        "samples: 41 x 29 pixels, but the colour has 41 x 30",
    );
    host.unset_image("samples");
    bad(&host, 8.0, 0.0, "no image \"samples\" is set");
    host.unset_image("colour");
    bad(&host, 8.0, 0.0, "no image \"colour\" is set");
    host.image("samples", &scene.colour, FLOAT3).fails(
        LINPRED_ERROR_ARGUMENT,
        "samples: a format of 3 channels, not 1",
    );
    host.image("samples", &scene.colour, HALF3)
        .fails(LINPRED_ERROR_ARGUMENT, "samples");
}

#[test]
fn places_and_structs_that_cannot_be() {
    let scene = scene();
    let (host, mut map) = (scene.host(), vec![7_u32; PIXELS]);
    let place = map.as_mut_ptr();
    let bad = |place: *mut u32, size: (usize, usize), at: At, words: &str| {
        host.sample_map_to(&goal(8.0, 0.0), place, size, at, null_mut())
            .fails(LINPRED_ERROR_ARGUMENT, words);
    };
    bad(null_mut(), SIZE, At::default(), "the map: the data is NULL");
    bad(
        place,
        (WIDTH, HEIGHT - 1),
        At::default(),
        "the map has 41 x 29 pixels, the image \"colour\" 41 x 30",
    );
    bad(
        place,
        (0, HEIGHT),
        At::default(),
        "the map: 0 x 30 pixels are no image",
    );
    let rows = |row_stride| At {
        row_stride,
        ..At::default()
    };
    bad(
        place,
        SIZE,
        rows(4 * WIDTH - 1),
        "the map: a row stride of 163 bytes is less than a row has, which is 164",
    );
    bad(place, SIZE, rows(usize::MAX / 2), "do not fit into memory");
    let narrow = At {
        pixel_stride: 3,
        ..At::default()
    };
    bad(
        place,
        SIZE,
        narrow,
        "the map: a pixel stride of 3 bytes is less than a pixel has, which is 4",
    );
    // SAFETY: NULL is told
    let no_goal =
        unsafe { linpred_sample_map(host.0, null(), place, WIDTH, HEIGHT, 0, 0, 0, null_mut()) };
    assert_eq!(no_goal, LINPRED_ERROR_ARGUMENT);
    let mut unsized_goal = goal(8.0, 0.0);
    unsized_goal.struct_size = 0;
    let mut unsized_summary = no_summary();
    unsized_summary.struct_size = 0;
    host.sample_map_to(&unsized_goal, place, SIZE, At::default(), null_mut())
        .fails(
            LINPRED_ERROR_ARGUMENT,
            "struct_size of a linpred_sample_goal is 0",
        );
    let summary = &raw mut unsized_summary;
    host.sample_map_to(&goal(8.0, 0.0), place, SIZE, At::default(), summary)
        .fails(
            LINPRED_ERROR_ARGUMENT,
            "struct_size of a linpred_sample_summary is 0",
        );
    assert!(map == vec![7; PIXELS]);
}

#[test]
fn memory_that_grows_with_the_image() {
    let scene = scene();
    let (host, mut map) = (scene.host(), vec![0; PIXELS]);
    host.options(|options| options.memory_limit = 1 << 20).ok();
    host.sample_map(&goal(8.0, 0.0), &mut map)
        .0
        .fails(LINPRED_ERROR_MEMORY, "the limit is 1.0 MiB");

    // rows take little here, and what is put aside more than twice the limit
    let (host, tall) = (Host::new(), (16, 1 << 17));
    let black = vec![0.0_f32; 3 * tall.0 * tall.1];
    let data = black.as_ptr().cast();
    host.set("colour", data, FLOAT3, tall, At::default()).ok();
    host.set("samples", data, FLOAT, tall, At::default()).ok();
    host.options(|options| options.memory_limit = 64 << 20).ok();
    let mut map = vec![0; tall.0 * tall.1];
    let place = map.as_mut_ptr();
    host.sample_map_to(&goal(8.0, 0.0), place, tall, At::default(), null_mut())
        .fails(
            LINPRED_ERROR_MEMORY,
            "most of it is what is put aside of every pixel: 144.0 MiB",
        );
}

#[test]
fn another_run_that_has_not_ended() {
    let scene = scene();
    let (host, mut map) = (scene.host(), vec![0; PIXELS]);
    host.start_rows(&layout()).ok();
    host.sample_map(&goal(8.0, 0.0), &mut map)
        .0
        .fails(LINPRED_ERROR_OPERATION, "gives it up");
    host.stop_rows().ok();
    assert!(map == vec![0; PIXELS]);
}

/// How far runs were.
#[derive(Default)]
struct Seen(Vec<(usize, usize)>);

unsafe extern "C" fn sees(user: *mut c_void, rows: usize, of: usize) -> bool {
    // SAFETY: the test lends it
    let seen = unsafe { &mut *user.cast::<Seen>() };
    seen.0.push((rows, of));
    true
}

unsafe extern "C" fn stops_at_the_last(_user: *mut c_void, rows: usize, of: usize) -> bool {
    rows < of
}

#[test]
fn progress_counts_what_is_denoised_and_can_stop_it() {
    let scene = scene();
    let (host, mut map, mut seen) = (scene.host(), vec![7; PIXELS], Seen::default());
    host.progress(Some(stops_at_the_last), null_mut()).ok();
    let (told, _) = host.sample_map(&goal(8.0, 0.0), &mut map);
    told.fails(LINPRED_ERROR_CANCELLED, "stopped before the end");
    assert!(map == vec![7; PIXELS]);

    host.progress(Some(sees), (&raw mut seen).cast()).ok();
    host.sample_map(&goal(8.0, 0.0), &mut map).0.ok();
    let rows = |of: usize| (1..=of).map(|rows| (rows, of)).collect::<Vec<_>>();
    assert_eq!(seen.0, rows(2 * HEIGHT));
    // without a variance it is denoised once
    seen.0.clear();
    host.unset_image("variance");
    host.sample_map(&goal(8.0, 0.0), &mut map).0.ok();
    assert_eq!(seen.0, rows(HEIGHT));
    host.progress(None, null_mut()).ok();
}

#[test]
fn a_handle_that_was_never_made() {
    let mut map = vec![0; PIXELS];
    let host = Host(null_mut());
    let (told, _) = host.sample_map(&goal(8.0, 0.0), &mut map);
    let words = "the denoiser is NULL: never made, or freed";
    assert_eq!(told, Told(LINPRED_ERROR_HANDLE, words.into()));
}
