//! Whether passes are of one picture, and of samples of their own.
//!
//! Two passes of one picture differ at a pixel by their noise, and by the same noise each of them differs from pixel to pixel. So a pixel speaks against a pass only where the
//! pass agrees with its neighbours, the others with theirs, and the two do not with each other: a firefly, an edge, a blade of grass, or noise of whatever size does not.
//! It takes no variance, and one sample per pixel is enough.

use std::fmt;

/// How many times the differences from neighbours, squared, a difference between passes is beyond noise.
const BEYOND_NOISE: f64 = 9.0;

/// Differences that are none, whatever the noise: what half floats round, and filters do at borders. Of features, which are some 1, as they are; of radiance by the mean of both.
const NO_DIFFERENCE: f64 = 0.02;

/// Pixels that must have been compared before anything is said.
const ENOUGH: u64 = 64;

/// What tells a pass from the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum By {
    /// Albedo and normal.
    Features,
    /// The radiance.
    Radiance,
}

impl By {
    const ALL: [Self; 2] = [Self::Features, Self::Radiance];

    /// Pixels on either side that a pixel is compared with. Few samples of radiance are often dark side by side, because what light there is is in the few that are not: they look as if they had no noise,
    /// unless one looks farther.
    const fn reach(self) -> usize {
        match self {
            Self::Features => 2,
            Self::Radiance => 10,
        }
    }

    /// The part of the pixels at which passes of one picture may differ beyond noise.
    ///
    /// Measured on five scenes at 4 against 16 and 64 samples, and between the two halves of 4, 16 and 64: at most 0.001 of the pixels by albedo and normal, none by radiance. Where a fiftieth of the samples
    /// has all the light, a pass of one sample differs from one of 256 at 0.09 of them by radiance. Between two scenes 0.63 or more by albedo and normal, half of all pairs at 0.25 or more by radiance: without features
    /// not all of them are told, but no pass is refused that is one.
    const fn most_differing(self) -> f64 {
        match self {
            Self::Features => 0.02,
            Self::Radiance => 0.2,
        }
    }

    /// What differs, for messages.
    pub(super) fn in_words(self) -> &'static str {
        match self {
            Self::Features => "albedo or normal",
            Self::Radiance => "colour",
        }
    }
}

/// How far a pass agrees with the others.
#[derive(Debug)]
pub(super) struct Agreement {
    /// By features, and by radiance.
    compared: [Compared; 2],
}

/// What one kind of channels says.
#[derive(Debug)]
struct Compared {
    /// Whether each pixel of the current row was compared, and whether it differs.
    row: Vec<(bool, bool)>,
    /// Pixels compared, and those that differ.
    pixels: u64,
    differing: u64,
}

impl Agreement {
    pub(super) fn new(width: usize) -> Self {
        let compared = |_| Compared {
            row: vec![(false, false); width],
            pixels: 0,
            differing: 0,
        };
        Self {
            compared: By::ALL.map(compared),
        }
    }

    /// Compares a row of one channel of the pass with what the others make of it; NaN where one of them has no sample.
    pub(super) fn compare(&mut self, by: By, own: &[f64], others: &[f64]) {
        for (x, (compared, differs)) in self.compared[by as usize].row.iter_mut().enumerate() {
            let difference = own[x] - others[x];
            let reach = by.reach();
            let noise = variation(own, x, reach).zip(variation(others, x, reach));
            let Some((noise, others_noise)) = noise.filter(|_| difference.is_finite()) else {
                continue;
            };
            let none = match by {
                By::Features => NO_DIFFERENCE,
                By::Radiance => NO_DIFFERENCE * 0.5 * (own[x] + others[x]),
            };
            let allowed = BEYOND_NOISE * (noise + others_noise + none * none);
            *compared = true;
            *differs |= difference * difference > allowed;
        }
    }

    /// Ends a row, all of whose channels have been compared.
    pub(super) fn end_row(&mut self) {
        for compared in &mut self.compared {
            for flags in &mut compared.row {
                compared.pixels += u64::from(flags.0);
                compared.differing += u64::from(flags.1);
                *flags = (false, false);
            }
        }
    }

    /// By what, and at which part of its pixels, the pass differs too much to be of one picture with the others.
    pub(super) fn verdict(&self) -> Option<(By, f64)> {
        By::ALL.into_iter().find_map(|by| {
            let Compared {
                pixels, differing, ..
            } = self.compared[by as usize];
            let share = differing as f64 / pixels.max(1) as f64;
            (pixels >= ENOUGH && share > by.most_differing()).then_some((by, share))
        })
    }
}

/// The mean squared difference of a pixel from its neighbours in the row that are so near, of which there are two at least.
fn variation(row: &[f64], x: usize, reach: usize) -> Option<f64> {
    let around = &row[x.saturating_sub(reach)..row.len().min(x + reach + 1)];
    let (mut sum, mut count) = (0.0, -1.0);
    for value in around {
        let difference = value - row[x];
        if difference.is_finite() {
            sum += difference * difference;
            count += 1.0;
        }
    }
    (count >= 2.0).then(|| sum / count)
}

/// What tells a pass from a copy of it: a checksum of its colours and counts.
#[derive(Default)]
pub(super) struct Content {
    crc: libdeflater::Crc,
    /// Whether any pixel differs from the one before it: empty pictures are alike without being copies.
    pub(super) varies: bool,
}

impl fmt::Debug for Content {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Content").finish_non_exhaustive()
    }
}

impl Content {
    /// Takes the next row of a channel.
    pub(super) fn add(&mut self, row: &[f32]) {
        self.add_counts(row);
        self.varies |= row.windows(2).any(|pair| pair[0] != pair[1]);
    }

    /// Takes the next row of counts.
    pub(super) fn add_counts(&mut self, row: &[f32]) {
        self.crc.update(bytemuck::cast_slice(row));
    }

    pub(super) fn sum(&self) -> u32 {
        self.crc.sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White noise of deviation 1: sums of twelve uniform numbers (Steele, Lea and Flood 2014, splitmix64).
    fn noise(seed: u64, count: usize) -> Vec<f64> {
        let uniform = |i: u64| {
            let mut z = (i + 1 + seed * 1_000_000).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let sum = |i: u64| (0..12).map(|k| uniform(i * 12 + k)).sum::<f64>() - 6.0;
        (0..count as u64).map(sum).collect()
    }

    fn verdict(by: By, own: &[f64], others: &[f64]) -> Option<(By, f64)> {
        let mut agreement = Agreement::new(own.len());
        agreement.compare(by, own, others);
        agreement.end_row();
        agreement.verdict()
    }

    #[test]
    fn noise_of_any_size_is_no_difference_and_a_shift_beyond_it_is() {
        let (a, b) = (noise(1, 1000), noise(2, 1000));
        for size in [0.0, 1e-3, 0.1, 10.0] {
            let row =
                |noise: &[f64]| -> Vec<f64> { noise.iter().map(|n| 0.5 + size * n).collect() };
            assert_eq!(verdict(By::Features, &row(&a), &row(&b)), None, "{size}");
            let shifted: Vec<f64> = row(&b).iter().map(|v| v + 0.2 + 10.0 * size).collect();
            let found = verdict(By::Features, &row(&a), &shifted);
            assert!(
                found.is_some_and(|(_, share)| share > 0.9),
                "{size}: {found:?}"
            );
        }
    }

    #[test]
    fn sparks_in_one_of_the_passes_are_no_difference() {
        let dark = vec![0.0; 1000];
        let sparks: Vec<f64> = (0..1000).map(|x| f64::from(x % 10 == 0) * 50.0).collect();
        assert_eq!(verdict(By::Radiance, &sparks, &dark), None);
    }

    /// Merged passes of rare light have less noise than the next one seems to have where it saw none.
    #[test]
    fn a_pass_that_saw_no_light_does_not_differ_from_many_that_did() {
        let uniform = |i: usize| (i as f64 * 0.618_033_988_749_9).fract();
        let one: Vec<f64> = (0..10_000)
            .map(|i| f64::from(uniform(i * 7919) < 0.1) * 10.0)
            .collect();
        let many: Vec<f64> = (0..10_000)
            .map(|i| 0.9 + 0.2 * uniform(i * 104_729))
            .collect();
        assert_eq!(verdict(By::Radiance, &one, &many), None);
    }

    #[test]
    fn pixels_without_samples_say_nothing() {
        let row = vec![f64::NAN; 1000];
        assert_eq!(verdict(By::Features, &row, &vec![1.0; 1000]), None);
        let mut few = row;
        few[..60].fill(3.0);
        assert_eq!(verdict(By::Features, &few, &vec![1.0; 1000]), None);
        few[..80].fill(3.0);
        let found = verdict(By::Features, &few, &vec![1.0; 1000]);
        assert_eq!(found, Some((By::Features, 1.0)));
    }

    #[test]
    fn only_pictures_with_something_in_them_are_copies() {
        let content = |rows: &[&[f32]]| {
            let mut content = Content::default();
            rows.iter().for_each(|row| content.add(row));
            (content.sum(), content.varies)
        };
        assert_eq!(content(&[&[0.0; 4]]), content(&[&[0.0; 4]]));
        assert!(!content(&[&[0.0; 4]]).1);
        assert!(content(&[&[0.0, 1.0]]).1);
        assert_ne!(content(&[&[0.0, 1.0]]), content(&[&[1.0, 0.0]]));
    }
}
