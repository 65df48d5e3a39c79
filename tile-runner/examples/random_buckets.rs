//! A renderer that delivers buckets in random order, denoised without a file while it still renders.
//!
//!     cargo run --release -p linpred --example random_buckets
//!
//! Whenever a row is wanted whose buckets are not all there, more are rendered; denoised rows come out in between. At the end the
//! bits are compared with those of the same image delivered from top to bottom.

use std::error::Error;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred::steps::{Step, Steps};
use linpred::{
    Feature, ImageSize, InputRow, Options, OutputRow, Params, Quality, RowLayout, RowSource,
    VarianceKind, denoise,
};

/// Pixels on the side of a bucket.
const BUCKET: usize = 32;
const WIDTH: usize = 200;
const HEIGHT: usize = 150;

fn main() -> Result<(), Box<dyn Error>> {
    let size = ImageSize::new(WIDTH, HEIGHT).ok_or("an empty image")?;
    let layout = RowLayout::new(size, VarianceKind::OfMean).with_feature(Feature::Normal);
    let options = Options::new(Params::new(Quality::Fast)).with_threads(NonZeroUsize::MIN);

    let mut frame = Framebuffer::new(&layout);
    let mut buckets = shuffled_buckets().into_iter().enumerate();
    let mut steps = Steps::start(layout, options)?;
    let mut stepwise = Vec::new();
    loop {
        match steps.next()? {
            Step::Wanted { y, row } => {
                while frame.complete_rows() <= y {
                    let (count, bucket) = buckets.next().ok_or("too few buckets")?;
                    frame.render(bucket);
                    if frame.complete_rows() > y {
                        println!("after bucket {}: row {y} is there", count + 1);
                    }
                }
                row.clone_from(&frame.rows[y]);
            }
            Step::Denoised { y, row } => stepwise.push((y, row.clone())),
            Step::Done(_) => break,
        }
    }

    let mut in_order = Vec::new();
    let mut keep = |y: usize, row: &OutputRow| {
        in_order.push((y, row.clone()));
        Ok(())
    };
    denoise(&mut frame, &mut keep, &options, &mut |_| {
        ControlFlow::Continue(())
    })?;
    // no value is NaN here, so equal means equal bits but for the sign of zero
    assert!(
        stepwise == in_order,
        "the order of the buckets changed the image"
    );
    println!("{} rows, the same as from top to bottom", stepwise.len());
    Ok(())
}

/// The renderer's buffers, as rows.
struct Framebuffer {
    layout: RowLayout,
    rows: Vec<InputRow>,
    /// Buckets that are there, of each row of buckets.
    done: Vec<usize>,
}

impl Framebuffer {
    fn new(layout: &RowLayout) -> Self {
        Self {
            layout: *layout,
            rows: vec![InputRow::new(layout); HEIGHT],
            done: vec![0; HEIGHT.div_ceil(BUCKET)],
        }
    }

    /// Renders the bucket in column `column` and row `row` of buckets.
    fn render(&mut self, (column, row): (usize, usize)) {
        for y in row * BUCKET..HEIGHT.min((row + 1) * BUCKET) {
            for x in column * BUCKET..WIDTH.min((column + 1) * BUCKET) {
                render_pixel(x, y, &mut self.rows[y]);
            }
        }
        self.done[row] += 1;
    }

    /// Rows from the top that lack nothing.
    fn complete_rows(&self) -> usize {
        let all = WIDTH.div_ceil(BUCKET);
        let complete = self.done.iter().take_while(|done| **done == all).count();
        HEIGHT.min(complete * BUCKET)
    }
}

impl RowSource for Framebuffer {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), linpred::Error> {
        row.clone_from(&self.rows[y]);
        Ok(())
    }
}

/// A ball on a wall, lit from above, with noise of a known variance.
fn render_pixel(x: usize, y: usize, row: &mut InputRow) {
    let (u, v) = (x as f32 / 50.0 - 2.0, y as f32 / 50.0 - 1.5);
    let inside = (1.0 - u * u - v * v).max(0.0).sqrt();
    let normal = if inside > 0.0 {
        [u, v, inside]
    } else {
        [0.0, 0.0, 1.0]
    };
    let light = 0.6 - 0.4 * normal[1];
    for (plane, value) in row.feature_mut(Feature::Normal).iter_mut().zip(normal) {
        plane[x] = value;
    }
    for channel in 0..3 {
        // uniform noise of variance 0.01
        let noise = (hash((y * WIDTH + x) * 3 + channel) - 0.5) * 0.12_f32.sqrt();
        row.colour[channel][x] = light + noise;
        row.variance[channel][x] = 0.01;
    }
}

/// All buckets, in an order that looks random and is always the same.
fn shuffled_buckets() -> Vec<(usize, usize)> {
    let columns = WIDTH.div_ceil(BUCKET);
    let mut buckets: Vec<(usize, usize)> = (0..columns * HEIGHT.div_ceil(BUCKET))
        .map(|index| (index % columns, index / columns))
        .collect();
    buckets.sort_by(|a, b| hash(a.1 * columns + a.0).total_cmp(&hash(b.1 * columns + b.0)));
    buckets
}

/// A number from 0 to 1 that looks random.
fn hash(index: usize) -> f32 {
    let mut x = (index as u32).wrapping_add(1).wrapping_mul(0x9E37_79B9);
    x = (x ^ (x >> 16)).wrapping_mul(0x7FEB_352D);
    x = (x ^ (x >> 15)).wrapping_mul(0x846C_A68B);
    ((x ^ (x >> 16)) >> 8) as f32 / (1 << 24) as f32
}
