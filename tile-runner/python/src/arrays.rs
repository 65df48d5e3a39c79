//! NumPy arrays as pixels: read where they lie, whatever their strides.

use half::f16;
use linpred::image::Pixels;
use numpy::PyReadonlyArray3;
use numpy::ndarray::{ArrayView3, Axis};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// An array of (rows, columns, channels) that nobody can write to through NumPy for Rust while it is held.
pub(crate) enum Array<'py> {
    Half(PyReadonlyArray3<'py, f16>),
    Single(PyReadonlyArray3<'py, f32>),
    Double(PyReadonlyArray3<'py, f64>),
}

impl<'py> Array<'py> {
    /// The package's own checks have made it aligned, of native byte order and of three dimensions.
    pub(crate) fn of(object: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = object.extract() {
            return Ok(Self::Single(array));
        }
        if let Ok(array) = object.extract() {
            return Ok(Self::Double(array));
        }
        let half = object.extract::<PyReadonlyArray3<'py, f16>>();
        half.map(Self::Half).map_err(|_| {
            PyTypeError::new_err("an array of three dimensions and of float16, 32 or 64 is wanted")
        })
    }

    /// Its pixels.
    pub(crate) fn pixels(&self) -> View<'_> {
        match self {
            Self::Half(array) => View::Half(array.as_array()),
            Self::Single(array) => View::Single(array.as_array()),
            Self::Double(array) => View::Double(array.as_array()),
        }
    }
}

/// What an array shows without the interpreter.
pub(crate) enum View<'a> {
    Half(ArrayView3<'a, f16>),
    Single(ArrayView3<'a, f32>),
    Double(ArrayView3<'a, f64>),
}

impl Pixels for View<'_> {
    fn size(&self) -> (usize, usize) {
        let (rows, columns, _) = match self {
            Self::Half(view) => view.dim(),
            Self::Single(view) => view.dim(),
            Self::Double(view) => view.dim(),
        };
        (columns, rows)
    }

    fn channels(&self) -> usize {
        match self {
            Self::Half(view) => view.dim().2,
            Self::Single(view) => view.dim().2,
            Self::Double(view) => view.dim().2,
        }
    }

    fn read_row(&self, channel: usize, y: usize, row: &mut [f32]) {
        match self {
            Self::Half(view) => read(view, channel, y, row, |v| v.to_f32()),
            Self::Single(view) => read(view, channel, y, row, |v| v),
            Self::Double(view) => read(view, channel, y, row, |v| v as f32),
        }
    }
}

fn read<T: Copy>(
    view: &ArrayView3<'_, T>,
    channel: usize,
    y: usize,
    row: &mut [f32],
    to_f32: impl Fn(T) -> f32,
) {
    let pixels = view.view().index_axis_move(Axis(0), y);
    // the usual case, at a third of the cost
    if let Some(values) = pixels.to_slice() {
        for (out, pixel) in row.iter_mut().zip(values.chunks_exact(pixels.dim().1)) {
            *out = to_f32(pixel[channel]);
        }
        return;
    }
    for (out, value) in row.iter_mut().zip(pixels.column(channel)) {
        *out = to_f32(*value);
    }
}
