//! Measurements as rows of a CSV file, and their medians.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use anyhow::Result;
use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use crate::machine;
use crate::method::Method;
use crate::point::Measured;
use crate::scenes::NoisyImage;

const FILE: &str = "results.csv";

/// One measurement.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) date: String,
    pub(crate) machine: String,
    pub(crate) revision: String,
    pub(crate) scene: String,
    pub(crate) spp: u32,
    pub(crate) method: String,
    /// As asked for; 0 for the image's own size.
    pub(crate) megapixels: f64,
    pub(crate) pixels: u64,
    pub(crate) threads: usize,
    pub(crate) cpu_seconds: f64,
    pub(crate) wall_seconds: f64,
    pub(crate) peak_mib: f64,
    pub(crate) before_mib: f64,
    pub(crate) rmse: Option<f64>,
    /// Measurements of before it was measured have none, nor a FLIP.
    #[serde(default)]
    pub(crate) psnr: Option<f64>,
    #[serde(default)]
    pub(crate) flip: Option<f64>,
    pub(crate) models: Option<u64>,
    pub(crate) passed_through: Option<u64>,
}

impl Row {
    pub(crate) fn new(
        image: &NoisyImage,
        method: &str,
        megapixels: f64,
        threads: usize,
        measured: &Measured,
    ) -> Self {
        Self {
            date: machine::date(),
            machine: machine::processor(),
            revision: machine::revision(),
            scene: image.scene.clone(),
            spp: image.spp,
            method: method.to_owned(),
            megapixels,
            pixels: measured.pixels,
            threads,
            cpu_seconds: measured.cost.cpu,
            wall_seconds: measured.cost.wall,
            peak_mib: measured.cost.peak_mib,
            before_mib: measured.cost.before_mib,
            rmse: measured.rmse,
            psnr: measured.psnr,
            flip: measured.flip,
            models: measured.models,
            passed_through: measured.passed_through,
        }
    }
}

/// The CSV file of a folder, open at its end.
pub(crate) struct Rows {
    writer: csv::Writer<File>,
}

impl Rows {
    pub(crate) fn append(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let new = !path.exists();
        let file = File::options().create(true).append(true).open(path)?;
        let writer = csv::WriterBuilder::new().has_headers(new).from_writer(file);
        Ok(Self { writer })
    }

    /// Adds a row; what was measured is kept should a later measurement fail.
    pub(crate) fn add(&mut self, row: Row) -> Result<()> {
        self.writer.serialize(row)?;
        Ok(self.writer.flush()?)
    }
}

/// Every row of a folder.
pub(crate) fn read(folder: &Path) -> Result<Vec<Row>> {
    let mut reader = csv::Reader::from_path(folder.join(FILE))?;
    Ok(reader.deserialize().collect::<Result<_, csv::Error>>()?)
}

/// A method on an image.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    pub(crate) scene: String,
    pub(crate) spp: u32,
    pub(crate) method: Method,
    pub(crate) threads: usize,
}

/// What all runs of a method on an image say.
#[derive(Clone, Debug, Default)]
pub(crate) struct Point {
    pub(crate) rmse: Option<f64>,
    pub(crate) psnr: Option<f64>,
    pub(crate) flip: Option<f64>,
    /// Error of the noisy image over this one's.
    pub(crate) gain: Option<f64>,
    /// Models per pixel, where they were counted.
    pub(crate) models: Option<f64>,
    /// Share of the pixels that passed through.
    pub(crate) passed_through: Option<f64>,
    /// By the megapixels that were asked for, in thousandths.
    pub(crate) sizes: BTreeMap<u64, Cost>,
}

/// Medians over the runs at one size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cost {
    pub(crate) cpu_per_megapixel: f64,
    pub(crate) wall_per_megapixel: f64,
    pub(crate) peak_mib: f64,
}

impl Point {
    /// The cost at the largest size measured.
    pub(crate) fn largest(&self) -> Option<&Cost> {
        self.sizes.values().next_back()
    }
}

/// Medians by point.
pub(crate) fn medians(rows: &[Row]) -> BTreeMap<Key, Point> {
    let mut groups: BTreeMap<Key, BTreeMap<u64, Vec<&Row>>> = BTreeMap::new();
    for row in rows {
        if let Ok(method) = Method::from_str(&row.method, false) {
            let key = Key {
                scene: row.scene.clone(),
                spp: row.spp,
                method,
                threads: row.threads,
            };
            let size = (row.megapixels * 1000.0).round() as u64;
            let sizes = groups.entry(key).or_default();
            sizes.entry(size).or_default().push(row);
        }
    }
    let mut points = BTreeMap::new();
    for (key, sizes) in groups {
        points.insert(key, point(&sizes));
    }
    add_gains(&mut points);
    points
}

fn point(sizes: &BTreeMap<u64, Vec<&Row>>) -> Point {
    let mut point = Point::default();
    for (size, rows) in sizes {
        let per_megapixel = |seconds: fn(&Row) -> f64| {
            median(rows.iter().map(|r| seconds(r) / (r.pixels as f64 / 1e6)))
        };
        let cost = Cost {
            cpu_per_megapixel: per_megapixel(|row| row.cpu_seconds),
            wall_per_megapixel: per_megapixel(|row| row.wall_seconds),
            peak_mib: median(rows.iter().map(|row| row.peak_mib)),
        };
        point.sizes.insert(*size, cost);
        for row in rows {
            let share = |count: Option<u64>| count.map(|n| n as f64 / row.pixels as f64);
            point.rmse = row.rmse.or(point.rmse);
            point.psnr = row.psnr.or(point.psnr);
            point.flip = row.flip.or(point.flip);
            point.models = share(row.models).or(point.models);
            point.passed_through = share(row.passed_through).or(point.passed_through);
        }
    }
    point
}

fn add_gains(points: &mut BTreeMap<Key, Point>) {
    let noisy: BTreeMap<(String, u32), f64> = points
        .iter()
        .filter(|(key, _)| key.method == Method::Noisy)
        .filter_map(|(key, point)| Some(((key.scene.clone(), key.spp), point.rmse?)))
        .collect();
    for (key, point) in points {
        let noisy = noisy.get(&(key.scene.clone(), key.spp));
        point.gain = noisy.zip(point.rmse).map(|(noisy, own)| noisy / own);
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[middle],
        _ => 0.5 * (values[middle - 1] + values[middle]),
    }
}
