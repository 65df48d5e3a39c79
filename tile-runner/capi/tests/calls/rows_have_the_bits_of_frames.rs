//! Rows that are asked for by functions, or wanted in a loop, give the bits of the whole image; and a run ends when the caller wants.

use std::ffi::c_void;
use std::ptr::null_mut;

use linpred_c::linpred_status::*;
use linpred_c::*;

use crate::host::{
    FLOAT, FLOAT3, HEIGHT, Host, WIDTH, bits, layout, no_functions, no_step, pixels,
};

/// What rows are made of and what becomes of them.
struct Rows {
    /// Pixels of colour, variance, albedo, two layers, of three numbers; depth, its variance, alpha, a scalar, of one; a further feature of three and another of one
    /// with its variance.
    images: [Vec<f32>; 12],
    /// Colour, error, layers, alpha, scalar of the denoised rows.
    denoised: Vec<Vec<f32>>,
    /// The row at which a function fails.
    fails_at: usize,
}

fn rows() -> Rows {
    let numbers = [3, 3, 3, 3, 3, 1, 1, 1, 1, 3, 1, 1];
    let mut images: [Vec<f32>; 12] = std::array::from_fn(|n| pixels(n + 1, numbers[n]));
    // not known
    images[1][100] = -1.0;
    images[6][200] = -1.0;
    images[11][300] = -1.0;
    Rows {
        images,
        denoised: vec![Vec::new(); 5],
        fails_at: usize::MAX,
    }
}

fn full_layout() -> linpred_layout {
    linpred_layout {
        variance: linpred_variance::LINPRED_VARIANCE_OF_MEAN as i32,
        albedo: linpred_feature::LINPRED_FEATURE_PRESENT as i32,
        depth: linpred_feature::LINPRED_FEATURE_WITH_VARIANCE as i32,
        alpha: 1,
        layers: 2,
        scalars: 1,
        further: [3, 1, 0, 0, 0, 0],
        further_with_variance: 0b10,
        ..layout()
    }
}

unsafe extern "C" fn read_row(user: *mut c_void, row: *const linpred_input_row) -> i32 {
    // SAFETY: the library lends a row, and the test its `Rows`
    let (rows, row) = unsafe { (&*user.cast::<Rows>(), &*row) };
    assert_eq!(
        (row.struct_size, row.width),
        (size_of::<linpred_input_row>(), WIDTH)
    );
    let absent = row
        .normal
        .iter()
        .chain(&row.normal_variance)
        .chain(&row.albedo_variance);
    assert!(absent.into_iter().all(|plane| plane.is_null()));
    // SAFETY: as the layout says
    let (layers, scalar) = unsafe { (std::slice::from_raw_parts(row.layers, 6), *row.scalars) };
    // SAFETY: as the layout says
    let (further, noise) = unsafe {
        let noise = std::slice::from_raw_parts(row.further_variance, 4);
        (std::slice::from_raw_parts(row.further, 4), noise)
    };
    assert!(noise[..3].iter().all(|plane| plane.is_null()));
    let planes = row
        .colour
        .iter()
        .chain(&row.variance)
        .chain(&row.albedo)
        .chain(layers);
    let planes = planes.chain([&row.depth, &row.depth_variance, &row.alpha, &scalar]);
    let planes = planes.chain(further).chain(&noise[3..]);
    let sources = rows.images.iter().flat_map(|image| {
        let numbers = image.len() / (WIDTH * HEIGHT);
        (0..numbers).map(move |channel| {
            image[numbers * WIDTH * row.y..]
                .iter()
                .skip(channel)
                .step_by(numbers)
        })
    });
    for (plane, source) in planes.zip(sources) {
        for (x, value) in source.take(WIDTH).enumerate() {
            // SAFETY: it has `width` floats
            unsafe { plane.add(x).write(*value) };
        }
    }
    if row.y == rows.fails_at { 77 } else { 0 }
}

unsafe extern "C" fn write_row(user: *mut c_void, row: *const linpred_output_row) -> i32 {
    // SAFETY: the library lends a row, and the test its `Rows`
    let (rows, row) = unsafe { (&mut *user.cast::<Rows>(), &*row) };
    // SAFETY: as the layout says
    let (layers, scalar) = unsafe { (std::slice::from_raw_parts(row.layers, 6), *row.scalars) };
    let kept = [
        &row.colour[..],
        &[row.error],
        layers,
        &[row.alpha],
        &[scalar],
    ];
    assert_eq!(row.y, rows.denoised[1].len() / WIDTH);
    for (planes, image) in kept.into_iter().zip(&mut rows.denoised) {
        for x in 0..WIDTH {
            // SAFETY: they have `width` floats
            image.extend(planes.iter().map(|plane| unsafe { *plane.add(x) }));
        }
    }
    0
}

fn functions(rows: &mut Rows) -> linpred_row_functions {
    linpred_row_functions {
        user: (&raw mut *rows).cast(),
        read_row: Some(read_row),
        write_row: Some(write_row),
        ..no_functions()
    }
}

/// The same of whole images.
fn of_images() -> Vec<Vec<f32>> {
    let (host, rows) = (Host::new(), rows());
    let inputs = [
        "colour",
        "variance",
        "albedo",
        "layer.a",
        "layer.b",
        "depth",
        "depth_variance",
        "alpha",
        "scalar.s",
        "feature.position",
        "feature.rough",
        "feature_variance.rough",
    ];
    for (name, image) in inputs.iter().zip(&rows.images) {
        let format = if image.len() == WIDTH * HEIGHT {
            FLOAT
        } else {
            FLOAT3
        };
        host.image(name, image, format).ok();
    }
    let outputs = ["colour", "error", "layer.a", "layer.b", "alpha", "scalar.s"];
    let mut images = [3, 1, 3, 3, 1, 1].map(|numbers| vec![0.0; WIDTH * HEIGHT * numbers]);
    for (name, image) in outputs.iter().zip(&mut images) {
        let format = if image.len() == WIDTH * HEIGHT {
            FLOAT
        } else {
            FLOAT3
        };
        host.output(name, image, format).ok();
    }
    host.execute().ok();
    let [colour, error, a, b, alpha, scalar] = images;
    let pairs = a.chunks_exact(3).zip(b.chunks_exact(3));
    let layers = pairs
        .flat_map(|(a, b)| a.iter().chain(b).copied())
        .collect();
    vec![colour, error, layers, alpha, scalar]
}

fn agree(denoised: &[Vec<f32>], wanted: &[Vec<f32>]) {
    for ((name, is), should) in ["colour", "error", "layers", "alpha", "scalar"]
        .iter()
        .zip(denoised)
        .zip(wanted)
    {
        assert!(bits(is) == bits(should), "{name}");
    }
}

#[test]
fn by_functions_and_in_a_loop() {
    let wanted = of_images();
    let host = Host::new();
    let mut called = rows();
    host.run_rows(&full_layout(), &functions(&mut called)).ok();
    agree(&called.denoised, &wanted);
    let models = host.report().1.models;

    let (mut looped, mut step) = (rows(), no_step());
    let user: *mut c_void = (&raw mut looped).cast();
    host.start_rows(&full_layout()).ok();
    loop {
        assert_eq!(host.next(&mut step), LINPRED_OK);
        // SAFETY: the step lends a row, and `looped` is used by nobody else
        let code = unsafe {
            match step.kind {
                0 => break,
                1 => read_row(user, step.wanted),
                _ => write_row(user, step.denoised),
            }
        };
        assert_eq!(code, 0);
    }
    agree(&looped.denoised, &wanted);
    assert_eq!(host.report().1.models, models);
    host.next_told()
        .fails(LINPRED_ERROR_OPERATION, "or it has ended");
}

#[test]
fn a_function_that_fails_ends_the_run() {
    let host = Host::new();
    let mut rows = rows();
    rows.fails_at = 5;
    let told = host.run_rows(&full_layout(), &functions(&mut rows));
    told.fails(LINPRED_ERROR_CALLBACK, "read_row returned 77 for row 5");
    rows.fails_at = usize::MAX;
    host.run_rows(&full_layout(), &functions(&mut rows)).ok();
}

#[test]
fn a_loop_may_stop_anywhere() {
    for steps in [0, 1, HEIGHT + 1] {
        let host = Host::new();
        host.start_rows(&layout()).ok();
        for _ in 0..steps {
            // left as it is: what a row holds before is left over, or zero
            assert_eq!(host.next(&mut no_step()), LINPRED_OK);
        }
        if steps == 1 {
            host.stop_rows().ok();
            host.progress(None, null_mut()).ok();
        }
    }
}
