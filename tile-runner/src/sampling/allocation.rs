//! From demands to whole samples: how high totals rise for a budget, and which pixels get the samples that fractions leave.

use linpred_core::{Sampler, pixel_hash};

use super::demands::{Demand, Demands};
use super::goal::{Goal, MOST_SAMPLES};
use super::map::{SampleMap, Summary};
use super::scratch::{RowFile, Scratch};
use crate::error::Error;
use crate::quantile::values_at;

/// The map that reaches a goal.
pub(super) fn allocate(
    demands: &mut Demands,
    goal: Goal,
    scratch: &Scratch,
) -> Result<SampleMap, Error> {
    let error = demands.error;
    if goal.error.is_some_and(|target| error <= target) {
        return write(demands, &Shares::NONE, 0, scratch);
    }
    let most = goal.budget.unwrap_or(f64::from(MOST_SAMPLES));
    // a budget that is above 0 gives something
    let most = (most * demands.size.pixels() as f64).round().max(1.0);
    let mut level = HIGHEST;
    let mut budget = match goal.error {
        None => most,
        Some(target) => smallest_budget(demands, target, most, &mut level)?,
    };
    loop {
        let shares = Shares::of(demands, budget, &mut level)?;
        let map = write(demands, &shares, budget as u64, scratch)?;
        let error = map.summary().error_then;
        // whole samples do a little less than the shares they stand for
        if budget < most && goal.error.is_some_and(|target| error > target) {
            budget = (PRECISION * budget).ceil().min(most);
            continue;
        }
        return Ok(map);
    }
}

/// How a budget is shared out, before it is rounded.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shares {
    /// Totals rise to this, in demands.
    level: f64,
    /// What each noisy pixel gets beside.
    even: f64,
    /// Whether all pixels are treated as noisy ones, because none is.
    all: bool,
}

impl Shares {
    const NONE: Self = Self {
        level: 0.0,
        even: 0.0,
        all: false,
    };

    /// Those of so many samples. The search for the level starts from `level`, and leaves what it found there.
    fn of(demands: &mut Demands, budget: f64, level: &mut f64) -> Result<Self, Error> {
        if demands.noisy == 0 {
            return Ok(Self {
                even: budget / demands.size.pixels() as f64,
                all: true,
                ..Self::NONE
            });
        }
        let even = demands.sampler.even * budget;
        *level = rise(demands, budget - even, *level)?;
        Ok(Self {
            level: *level,
            even: even / demands.noisy as f64,
            all: false,
        })
    }

    /// The share of a pixel; `None` if it gets nothing whatever the budget.
    fn share(&self, sampler: &Sampler, pixel: &Demand) -> Option<f64> {
        if self.all {
            return Some(self.even);
        }
        let demand = pixel.demand?;
        Some(sampler.missing(self.level, demand, pixel.samples) + self.even)
    }

    /// Gives the share of every pixel that has one to `each`, row by row, with its column and row.
    fn for_each(
        &self,
        demands: &mut Demands,
        mut each: impl FnMut(usize, usize, f64),
    ) -> Result<(), Error> {
        let sampler = demands.sampler;
        demands.for_each(|x, y, pixel| {
            if let Some(share) = self.share(&sampler, &pixel) {
                each(x, y, share);
            }
        })
    }
}

/// Above all levels: whoever demands something lacks something.
const HIGHEST: f64 = f64::MAX;

/// The most passes of [`rise`]; it takes some five.
const PASSES: usize = 64;

/// The level at which what all pixels lack sums up to `samples`: Newton's method on a sum that is convex and piecewise linear in the level, so that it ends at
/// the root itself. What a pixel lacks at the level L is `max(0, L w - n)`.
fn rise(demands: &mut Demands, samples: f64, start: f64) -> Result<f64, Error> {
    let mut level = start;
    for _ in 0..PASSES {
        let (mut demand, mut have) = (0.0, 0.0);
        demands.for_each(|_, _, pixel| {
            if let Some(own) = pixel.demand
                && own > 0.0
                && own > pixel.samples / level
            {
                demand += own;
                have += pixel.samples;
            }
        })?;
        let next = match demand > 0.0 {
            true => (samples + have) / demand,
            // nobody lacks anything yet at this level: from above, or not at all
            false if level < HIGHEST => HIGHEST,
            false => return Ok(0.0),
        };
        if next == level {
            break;
        }
        level = next;
    }
    Ok(level)
}

/// The budget is found to within this factor.
const PRECISION: f64 = 1.001;

/// As few samples as it takes until the expected mean error is `target`, `most` if that many do not suffice.
fn smallest_budget(
    demands: &mut Demands,
    target: f64,
    most: f64,
    level: &mut f64,
) -> Result<f64, Error> {
    let mut left = |budget: f64| -> Result<f64, Error> {
        let shares = Shares::of(demands, budget, level)?;
        expected_error(demands, &shares)
    };
    let (mut too_few, mut enough) = (0.0, 1.0_f64.min(most));
    while left(enough)? > target {
        if enough >= most {
            return Ok(most);
        }
        (too_few, enough) = (enough, (4.0 * enough).min(most));
    }
    while enough > PRECISION * too_few && enough - too_few > 1.0 {
        let middle = (too_few.max(1.0) * enough).sqrt();
        match left(middle)? > target {
            true => too_few = middle,
            false => enough = middle,
        }
    }
    Ok(enough.ceil().min(most))
}

/// The mean relative error once the shares are rendered.
fn expected_error(demands: &mut Demands, shares: &Shares) -> Result<f64, Error> {
    let (mut sum, sampler) = (0.0, demands.sampler);
    let pixels = demands.size.pixels() as f64;
    demands.for_each(|_, _, pixel| {
        let more = shares.share(&sampler, &pixel).unwrap_or(0.0);
        sum += sampler.expected_error(pixel.error, pixel.samples, more);
    })?;
    Ok(sum / pixels)
}

/// Which pixels get one sample more than the whole ones of their share: those whose fraction is the most above their hash, as many as samples are left. A share is its pixel's
/// expected number of samples, over hashes.
struct Rounding {
    salt: u64,
    /// What all pixels get beside, should there be more left than pixels.
    each: u64,
    /// The least that a fraction must be above its hash, and how many pixels with just that get one, too.
    least: f64,
    ties: u64,
}

impl Rounding {
    fn new(demands: &mut Demands, shares: &Shares, budget: u64) -> Result<Self, Error> {
        // the samples of an image tell its passes apart
        let salt = demands.samples as u64;
        let (mut given, mut pixels) = (0, 0);
        shares.for_each(demands, |_, _, share| {
            given += share.floor() as u64;
            pixels += 1;
        })?;
        let left = budget.saturating_sub(given);
        let mut rounding = Self {
            salt,
            each: left.checked_div(pixels).unwrap_or(0),
            least: f64::INFINITY,
            ties: 0,
        };
        let left = left.checked_rem(pixels).unwrap_or(0);
        if left == 0 {
            return Ok(rounding);
        }
        let place = |pixels: u64| (pixels - left) as f64;
        let keys = |each: &mut dyn FnMut(f64)| {
            shares.for_each(demands, |x, y, share| each(rounding.key(x, y, share)))
        };
        let [least] = values_at([&place], keys)?;
        let mut above = 0;
        shares.for_each(demands, |x, y, share| {
            above += u64::from(rounding.key(x, y, share) > least);
        })?;
        rounding.least = least;
        rounding.ties = left.saturating_sub(above);
        Ok(rounding)
    }

    /// How far the fraction of a share is above the pixel's hash.
    fn key(&self, x: usize, y: usize, share: f64) -> f64 {
        share.fract() - pixel_hash(x as u32, y as u32, self.salt)
    }

    /// The whole samples of a share; asked for once for each pixel, row by row.
    fn whole(&mut self, x: usize, y: usize, share: f64) -> u64 {
        let key = self.key(x, y, share);
        let tie = key == self.least && self.ties > 0;
        self.ties -= u64::from(tie);
        share.floor() as u64 + self.each + u64::from(tie || key > self.least)
    }
}

/// Writes the map of `budget` samples.
fn write(
    demands: &mut Demands,
    shares: &Shares,
    budget: u64,
    scratch: &Scratch,
) -> Result<SampleMap, Error> {
    let (size, sampler) = (demands.size, demands.sampler);
    let mut rounding = Rounding::new(demands, shares, budget)?;
    let mut rows = RowFile::new(scratch, size.width(), 1);
    let mut row = vec![0_u32; size.width()];
    let (mut added, mut most, mut error) = (0, 0, 0.0);
    for y in 0..size.height() {
        demands.for_row(y, |x, pixel| {
            let share = shares.share(&sampler, &pixel);
            let more = share.map_or(0, |share| rounding.whole(x, y, share));
            added += more;
            most = most.max(more);
            error += sampler.expected_error(pixel.error, pixel.samples, more as f64);
            row[x] = u32::try_from(more).unwrap_or(u32::MAX);
        })?;
        rows.push(&[&row[..]])?;
    }
    debug_assert_eq!(added, budget, "the budget is spent");
    if most > u64::from(MOST_SAMPLES) {
        return Err(Error::Usage(format!(
            "a pixel would get {most} samples, more than {MOST_SAMPLES}: ask for a smaller budget, or a larger error"
        )));
    }
    let summary = Summary {
        pixels: size.pixels(),
        samples: demands.samples as u64,
        added,
        most: most as u32,
        error: demands.error,
        error_then: error / size.pixels() as f64,
    };
    Ok(SampleMap::new(size, rows, summary))
}
