//! Maps of samples.

use std::path::PathBuf;

use linpred::job::{self, JobOptions, check_memory_of_map};
use linpred::sampling::{Goal, Scratch, Summary, measure, rows_to_measure};
use linpred::{Error, RowSource};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::raise;
use crate::files::Reading;
use crate::frame::{frame, planes};
use crate::options::Computing;
use crate::watch::{go_on, watched};

/// What a map is to reach: (budget, error).
type Wanted = (Option<f64>, Option<f64>);

/// The map of a frame in memory, (rows, columns), and what it gives.
#[pyfunction]
pub(crate) fn sample_map<'py>(
    py: Python<'py>,
    arrays: &Bound<'py, PyAny>,
    wanted: Wanted,
    computing: Computing,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyDict>)> {
    let planes = planes(arrays)?;
    let options = computing.options()?;
    let goal = Goal::of(wanted.0, wanted.1).map_err(raise)?;
    let mut frame = frame(&planes).map_err(raise)?;
    let layout = frame.layout();
    let (width, height) = (layout.size.width(), layout.size.height());
    let rows = rows_to_measure(&layout);
    let (map, summary) = watched(py, rows, progress.as_ref(), move |stop, tell| {
        check_memory_of_map(&layout, &options, &Scratch::Memory, u64::MAX)?;
        let mut go_on = go_on(stop, tell);
        let mut measured = measure(&mut frame, &options, &Scratch::Memory, &mut go_on)?;
        let mut map = measured.plan(goal)?;
        let mut samples = Vec::new();
        samples
            .try_reserve_exact(width * height)
            .map_err(|_| Error::Budget("there is no memory for the map".into()))?;
        samples.resize(width * height, 0);
        for (y, row) in samples.chunks_exact_mut(width).enumerate() {
            map.read_row(y, row)?;
        }
        Ok((samples, map.summary()))
    })?;
    let map = PyArray1::from_vec(py, map).reshape([height, width])?;
    Ok((map.into_any(), fields(py, &summary)?))
}

/// The map of a file, into another; what it gives. Warnings are given to `warn` before it begins.
#[pyfunction]
pub(crate) fn sample_map_file<'py>(
    py: Python<'py>,
    reading: Reading,
    output: PathBuf,
    wanted: Wanted,
    computing: Computing,
    warn: &Bound<'py, PyAny>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let request = reading.request()?;
    let goal = Goal::of(wanted.0, wanted.1).map_err(raise)?;
    let mut options = JobOptions::new(computing.options()?);
    if let Some(limit) = request.memory_limit {
        options = options.with_memory_limit(limit);
    }
    let picture = py.detach(|| job::only_picture(&request)).map_err(raise)?;
    for warning in &picture.roles.warnings {
        warn.call1((warning,))?;
    }
    let rows = job::rows_to_measure(&picture);
    let summary = watched(py, rows, progress.as_ref(), |stop, tell| {
        let map = job::sample_map(&picture, &output, goal, &options, stop, tell)?;
        Ok(map.summary())
    })?;
    fields(py, &summary)
}

/// The fields of the package's `SampleReport`.
fn fields<'py>(py: Python<'py>, summary: &Summary) -> PyResult<Bound<'py, PyDict>> {
    let mean = |samples: u64| samples as f64 / summary.pixels as f64;
    let fields = PyDict::new(py);
    fields.set_item("pixels", summary.pixels)?;
    fields.set_item("samples", mean(summary.samples))?;
    fields.set_item("added", mean(summary.added))?;
    fields.set_item("most", summary.most)?;
    fields.set_item("error", summary.error)?;
    fields.set_item("error_then", summary.error_then)?;
    fields.set_item("reached", summary.added == 0)?;
    Ok(fields)
}
