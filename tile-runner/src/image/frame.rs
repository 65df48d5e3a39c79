//! An image in memory as rows in: whatever its pixels look like there.

use std::ops::Range;

use linpred_core::Feature;

use crate::channels::variance::{Meaning, to_variance_of_mean, variance_from_halves};
use crate::error::Error;
use crate::geometry::ImageSize;
use crate::row::{InputRow, RowLayout, RowSource, VarianceKind};

/// Pixels in memory, of some channels. A renderer implements it for its buffers.
pub trait Pixels: Send + Sync {
    /// Columns and rows.
    fn size(&self) -> (usize, usize);

    /// Channels of a pixel.
    fn channels(&self) -> usize;

    /// Writes row `y` of a channel to `row`, which has as many pixels as there are columns.
    fn read_row(&self, channel: usize, y: usize, row: &mut [f32]);
}

/// Pixels of `N` channels each, row after row without gaps.
#[derive(Clone, Copy, Debug)]
pub struct Interleaved<'a, const N: usize> {
    size: ImageSize,
    pixels: &'a [[f32; N]],
}

impl<'a, const N: usize> Interleaved<'a, N> {
    /// [`Error::Usage`] if there are not as many pixels as the size says.
    pub fn new(size: ImageSize, pixels: &'a [[f32; N]]) -> Result<Self, Error> {
        let (width, height) = (size.width(), size.height());
        if width.checked_mul(height) != Some(pixels.len()) {
            return Err(Error::Usage(format!(
                "{} pixels are not an image of {width} x {height}",
                pixels.len()
            )));
        }
        Ok(Self { size, pixels })
    }
}

impl<const N: usize> Pixels for Interleaved<'_, N> {
    fn size(&self) -> (usize, usize) {
        (self.size.width(), self.size.height())
    }

    fn channels(&self) -> usize {
        N
    }

    fn read_row(&self, channel: usize, y: usize, row: &mut [f32]) {
        let own = self.pixels.chunks_exact(self.size.width()).nth(y);
        for (value, pixel) in row.iter_mut().zip(own.into_iter().flatten()) {
            *value = pixel[channel];
        }
    }
}

/// Pixels that a frame keeps.
type Kept<'a> = Box<dyn Pixels + 'a>;

/// What is known of the noise of some channels.
enum Noise<'a> {
    Unknown,
    Variance(Kept<'a>),
    Halves(Kept<'a>, Kept<'a>),
}

/// An image in memory: a colour, and what there is beside it. Values mean what those of [`InputRow`] mean; a variance below 0 is taken for one that is not known. The crate's example shows one.
pub struct Frame<'a> {
    layout: RowLayout,
    colour: Kept<'a>,
    noise: Noise<'a>,
    /// With the place of their channels in a row.
    features: Vec<(Range<usize>, Kept<'a>, Option<Kept<'a>>)>,
    /// What the further ones among them are called.
    further: Vec<String>,
    layers: Vec<Kept<'a>>,
    alpha: Option<Kept<'a>>,
    scalars: Vec<Kept<'a>>,
    samples: Option<Kept<'a>>,
    other: Vec<f32>,
}

impl<'a> Frame<'a> {
    /// A colour, red green blue. [`Error::Usage`] if it has no pixels, too many, or other channels.
    pub fn new(colour: impl Pixels + 'a) -> Result<Self, Error> {
        let (width, height) = colour.size();
        let size = ImageSize::new(width, height).ok_or_else(|| {
            Error::Usage(format!(
                "colour: {width} x {height} pixels are no image, whose sides are 1 to 2^31 - 1"
            ))
        })?;
        let layout = RowLayout::new(size, VarianceKind::Estimated);
        Ok(Self {
            colour: kept("colour", 3, &layout, colour)?,
            other: vec![0.0; width],
            layout,
            noise: Noise::Unknown,
            features: Vec::new(),
            further: Vec::new(),
            layers: Vec::new(),
            alpha: None,
            scalars: Vec::new(),
            samples: None,
        })
    }

    /// The colour's noise: variances of the mean of a pixel's samples. This and the following refuse pixels of another size or other channels with [`Error::Usage`].
    pub fn with_variance(mut self, variance: impl Pixels + 'a) -> Result<Self, Error> {
        let variance = kept("variance", 3, &self.layout, variance)?;
        self.layout.variance = VarianceKind::OfMean;
        self.noise = Noise::Variance(variance);
        Ok(self)
    }

    /// The colour's noise: the means of either half of a pixel's samples, of which the colour is the mean.
    pub fn with_halves(mut self, a: impl Pixels + 'a, b: impl Pixels + 'a) -> Result<Self, Error> {
        let a = kept("first half", 3, &self.layout, a)?;
        let b = kept("second half", 3, &self.layout, b)?;
        self.layout.variance = VarianceKind::OfHalves;
        self.noise = Noise::Halves(a, b);
        Ok(self)
    }

    /// A feature, whose noise is estimated.
    pub fn with_feature(self, feature: Feature, pixels: impl Pixels + 'a) -> Result<Self, Error> {
        let kept = kept(feature.name(), feature.range().len(), &self.layout, pixels)?;
        self.feature(feature, kept, None)
    }

    /// A feature and the variances of its means.
    pub fn with_feature_and_variance(
        self,
        feature: Feature,
        pixels: impl Pixels + 'a,
        variance: impl Pixels + 'a,
    ) -> Result<Self, Error> {
        let (name, channels) = (feature.name(), feature.range().len());
        let pixels = kept(name, channels, &self.layout, pixels)?;
        let name = format!("variance of the {name}");
        let variance = kept(&name, channels, &self.layout, variance)?;
        self.feature(feature, pixels, Some(variance))
    }

    fn feature(
        mut self,
        feature: Feature,
        pixels: Kept<'a>,
        variance: Option<Kept<'a>>,
    ) -> Result<Self, Error> {
        if self.layout.has(feature) {
            return Err(Error::Usage(format!("{} is given twice", feature.name())));
        }
        self.layout = match variance {
            Some(_) => self.layout.with_feature_and_variance(feature),
            None => self.layout.with_feature(feature),
        };
        self.features.push((feature.range(), pixels, variance));
        Ok(self)
    }

    /// A feature beside normal, albedo and depth that light may follow, of one to three channels that belong together; its noise is estimated. Not finite, or a magnitude of 1e9 or more: as
    /// for [`RowLayout::with_further_feature`]. [`Error::Usage`] also if all have more than [`FURTHER`](crate::FURTHER) channels, or one of this name is there.
    pub fn with_further_feature(self, name: &str, pixels: impl Pixels + 'a) -> Result<Self, Error> {
        self.further(name, pixels, None::<Interleaved<'a, 1>>)
    }

    /// The same of one and the variances of its means.
    pub fn with_further_feature_and_variance(
        self,
        name: &str,
        pixels: impl Pixels + 'a,
        variance: impl Pixels + 'a,
    ) -> Result<Self, Error> {
        self.further(name, pixels, Some(variance))
    }

    fn further(
        mut self,
        name: &str,
        pixels: impl Pixels + 'a,
        variance: Option<impl Pixels + 'a>,
    ) -> Result<Self, Error> {
        if Feature::ALL.iter().any(|feature| feature.name() == name) {
            let problem = format!("{name} is a feature that is known, and no further one");
            return Err(Error::Usage(problem));
        }
        if self.further.iter().any(|other| other == name) {
            return Err(Error::Usage(format!("{name} is given twice")));
        }
        let channels = pixels.channels();
        let pixels = kept(name, channels, &self.layout, pixels)?;
        let variance = match variance {
            Some(variance) => {
                let name = format!("variance of the {name}");
                Some(kept(&name, channels, &self.layout, variance)?)
            }
            None => None,
        };
        let layout = match variance {
            Some(_) => self.layout.with_further_feature_and_variance(channels),
            None => self.layout.with_further_feature(channels),
        };
        self.layout = layout.map_err(|error| Error::Usage(format!("{name}: {error}")))?;
        let range = self.layout.further_features().last();
        self.features
            .extend(range.map(|range| (range, pixels, variance)));
        self.further.push(name.to_owned());
        Ok(self)
    }

    /// One more layer of light, denoised with the models of the colour.
    pub fn with_layer(mut self, name: &str, layer: impl Pixels + 'a) -> Result<Self, Error> {
        self.layers.push(kept(name, 3, &self.layout, layer)?);
        self.layout.layers += 1;
        Ok(self)
    }

    /// The alpha, 0 to 1, by which the colour is premultiplied.
    pub fn with_alpha(mut self, alpha: impl Pixels + 'a) -> Result<Self, Error> {
        self.alpha = Some(kept("alpha", 1, &self.layout, alpha)?);
        self.layout.alpha = true;
        Ok(self)
    }

    /// One more channel that is no light, denoised likewise.
    pub fn with_scalar(mut self, name: &str, scalar: impl Pixels + 'a) -> Result<Self, Error> {
        self.scalars.push(kept(name, 1, &self.layout, scalar)?);
        self.layout.scalars += 1;
        Ok(self)
    }

    /// How many samples each pixel has.
    pub fn with_samples(mut self, samples: impl Pixels + 'a) -> Result<Self, Error> {
        self.samples = Some(kept("samples", 1, &self.layout, samples)?);
        self.layout.samples = true;
        Ok(self)
    }
}

impl std::fmt::Debug for Frame<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Frame")
            .field("layout", &self.layout)
            .finish_non_exhaustive()
    }
}

/// The pixels, if they have the size of the image and so many channels.
fn kept<'a>(
    name: &str,
    channels: usize,
    layout: &RowLayout,
    pixels: impl Pixels + 'a,
) -> Result<Kept<'a>, Error> {
    let (width, height) = pixels.size();
    let wanted = (layout.size.width(), layout.size.height());
    if (width, height) != wanted {
        return Err(Error::Usage(format!(
            "{name}: {width} x {height} pixels, but the colour has {} x {}",
            wanted.0, wanted.1
        )));
    }
    if pixels.channels() != channels {
        return Err(Error::Usage(format!(
            "{name}: {} channels, not {channels}",
            pixels.channels()
        )));
    }
    Ok(Box::new(pixels))
}

/// Reads a row of each channel.
fn read<'r>(pixels: &Kept<'_>, y: usize, rows: impl IntoIterator<Item = &'r mut Vec<f32>>) {
    for (channel, row) in rows.into_iter().enumerate() {
        pixels.read_row(channel, y, row);
    }
}

impl RowSource for Frame<'_> {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        read(&self.colour, y, &mut row.colour);
        match &self.noise {
            Noise::Unknown => {}
            Noise::Variance(variance) => read_variance(variance, y, &mut row.variance),
            Noise::Halves(a, b) => {
                read(a, y, &mut row.variance);
                for (channel, variance) in row.variance.iter_mut().enumerate() {
                    b.read_row(channel, y, &mut self.other);
                    variance_from_halves(variance, &self.other);
                }
            }
        }
        for (range, pixels, variance) in &self.features {
            read(pixels, y, &mut row.features[range.clone()]);
            if let Some(variance) = variance {
                read_variance(variance, y, &mut row.feature_variances[range.clone()]);
            }
        }
        for (pixels, planes) in self.layers.iter().zip(&mut row.layers) {
            read(pixels, y, planes);
        }
        if let Some(alpha) = &self.alpha {
            alpha.read_row(0, y, &mut row.alpha);
        }
        for (pixels, plane) in self.scalars.iter().zip(&mut row.scalars) {
            pixels.read_row(0, y, plane);
        }
        if let Some(samples) = &self.samples {
            samples.read_row(0, y, &mut row.samples);
        }
        Ok(())
    }
}

fn read_variance(variance: &Kept<'_>, y: usize, rows: &mut [Vec<f32>]) {
    for (channel, row) in rows.iter_mut().enumerate() {
        variance.read_row(channel, y, row);
        to_variance_of_mean(Meaning::OfMean, row, &[], &[]);
    }
}
