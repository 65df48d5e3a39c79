//! What the C interface takes beside the library: a megapixel denoised in turns through either, the ratio of each pair, and that of the shortest times,
//! which a busy machine disturbs least.
//!
//!     cargo run --release -p linpred-capi --example overhead

use std::error::Error;
use std::ffi::CStr;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use linpred::{
    Feature, ImageSize, InputRow, Options, OutputRow, Params, Quality, RowLayout, RowSource,
    VarianceKind, denoise,
};
use linpred_c::linpred_format::{LINPRED_FORMAT_FLOAT, LINPRED_FORMAT_FLOAT3};
use linpred_c::linpred_status::LINPRED_OK;
use linpred_c::*;

const SIDE: usize = 1024;
const PAIRS: usize = 15;

/// Rows that are there.
struct Rows {
    layout: RowLayout,
    rows: Vec<InputRow>,
}

impl RowSource for Rows {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), linpred::Error> {
        std::mem::swap(row, &mut self.rows[y]);
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let names = [c"colour", c"variance", c"normal", c"albedo", c"depth"];
    let numbers = [3, 3, 3, 3, 1];
    let images: Vec<Vec<f32>> = (0..)
        .zip(numbers)
        .map(|(seed, numbers)| image(seed, numbers))
        .collect();
    let mut ratios = Vec::new();
    let mut shortest = [Duration::MAX; 2];
    for _ in 0..PAIRS {
        let own = library(&images)?;
        let through_c = c_interface(&names, &images)?;
        let ratio = through_c.as_secs_f64() / own.as_secs_f64();
        println!("library {own:.2?}, C {through_c:.2?}, ratio {ratio:.3}");
        ratios.push(ratio);
        shortest = [shortest[0].min(own), shortest[1].min(through_c)];
    }
    ratios.sort_by(f64::total_cmp);
    let [own, through_c] = shortest.map(|time| time.as_secs_f64());
    println!(
        "median {:.3}, shortest {:.3}",
        ratios[PAIRS / 2],
        through_c / own
    );
    Ok(())
}

/// Numbers around 1 that look random.
fn image(seed: usize, numbers: usize) -> Vec<f32> {
    let number = |n: usize| {
        let mut n = (n as u32).wrapping_mul(0x9E37_79B9) ^ (seed as u32).wrapping_mul(0x85EB_CA6B);
        n = (n ^ (n >> 16)).wrapping_mul(0x7FEB_352D);
        0.5 + (n >> 8) as f32 / 16_777_216.0
    };
    (0..SIDE * SIDE * numbers).map(number).collect()
}

/// Rows that are there already go in, and rows come out.
fn library(images: &[Vec<f32>]) -> Result<Duration, Box<dyn Error>> {
    let size = ImageSize::new(SIDE, SIDE).ok_or("an empty image")?;
    let layout = RowLayout::new(size, VarianceKind::OfMean);
    let layout = Feature::ALL
        .into_iter()
        .fold(layout, RowLayout::with_feature);
    let rows = (0..SIDE).map(|y| {
        let mut row = InputRow::new(&layout);
        let planes = row
            .colour
            .iter_mut()
            .chain(&mut row.variance)
            .chain(&mut row.features);
        let sources = images.iter().flat_map(|image| {
            let numbers = image.len() / (SIDE * SIDE);
            let start = y * SIDE * numbers;
            (0..numbers).map(move |c| {
                image[start..][..SIDE * numbers]
                    .iter()
                    .skip(c)
                    .step_by(numbers)
            })
        });
        for (plane, source) in planes.zip(sources) {
            plane
                .iter_mut()
                .zip(source)
                .for_each(|(value, read)| *value = *read);
        }
        row
    });
    let mut source = Rows {
        layout,
        rows: rows.collect(),
    };
    let mut last = 0.0;
    let mut sink = |_: usize, row: &OutputRow| {
        last = row.colour[0][0];
        Ok(())
    };
    let options = Options::new(Params::new(Quality::Fast)).with_threads(NonZeroUsize::MIN);
    let start = Instant::now();
    denoise(&mut source, &mut sink, &options, &mut |_| {
        ControlFlow::Continue(())
    })?;
    std::hint::black_box(last);
    Ok(start.elapsed())
}

/// The same from a caller's memory into a caller's memory.
fn c_interface(names: &[&CStr], images: &[Vec<f32>]) -> Result<Duration, Box<dyn Error>> {
    let options = linpred_options {
        struct_size: size_of::<linpred_options>(),
        quality: linpred_quality::LINPRED_QUALITY_FAST as i32,
        formulas: 0,
        coverage: 0,
        threads: 1,
        memory_limit: 0,
    };
    let mut clean = vec![0.0_f32; SIDE * SIDE * 3];
    let mut denoiser = linpred_new();
    let format = |image: &[f32]| match image.len() == SIDE * SIDE {
        true => LINPRED_FORMAT_FLOAT as i32,
        false => LINPRED_FORMAT_FLOAT3 as i32,
    };
    let start = Instant::now();
    // SAFETY: names end with a zero, and the images are there until the denoiser is freed
    let status = unsafe {
        linpred_set_options(denoiser, &raw const options);
        for (name, image) in names.iter().zip(images) {
            linpred_set_image(
                denoiser,
                name.as_ptr(),
                image.as_ptr().cast(),
                format(image),
                SIDE,
                SIDE,
                0,
                0,
                0,
            );
        }
        let output = clean.as_mut_ptr().cast();
        linpred_set_output(
            denoiser,
            c"colour".as_ptr(),
            output,
            format(&clean),
            SIDE,
            SIDE,
            0,
            0,
            0,
        );
        linpred_execute(denoiser)
    };
    let time = start.elapsed();
    // SAFETY: of `linpred_new`
    unsafe { linpred_free(&raw mut denoiser) };
    match status {
        LINPRED_OK => Ok(time),
        failed => Err(format!("{failed:?}").into()),
    }
}
