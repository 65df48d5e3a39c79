//! How the channels of an image's further features are grouped.

use std::ops::Range;

use linpred_core::{FEATURES, FURTHER};

use crate::error::Error;

/// Channels of a feature at most: more do not belong together as those of a vector or a colour do.
pub(crate) const FEATURE_CHANNELS: usize = 3;

/// The features of an image beside those of [`Feature`](crate::Feature): each has one to three channels, which are filtered together, and all have no more than
/// [`FURTHER`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FurtherFeatures {
    /// Channels of each; 0 for those that are not there.
    channels: [u8; FURTHER],
}

impl FurtherFeatures {
    /// With one more of so many channels.
    ///
    /// [`Error::Usage`] if they are none or more than three, or more than there is room for.
    pub fn with(mut self, channels: usize) -> Result<Self, Error> {
        if !(1..=FEATURE_CHANNELS).contains(&channels) {
            return Err(Error::Usage(format!(
                "a feature of {channels} channels: one has 1 to {FEATURE_CHANNELS}"
            )));
        }
        let all = self.channels() + channels;
        let free = self.channels.iter_mut().find(|own| **own == 0);
        match free.filter(|_| all <= FURTHER) {
            Some(own) => *own = channels as u8,
            None => {
                return Err(Error::Usage(format!(
                    "further features of {all} channels: there is room for {FURTHER}"
                )));
            }
        }
        Ok(self)
    }

    /// Channels of all.
    pub fn channels(self) -> usize {
        self.channels.iter().copied().map(usize::from).sum()
    }

    /// Where the channels of each are among the features of a row, in the order in which they came.
    pub fn ranges(self) -> impl Iterator<Item = Range<usize>> {
        let present = self.channels.into_iter().filter(|channels| *channels > 0);
        present.scan(FEATURES, |next, channels| {
            let start = *next;
            *next += usize::from(channels);
            Some(start..*next)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_follow_one_another_as_long_as_there_is_room() {
        let none = FurtherFeatures::default();
        let some = none.with(3).and_then(|some| some.with(1)).unwrap();
        let ranges: Vec<_> = some.ranges().collect();
        assert_eq!(ranges, [FEATURES..FEATURES + 3, FEATURES + 3..FEATURES + 4]);
        assert_eq!(some.with(2).unwrap().channels(), FURTHER);
        let error = some.with(3).unwrap_err().to_string();
        assert_eq!(error, "further features of 7 channels: there is room for 6");
        for channels in [0, 4] {
            assert!(matches!(none.with(channels), Err(Error::Usage(_))));
        }
    }
}
