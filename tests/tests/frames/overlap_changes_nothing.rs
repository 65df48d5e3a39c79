//! Reading ahead and writing behind pass every row and every error on.

use std::num::NonZeroUsize;
use std::thread;

use linpred::overlap::{ReadAhead, WriteBehind};
use linpred::{Error, ImageSize, InputRow, OutputRow, RowLayout, RowSink, RowSource, VarianceKind};

const WIDTH: usize = 3;

/// Rows that hold their own number, up to one that cannot be read.
struct Numbers {
    rows: usize,
    bad: Option<usize>,
}

impl RowSource for Numbers {
    fn layout(&self) -> RowLayout {
        let size = ImageSize::new(WIDTH, self.rows).unwrap();
        RowLayout::new(size, VarianceKind::Estimated)
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        if self.bad == Some(y) {
            return Err(Error::Invalid(format!("row {y}")));
        }
        row.colour[0].fill(y as f32);
        Ok(())
    }
}

/// Remembers the rows it took, up to one that cannot be written.
#[derive(Default)]
struct Memory {
    rows: Vec<(usize, f32)>,
    bad: Option<usize>,
}

impl RowSink for Memory {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        if self.bad == Some(y) {
            return Err(Error::Budget(format!("row {y}")));
        }
        self.rows.push((y, row.colour[0][WIDTH - 1]));
        Ok(())
    }
}

/// Copies every row through both ends, as the pipeline would.
fn copy(source: &mut Numbers, sink: &mut Memory) -> Result<(), Error> {
    let rows = NonZeroUsize::new(source.rows).unwrap().get();
    thread::scope(|scope| {
        let mut ahead = ReadAhead::start(scope, source, 5).unwrap();
        let mut behind = WriteBehind::start(scope, sink, 5).unwrap();
        let mut input = InputRow::new(&ahead.layout());
        let copied = (0..rows).try_for_each(|y| {
            ahead.read_row(y, &mut input)?;
            let mut output = OutputRow::default();
            output.colour.clone_from(&input.colour);
            behind.write_row(y, &output)
        });
        drop(ahead);
        behind.finish()?;
        copied
    })
}

#[test]
fn every_row_arrives_once_and_in_order() {
    for rows in [1, 18, 19, 20, 500] {
        let mut sink = Memory::default();
        copy(&mut Numbers { rows, bad: None }, &mut sink).unwrap();
        assert_eq!(
            sink.rows,
            (0..rows).map(|y| (y, y as f32)).collect::<Vec<_>>()
        );
    }
}

#[test]
fn a_row_that_cannot_be_read_ends_the_copy_after_those_before_it() {
    let mut sink = Memory::default();
    let error = copy(
        &mut Numbers {
            rows: 100,
            bad: Some(57),
        },
        &mut sink,
    )
    .unwrap_err();
    assert_eq!(error.to_string(), "row 57");
    assert_eq!(sink.rows.len(), 57);
}

#[test]
fn a_row_that_cannot_be_written_is_the_error_that_is_told() {
    let mut sink = Memory {
        bad: Some(31),
        ..Memory::default()
    };
    let error = copy(
        &mut Numbers {
            rows: 100,
            bad: None,
        },
        &mut sink,
    )
    .unwrap_err();
    assert_eq!(error.to_string(), "row 31");
    assert_eq!(sink.rows.len(), 31);
}
