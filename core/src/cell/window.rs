//! The windows of `L` models, one in each lane, as the fits read them.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::cell::rings::{Centre, Centres, RING_STEPS, RINGS, window_pixels};
use crate::float::sqrt;
use crate::lanes::{Lanes, Rgb, Vector, lanes_stay_innermost};
use crate::tile::{Pixel, RADIUS, Seen, TILE, Tile, WINDOW_AREA};

/// Radiance over each window, ring after ring.
pub(crate) type Colours<const L: usize> = [Rgb<L>; WINDOW_AREA];

/// A pixel of each window, its radiance in the window's own unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample<const L: usize> {
    pub(crate) colour: Rgb<L>,
    /// 0 to 1; 0 keeps it out of the fit.
    pub(crate) weight: Lanes<L>,
    /// Variance of the mean, summed over the channels.
    pub(crate) variance: Lanes<L>,
    /// Squared distance at which a prediction disagrees.
    pub(crate) tolerance: Lanes<L>,
}

impl<const L: usize> Sample<L> {
    /// Values of a sample.
    const VALUES: usize = 6;

    /// Sets value `k`: colour, weight, variance, tolerance; nothing beyond them.
    #[inline(always)]
    fn set(&mut self, k: usize, value: Lanes<L>) {
        match k {
            0..3 => self.colour[k] = value,
            3 => self.weight = value,
            4 => self.variance = value,
            5 => self.tolerance = value,
            _ => {}
        }
    }

    const ZERO: Self = Self {
        colour: [[0.0; L]; 3],
        weight: [0.0; L],
        variance: [0.0; L],
        tolerance: [0.0; L],
    };
}

/// `L` windows of `D` features, ring after ring.
#[repr(C, align(64))]
pub(crate) struct Windows<const D: usize, const L: usize> {
    /// Features as given, then scaled to their range, in the end the local ones (see [`crate::cell::feature_space`]).
    pub(crate) features: [Vector<D, L>; WINDOW_AREA],
    pub(crate) samples: [Sample<L>; WINDOW_AREA],
    /// Radiance of 1 in each window's unit.
    pub(crate) radiance_scale: Lanes<L>,
    /// Windows that have a model: those with a centre and a valid pixel.
    pub(crate) live: [bool; L],
    /// Whether they are over several frames, their pixels in the order of [`in_frame`].
    pub(crate) over_frames: bool,
}

/// Where each window's features lie, over its valid pixels.
pub(crate) struct Extent<const D: usize, const L: usize> {
    pub(crate) pixels: Lanes<L>,
    pub(crate) low: Vector<D, L>,
    pub(crate) high: Vector<D, L>,
    /// The largest weight.
    pub(crate) weight: Lanes<L>,
}

impl<const D: usize, const L: usize> Windows<D, L> {
    pub(crate) const ZERO: Self = Self {
        features: [[[0.0; L]; D]; WINDOW_AREA],
        samples: [Sample::ZERO; WINDOW_AREA],
        radiance_scale: [1.0; L],
        live: [false; L],
        over_frames: false,
    };

    /// Reads the window around each centre; a lane without one has no valid pixel.
    #[inline(always)]
    pub(crate) fn read(&mut self, seen: &[Seen<D>; L], centres: &Centres<L>) -> Extent<D, L> {
        let positions = centres.map(|centre| centre.map_or(BEYOND, Centre::position));
        let sets = centres.map(|centre| centre.map_or(0, |centre| usize::from(centre.set)));
        self.over_frames = false;
        let mut extent = Extent::EMPTY;
        for (row, places) in RASTER_TO_RING.iter().enumerate() {
            for (column, &place) in places.iter().enumerate() {
                let step = (row * TILE + column) as isize - (RADIUS * (TILE + 1)) as isize;
                let mut pixels = [const { &Pixel::OUTSIDE }; L];
                let mut guides = [const { &[0.0; D] }; L];
                for l in 0..L {
                    let position = positions[l].wrapping_add_signed(step);
                    pixels[l] = seen[l].tile.pixel_at(position);
                    guides[l] = seen[l].features_at(sets[l], position);
                }
                let read = Read {
                    features: guides,
                    pixels,
                };
                self.take(usize::from(place), &read, &mut extent);
                lanes_stay_innermost();
            }
        }
        self.use_own_unit(&extent.weight);
        extent
    }

    /// Reads, of each centre's own frame and of those around it, the 7 x 7 pixels in its place (WLR section 8), the centre first; what is left of the
    /// window's pixels is none. Also the sums of the features' variances over its valid pixels.
    #[inline(always)]
    pub(crate) fn read_frames(
        &mut self,
        seen: &[Seen<D>; L],
        frames: &[[Option<&Tile<D>>; OTHER_FRAMES]; L],
        centres: &Centres<L>,
    ) -> (Extent<D, L>, Vector<D, L>) {
        let positions = centres.map(|centre| centre.map_or(BEYOND, Centre::position));
        self.over_frames = true;
        let mut extent = Extent::EMPTY;
        let mut variances = [[0.0; L]; D];
        for place in 0..WINDOW_AREA {
            let (frame, pixel) = in_frame(place);
            let mut pixels = [const { &Pixel::OUTSIDE }; L];
            for l in 0..L {
                let tile = match frame.checked_sub(1) {
                    None => Some(seen[l].tile),
                    Some(other) => frames[l].get(other).copied().flatten(),
                };
                let step = RING_STEPS.get(pixel).copied().unwrap_or(0);
                let position = positions[l].wrapping_add_signed(step);
                let Some(tile) = tile else { continue };
                pixels[l] = tile.pixel_at(position);
                let variance = tile.feature_variance.get(position);
                if let Some(variance) = variance.filter(|_| pixels[l].weight > 0.0) {
                    for (sum, own) in variances.iter_mut().zip(variance) {
                        sum[l] += own;
                    }
                }
            }
            let features = pixels.map(|pixel| &pixel.features);
            self.take(place, &Read { features, pixels }, &mut extent);
            lanes_stay_innermost();
        }
        self.use_own_unit(&extent.weight);
        (extent, variances)
    }

    /// Takes a pixel of each window.
    #[inline(always)]
    fn take(&mut self, place: usize, read: &Read<D, L>, extent: &mut Extent<D, L>) {
        let (Some(features), Some(sample)) =
            (self.features.get_mut(place), self.samples.get_mut(place))
        else {
            debug_assert!(false, "{place} is not in the window");
            return;
        };
        take_four::<0, D, L>(read, features, sample);
        take_four::<4, D, L>(read, features, sample);
        take_four::<8, D, L>(read, features, sample);
        take_four::<12, D, L>(read, features, sample);
        take_four::<16, D, L>(read, features, sample);
        take_four::<20, D, L>(read, features, sample);
        extent.take_in(features, sample);
    }

    /// Scales radiance to the unit in which the largest weight is 1, so that no exposure overflows.
    #[inline(always)]
    fn use_own_unit(&mut self, largest_weight: &Lanes<L>) {
        let mut radiance_scale = [1.0; L];
        let mut largest = [1.0; L];
        for l in 0..L {
            self.live[l] = largest_weight[l] > 0.0 && largest_weight[l].is_finite();
            if self.live[l] {
                largest[l] = largest_weight[l];
            }
            radiance_scale[l] = sqrt(largest[l]);
        }
        self.radiance_scale = radiance_scale;
        for sample in &mut self.samples {
            for l in 0..L {
                for c in 0..3 {
                    sample.colour[c][l] *= radiance_scale[l];
                }
                sample.weight[l] /= largest[l];
                sample.variance[l] *= largest[l];
                sample.tolerance[l] *= largest[l];
            }
            lanes_stay_innermost();
        }
    }
}

impl<const D: usize, const L: usize> Extent<D, L> {
    /// Of no pixels.
    const EMPTY: Self = Self {
        pixels: [0.0; L],
        low: [[f32::MAX; L]; D],
        high: [[f32::MIN; L]; D],
        weight: [0.0; L],
    };

    /// Takes in a pixel of each window.
    #[inline(always)]
    fn take_in(&mut self, values: &Vector<D, L>, sample: &Sample<L>) {
        // Moves what does not count out of the way; a condition here would be a branch, and no vector instruction.
        let mut away = [0.0; L];
        for l in 0..L {
            let weight = sample.weight[l];
            away[l] = if weight > 0.0 { 0.0 } else { f32::INFINITY };
            self.pixels[l] += if weight > 0.0 { 1.0 } else { 0.0 };
            let largest = self.weight[l];
            self.weight[l] = if weight > largest { weight } else { largest };
        }
        for j in 0..D {
            for l in 0..L {
                let (low, high) = (self.low[j][l], self.high[j][l]);
                let (below, above) = (values[j][l] + away[l], values[j][l] - away[l]);
                self.low[j][l] = if below < low { below } else { low };
                self.high[j][l] = if above > high { above } else { high };
            }
            lanes_stay_innermost();
        }
    }
}

/// Where a pixel of each window is read from.
struct Read<'a, const D: usize, const L: usize> {
    features: [&'a [f32; D]; L],
    pixels: [&'a Pixel<D>; L],
}

impl<const D: usize, const L: usize> Read<'_, D, L> {
    /// Values `K` to `K + 3` of lane `l`; zeros beyond the last lane.
    #[inline(always)]
    fn four<const K: usize>(&self, l: usize) -> [f32; 4] {
        match (self.features.get(l), self.pixels.get(l)) {
            (Some(features), Some(pixel)) => [
                value(features, pixel, K),
                value(features, pixel, K + 1),
                value(features, pixel, K + 2),
                value(features, pixel, K + 3),
            ],
            _ => [0.0; 4],
        }
    }
}

/// Takes values `K` to `K + 3` of each of `L` pixels. They are read four at a time, so that the compiler makes shuffles of it
/// (measured: a model takes 5 % fewer cycles than value by value).
#[inline(always)]
fn take_four<const K: usize, const D: usize, const L: usize>(
    read: &Read<D, L>,
    features: &mut Vector<D, L>,
    sample: &mut Sample<L>,
) {
    if const { K >= D + Sample::<1>::VALUES } {
        return;
    }
    let mut rows = [[0.0; L]; 4];
    for l in (0..L).step_by(4) {
        let own = [
            read.four::<K>(l),
            read.four::<K>(l + 1),
            read.four::<K>(l + 2),
            read.four::<K>(l + 3),
        ];
        for (j, row) in rows.iter_mut().enumerate() {
            for (i, place) in row.iter_mut().skip(l).take(4).enumerate() {
                *place = own[i][j];
            }
        }
    }
    for (k, value) in (K..).zip(rows) {
        match features.get_mut(k) {
            Some(feature) => *feature = value,
            None => sample.set(k - D, value),
        }
    }
}

/// Value `k` of a pixel: its features, then those of a [`Sample`], in the order in which they lie in memory.
#[inline(always)]
fn value<const D: usize>(features: &[f32; D], pixel: &Pixel<D>, k: usize) -> f32 {
    match k.checked_sub(D) {
        None => features[k],
        Some(c @ 0..3) => pixel.colour[c],
        Some(3) => pixel.weight,
        Some(4) => pixel.variance,
        Some(5) => pixel.tolerance,
        _ => 0.0,
    }
}

/// Frames that a window over several reads beside its own: two before and two after.
pub(crate) const OTHER_FRAMES: usize = 4;
/// Pixels that it reads of each: those up to ring 3.
const FRAME_PIXELS: usize = window_pixels(3);
const _: () = assert!((OTHER_FRAMES + 1) * FRAME_PIXELS <= WINDOW_AREA);

/// Which frame place `place` of a window over several is of, 0 its own, and which pixel of that, ring after ring. There are more places than pixels.
#[inline(always)]
pub(crate) fn in_frame(place: usize) -> (usize, usize) {
    (place / FRAME_PIXELS, place % FRAME_PIXELS)
}

/// The centre of a window without a centre: beyond every tile.
const BEYOND: usize = usize::MAX / 2;

/// Pixels along a window.
const SPAN: usize = 2 * RADIUS + 1;

/// Where the pixels of a window's rows stand ring after ring: a tile is read row by row, as it lies in memory.
const RASTER_TO_RING: [[u16; SPAN]; SPAN] = {
    let mut places = [[0; SPAN]; SPAN];
    let mut i = 0;
    while i < WINDOW_AREA {
        let row = (RADIUS as isize + RINGS[i].1 as isize) as usize;
        let column = (RADIUS as isize + RINGS[i].0 as isize) as usize;
        places[row][column] = i as u16;
        i += 1;
    }
    places
};
