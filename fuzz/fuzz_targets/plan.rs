//! Any size, any number of bands and threads: every row of the frame is written once and in order, no row outside it is read, a pixel
//! without noise comes out as it went in, and the bands' pixels are those of the whole frame to the bit.
//!
//! Bytes: width, height, bands, the unit that bands are cut by, threads and features; then which pixels are noisy or no numbers.

#![no_main]

use std::num::NonZeroUsize;
use std::ops::{ControlFlow, Range};

use libfuzzer_sys::fuzz_target;
use linpred::{denoise, Error, FEATURES, ImageSize, InputRow, Options, OutputRow, RowLayout, RowSink, RowSource, VarianceKind};
use linpred::job::{Band, BandSink, BandSource};
use linpred_core::{Params, Quality};

fuzz_target!(|data: &[u8]| {
    let Some((&[width, height, bands, unit, rest, spare], states)) = data.split_first_chunk::<6>()
    else {
        return;
    };
    let size = ImageSize::new(1 + usize::from(width) % 64, 1 + usize::from(height) % 128);
    let Some(size) = size else { return };
    let mut layout = RowLayout::new(size, VarianceKind::OfMean);
    layout.features[..FEATURES].fill(rest & 4 != 0);
    layout.feature_variances[..FEATURES].fill(rest & 8 != 0);
    layout.layers = usize::from(rest & 16 != 0);
    let frame = Frame {
        layout,
        states,
        next: 0,
    };
    let quality = match spare & 1 {
        0 => Quality::Fast,
        _ => Quality::Balanced,
    };
    let threads = NonZeroUsize::new(1 + usize::from(rest & 3)).unwrap_or(NonZeroUsize::MIN);
    let options = Options::new(Params::new(quality)).with_threads(threads);
    let whole = run(&frame, 0..size.height(), &options);
    assert_eq!(whole.len(), size.height());
    for (y, row) in whole.iter().enumerate() {
        for x in 0..size.width() {
            let values = [0, 1, 2].map(|c: usize| row.colour[c][x]);
            assert!(
                values.iter().all(|v| v.is_finite()),
                "({x}, {y}): {values:?}"
            );
            if is_clean(&frame, x, y) {
                let own = [0, 1, 2].map(|c| frame.radiance(x, y, c));
                assert_eq!(values, own, "({x}, {y})");
            }
        }
    }
    let (count, unit) = (1 + usize::from(bands) % 9, 1 + usize::from(unit) % 40);
    let mut next = 0;
    for index in 1..=count {
        let band = Band::parse(&format!("{index}/{count}")).expect("from 1 to the count");
        // Fewer pieces than bands: some are empty, and say so.
        let Ok(rows) = band.rows(size.height(), unit) else {
            assert!(size.height().div_ceil(unit) < count);
            continue;
        };
        assert_eq!(rows.start, next);
        assert!(rows.start % unit == 0 && (rows.end % unit == 0 || rows.end == size.height()));
        next = rows.end;
        assert!(
            run(&frame, rows.clone(), &options) == whole[rows],
            "band {index}/{count}"
        );
    }
    assert_eq!(next, size.height());
});

/// Whether no pixel around is noisy, so that the variance around it is 0.
fn is_clean(frame: &Frame, x: usize, y: usize) -> bool {
    let rows = y.saturating_sub(1)..(y + 2).min(frame.layout.size.height());
    rows.into_iter().all(|y| {
        let columns = x.saturating_sub(1)..(x + 2).min(frame.layout.size.width());
        columns.into_iter().all(|x| frame.state(x, y) == 0)
    })
}

fn run(frame: &Frame, rows: Range<usize>, options: &Options) -> Vec<OutputRow> {
    let mut source = BandSource::new(frame.clone(), &rows);
    let first = source.first();
    let mut sink = BandSink::new(Rows(Vec::new()), rows.start - first..rows.end - first);
    let mut written = 0;
    denoise(&mut source, &mut sink, options, &mut |rows| {
        written += 1;
        assert_eq!(rows, written);
        ControlFlow::Continue(())
    })
    .expect("nothing fails here");
    sink.into_inner().0
}

#[derive(Clone)]
struct Frame<'a> {
    layout: RowLayout,
    states: &'a [u8],
    /// The row that is to be read next, 0 before the first.
    next: usize,
}

impl Frame<'_> {
    /// 0 for a pixel without noise, 1 for one that is no number, else noisy.
    fn state(&self, x: usize, y: usize) -> u8 {
        let at = y * self.layout.size.width() + x;
        self.states
            .get(at % self.states.len().max(1))
            .map_or(0, |s| s % 8)
    }

    /// A value that no other pixel has.
    fn radiance(&self, x: usize, y: usize, channel: usize) -> f32 {
        0.25 + (x + 64 * (y + 128 * channel)) as f32 / 1024.0
    }
}

impl RowSource for Frame<'_> {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        assert!(
            y < self.layout.size.height(),
            "row {y} is outside the image"
        );
        assert!(
            self.next == 0 || y == self.next,
            "row {y} after {}",
            self.next
        );
        self.next = y + 1;
        for x in 0..self.layout.size.width() {
            for c in 0..3 {
                let state = self.state(x, y);
                let value = self.radiance(x, y, c);
                row.colour[c][x] = if state == 1 { f32::NAN } else { value };
                row.variance[c][x] = if state < 2 { 0.0 } else { value * value / 9.0 };
                for layer in &mut row.layers {
                    layer[c][x] = value / 2.0;
                }
            }
            for (k, plane) in row.features.iter_mut().enumerate() {
                if let Some(place) = plane.get_mut(x) {
                    *place = ((x * (k + 3) + y) % 11) as f32;
                }
            }
            for plane in &mut row.feature_variances {
                if let Some(place) = plane.get_mut(x) {
                    *place = f32::from(self.state(x, y) / 4);
                }
            }
        }
        Ok(())
    }
}

struct Rows(Vec<OutputRow>);

impl RowSink for Rows {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        assert_eq!(y, self.0.len(), "rows come in order, each once");
        self.0.push(row.clone());
        Ok(())
    }
}
