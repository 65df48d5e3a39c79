//! Finds the noise of further features.

use exr::meta::attribute::SampleType;

use super::further::refused;
use super::{NamedFeature, Search};
use crate::channels::names::ChannelRef;
use crate::channels::presets::MOMENT;
use crate::channels::samples::Samples;
use crate::channels::variance::{Meaning, Variance};
use crate::error::Error;

/// How renderers call the variance of a layer, by what stands before and after its name, and what it holds.
const VARIANCES: [(&str, &str, Meaning); 6] = [
    ("", "Variance", Meaning::OfMean),
    ("", " Variance", Meaning::OfMean),
    ("", "_variance", Meaning::OfMean),
    ("", "_mse", Meaning::OfMean),
    ("", "_var", Meaning::OfSample),
    (MOMENT, "", Meaning::SecondMoment),
];

impl Search<'_> {
    /// The variance of the mean that is said to be in these channels or in this layer.
    pub(super) fn stated_variance(
        &self,
        feature: &NamedFeature,
        target: &str,
        means: &[ChannelRef],
    ) -> Result<Variance, Error> {
        let joined = target
            .split(',')
            .map(|own| self.names.channel(0, own.trim()));
        let joined: Option<Vec<ChannelRef>> = joined.collect();
        let joined = joined.filter(|channels| channels.len() == means.len());
        let channels = joined.or_else(|| {
            let (layer, all) = self.channels_called(target)?;
            self.beside(&layer, means)
                .or_else(|| (all.len() == means.len()).then_some(all))
        });
        let channels = channels.ok_or_else(|| {
            let path = self.names.files()[0].path().display();
            let (count, of) = (means.len(), self.in_words(means));
            let problem = format!("{path} has no {target} of {count} channels, as many as {of}, whose variance it is to be");
            refused(&feature.name, problem)
        })?;
        Ok(Variance::Given {
            meaning: Meaning::OfMean,
            channels,
            count: None,
        })
    }

    /// The channels of a layer whose components are called as those of the means, or its only one for a single mean.
    fn beside(&self, layer: &str, means: &[ChannelRef]) -> Option<Vec<ChannelRef>> {
        let all = self.channels_of_layer(layer);
        let own = |mean: &ChannelRef| {
            let component = self.component(*mean);
            let mut all = all.iter();
            all.find(|at| self.component(**at) == component).copied()
        };
        let alike: Option<Vec<ChannelRef>> = means.iter().map(own).collect();
        alike.or_else(|| (all.len() == 1 && means.len() == 1).then_some(all))
    }

    /// The variance of a feature's channels by what renderers call it, or [`Variance::None`]: then it is estimated.
    pub(super) fn further_variance(
        &mut self,
        means: &[ChannelRef],
        samples: Option<&Samples>,
    ) -> Variance {
        if let Some(file) = self.request.other_half {
            let twins = means.iter().map(|at| self.names.twin(*at, file));
            let twins: Result<Vec<ChannelRef>, Error> = twins.collect();
            return twins.map_or(Variance::None, Variance::OtherFile);
        }
        let count = samples.map(|samples| samples.count);
        let own = self.layer_of(means[0]).to_owned();
        let stem = match own.is_empty() {
            true => self.component(means[0]),
            false => own,
        };
        for (before, after, meaning) in VARIANCES {
            let name = format!("{before}{stem}{after}");
            let single = || {
                (means.len() == 1)
                    .then(|| self.names.channel(0, &name))
                    .flatten()
            };
            let channels = self
                .beside(&name, means)
                .or_else(|| single().map(|at| vec![at]));
            let Some(channels) = channels.filter(|channels| self.decodable(channels)) else {
                continue;
            };
            let half = |at: &ChannelRef| {
                let part = &self.names.files()[at.file].parts()[at.part];
                part.sample_type(at.channel) == SampleType::F16
            };
            let problem = if meaning.needs_count() && count.is_none() {
                Some("the number of samples is not known")
            } else if meaning == Meaning::SecondMoment && channels.iter().chain(means).any(half) {
                Some("second moments in half precision keep no digit of it")
            } else {
                None
            };
            match problem {
                Some(problem) => self.warnings.push(format!("{name} not used: {problem}")),
                None => {
                    return Variance::Given {
                        meaning,
                        channels,
                        count,
                    };
                }
            }
        }
        Variance::None
    }
}
