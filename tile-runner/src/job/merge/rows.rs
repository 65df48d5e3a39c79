//! A row of the output from the rows of the passes.

use linpred_core::Feature;

use crate::channels::names::ChannelRef;
use crate::channels::variance::Meaning;
use crate::error::Error;
use crate::exr_file::compression::SharedCodec;
use crate::job::merge::agreement::{Agreement, By, Content};
use crate::job::merge::channels::Kind;
use crate::job::merge::pass::{Pass, PassRows};
use crate::job::merge::pool::Pool;

/// One row in so many is looked at for whether the passes are of one picture.
const COMPARED_ROWS: usize = 4;

/// A channel of the output, and where it is in each pass.
#[derive(Debug)]
struct Source {
    kind: Kind,
    picture: usize,
    at: Vec<ChannelRef>,
    /// Whether passes of one picture are told by it.
    tells: Option<By>,
}

/// Merges rows. Channels are those of the first pass, in their order.
#[derive(Debug)]
pub(super) struct MergedRows {
    sources: Vec<Source>,
    passes: Vec<PassRows>,
    /// The row of each channel.
    pub(super) planes: Vec<Vec<f32>>,
    /// Of each picture, the samples of each pixel, and the pass that has most of them.
    totals: Vec<Vec<f64>>,
    most: Vec<Vec<usize>>,
    pub(super) agreements: Vec<Agreement>,
    pub(super) contents: Vec<Content>,
    /// Of the channel at work, in each pixel.
    pools: Vec<Pool>,
    row: Vec<f32>,
    noise: Vec<f32>,
    own: Vec<f64>,
    others: Vec<f64>,
}

impl MergedRows {
    /// Of passes of one picture whose channels are alike, each decoded by one codec in turn. Errors as for [`PassRows::new`].
    pub(super) fn new(passes: &[Pass], limit: u64) -> Result<Self, Error> {
        let first = &passes[0];
        let (width, pictures) = (first.pictures[0].width(), first.pictures.len());
        let codec = SharedCodec::default();
        let rows = passes.iter().map(|pass| PassRows::new(pass, &codec, limit));
        let list = first.channels.list.iter().enumerate();
        let sources: Vec<Source> = list
            .map(|(position, channel)| Source {
                kind: channel.kind,
                picture: channel.picture,
                // the numbers of samples come last, and are counted
                at: passes
                    .iter()
                    .filter_map(|pass| pass.channels.read().nth(position))
                    .map(|channel| channel.at)
                    .collect(),
                tells: tells(first, channel.at).filter(|_| channel.kind == Kind::Mean),
            })
            .collect();
        Ok(Self {
            planes: vec![vec![0.0; width]; sources.len()],
            sources,
            passes: rows.collect::<Result<_, Error>>()?,
            totals: vec![vec![0.0; width]; pictures],
            most: vec![vec![0; width]; pictures],
            agreements: passes.iter().map(|_| Agreement::new(width)).collect(),
            contents: passes.iter().map(|_| Content::default()).collect(),
            pools: vec![Pool::default(); width],
            row: vec![0.0; width],
            noise: vec![0.0; width],
            own: vec![0.0; width],
            others: vec![0.0; width],
        })
    }

    /// Bytes that they take, beside the chunks that the passes are read from.
    pub(super) fn bytes(passes: &[Pass]) -> u64 {
        let first = &passes[0];
        let pictures = first.pictures.len() as u64;
        let of_pass = pictures * (size_of::<f32>() + size_of::<bool>()) as u64 + 4;
        let of_picture = (size_of::<f64>() + size_of::<usize>()) as u64;
        let working = (size_of::<Pool>() + 2 * size_of::<f32>() + 2 * size_of::<f64>()) as u64;
        let planes = (first.channels.list.len() * size_of::<f32>()) as u64;
        let pixel = of_pass * passes.len() as u64 + of_picture * pictures + working + planes;
        pixel.saturating_mul(first.pictures[0].width() as u64)
    }

    /// The samples of each pixel of a picture in the current row.
    pub(super) fn totals(&self, picture: usize) -> &[f64] {
        &self.totals[picture]
    }

    /// Pixels of all passes that took no part because they are not finite.
    pub(super) fn lost(&self) -> u64 {
        self.passes.iter().map(|pass| pass.lost).sum()
    }

    /// Merges row `y` of every channel into `planes`.
    pub(super) fn merge(&mut self, y: usize) -> Result<(), Error> {
        self.count(y)?;
        let sources = std::mem::take(&mut self.sources);
        let mut channels = sources.iter().enumerate();
        let merged = channels.try_for_each(|(channel, source)| {
            let mut plane = std::mem::take(&mut self.planes[channel]);
            let merged = self.merge_channel(source, &sources, y, &mut plane);
            self.planes[channel] = plane;
            merged
        });
        self.sources = sources;
        self.agreements.iter_mut().for_each(Agreement::end_row);
        merged
    }

    fn merge_channel(
        &mut self,
        source: &Source,
        sources: &[Source],
        y: usize,
        plane: &mut [f32],
    ) -> Result<(), Error> {
        match source.kind {
            Kind::Mean => {
                self.average(source, y, plane)?;
                match source.tells {
                    Some(by) => self.compare(source, by, y),
                    None => Ok(()),
                }
            }
            Kind::Moment => {
                self.average(source, y, plane)?;
                self.forget_incomplete(source.picture, plane);
                Ok(())
            }
            Kind::Noise { of, meaning } => self.pool(&sources[of], source, meaning, y, plane),
            Kind::Identifier { integer } => self.choose(source, integer, y, plane),
            Kind::Samples => {
                let totals = self.totals[source.picture].iter();
                plane
                    .iter_mut()
                    .zip(totals)
                    .for_each(|(n, total)| *n = *total as f32);
                Ok(())
            }
        }
    }

    /// Counts the samples of every pass in row `y`.
    fn count(&mut self, y: usize) -> Result<(), Error> {
        for (totals, most) in self.totals.iter_mut().zip(&mut self.most) {
            totals.fill(0.0);
            most.fill(0);
        }
        for pass in &mut self.passes {
            pass.count(y, &mut self.row)?;
        }
        let pictures = self.totals.iter_mut().zip(&mut self.most).enumerate();
        for (picture, (totals, most)) in pictures {
            for (x, (total, most)) in totals.iter_mut().zip(most).enumerate() {
                let mut best = 0.0;
                for (index, pass) in self.passes.iter().enumerate() {
                    let count = pass.samples[picture].counts[x];
                    *total += f64::from(count);
                    if count > best {
                        (best, *most) = (count, index);
                    }
                }
            }
        }
        for (pass, content) in self.passes.iter().zip(&mut self.contents) {
            pass.samples
                .iter()
                .for_each(|own| content.add_counts(&own.counts));
        }
        Ok(())
    }

    /// The mean of a channel. Values that are not finite take no part where another pass has one that is: a depth of infinity stays where all passes have it.
    fn average(&mut self, source: &Source, y: usize, plane: &mut [f32]) -> Result<(), Error> {
        self.pools.fill(Pool::default());
        plane.fill(0.0);
        for (index, pass) in self.passes.iter_mut().enumerate() {
            pass.read(source.at[index], y, &mut self.row)?;
            if source.tells == Some(By::Radiance) {
                self.contents[index].add(&self.row);
            }
            let counts = &pass.samples[source.picture].counts;
            for (x, (&value, &count)) in self.row.iter().zip(counts).enumerate() {
                if count > 0.0 && value.is_finite() {
                    self.pools[x].add(f64::from(count), f64::from(value), f64::NAN);
                } else if count > 0.0 {
                    plane[x] = value;
                }
            }
        }
        let pools = plane.iter_mut().zip(&self.pools);
        for (value, pool) in pools.filter(|(_, pool)| pool.samples() > 0.0) {
            *value = pool.mean() as f32;
        }
        Ok(())
    }

    /// Makes a mean that some samples are missing from NaN: a second moment tells nothing without them, for the mean has them.
    fn forget_incomplete(&self, picture: usize, plane: &mut [f32]) {
        let totals = self.totals[picture].iter().zip(&self.pools);
        for (value, (total, pool)) in plane.iter_mut().zip(totals) {
            if pool.samples() < *total {
                *value = f32::NAN;
            }
        }
    }

    /// The noise of a mean.
    fn pool(
        &mut self,
        mean: &Source,
        noise: &Source,
        meaning: Meaning,
        y: usize,
        plane: &mut [f32],
    ) -> Result<(), Error> {
        self.pools.fill(Pool::default());
        let of_radiance = mean.tells == Some(By::Radiance);
        for (index, pass) in self.passes.iter_mut().enumerate() {
            pass.read(mean.at[index], y, &mut self.row)?;
            pass.read(noise.at[index], y, &mut self.noise)?;
            let samples = &pass.samples[noise.picture];
            for (x, &count) in samples.counts.iter().enumerate() {
                if count > 0.0 && self.row[x].is_finite() {
                    let (n, mean) = (f64::from(count), f64::from(self.row[x]));
                    let variance = match (meaning, f64::from(self.noise[x])) {
                        _ if of_radiance && samples.unknown[x] => f64::NAN,
                        (Meaning::OfMean, variance) => n * variance,
                        (_, variance) => variance,
                    };
                    self.pools[x].add(n, mean, variance);
                }
            }
        }
        for (value, pool) in plane.iter_mut().zip(&self.pools) {
            *value = match meaning {
                Meaning::OfMean => pool.variance_of_mean(),
                _ => pool.variance_of_sample(),
            } as f32;
        }
        Ok(())
    }

    /// Takes each pixel from the pass that has most samples in it, of equal ones from the first.
    fn choose(
        &mut self,
        source: &Source,
        integer: bool,
        y: usize,
        plane: &mut [f32],
    ) -> Result<(), Error> {
        plane.fill(0.0);
        for (index, pass) in self.passes.iter_mut().enumerate() {
            match integer {
                true => pass.read_integers(source.at[index], y, &mut self.row)?,
                false => pass.read(source.at[index], y, &mut self.row)?,
            }
            let chosen = self.most[source.picture].iter();
            let chosen = chosen.zip(&pass.samples[source.picture].counts);
            for (x, (&most, &count)) in chosen.enumerate() {
                if most == index && count > 0.0 {
                    plane[x] = self.row[x];
                }
            }
        }
        Ok(())
    }

    /// Compares each pass with what the others make of a channel, whose pools are there.
    fn compare(&mut self, source: &Source, by: By, y: usize) -> Result<(), Error> {
        if !y.is_multiple_of(COMPARED_ROWS) {
            return Ok(());
        }
        for (index, pass) in self.passes.iter_mut().enumerate() {
            pass.read(source.at[index], y, &mut self.row)?;
            for (x, &count) in pass.samples[source.picture].counts.iter().enumerate() {
                let (n, value, pool) = (f64::from(count), f64::from(self.row[x]), &self.pools[x]);
                let rest = pool.samples() - n;
                (self.own[x], self.others[x]) = match n > 0.0 && value.is_finite() && rest > 0.0 {
                    true => (value, (pool.samples() * pool.mean() - n * value) / rest),
                    false => (f64::NAN, f64::NAN),
                };
            }
            self.agreements[index].compare(by, &self.own, &self.others);
        }
        Ok(())
    }
}

/// What passes of one picture are told by.
fn tells(pass: &Pass, at: ChannelRef) -> Option<By> {
    let mut roles = pass.pictures.iter().map(|picture| &picture.roles);
    roles.find_map(|roles| {
        let feature = |feature| {
            let found = roles.feature(feature);
            found.is_some_and(|found| found.channels.contains(&at))
        };
        if roles.colour.contains(&at) {
            Some(By::Radiance)
        } else if feature(Feature::Albedo) || feature(Feature::Normal) {
            Some(By::Features)
        } else {
            None
        }
    })
}
