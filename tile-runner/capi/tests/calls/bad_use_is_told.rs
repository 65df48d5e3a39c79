//! Whatever is asked for wrongly ends in a code with a sentence that says what is wrong.

use std::ffi::{CStr, c_void};
use std::ptr::{null, null_mut};

use linpred_c::linpred_status::*;
use linpred_c::*;

use crate::host::{
    At, FLOAT, FLOAT3, FLOAT4, HEIGHT, Host, Told, WIDTH, layout, no_functions, pixels,
};

const SIZE: (usize, usize) = (WIDTH, HEIGHT);

#[test]
fn null_and_freed_handles() {
    let mut host = Host::new();
    // SAFETY: of `linpred_new`
    assert_eq!(unsafe { linpred_free(&raw mut host.0) }, LINPRED_OK);
    assert!(host.0.is_null());
    let told = "the denoiser is NULL: never made, or freed";
    let data = pixels(1, 3);
    for call in [
        host.execute(),
        host.image("colour", &data, FLOAT3),
        host.options(|_| {}),
        host.start_rows(&layout()),
        host.run_rows(&layout(), &no_functions()),
        host.next_told(),
        host.stop_rows(),
        host.progress(None, null_mut()),
        host.report().0,
    ] {
        assert_eq!(call, Told(LINPRED_ERROR_HANDLE, told.into()));
    }
    // SAFETY: NULL, and a pointer to NULL
    let freed = unsafe { (linpred_free(null_mut()), linpred_free(&raw mut host.0)) };
    assert_eq!(freed, (LINPRED_ERROR_HANDLE, LINPRED_ERROR_HANDLE));
}

#[test]
fn names_and_places_of_images() {
    let host = Host::new();
    let mut data = pixels(1, 4);
    let (read, write): (*const c_void, *mut c_void) =
        (data.as_ptr().cast(), data.as_mut_ptr().cast());
    let bad = |told: Told, words: &str| told.fails(LINPRED_ERROR_ARGUMENT, words);
    bad(
        host.set("beauty", read, FLOAT3, SIZE, At::default()),
        "no image is called \"beauty\"",
    );
    bad(
        host.set_output("normal", write, FLOAT3, SIZE, At::default()),
        "no output is called \"normal\"",
    );
    bad(
        host.set("colour", null(), FLOAT3, SIZE, At::default()),
        "colour: the data is NULL",
    );
    bad(
        host.set("colour", read, 2, SIZE, At::default()),
        "colour: the format 2 is none of linpred_format",
    );
    bad(
        host.set("colour", read, FLOAT, SIZE, At::default()),
        "colour: a format of 1 channels, not 3",
    );
    bad(
        host.set("depth", read, FLOAT4, SIZE, At::default()),
        "depth: a format of 3 channels, not 1",
    );
    bad(
        host.set("colour", read, FLOAT3, (0, HEIGHT), At::default()),
        "colour: 0 x 30 pixels are no image",
    );
    bad(
        host.set("colour", read, FLOAT3, (WIDTH, usize::MAX), At::default()),
        "pixels are no image",
    );
    let far = At {
        row_stride: usize::MAX / 2,
        ..At::default()
    };
    bad(
        host.set("colour", read, FLOAT3, SIZE, far),
        "do not fit into memory",
    );
    let narrow = At {
        pixel_stride: 8,
        ..At::default()
    };
    bad(
        host.set("colour", read, FLOAT3, SIZE, narrow),
        "a pixel stride of 8 bytes is less than a pixel has",
    );
    // SAFETY: NULL and not UTF-8, which is allowed to be said
    let (null_name, no_utf8) = unsafe {
        let set = |name| linpred_set_image(host.0, name, read, FLOAT3, WIDTH, HEIGHT, 0, 0, 0);
        (set(null()), set(c"\xFF".as_ptr()))
    };
    assert_eq!(
        (null_name, no_utf8),
        (LINPRED_ERROR_ARGUMENT, LINPRED_ERROR_ARGUMENT)
    );
    host.execute()
        .fails(LINPRED_ERROR_ARGUMENT, "no image \"colour\" is set");
}

#[test]
fn images_that_do_not_belong_together() {
    let host = Host::new();
    let (colour, mut clean) = (pixels(1, 3), pixels(2, 3));
    let read = colour.as_ptr().cast();
    let executes = |words: &str| host.execute().fails(LINPRED_ERROR_ARGUMENT, words);
    host.image("colour", &colour, FLOAT3).ok();
    executes("no output is set");
    host.output("colour", &mut clean, FLOAT3).ok();
    host.set("normal", read, FLOAT3, (WIDTH, HEIGHT - 1), At::default())
        .ok();
    executes("normal: 41 x 29 pixels, but the colour has 41 x 30");
    host.unset_image("normal");
    host.image("half_a", &colour, FLOAT3).ok();
    executes("neither the first alone nor the other two");
    host.unset_image("half_a");
    host.image("depth_variance", &colour, FLOAT).ok();
    executes("\"depth_variance\" is set, but no \"depth\"");
    host.unset_image("depth_variance");
    host.output("layer.direct", &mut clean, FLOAT3).ok();
    executes("the output \"layer.direct\" needs the image \"layer.direct\", which is not set");
    host.unset_output("layer.direct");
    host.set_output(
        "error",
        clean.as_mut_ptr().cast(),
        FLOAT,
        (WIDTH - 1, HEIGHT),
        At::default(),
    )
    .ok();
    executes("the output \"error\" has 40 x 30 pixels, the image \"colour\" 41 x 30");
    host.output("error", &mut clean, FLOAT).ok();
    executes("the outputs \"colour\" and \"error\" begin at the same place");
    host.unset_output("error");
    host.report().0.fails(
        LINPRED_ERROR_OPERATION,
        "no run of this denoiser has come to its end",
    );
}

#[test]
fn options_and_layouts() {
    let host = Host::new();
    let bad = |told: Told, words: &str| told.fails(LINPRED_ERROR_ARGUMENT, words);
    bad(
        host.options(|options| options.quality = 1),
        "quality is 1, none of linpred_quality",
    );
    bad(
        host.options(|options| options.formulas = -1),
        "formulas is -1, none of linpred_formulas",
    );
    bad(
        host.options(|options| options.coverage = 65536),
        "coverage is 65536, and at most 65535",
    );
    bad(
        host.options(|options| options.struct_size = 0),
        "struct_size of a linpred_options is 0",
    );
    type Change = fn(&mut linpred_layout);
    let layouts: [(Change, &str); 8] = [
        (|layout| layout.width = 0, "0 x 30 pixels are no image"),
        (|layout| layout.height = usize::MAX, "pixels are no image"),
        (
            |layout| layout.variance = 3,
            "variance is 3, none of linpred_variance",
        ),
        (
            |layout| layout.albedo = -1,
            "albedo is -1, none of linpred_feature",
        ),
        (|layout| layout.alpha = 2, "alpha is 2, neither 0 nor 1"),
        (
            |layout| layout.layers = u32::MAX,
            "4294967295 layers, and 1024 at most",
        ),
        (
            |layout| layout.scalars = 1025,
            "1025 scalars, and 1024 at most",
        ),
        (
            |layout| layout.struct_size = 5000,
            "struct_size of a linpred_layout is 5000",
        ),
    ];
    for (change, words) in layouts {
        let mut layout = layout();
        change(&mut layout);
        bad(host.start_rows(&layout), words);
        bad(host.run_rows(&layout, &no_functions()), words);
    }
    bad(
        host.run_rows(&layout(), &no_functions()),
        "read_row of linpred_row_functions is NULL",
    );
}

#[test]
fn memory_that_a_run_may_not_take() {
    let host = Host::new();
    let wide = linpred_layout {
        width: i32::MAX as usize,
        ..layout()
    };
    host.start_rows(&wide).fails(
        LINPRED_ERROR_MEMORY,
        "the limit is 2048.0 MiB; most of it is rows of 2147483647 pixels",
    );
    let many = linpred_layout {
        width: 100_000,
        layers: 1024,
        scalars: 1024,
        ..layout()
    };
    host.start_rows(&many)
        .fails(LINPRED_ERROR_MEMORY, "the limit is");
    host.options(|options| options.threads = u32::MAX).ok();
    host.start_rows(&layout())
        .fails(LINPRED_ERROR_MEMORY, "on 4294967295 threads");
    host.options(|options| options.memory_limit = 1 << 20).ok();
    let (colour, mut clean) = (pixels(1, 3), pixels(2, 3));
    host.image("colour", &colour, FLOAT3).ok();
    host.output("colour", &mut clean, FLOAT3).ok();
    host.execute()
        .fails(LINPRED_ERROR_MEMORY, "the limit is 1.0 MiB");
    host.options(|options| (options.threads, options.memory_limit) = (1, u64::MAX))
        .ok();
    // more than any address space
    let endless = linpred_layout {
        width: i32::MAX as usize,
        ..many
    };
    host.start_rows(&endless)
        .fails(LINPRED_ERROR_MEMORY, "the system does not give");
}

#[test]
fn further_features_that_are_none() {
    let host = Host::new();
    for (further, further_with_variance, told) in [
        (
            [3, 3, 1, 0, 0, 0],
            0,
            "further features of 7 channels: there is room for 6",
        ),
        (
            [4, 0, 0, 0, 0, 0],
            0,
            "a feature of 4 channels: one has 1 to 3",
        ),
        ([1, 0, 1, 0, 0, 0], 0, "behind one of 0 channels"),
        (
            [1, 1, 0, 0, 0, 0],
            4,
            "further_with_variance is 4, but further has 2 features",
        ),
    ] {
        let refused = linpred_layout {
            further,
            further_with_variance,
            ..layout()
        };
        host.start_rows(&refused)
            .fails(LINPRED_ERROR_ARGUMENT, told);
    }
    let (colour, depth) = (pixels(1, 3), pixels(2, 1));
    let mut clean = pixels(3, 3);
    host.image("colour", &colour, FLOAT3).ok();
    host.output("colour", &mut clean, FLOAT3).ok();
    host.image("feature_variance.a", &depth, FLOAT).ok();
    host.execute()
        .fails(LINPRED_ERROR_ARGUMENT, "no \"feature.a\"");
    host.image("feature.a", &colour, FLOAT3).ok();
    host.execute().fails(
        LINPRED_ERROR_ARGUMENT,
        "variance of the a: 1 channels, not 3",
    );
    host.image("feature.a", &depth, FLOAT).ok();
    host.execute().ok();
    host.image("feature.depth", &depth, FLOAT).ok();
    host.execute()
        .fails(LINPRED_ERROR_ARGUMENT, "depth is a feature that is known");
}

#[test]
fn calls_out_of_turn() {
    let host = Host::new();
    host.next_told().fails(
        LINPRED_ERROR_OPERATION,
        "no run was begun by linpred_start_rows",
    );
    host.stop_rows().ok();
    host.start_rows(&layout()).ok();
    host.start_rows(&layout())
        .fails(LINPRED_ERROR_OPERATION, "linpred_stop_rows gives it up");
    host.execute()
        .fails(LINPRED_ERROR_OPERATION, "linpred_stop_rows gives it up");
    host.run_rows(&layout(), &no_functions())
        .fails(LINPRED_ERROR_OPERATION, "gives it up");
    host.stop_rows().ok();
    // SAFETY: NULL is told
    let null_step = unsafe { linpred_next_step(host.0, null_mut()) };
    assert_eq!(null_step, LINPRED_ERROR_ARGUMENT);
}

#[test]
fn codes_that_there_are_none_of() {
    for code in [-1, 5, 14, i32::MAX] {
        // SAFETY: it stays where it is
        let text = unsafe { CStr::from_ptr(linpred_status_text(code)) };
        assert_eq!(text, c"not a code of this version");
    }
}

#[test]
fn pixels_that_are_no_numbers_are_repaired_and_counted() {
    let host = Host::new();
    let mut colour = pixels(1, 3);
    colour[300] = f32::NAN;
    colour[900] = f32::INFINITY;
    let mut clean = vec![f32::NAN; colour.len()];
    host.image("colour", &colour, FLOAT3).ok();
    host.output("colour", &mut clean, FLOAT3).ok();
    host.execute().ok();
    assert!(clean.iter().all(|value| value.is_finite()));
    let (told, report) = host.report();
    told.ok();
    assert_eq!(
        (report.repaired, report.pixels),
        (2, (WIDTH * HEIGHT) as u64)
    );
}
