//! What a run counts, as a dictionary.

use linpred::Report;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The fields of the package's `Report`.
pub(crate) fn fields<'py>(py: Python<'py>, report: &Report) -> PyResult<Bound<'py, PyDict>> {
    let counts = &report.counts;
    let fields = PyDict::new(py);
    for (name, count) in [
        ("pixels", counts.pixels),
        ("passed_through", counts.passed_through),
        ("repaired", counts.repaired),
        ("fireflies", counts.fireflies),
        ("estimated", counts.estimated),
        ("cells", counts.cells),
        ("cells_skipped", counts.cells_skipped),
        ("feature_blocks", counts.feature_blocks),
        ("feature_blocks_skipped", counts.feature_blocks_skipped),
        ("models", report.models),
    ] {
        fields.set_item(name, count)?;
    }
    fields.set_item("fitting_seconds", report.fitting.as_secs_f64())?;
    Ok(fields)
}
