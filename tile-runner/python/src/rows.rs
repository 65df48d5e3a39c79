//! Frames of which only some rows are in memory.

use std::sync::{Mutex, PoisonError};

use linpred::job::check_memory;
use linpred::steps::{Step, Steps};
use linpred::{Error, InputRow, Options, Report, RowLayout, RowSource};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{Busy, raise};
use crate::frame::{Output, frame, layout, planes};
use crate::options::Computing;
use crate::report;

/// Denoised rows, an iterator over (y, arrays of one row). It takes what it needs of an iterator of rows, on the thread that asks.
#[pyclass(frozen)]
pub(crate) struct Rows {
    source: Py<PyAny>,
    height: usize,
    options: Options,
    run: Mutex<Run>,
}

/// How far it is.
enum Run {
    Start,
    Rows(Box<Steps>),
    Done(Report),
    Failed,
}

/// What a step gives without the interpreter.
enum Next {
    Wanted(usize),
    Denoised(usize, Output),
    Done(Report),
}

#[pymethods]
impl Rows {
    /// `source` gives the arrays of each row, from top to bottom.
    #[new]
    fn new(source: Py<PyAny>, height: usize, computing: Computing) -> PyResult<Self> {
        Ok(Self {
            source,
            height,
            options: computing.options()?,
            run: Mutex::new(Run::Start),
        })
    }

    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<(usize, Bound<'py, PyDict>)>> {
        let (py, this) = (slf.py(), slf.get());
        let mut run = this.run.try_lock().or_else(|error| match error {
            std::sync::TryLockError::Poisoned(poisoned) => Ok(PoisonError::into_inner(poisoned)),
            std::sync::TryLockError::WouldBlock => Err(Busy::new_err(
                "another thread, or the source of the rows itself, waits for a row",
            )),
        })?;
        match this.step(py, &mut run) {
            Ok(row) => Ok(row),
            Err(error) => {
                // the pipeline ends, without the interpreter
                let failed = std::mem::replace(&mut *run, Run::Failed);
                py.detach(move || drop(failed));
                Err(error)
            }
        }
    }

    /// What the run counted; `None` before its end.
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        // who holds it waits for a row: that is before the end
        let Ok(run) = self.run.try_lock() else {
            return Ok(None);
        };
        match &*run {
            Run::Done(report) => report::fields(py, report).map(Some),
            _ => Ok(None),
        }
    }
}

impl Rows {
    /// Goes on to the next denoised row.
    fn step<'py>(
        &self,
        py: Python<'py>,
        run: &mut Run,
    ) -> PyResult<Option<(usize, Bound<'py, PyDict>)>> {
        let mut first = None;
        if let Run::Start = run {
            let row = self.row(py, 0)?;
            let layout = layout(&planes(row.bind(py))?, self.height)?;
            check_memory(&layout, &self.options, u64::MAX).map_err(raise)?;
            let steps = Steps::start(layout, self.options).map_err(raise)?;
            *run = Run::Rows(Box::new(steps));
            first = Some(row);
        }
        let steps = match run {
            Run::Rows(steps) => steps,
            Run::Start | Run::Done(_) | Run::Failed => return Ok(None),
        };
        loop {
            py.check_signals()?;
            let layout = steps.layout();
            match py.detach(|| next(steps, &layout)).map_err(raise)? {
                Next::Wanted(y) => {
                    let row = match first.take() {
                        Some(row) => row,
                        None => self.row(py, y)?,
                    };
                    fill(py, &row, y, steps)?;
                }
                Next::Denoised(y, output) => {
                    let arrays = output.into_arrays(py, [1, layout.size.width()])?;
                    return Ok(Some((y, arrays)));
                }
                Next::Done(report) => {
                    *run = Run::Done(report);
                    return Ok(None);
                }
            }
        }
    }

    /// The next row of the source, which is row `y`.
    fn row(&self, py: Python<'_>, y: usize) -> PyResult<Py<PyAny>> {
        let mut source = self.source.bind(py).try_iter()?;
        let row = source.next().transpose()?.ok_or_else(|| {
            PyValueError::new_err(format!("the rows end before row {y} of {}", self.height))
        })?;
        Ok(row.unbind())
    }
}

/// Goes to the next step, and copies what it gives.
fn next(steps: &mut Steps, layout: &RowLayout) -> Result<Next, Error> {
    Ok(match steps.next()? {
        Step::Wanted { y, .. } => Next::Wanted(y),
        Step::Done(report) => Next::Done(report),
        Step::Denoised { y, row } => {
            let no_room = || Error::Budget("there is no memory for a row".into());
            let width = layout.size.width();
            let mut output = Output::with_room(layout, width).ok_or_else(no_room)?;
            output.push(row);
            Next::Denoised(y, output)
        }
    })
}

/// Fills the row that is wanted.
fn fill(py: Python<'_>, row: &Py<PyAny>, y: usize, steps: &mut Steps) -> PyResult<()> {
    let layout = steps.layout();
    let planes = planes(row.bind(py))?;
    let mut source = frame(&planes).map_err(raise)?;
    if source.layout().with_size(layout.size) != layout {
        return Err(PyValueError::new_err(format!(
            "row {y} has other arrays than row 0"
        )));
    }
    if source.layout().size.width() != layout.size.width() {
        return Err(PyValueError::new_err(format!(
            "row {y} has {} pixels, row 0 has {}",
            source.layout().size.width(),
            layout.size.width()
        )));
    }
    let wanted: Option<&mut InputRow> = steps.wanted();
    match wanted {
        Some(wanted) => source.read_row(0, wanted).map_err(raise),
        None => Ok(()),
    }
}
