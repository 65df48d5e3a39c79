//! A run that is taken step by step gives the bits of one that asks for its rows, and ends whenever its caller does.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred::steps::{Step, Steps};
use linpred::{
    Error, Feature, ImageSize, InputRow, Options, OutputRow, RowLayout, RowSource, VarianceKind,
    denoise,
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

/// The bits of a row.
fn bits(row: &OutputRow) -> Vec<u32> {
    let layers = row.layers.iter().flatten();
    let models = [&row.error, &row.radius, &row.rank];
    let planes = row.colour.iter().chain(models).chain(layers);
    planes.flatten().map(|v| v.to_bits()).collect()
}

#[test]
fn rows_have_the_bits_of_rows_that_were_asked_for() {
    let mut source = Noise(layout(47, 90));
    let mut asked = Vec::new();
    let mut keep = |y: usize, row: &OutputRow| {
        asked.push((y, bits(row)));
        Ok(())
    };
    let go_on = &mut |_| ControlFlow::Continue(());
    let report = denoise(&mut source, &mut keep, &options(), go_on).unwrap();
    let mut steps = Steps::start(source.layout(), options()).unwrap();
    let (mut wanted, mut given) = (0, Vec::new());
    let done = loop {
        match steps.next().unwrap() {
            Step::Wanted { y, row } => {
                assert_eq!(y, wanted, "rows are wanted from the top, each once");
                wanted += 1;
                source.read_row(y, row).unwrap();
            }
            Step::Denoised { y, row } => given.push((y, bits(row))),
            Step::Done(report) => break report,
        }
    };
    assert_eq!((done.counts, done.models), (report.counts, report.models));
    assert_eq!(given.len(), 90);
    assert!(given == asked, "bits differ");
    assert!(
        matches!(steps.next(), Ok(Step::Done(_))),
        "the end comes again"
    );
}

#[test]
fn denoised_rows_come_before_the_last_is_given() {
    let mut source = Noise(layout(47, 300));
    let mut steps = Steps::start(source.layout(), options()).unwrap();
    let (mut wanted, mut longest) = (0, 0);
    loop {
        match steps.next().unwrap() {
            Step::Wanted { y, row } => {
                wanted = y + 1;
                source.read_row(y, row).unwrap();
            }
            Step::Denoised { y, .. } => longest = longest.max(wanted - y),
            Step::Done(_) => break,
        }
    }
    assert!(
        (20..120).contains(&longest),
        "{longest} rows are held before the first comes out"
    );
}

#[test]
fn a_run_that_is_dropped_leaves_no_thread_behind() {
    let tasks = std::path::Path::new("/proc/self/task");
    if !tasks.is_dir() {
        println!("NOT RUN: this system does not tell how many threads there are");
        return;
    }
    let threads = || tasks.read_dir().unwrap().count();
    let run = |rows: usize| {
        let mut source = Noise(layout(47, 300));
        let mut steps = Steps::start(source.layout(), options()).unwrap();
        for _ in 0..rows {
            if let Step::Wanted { y, row } = steps.next().unwrap() {
                source.read_row(y, row).unwrap();
            }
        }
    };
    // other tests have threads of their own: those of a hundred runs would stand out
    let before = threads();
    (0..100).for_each(|rows| run(rows % 3));
    assert!(
        threads() < before + 90,
        "{before} threads before, {} after",
        threads()
    );
    run(200);
}

#[test]
fn a_row_whose_planes_were_resized_is_refused() {
    let mut steps = Steps::start(layout(47, 90), options()).unwrap();
    match steps.next().unwrap() {
        Step::Wanted { row, .. } => row.colour[1].truncate(46),
        other => panic!("{other:?}"),
    }
    match steps.next() {
        Err(Error::Usage(reason)) => assert!(reason.contains("47 pixels wide"), "{reason}"),
        other => panic!("{other:?}"),
    }
    assert!(matches!(steps.next(), Err(Error::Cancelled)));
}
