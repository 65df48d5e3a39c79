//! Frames in memory.

use linpred::image::Frame;
use linpred::job::check_memory;
use linpred::{Error, Feature, OutputRow, RowLayout, RowSource};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::Array;
use crate::errors::raise;
use crate::options::Computing;
use crate::report;
use crate::watch::{go_on, watched};

/// What an array is: its role, its name where there are several of that role, and its pixels.
pub(crate) struct Plane<'py> {
    role: String,
    name: String,
    array: Array<'py>,
}

/// The arrays that a caller gives, as the package lists them.
pub(crate) fn planes<'py>(list: &Bound<'py, PyAny>) -> PyResult<Vec<Plane<'py>>> {
    let plane = |item: PyResult<Bound<'py, PyAny>>| {
        let (role, name, array): (String, String, Bound<'py, PyAny>) = item?.extract()?;
        Ok(Plane {
            role,
            name,
            array: Array::of(&array)?,
        })
    };
    list.try_iter()?.map(plane).collect()
}

/// The frame that they are.
pub(crate) fn frame<'a>(planes: &'a [Plane<'_>]) -> Result<Frame<'a>, Error> {
    let find = |role: &str| planes.iter().find(|plane| plane.role == role);
    let pixels = |role: &str| find(role).map(|plane| plane.array.pixels());
    let Some(colour) = pixels("colour") else {
        return Err(Error::Usage("there is no colour".into()));
    };
    let mut frame = Frame::new(colour)?;
    if let Some(variance) = pixels("variance") {
        frame = frame.with_variance(variance)?;
    }
    if let (Some(a), Some(b)) = (pixels("half_a"), pixels("half_b")) {
        frame = frame.with_halves(a, b)?;
    }
    for feature in Feature::ALL {
        let (name, variance) = (feature.name(), format!("{}_variance", feature.name()));
        frame = match (pixels(name), pixels(&variance)) {
            (Some(feature_pixels), Some(variance)) => {
                frame.with_feature_and_variance(feature, feature_pixels, variance)?
            }
            (Some(feature_pixels), None) => frame.with_feature(feature, feature_pixels)?,
            (None, _) => frame,
        };
    }
    for plane in planes.iter().filter(|plane| plane.role == "feature") {
        let noise = planes
            .iter()
            .find(|other| other.role == "feature_variance" && other.name == plane.name);
        let pixels = plane.array.pixels();
        frame = match noise.map(|noise| noise.array.pixels()) {
            Some(variance) => {
                frame.with_further_feature_and_variance(&plane.name, pixels, variance)?
            }
            None => frame.with_further_feature(&plane.name, pixels)?,
        };
    }
    if let Some(alpha) = pixels("alpha") {
        frame = frame.with_alpha(alpha)?;
    }
    if let Some(samples) = pixels("samples") {
        frame = frame.with_samples(samples)?;
    }
    for plane in planes {
        let pixels = || plane.array.pixels();
        frame = match plane.role.as_str() {
            "layer" => frame.with_layer(&plane.name, pixels())?,
            "scalar" => frame.with_scalar(&plane.name, pixels())?,
            _ => frame,
        };
    }
    Ok(frame)
}

/// Denoised planes, row after row.
pub(crate) struct Output {
    colour: Vec<f32>,
    error: Vec<f32>,
    radius: Vec<f32>,
    rank: Vec<f32>,
    alpha: Vec<f32>,
    layers: Vec<Vec<f32>>,
    scalars: Vec<Vec<f32>>,
}

impl Output {
    /// With room for so many pixels. `None` if there is no memory for them.
    pub(crate) fn with_room(layout: &RowLayout, pixels: usize) -> Option<Self> {
        let room = |channels: usize| {
            let mut plane = Vec::new();
            plane
                .try_reserve_exact(pixels.checked_mul(channels)?)
                .ok()?;
            Some(plane)
        };
        Some(Self {
            colour: room(3)?,
            error: room(1)?,
            radius: room(1)?,
            rank: room(1)?,
            alpha: room(usize::from(layout.alpha))?,
            layers: (0..layout.layers).map(|_| room(3)).collect::<Option<_>>()?,
            scalars: (0..layout.scalars)
                .map(|_| room(1))
                .collect::<Option<_>>()?,
        })
    }

    /// Adds a row below the others.
    pub(crate) fn push(&mut self, row: &OutputRow) {
        let interleave = |out: &mut Vec<f32>, [red, green, blue]: &[Vec<f32>; 3]| {
            let before = out.len();
            out.resize(before + 3 * red.len(), 0.0);
            let pixels = out[before..].chunks_exact_mut(3);
            for (pixel, ((red, green), blue)) in pixels.zip(red.iter().zip(green).zip(blue)) {
                pixel.copy_from_slice(&[*red, *green, *blue]);
            }
        };
        interleave(&mut self.colour, &row.colour);
        for (out, layer) in self.layers.iter_mut().zip(&row.layers) {
            interleave(out, layer);
        }
        self.error.extend_from_slice(&row.error);
        self.radius.extend_from_slice(&row.radius);
        self.rank.extend_from_slice(&row.rank);
        self.alpha.extend_from_slice(&row.alpha);
        for (out, scalar) in self.scalars.iter_mut().zip(&row.scalars) {
            out.extend_from_slice(scalar);
        }
    }

    /// As arrays: (rows, columns, 3) or (rows, columns). They take the memory over.
    pub(crate) fn into_arrays<'py>(
        self,
        py: Python<'py>,
        [rows, columns]: [usize; 2],
    ) -> PyResult<Bound<'py, PyDict>> {
        let light = |plane: Vec<f32>| {
            let flat = PyArray1::from_vec(py, plane);
            flat.reshape([rows, columns, 3]).map(Bound::into_any)
        };
        let plain = |plane: Vec<f32>| {
            let flat = PyArray1::from_vec(py, plane);
            flat.reshape([rows, columns]).map(Bound::into_any)
        };
        let arrays = PyDict::new(py);
        arrays.set_item("colour", light(self.colour)?)?;
        arrays.set_item("error", plain(self.error)?)?;
        arrays.set_item("radius", plain(self.radius)?)?;
        arrays.set_item("rank", plain(self.rank)?)?;
        let alpha = Some(self.alpha).filter(|alpha| !alpha.is_empty());
        arrays.set_item("alpha", alpha.map(plain).transpose()?)?;
        let list = |planes: Vec<Bound<'py, PyAny>>| PyList::new(py, planes);
        let layers: PyResult<Vec<_>> = self.layers.into_iter().map(light).collect();
        arrays.set_item("layers", list(layers?)?)?;
        let scalars: PyResult<Vec<_>> = self.scalars.into_iter().map(plain).collect();
        arrays.set_item("scalars", list(scalars?)?)?;
        Ok(arrays)
    }
}

/// Denoises a frame: a dictionary of arrays, and one of counts.
#[pyfunction]
pub(crate) fn denoise<'py>(
    py: Python<'py>,
    arrays: &Bound<'py, PyAny>,
    computing: Computing,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>)> {
    let planes = planes(arrays)?;
    let options = computing.options()?;
    let mut frame = frame(&planes).map_err(raise)?;
    let layout = frame.layout();
    let size = [layout.size.height(), layout.size.width()];
    let (denoised, report) = watched(py, size[0], progress.as_ref(), move |stop, tell| {
        let no_room = || Error::Budget("there is no memory for the output".into());
        let pixels = size[0].checked_mul(size[1]).ok_or_else(no_room)?;
        let mut output = Output::with_room(&layout, pixels).ok_or_else(no_room)?;
        // what the caller wants is not limited but by what there is, beside the output
        check_memory(&layout, &options, u64::MAX)?;
        let mut keep = |_: usize, row: &OutputRow| {
            output.push(row);
            Ok(())
        };
        let mut go_on = go_on(stop, tell);
        let report = linpred::denoise(&mut frame, &mut keep, &options, &mut go_on)?;
        Ok((output, report))
    })?;
    Ok((
        denoised.into_arrays(py, size)?,
        report::fields(py, &report)?,
    ))
}

/// The layout of an image of another height.
pub(crate) fn layout(planes: &[Plane<'_>], rows: usize) -> PyResult<RowLayout> {
    let layout = frame(planes).map_err(raise)?.layout();
    let size = linpred::ImageSize::new(layout.size.width(), rows);
    let size = size.ok_or_else(|| PyValueError::new_err(format!("height {rows}: no image")))?;
    Ok(layout.with_size(size))
}
