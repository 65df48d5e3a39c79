//! Rows of an image from EXR files.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use crate::channels::names::ChannelRef;
use crate::channels::roles::layers::Layer;
use crate::channels::roles::{FeatureChannels, Roles};
use crate::channels::variance::{Count, Variance, to_variance_of_mean, variance_from_halves};
use crate::error::Error;
use crate::exr_file::{ExrFile, PartRows};
use crate::geometry::ImageSize;
use linpred_core::{FEATURES, Feature};

use crate::row::{InputRow, RowLayout, RowSource, VarianceKind};

/// Channels, and where their variance comes from.
#[derive(Clone, Debug)]
struct Channels {
    means: Vec<ChannelRef>,
    variance: Variance,
}

impl Channels {
    /// Every channel that is read.
    fn all(&self) -> impl Iterator<Item = ChannelRef> {
        let means = self.means.clone().into_iter();
        means.chain(self.variance.channels())
    }
}

/// Reads [`InputRow`]s from the channels that have been given roles. Holds one row of decoded chunks for every part in use.
#[derive(Debug)]
pub struct ExrSource {
    planes: Planes,
    layout: RowLayout,
    colour: Channels,
    features: Vec<(Feature, Channels)>,
    layers: Vec<Channels>,
    layers_off: u64,
}

impl ExrSource {
    /// A source for `roles`, with `layers` to be denoised beside the colour. `files` are those that the roles refer to.
    ///
    /// [`Error::Unsupported`] if a part in use cannot be decoded, [`Error::Budget`] if a row of its chunks takes more than
    /// `limit` bytes.
    pub fn new(
        files: &[Arc<ExrFile>],
        roles: &Roles,
        layers: &[Layer],
        limit: u64,
    ) -> Result<Self, Error> {
        let at = roles.colour[0];
        let part = &files[at.file].parts()[at.part];
        let size = part.size().ok_or_else(|| {
            let path = files[at.file].path().display();
            Error::Invalid(format!(
                "{path}: {}: the data window is empty",
                part.label()
            ))
        })?;
        // rows to work in, and those that a caller makes to be filled
        let row_bytes = (size.width() as u64).saturating_mul(4 * 2 * (6 + 2 * FEATURES as u64));
        if row_bytes > limit {
            let path = files[at.file].path().display();
            return Err(Error::Budget(format!(
                "{path}: {}: one row of {} pixels takes {} MiB, the limit is {} MiB",
                part.label(),
                size.width(),
                row_bytes >> 20,
                limit >> 20
            )));
        }
        let mut source = Self {
            planes: Planes::new(size),
            layout: layout(roles, size, layers.len()),
            colour: Channels {
                means: roles.colour.to_vec(),
                variance: roles.variance.clone(),
            },
            features: roles.features.iter().map(feature_channels).collect(),
            layers: layers.iter().map(layer_channels).collect(),
            layers_off: 0,
        };
        for at in source.channels() {
            source.planes.open(files, at, limit)?;
        }
        Ok(source)
    }

    /// Pixels read so far whose layers do not sum to the colour, to the precision of half floats. 0 without layers.
    pub fn layers_off(&self) -> u64 {
        self.layers_off
    }

    /// Every channel that is read.
    fn channels(&self) -> Vec<ChannelRef> {
        let features = self.features.iter().map(|(_, channels)| channels);
        let all = std::iter::once(&self.colour).chain(features);
        all.chain(&self.layers).flat_map(Channels::all).collect()
    }
}

fn feature_channels(found: &FeatureChannels) -> (Feature, Channels) {
    let channels = Channels {
        means: found.channels.clone(),
        variance: found.variance.clone(),
    };
    (found.feature, channels)
}

fn layer_channels(layer: &Layer) -> Channels {
    Channels {
        means: layer.channels.to_vec(),
        variance: layer.variance.clone(),
    }
}

impl RowSource for ExrSource {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        let planes = &mut self.planes;
        planes.read(&self.colour, y, &mut row.colour, Some(&mut row.variance))?;
        for (feature, channels) in &self.features {
            let means = &mut row.features[feature.range()];
            let variances = &mut row.feature_variances[feature.range()];
            planes.read(channels, y, means, Some(variances))?;
        }
        for (layer, out) in self.layers.iter().zip(&mut row.layers) {
            planes.read(layer, y, out, None)?;
        }
        if !self.layers.is_empty() {
            self.layers_off += count_off(row);
        }
        Ok(())
    }
}

/// Half floats have 11 bits: each of a few layers and the colour may be rounded by 2^-12 of itself.
const SUM_TOLERANCE: f32 = 1.0 / 1024.0;

/// Pixels of a row whose layers do not sum to the colour. Values that are not finite are not counted.
fn count_off(row: &InputRow) -> u64 {
    let off = |x: usize| {
        (0..3).any(|k| {
            let sum: f32 = row.layers.iter().map(|layer| layer[k][x]).sum();
            let size: f32 = row.layers.iter().map(|layer| layer[k][x].abs()).sum();
            let colour = row.colour[k][x];
            (sum - colour).abs() > SUM_TOLERANCE * size.max(colour.abs())
        })
    };
    (0..row.colour[0].len()).filter(|&x| off(x)).count() as u64
}

/// What the rows of a source for `roles` hold.
pub(crate) fn layout(roles: &Roles, size: ImageSize, layers: usize) -> RowLayout {
    let mut features = [false; FEATURES];
    let mut feature_variances = [false; FEATURES];
    for found in &roles.features {
        let channels = found.feature.range();
        features[channels.clone()].fill(true);
        feature_variances[channels].fill(found.variance.is_known());
    }
    RowLayout {
        size,
        variance: match &roles.variance {
            Variance::Given { .. } => VarianceKind::OfMean,
            Variance::Halves { .. } | Variance::OtherFile(_) => VarianceKind::OfHalves,
            Variance::None => VarianceKind::Estimated,
        },
        features,
        feature_variances,
        layers,
    }
}

/// The parts that are open, and rows to work in.
#[derive(Debug)]
struct Planes {
    parts: BTreeMap<(usize, usize), PartRows>,
    count: Vec<f32>,
    other: Vec<f32>,
}

impl Planes {
    fn new(size: ImageSize) -> Self {
        Self {
            parts: BTreeMap::new(),
            count: vec![0.0; size.width()],
            other: vec![0.0; size.width()],
        }
    }

    fn open(&mut self, files: &[Arc<ExrFile>], at: ChannelRef, limit: u64) -> Result<(), Error> {
        let file = &files[at.file];
        let rows = match self.parts.entry((at.file, at.part)) {
            Entry::Occupied(rows) => rows.into_mut(),
            Entry::Vacant(free) => free.insert(PartRows::new(
                file.clone(),
                file.codec().clone(),
                at.part,
                limit,
            )?),
        };
        rows.keep(at.channel);
        Ok(())
    }

    fn plane(&mut self, at: ChannelRef, y: usize, out: &mut [f32]) -> Result<(), Error> {
        let rows = self
            .parts
            .get_mut(&(at.file, at.part))
            .expect("every part in use was opened");
        rows.read_row(at.channel, y, out)
    }

    /// Reads row `y` of the means and, where wanted and known, of their variances.
    fn read(
        &mut self,
        channels: &Channels,
        y: usize,
        means: &mut [Vec<f32>],
        variances: Option<&mut [Vec<f32>]>,
    ) -> Result<(), Error> {
        for (at, plane) in channels.means.iter().zip(&mut *means) {
            self.plane(*at, y, plane)?;
        }
        if let Variance::OtherFile(twins) = &channels.variance {
            return self.average(twins, y, means, variances);
        }
        let Some(variances) = variances else {
            return Ok(());
        };
        match &channels.variance {
            Variance::Given {
                meaning,
                channels,
                count,
            } => {
                self.counts(*count, y)?;
                for ((at, variance), mean) in channels.iter().zip(variances).zip(means) {
                    self.plane(*at, y, variance)?;
                    to_variance_of_mean(*meaning, variance, mean, &self.count);
                }
            }
            Variance::Halves { a, b } => {
                for ((a, b), variance) in a.iter().zip(b).zip(variances) {
                    self.plane(*a, y, variance)?;
                    let mut other = std::mem::take(&mut self.other);
                    self.plane(*b, y, &mut other)?;
                    variance_from_halves(variance, &other);
                    self.other = other;
                }
            }
            Variance::OtherFile(_) | Variance::None => {}
        }
        Ok(())
    }

    /// Averages the means with those of the other half, whose difference gives the variances.
    fn average(
        &mut self,
        twins: &[ChannelRef],
        y: usize,
        means: &mut [Vec<f32>],
        mut variances: Option<&mut [Vec<f32>]>,
    ) -> Result<(), Error> {
        for (k, twin) in twins.iter().enumerate() {
            let mut other = std::mem::take(&mut self.other);
            self.plane(*twin, y, &mut other)?;
            if let Some(variances) = &mut variances {
                variances[k].copy_from_slice(&means[k]);
                variance_from_halves(&mut variances[k], &other);
            }
            means[k]
                .iter_mut()
                .zip(&other)
                .for_each(|(mean, other)| *mean = 0.5 * *mean + 0.5 * other);
            self.other = other;
        }
        Ok(())
    }

    /// Fills `self.count` with the samples of each pixel of row `y`.
    fn counts(&mut self, count: Option<Count>, y: usize) -> Result<(), Error> {
        match count {
            None => {}
            Some(Count::Fixed(count)) => self.count.fill(count),
            Some(Count::Channel { at, scale }) => {
                let mut row = std::mem::take(&mut self.count);
                self.plane(at, y, &mut row)?;
                row.iter_mut().for_each(|count| *count *= scale);
                self.count = row;
            }
        }
        Ok(())
    }
}
