//! The windows of `L` models, one in each lane, as the fits read them.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::cell::rings::{Centre, Centres, RING_STEPS, RINGS, window_pixels};
use crate::float::sqrt;
use crate::lanes::{Lanes, Rgb, Vector, lanes_stay_innermost};
use crate::tile::{FeatureSet, Pixel, RADIUS, Seen, TILE, Tile, WINDOW_AREA};

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
        let mut corners = [BEYOND; L];
        let mut others = [None; L];
        for (lane, (centre, seen)) in centres.iter().zip(seen).enumerate() {
            if let Some(centre) = centre {
                corners[lane] = centre.position() - RADIUS * (TILE + 1);
                others[lane] = seen.other(usize::from(centre.set));
            }
        }
        self.over_frames = false;
        let mut extent = Extent::EMPTY;
        // Where no model sees other features than the pixels', none are looked for.
        if others.iter().all(Option::is_none) {
            self.read_rows::<false>(seen, &corners, &others, &mut extent);
        } else {
            self.read_rows::<true>(seen, &corners, &others, &mut extent);
        }
        self.use_own_unit(&extent.weight);
        extent
    }

    /// Reads the windows from their `corners` on, row by row; `OTHERWISE` if any of `others` is not none.
    #[inline(always)]
    fn read_rows<const OTHERWISE: bool>(
        &mut self,
        seen: &[Seen<D>; L],
        corners: &[usize; L],
        others: &[Option<&FeatureSet<D>>; L],
        extent: &mut Extent<D, L>,
    ) {
        let outside = const { &[Pixel::<D>::OUTSIDE; SPAN] };
        for (row, places) in RASTER_TO_RING.iter().enumerate() {
            let mut rows = [outside; L];
            let mut guides = [None; L];
            for l in 0..L {
                let first = corners[l].wrapping_add(row * TILE);
                let pixels = seen[l].tile.pixels.get(first..);
                rows[l] = pixels.and_then(<[_]>::first_chunk).unwrap_or(outside);
                if OTHERWISE {
                    let values = others[l].and_then(|other| other.value.get(first..));
                    guides[l] = values.and_then(<[_]>::first_chunk::<SPAN>);
                }
            }
            for (column, &place) in places.iter().enumerate() {
                let mut read = Read {
                    features: [const { &[0.0; D] }; L],
                    pixels: [const { &Pixel::OUTSIDE }; L],
                };
                for l in 0..L {
                    read.pixels[l] = &rows[l][column];
                    read.features[l] = match guides[l] {
                        Some(guides) if OTHERWISE => &guides[column],
                        _ => &rows[l][column].features,
                    };
                }
                self.take(usize::from(place), &read, extent);
                lanes_stay_innermost();
            }
        }
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
        take_features::<0, D, L>(read, features);
        take_features::<4, D, L>(read, features);
        take_features::<8, D, L>(read, features);
        take_features::<12, D, L>(read, features);
        take_sample(read, sample);
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

/// Takes features `K` to `K + 3` of each of `L` pixels. They are read four at a time, which lie side by side in memory, so that the compiler makes
/// shuffles of it; the last four overlap those before.
#[inline(always)]
fn take_features<const K: usize, const D: usize, const L: usize>(
    read: &Read<D, L>,
    features: &mut Vector<D, L>,
) {
    if const { K >= D } {
        return;
    }
    if const { D < 4 } {
        for j in K..D {
            for l in 0..L {
                features[j][l] = read.features[l][j];
            }
        }
        return;
    }
    let first = const { if K + 4 <= D || D < 4 { K } else { D - 4 } };
    let fours = transposed::<L>(|l| {
        let values = read.features.get(l).and_then(|own| own.get(first..));
        match values.and_then(<[_]>::first_chunk) {
            Some(four) => *four,
            None => [0.0; 4],
        }
    });
    for (feature, value) in features.iter_mut().skip(first).zip(fours) {
        *feature = value;
    }
}

/// The same of what is not a feature.
#[inline(always)]
fn take_sample<const D: usize, const L: usize>(read: &Read<D, L>, sample: &mut Sample<L>) {
    let [red, green, blue, weight] = transposed(|l| match read.pixels.get(l) {
        Some(pixel) => {
            let [red, green, blue] = pixel.colour;
            [red, green, blue, pixel.weight]
        }
        None => [0.0; 4],
    });
    let [_, _, variance, tolerance] = transposed(|l| match read.pixels.get(l) {
        // The first two only make it four that lie side by side.
        Some(pixel) => {
            let [_, _, blue] = pixel.colour;
            [blue, pixel.weight, pixel.variance, pixel.tolerance]
        }
        None => [0.0; 4],
    });
    *sample = Sample {
        colour: [red, green, blue],
        weight,
        variance,
        tolerance,
    };
}

/// Four values of each lane, those of one index side by side.
#[inline(always)]
fn transposed<const L: usize>(four: impl Fn(usize) -> [f32; 4]) -> [Lanes<L>; 4] {
    let mut rows = [[0.0; L]; 4];
    for l in (0..L).step_by(4) {
        let own = [four(l), four(l + 1), four(l + 2), four(l + 3)];
        for (j, row) in rows.iter_mut().enumerate() {
            for (i, place) in row.iter_mut().skip(l).take(4).enumerate() {
                *place = own[i][j];
            }
        }
    }
    rows
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
