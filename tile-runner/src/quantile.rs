//! Values at given places of an order too long to hold, exactly: radix selection in several passes over them.

use crate::error::Error;

/// Bits of a value that one pass finds out.
const DIGIT: u32 = 16;
/// Values that are collected and sorted at last: they take as much memory as the bins do.
const COLLECTED: u64 = 1 << 16;
/// Bytes of bins and collected values of `places` that are searched for at once.
pub(crate) const fn bytes(places: u64) -> u64 {
    places * 2 * COLLECTED * size_of::<u64>() as u64
}

/// The values at `places` of all of them in order, from 0 on; between two it is linear. NaN if there are none.
///
/// `pass` gives all values to its argument, the same ones whenever it is called, none of them NaN: some two or three times, at most five. A place is asked for
/// after the first time, with the number of the values, and lies among them.
pub(crate) fn values_at<const N: usize>(
    places: [&dyn Fn(u64) -> f64; N],
    mut pass: impl FnMut(&mut dyn FnMut(f64)) -> Result<(), Error>,
) -> Result<[f64; N], Error> {
    let mut searches = places.map(|_| Search::new());
    let mut count = |searches: &mut [Search; N]| {
        pass(&mut |value| {
            let key = key(value);
            searches.iter_mut().for_each(|search| search.take(key));
        })
    };
    count(&mut searches)?;
    let values: u64 = searches.first().map_or(0, Search::counted);
    if values == 0 {
        return Ok([f64::NAN; N]);
    }
    for (search, place) in searches.iter_mut().zip(places) {
        search.look_at(place(values), values);
    }
    while searches.iter().any(|search| !search.done) {
        count(&mut searches)?;
        searches.iter_mut().for_each(Search::go_on);
    }
    Ok(searches.map(|search| search.value()))
}

/// The search for the value at one place.
struct Search {
    bins: Vec<u64>,
    found: Prefix,
    collected: Option<Collected>,
    done: bool,
    /// Where it is, and how many values there are.
    place: f64,
    values: u64,
}

impl Search {
    fn new() -> Self {
        Self {
            bins: vec![0; 1 << DIGIT],
            found: Prefix::default(),
            collected: None,
            done: false,
            place: 0.0,
            values: 0,
        }
    }

    /// Takes a key of a pass.
    fn take(&mut self, key: u64) {
        match &mut self.collected {
            _ if self.done => {}
            None => self.found.count(&mut self.bins, key),
            Some(collected) => collected.take(&self.found, key),
        }
    }

    /// The keys of the first pass.
    fn counted(&self) -> u64 {
        self.bins.iter().sum()
    }

    fn look_at(&mut self, place: f64, values: u64) {
        (self.place, self.values) = (place, values);
        self.go_on();
    }

    fn rank(&self) -> u64 {
        self.place.floor() as u64
    }

    /// After a pass: says what the next one is for.
    fn go_on(&mut self) {
        if self.collected.is_some() {
            self.done = true;
            return;
        }
        self.found.narrow(&self.bins, self.rank());
        match self.found.inside > COLLECTED && self.found.bits < u64::BITS {
            true => self.bins.fill(0),
            false => self.collected = Some(Collected::default()),
        }
    }

    fn value(self) -> f64 {
        let rank = self.rank();
        let mut collected = self.collected.unwrap_or_default();
        collected.keys.sort_unstable();
        let low = collected.value(&self.found, rank);
        let high = collected.value(&self.found, (rank + 1).min(self.values - 1));
        between(low, high, self.place - rank as f64)
    }
}

/// The place below which `share` of so many values lies, as `numpy.quantile` defines it.
pub(crate) fn quantile(share: f64, values: u64) -> f64 {
    share * (values - 1) as f64
}

/// From `low` to `high`, rounded as numpy rounds: a threshold between equal values is that value.
fn between(low: f64, high: f64, share: f64) -> f64 {
    match share < 0.5 {
        true => low + (high - low) * share,
        false => high - (high - low) * (1.0 - share),
    }
}

/// An integer in the order of the values.
fn key(value: f64) -> u64 {
    let bits = value.to_bits();
    bits ^ match bits >> 63 {
        0 => 1 << 63,
        _ => u64::MAX,
    }
}

/// The value of a key.
fn value(key: u64) -> f64 {
    f64::from_bits(
        key ^ match key >> 63 {
            1 => 1 << 63,
            _ => u64::MAX,
        },
    )
}

/// The leading bits of the key at the wanted rank, as far as they are known.
#[derive(Debug, Default)]
struct Prefix {
    leading: u64,
    bits: u32,
    /// Keys that are smaller than all with these leading bits.
    below: u64,
    /// Keys with these leading bits.
    inside: u64,
}

impl Prefix {
    fn of(&self, key: u64) -> u64 {
        key.checked_shr(u64::BITS - self.bits).unwrap_or(0)
    }

    /// Counts a key with these leading bits in the bin of its next ones.
    fn count(&self, bins: &mut [u64], key: u64) {
        if self.of(key) == self.leading {
            let digit = key >> (u64::BITS - self.bits - DIGIT);
            bins[digit as usize & (bins.len() - 1)] += 1;
        }
    }

    /// Takes in the bin that holds the key at `rank`.
    fn narrow(&mut self, bins: &[u64], rank: u64) {
        let mut digit = 0;
        while self.below + bins[digit] <= rank {
            self.below += bins[digit];
            digit += 1;
        }
        self.leading = (self.leading << DIGIT) | digit as u64;
        self.bits += DIGIT;
        self.inside = bins[digit];
    }
}

/// The keys with the leading bits that were found, unless they are too many: then all of them are equal.
#[derive(Debug, Default)]
struct Collected {
    keys: Vec<u64>,
    /// The smallest key beyond.
    above: Option<u64>,
}

impl Collected {
    fn take(&mut self, found: &Prefix, key: u64) {
        let leading = found.of(key);
        if leading == found.leading && found.inside <= COLLECTED {
            self.keys.push(key);
        }
        if leading > found.leading {
            self.above = Some(self.above.map_or(key, |above| above.min(key)));
        }
    }

    /// The value at a rank from that of the first collected key to one past the last.
    fn value(&self, found: &Prefix, rank: u64) -> f64 {
        let at = rank - found.below;
        let inside = match self.keys.is_empty() {
            true => Some(found.leading),
            false => self.keys.get(at as usize).copied(),
        };
        let key = if at < found.inside {
            inside
        } else {
            self.above
        };
        value(key.expect("a rank of a value that was counted"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64], share: f64) -> f64 {
        let place = |values| quantile(share, values);
        // beside others, which take other numbers of passes
        let places: [&dyn Fn(u64) -> f64; 3] = [&|_| 0.0, &place, &|values| (values / 2) as f64];
        let found = values_at(places, |each| {
            values.iter().for_each(|&value| each(value));
            Ok(())
        });
        let [least, found, upper_median] = found.unwrap();
        if !values.is_empty() {
            let mut sorted = values.to_vec();
            sorted.sort_by(f64::total_cmp);
            assert_eq!((least, upper_median), (sorted[0], sorted[values.len() / 2]));
        }
        found
    }

    /// By sorting all of them.
    fn expected(values: &[f64], share: f64) -> f64 {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let position = share * (values.len() - 1) as f64;
        let (low, high) = (
            sorted[position.floor() as usize],
            sorted[position.ceil() as usize],
        );
        low + (high - low) * position.fract()
    }

    #[test]
    fn quantiles_equal_those_of_sorted_values() {
        let mixed = |i: u64| (i.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / 1e6 - 8.0;
        let close = |i: u64| 1.0 + mixed(i) * 1e-13;
        let sets: [Vec<f64>; 4] = [
            (0..1000).map(mixed).collect(),
            // more than are collected within one bin of two digits
            (0..70_000).map(close).collect(),
            vec![-2.5],
            vec![3.0, -3.0],
        ];
        for values in &sets {
            for share in [0.0, 0.25, 0.5, 0.99, 1.0] {
                let (actual, expected) = (of(values, share), expected(values, share));
                assert!(
                    (actual - expected).abs() <= 1e-15 * expected.abs(),
                    "{} values, {share}: {actual} {expected}",
                    values.len()
                );
            }
        }
        assert!(of(&[], 0.5).is_nan());
    }

    #[test]
    fn more_equal_values_than_are_collected_are_found_and_so_is_the_next_one() {
        let mut values = vec![0.75; 99_000];
        values.extend(vec![0.5; 1_000]);
        assert_eq!(of(&values, 0.99), 0.75);
        // position 98_999.01 of 0.75 x 99_000, 2.0 x 1_000
        values.truncate(99_000);
        values.extend(vec![2.0; 1_000]);
        let position = 0.99 * 99_999.0_f64;
        assert_eq!(of(&values, 0.99), 0.75 + 1.25 * position.fract());
    }
}
