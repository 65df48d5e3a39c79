//! The loop of examples/adaptive.c, by the library that the interface is made of.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred::image::{Frame, Interleaved};
use linpred::sampling::{Goal, Scratch, measure};
use linpred::{ImageSize, Options, OutputRow, denoise};

use crate::frame_in_a_file::{HEIGHT, WIDTH, checksum, random};

/// sample() of examples/adaptive.c.
fn sample(i: usize, n: u32) -> f64 {
    let (x, y) = (i % WIDTH, i / WIDTH);
    let random = (256.0 * random(n * (WIDTH * HEIGHT) as u32 + i as u32)) as i32;
    let noise = match x >= WIDTH / 2 && y >= HEIGHT / 2 {
        true => f64::from(random) / 128.0,
        false => 1.0 + f64::from(random - 128) / 1024.0,
    };
    (64 + x) as f64 / 64.0 * noise
}

/// Mean, its variance and the number of samples of each pixel.
struct Rendered {
    colour: Vec<[f32; 3]>,
    variance: Vec<[f32; 3]>,
    samples: Vec<[f32; 1]>,
}

/// All samples anew, of which each pixel has so many.
fn render(counts: &[u32]) -> Rendered {
    let moments = |(i, &count): (usize, &u32)| {
        let values = (0..count).map(|n| sample(i, n));
        let (sum, squares) = values.fold((0.0, 0.0), |(sum, squares), value| {
            (sum + value, squares + value * value)
        });
        let n = f64::from(count);
        let variance = (n * squares - sum * sum) / (n * n * (n - 1.0));
        ((sum / n) as f32, variance as f32)
    };
    let moments: Vec<(f32, f32)> = counts.iter().enumerate().map(moments).collect();
    Rendered {
        colour: moments.iter().map(|(mean, _)| [*mean; 3]).collect(),
        variance: moments.iter().map(|(_, variance)| [*variance; 3]).collect(),
        samples: counts.iter().map(|count| [*count as f32]).collect(),
    }
}

fn frame(rendered: &Rendered) -> Frame<'_> {
    let size = ImageSize::new(WIDTH, HEIGHT).unwrap();
    Frame::new(Interleaved::new(size, &rendered.colour).unwrap())
        .and_then(|frame| frame.with_variance(Interleaved::new(size, &rendered.variance)?))
        .and_then(|frame| frame.with_samples(Interleaved::new(size, &rendered.samples)?))
        .unwrap()
}

/// The checksum that the program should print.
pub(crate) fn checksum_by_the_library() -> String {
    let go_on = &mut |_| ControlFlow::Continue(());
    let mut counts = vec![4; WIDTH * HEIGHT];
    let first = render(&counts);
    let options = Options::for_sampling().with_threads(NonZeroUsize::MIN);
    let mut measured = measure(&mut frame(&first), &options, &Scratch::Memory, go_on).unwrap();
    let mut map = measured.plan(Goal::budget(8.0).unwrap()).unwrap();
    let mut row = vec![0; WIDTH];
    for (y, counts) in counts.chunks_exact_mut(WIDTH).enumerate() {
        map.read_row(y, &mut row).unwrap();
        for (count, more) in counts.iter_mut().zip(&row) {
            *count += more;
        }
    }
    // it goes where the noise is
    let (quiet, noisy) = (counts[0], counts[WIDTH * HEIGHT - 1]);
    assert!(
        noisy > 2 * quiet,
        "{noisy} of the corner, {quiet} elsewhere"
    );

    let mut clean = Vec::new();
    let mut keep = |_: usize, row: &OutputRow| {
        clean.extend((0..WIDTH).flat_map(|x| row.colour.each_ref().map(|plane| plane[x])));
        Ok(())
    };
    let second = render(&counts);
    let options = Options::default().with_threads(NonZeroUsize::MIN);
    denoise(&mut frame(&second), &mut keep, &options, go_on).unwrap();
    format!("{:016x}\n", checksum(clean))
}
