//! Rows of an image from EXR files.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::ops::Range;
use std::sync::Arc;

use crate::channels::names::ChannelRef;
use crate::channels::roles::Roles;
use crate::channels::roles::layers::Layer;
use crate::channels::variance::{Count, Variance, to_variance_of_mean, variance_from_halves};
use crate::error::Error;
use crate::exr_file::compression::SharedCodec;
use crate::exr_file::{ExrFile, PartRows};
use crate::geometry::ImageSize;
use crate::image::area::Area;
use crate::image::motion::MotionChannels;
use exr::meta::attribute::IntegerBounds;
use linpred_core::FEATURES;

use crate::row::{InputRow, RowLayout, RowSource, VarianceKind, sums_up};

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
    /// Whether a variance of 0 says that nothing is known.
    zero_is_unknown: bool,
    /// Of each feature, those that are known by their names first, and where its channels are in a row.
    features: Vec<(Range<usize>, Channels)>,
    layers: Vec<Channels>,
    alpha: Option<Channels>,
    /// Of each layer that is no light.
    scalars: Vec<Channels>,
    /// Samples of each pixel, if a channel has them or they are wanted.
    samples: Option<Count>,
    layers_off: u64,
    /// What is read of motion: nothing where a frame is denoised alone.
    motion: MotionChannels,
    /// The rows whose layers have been counted.
    counted: Vec<bool>,
}

impl ExrSource {
    /// A source for `area` of the picture that `roles` are of, with `layers` to be denoised beside the colour. `files` are those that the roles refer to.
    ///
    /// [`Error::Unsupported`] if a part in use cannot be decoded, [`Error::Budget`] if a row of its chunks takes more than
    /// `limit` bytes.
    pub fn new(
        files: &[Arc<ExrFile>],
        roles: &Roles,
        layers: &[Layer],
        area: Area,
        limit: u64,
    ) -> Result<Self, Error> {
        let at = roles.colour[0];
        let part = &files[at.file].parts()[at.part];
        // rows to work in, and those that a caller makes to be filled
        let further = roles.further.iter().map(|feature| feature.channels.len());
        let channels = FEATURES + further.sum::<usize>();
        let row_bytes =
            (area.size.width() as u64).saturating_mul(4 * 2 * (6 + 2 * channels as u64));
        if row_bytes > limit {
            let path = files[at.file].path().display();
            return Err(Error::Budget(format!(
                "{path}: {}: one row of {} pixels takes {} MiB, the limit is {} MiB",
                part.label(),
                area.size.width(),
                row_bytes >> 20,
                limit >> 20
            )));
        }
        let alpha = roles.alpha.map(|at| {
            let means = vec![at];
            let variance = other_half(roles, at, files);
            Channels { means, variance }
        });
        let channels = |layer: &Layer| Channels {
            means: layer.channels.clone(),
            variance: layer.variance.clone(),
        };
        let (light, plain): (Vec<&Layer>, Vec<&Layer>) = layers.iter().partition(|l| l.is_light);
        let corner = part.data_window().position;
        let layout = layout(roles, area.size, layers);
        let mut source = Self {
            planes: Planes::new(area, [corner.0, corner.1]),
            layout,
            colour: Channels {
                means: roles.colour.to_vec(),
                variance: roles.variance.clone(),
            },
            zero_is_unknown: roles.zero_is_unknown,
            features: features(roles, &layout),
            layers: light.into_iter().map(channels).collect(),
            alpha,
            scalars: plain.into_iter().map(channels).collect(),
            samples: None,
            layers_off: 0,
            motion: MotionChannels::default(),
            counted: vec![false; area.size.height()],
        };
        for at in source.channels() {
            source.planes.open(files, at, limit)?;
        }
        if let Some(samples) = &roles.samples
            && let Count::Channel { at, .. } = samples.count
        {
            source.planes.open(files, at, limit)?;
            source.samples = Some(samples.count);
        }
        Ok(source)
    }

    /// Tells how many samples each pixel has, too: `count`, which is that of the roles.
    pub(crate) fn with_samples(mut self, count: Count) -> Self {
        self.layout.samples = true;
        self.samples = Some(count);
        self
    }

    /// Decodes by `codec`, in turn with whoever else does.
    pub(crate) fn decoded_by(mut self, codec: &SharedCodec) -> Self {
        let parts = self.planes.parts.values_mut();
        parts.for_each(|part| part.rows.decode_by(codec));
        self
    }

    /// Tells where the surfaces are in other frames, too, as far as the roles say. What is not finite, or beyond the data window of its part, is NaN.
    ///
    /// Errors as those of [`ExrSource::new`].
    pub(crate) fn with_motion(
        mut self,
        files: &[Arc<ExrFile>],
        roles: &Roles,
        limit: u64,
    ) -> Result<Self, Error> {
        self.motion = MotionChannels::of(roles);
        self.layout.motion = self.motion.layout();
        for at in self.motion.all() {
            self.planes.open(files, at, limit)?;
        }
        Ok(self)
    }

    /// Pixels read so far, each counted once, whose layers do not sum to the colour, to the precision of half floats. 0 without layers.
    pub fn layers_off(&self) -> u64 {
        self.layers_off
    }

    /// Every channel that is read.
    fn channels(&self) -> Vec<ChannelRef> {
        let features = self.features.iter().map(|(_, channels)| channels);
        let all = std::iter::once(&self.colour).chain(features);
        let all = all.chain(&self.layers).chain(&self.alpha);
        all.chain(&self.scalars).flat_map(Channels::all).collect()
    }
}

/// The channels of every feature, and where they are in a row.
fn features(roles: &Roles, layout: &RowLayout) -> Vec<(Range<usize>, Channels)> {
    let channels = |means: &Vec<ChannelRef>, variance: &Variance| Channels {
        means: means.clone(),
        variance: variance.clone(),
    };
    let known = roles.features.iter();
    let known = known.map(|own| {
        let range = own.feature.range();
        (range, channels(&own.channels, &own.variance))
    });
    let further = layout.further_features().zip(&roles.further);
    let further = further.map(|(range, own)| (range, channels(&own.channels, &own.variance)));
    known.chain(further).collect()
}

/// The channel of the other half of the samples that `at` is averaged with, if the colour's are.
fn other_half(roles: &Roles, at: ChannelRef, files: &[Arc<ExrFile>]) -> Variance {
    let Variance::OtherFile(twins) = &roles.variance else {
        return Variance::None;
    };
    let name = |at: ChannelRef| files[at.file].parts()[at.part].channel_name(at.channel);
    let part = &files[twins[0].file].parts()[twins[0].part];
    let channel = part.channel(&name(at));
    channel.map_or(Variance::None, |channel| {
        let twin = ChannelRef {
            channel,
            ..twins[0]
        };
        Variance::OtherFile(vec![twin])
    })
}

impl RowSource for ExrSource {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        let planes = &mut self.planes;
        planes.read(&self.colour, y, &mut row.colour, Some(&mut row.variance))?;
        if self.zero_is_unknown {
            forget_zeros(&mut row.variance);
        }
        for (range, channels) in &self.features {
            let means = &mut row.features[range.clone()];
            let variances = &mut row.feature_variances[range.clone()];
            planes.read(channels, y, means, Some(variances))?;
        }
        for (layer, out) in self.layers.iter().zip(&mut row.layers) {
            planes.read(layer, y, out, None)?;
        }
        if let Some(alpha) = &self.alpha {
            planes.read(alpha, y, std::slice::from_mut(&mut row.alpha), None)?;
        }
        let mut scalars = row.scalars.as_mut_slice();
        for layer in &self.scalars {
            let (own, rest) = scalars.split_at_mut(layer.means.len());
            planes.read(layer, y, own, None)?;
            scalars = rest;
        }
        if self.samples.is_some() {
            planes.counts(self.samples, y)?;
            row.forget_unsampled(&planes.count);
            if self.layout.samples {
                row.samples.copy_from_slice(&planes.count);
            }
        }
        if !self.layers.is_empty() && !std::mem::replace(&mut self.counted[y], true) {
            self.layers_off += count_off(row);
        }
        self.motion.read(&mut self.planes, y, row)?;
        Ok(())
    }
}

/// Pixels of a row whose layers do not sum to the colour. Values that are not finite are not counted.
fn count_off(row: &InputRow) -> u64 {
    let off = |x: usize| {
        let layers = |k: usize| row.layers.iter().map(move |layer| layer[k][x]);
        (0..3).any(|k| !sums_up(row.colour[k][x], layers(k)))
    };
    (0..row.colour[0].len()).filter(|&x| off(x)).count() as u64
}

/// Makes the variances of a pixel that are all 0 unknown.
fn forget_zeros(variance: &mut [Vec<f32>; 3]) {
    let [red, green, blue] = variance;
    for ((red, green), blue) in red.iter_mut().zip(green).zip(blue) {
        if (*red, *green, *blue) == (0.0, 0.0, 0.0) {
            (*red, *green, *blue) = (f32::NAN, f32::NAN, f32::NAN);
        }
    }
}

/// What the rows of a source for `roles` hold.
pub(crate) fn layout(roles: &Roles, size: ImageSize, layers: &[Layer]) -> RowLayout {
    let variance = match &roles.variance {
        Variance::Given { .. } => VarianceKind::OfMean,
        Variance::Halves { .. } | Variance::OtherFile(_) => VarianceKind::OfHalves,
        Variance::None => VarianceKind::Estimated,
    };
    let (light, plain): (Vec<&Layer>, Vec<&Layer>) = layers.iter().partition(|l| l.is_light);
    let mut layout = RowLayout::new(size, variance)
        .with_layers(light.len())
        .with_scalars(plain.iter().map(|layer| layer.channels.len()).sum());
    layout.alpha = roles.alpha.is_some();
    for found in &roles.features {
        layout = match found.variance.is_known() {
            true => layout.with_feature_and_variance(found.feature),
            false => layout.with_feature(found.feature),
        };
    }
    for found in &roles.further {
        let channels = found.channels.len();
        let wider = match found.variance.is_known() {
            true => layout.with_further_feature_and_variance(channels),
            false => layout.with_further_feature(channels),
        };
        layout = wider.expect("the roles have room for their features");
    }
    layout
}

/// The parts that are open, and rows to work in.
#[derive(Debug)]
pub(super) struct Planes {
    parts: BTreeMap<(usize, usize), OpenPart>,
    area: Area,
    /// The top left corner of the colour's data window.
    corner: [i32; 2],
    count: Vec<f32>,
    other: Vec<f32>,
    /// A row of a part of another data window.
    whole: Vec<f32>,
}

/// A part whose rows are read.
#[derive(Debug)]
struct OpenPart {
    rows: PartRows,
    window: IntegerBounds,
}

impl Planes {
    fn new(area: Area, corner: [i32; 2]) -> Self {
        Self {
            parts: BTreeMap::new(),
            area,
            corner,
            count: vec![0.0; area.size.width()],
            other: vec![0.0; area.size.width()],
            whole: Vec::new(),
        }
    }

    fn open(&mut self, files: &[Arc<ExrFile>], at: ChannelRef, limit: u64) -> Result<(), Error> {
        let file = &files[at.file];
        let part = match self.parts.entry((at.file, at.part)) {
            Entry::Occupied(part) => part.into_mut(),
            Entry::Vacant(free) => free.insert(OpenPart {
                rows: PartRows::new(file.clone(), file.codec().clone(), at.part, limit)?,
                window: file.parts()[at.part].data_window(),
            }),
        };
        part.rows.keep(at.channel);
        Ok(())
    }

    /// Reads row `y` of the area from a channel; what lies beyond the channel's data window is NaN.
    pub(super) fn plane(&mut self, at: ChannelRef, y: usize, out: &mut [f32]) -> Result<(), Error> {
        let part = self
            .parts
            .get_mut(&(at.file, at.part))
            .expect("every part in use was opened");
        let (window, [left, top]) = (part.window, self.corner);
        // of the area's row and first column, in the part's window
        let row = i64::from(top) + (self.area.y + y) as i64 - i64::from(window.position.1);
        let column = i64::from(left) + self.area.x as i64 - i64::from(window.position.0);
        let inside = usize::try_from(row).ok().filter(|row| *row < window.size.1);
        let Some(row) = inside else {
            out.fill(f32::NAN);
            return Ok(());
        };
        if column == 0 && out.len() == window.size.0 {
            return part.rows.read_row(at.channel, row, out);
        }
        self.whole.resize(window.size.0, 0.0);
        part.rows.read_row(at.channel, row, &mut self.whole)?;
        for (value, x) in out.iter_mut().zip(column..) {
            let own = usize::try_from(x).ok().and_then(|x| self.whole.get(x));
            *value = own.copied().unwrap_or(f32::NAN);
        }
        Ok(())
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
