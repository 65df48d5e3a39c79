//! Rows that are pushed come out with the bits of rows that are asked for; an end that goes away ends the run.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred::{
    Error, Feature, ImageSize, InputRow, Options, OutputRow, RowLayout, RowSink, RowSource,
    VarianceKind, denoise, push,
};
use linpred_core::{Params, Quality};
use linpred_tests::images::noise;

fn options() -> Options {
    Options::new(Params::new(Quality::Fast)).with_threads(NonZeroUsize::new(2).unwrap())
}

fn layout(width: usize, height: usize) -> RowLayout {
    let size = ImageSize::new(width, height).unwrap();
    let layout = RowLayout::new(size, VarianceKind::Estimated).with_layers(1);
    Feature::ALL
        .into_iter()
        .fold(layout, RowLayout::with_feature)
}

/// Rows of noise.
struct Noise(RowLayout);

impl RowSource for Noise {
    fn layout(&self) -> RowLayout {
        self.0
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        let layers = row.layers.iter_mut().flatten();
        let planes = row.colour.iter_mut().chain(&mut row.features).chain(layers);
        for (seed, plane) in (0..).zip(planes) {
            let width = plane.len();
            let values = (y * width..(y + 1) * width).map(|at| noise(seed, at));
            plane.iter_mut().zip(values).for_each(|(v, n)| *v = n);
        }
        Ok(())
    }
}

#[derive(Default)]
struct Collect(Vec<(usize, OutputRow)>);

impl RowSink for Collect {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        self.0.push((y, row.clone()));
        Ok(())
    }
}

/// Pushes the rows before `end`.
fn push_to(push: &mut push::Push, end: usize) -> Result<(), Error> {
    let mut rows = Noise(layout(47, 90));
    let mut row = InputRow::new(&rows.layout());
    (0..end).try_for_each(|y| {
        rows.read_row(y, &mut row)?;
        push.push_row(y, &row)
    })
}

#[test]
fn pushed_rows_have_the_bits_of_rows_that_were_asked_for() {
    let mut source = Noise(layout(47, 90));
    let mut asked = Collect::default();
    let go_on = &mut |_| ControlFlow::Continue(());
    let report = denoise(&mut source, &mut asked, &options(), go_on).unwrap();
    let (mut push, mut denoised) = push::start(source.layout(), options()).unwrap();
    let pusher = std::thread::spawn(move || push_to(&mut push, 90));
    let pulled: Vec<_> = denoised.by_ref().map(Result::unwrap).collect();
    pusher.join().unwrap().unwrap();
    let pushed = denoised.report().expect("the run has ended");
    assert_eq!(
        (pushed.counts, pushed.models),
        (report.counts, report.models)
    );
    assert_eq!(pulled.len(), 90);
    for ((y, pulled), (same, asked)) in pulled.iter().zip(&asked.0) {
        assert_eq!(y, same);
        let bits = |row: &OutputRow| -> Vec<u32> {
            let layers = row.layers.iter().flatten();
            let planes = row
                .colour
                .iter()
                .chain([&row.error, &row.radius])
                .chain(layers);
            planes.flatten().map(|v| v.to_bits()).collect()
        };
        assert_eq!(bits(pulled), bits(asked), "row {y}");
    }
}

#[test]
fn an_image_that_is_not_pushed_to_the_end_ends_in_an_error() {
    let (mut push, denoised) = push::start(layout(47, 90), options()).unwrap();
    let pusher = std::thread::spawn(move || push_to(&mut push, 60));
    let pulled: Vec<_> = denoised.collect();
    pusher.join().unwrap().unwrap();
    assert!(pulled.len() < 61, "{}", pulled.len());
    let (last, rows) = pulled.split_last().unwrap();
    assert!(matches!(last, Err(Error::Cancelled)), "{last:?}");
    assert!(rows.iter().all(Result::is_ok));
}

#[test]
fn a_pusher_is_told_that_nobody_pulls() {
    // More rows than are in memory before the first comes out.
    let (mut push, denoised) = push::start(layout(47, 300), options()).unwrap();
    drop(denoised);
    assert!(matches!(push_to(&mut push, 300), Err(Error::Cancelled)));
}

#[test]
fn rows_out_of_order_or_of_another_size_are_refused() {
    let wanted = layout(47, 90);
    let (mut push, _denoised) = push::start(wanted, options()).unwrap();
    let row = InputRow::new(&wanted);
    let refused = |result: Result<(), Error>| match result {
        Err(Error::Usage(reason)) => reason,
        other => panic!("{other:?}"),
    };
    assert!(refused(push.push_row(1, &row)).contains("the next of 90 is row 0"));
    let narrow = InputRow::new(&layout(46, 90));
    assert!(refused(push.push_row(0, &narrow)).contains("47 pixels wide"));
    push.push_row(0, &row).unwrap();
    assert!(refused(push.push_row(0, &row)).contains("row 1"));
}
