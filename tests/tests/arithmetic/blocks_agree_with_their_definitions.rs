//! Weights and filtered features, which the core works out row by row with shared sums and approximate logarithms, against their
//! formulas in double precision, pixel by pixel.

use linpred_core::{
    BLOCK_HEIGHT, BLOCK_WIDTH, ColourBlock, FeatureGroup, FilteredGroup, PREFILTER_HALO,
    WEIGHTS_HALO, WeightBlock, prefilter, weigh_samples,
};
use linpred_tests::tolerance::{BLOCK, close};

/// Numbers from 0 to 1 that look random.
fn noise(seed: usize, x: usize, y: usize) -> f32 {
    let mut bits = (seed * 7919 + y * 613 + x) as u32;
    for _ in 0..3 {
        bits = bits.wrapping_mul(0x9e37_79b1) ^ (bits >> 15);
    }
    (bits >> 8) as f32 / 16_777_216.0
}

/// Values of a plane at (x, y) and the `radius` around.
fn around<const W: usize>(
    plane: &[[f32; W]],
    x: usize,
    y: usize,
    radius: usize,
) -> impl Iterator<Item = f64> + '_ {
    let rows = &plane[y - radius..=y + radius];
    rows.iter()
        .flat_map(move |row| &row[x - radius..=x + radius])
        .map(|v| f64::from(*v))
}

fn mean_of_good<const W: usize>(
    plane: &[[f32; W]],
    good: &[[f32; W]],
    radius: usize,
    x: usize,
    y: usize,
) -> f64 {
    let count: f64 = around(good, x, y, radius).sum();
    around(plane, x, y, radius).sum::<f64>() / count.max(1.0)
}

fn median<const W: usize>(plane: &[[f32; W]], x: usize, y: usize) -> f64 {
    let mut nine: Vec<f64> = around(plane, x, y, 1).collect();
    nine.sort_by(f64::total_cmp);
    nine[4]
}

/// Half lit with a range of 10^8, half black, with bad pixels in between.
fn colours() -> Box<ColourBlock> {
    let mut block = Box::new(ColourBlock::BLACK);
    for y in 0..ColourBlock::HEIGHT {
        for x in 0..ColourBlock::WIDTH {
            let good = noise(1, x, y) > 0.1;
            let lit = good && x > 12 && x < 45;
            // lit and without noise: a light that is seen
            let seen = x > 40;
            let level = 10f32.powf(8.0 * noise(2, x, y) - 4.0);
            block.good[y][x] = if good { 1.0 } else { 0.0 };
            block.luminance[y][x] = if lit { level } else { 0.0 };
            block.variance[y][x] = if lit && !seen {
                level * level * noise(3, x, y)
            } else {
                0.0
            };
        }
    }
    block
}

/// Weight, variance and tolerance of the pixel at (x, y) of the input.
fn prepared(input: &ColourBlock, x: usize, y: usize) -> [f64; 3] {
    let mean = |x, y| mean_of_good(&input.luminance, &input.good, 1, x, y);
    let logs: Vec<f64> = (y - 9..=y + 9)
        .flat_map(|y| (x - 9..=x + 9).map(move |x| (x, y)))
        .map(|(x, y)| mean(x, y))
        .filter(|mean| *mean > 0.0)
        .map(f64::ln)
        .collect();
    let level = match logs.len() {
        0 => 0.0,
        count => (logs.iter().sum::<f64>() / count as f64).exp(),
    };
    let square = mean(x, y).powi(2);
    let scale = 4.0 * level * level;
    let good = f64::from(input.good[y][x]);
    let near = mean_of_good(&input.variance, &input.good, 1, x, y);
    let corners = [
        (x - 2, y - 2),
        (x + 2, y - 2),
        (x - 2, y + 2),
        (x + 2, y + 2),
    ];
    let least = corners
        .map(|(x, y)| mean_of_good(&input.variance, &input.good, 2, x, y))
        .into_iter()
        .fold(f64::INFINITY, f64::min);
    let exact = near == 0.0 && mean(x, y) > 0.0;
    let middle = median(&input.luminance, x, y);
    let relative = near / square.max(f64::from(f32::MIN_POSITIVE));
    let spread = median(&input.variance, x, y)
        .max(f64::from(input.variance[y][x]))
        .max(relative * middle * middle)
        .max(least);
    [
        if scale > 0.0 { good / scale } else { 0.0 },
        if exact { 0.0 } else { near.max(least) },
        spread + 3.0 * ((0.1 * middle).powi(2) + 1e-3 * scale),
    ]
}

#[test]
fn weights_variances_and_tolerances() {
    let input = colours();
    let mut output = Box::new(WeightBlock::EMPTY);
    weigh_samples(&input, &mut output);
    let mut black = 0;
    for (y, x) in (0..BLOCK_HEIGHT).flat_map(|y| (0..BLOCK_WIDTH).map(move |x| (y, x))) {
        let expected = prepared(&input, x + WEIGHTS_HALO, y + WEIGHTS_HALO);
        let own = [&output.weight, &output.variance, &output.tolerance].map(|plane| plane[y][x]);
        for (own, expected) in own.into_iter().zip(expected) {
            let own = f64::from(own);
            assert!(
                close(own, expected, BLOCK * expected),
                "{x} {y}: {own} {expected}"
            );
        }
        black += usize::from(expected[0] == 0.0);
    }
    assert!(black > 0 && black < BLOCK_WIDTH * BLOCK_HEIGHT / 2);
}

/// An edge, noise on its left, and none further right.
fn features() -> Box<FeatureGroup<3>> {
    let mut group = Box::new(FeatureGroup::<3>::ZERO);
    for c in 0..3 {
        for y in 0..FeatureGroup::<3>::HEIGHT {
            for x in 0..FeatureGroup::<3>::WIDTH {
                let edge = if x + y / 3 > 20 { 0.8 } else { 0.2 };
                let noisy = if x < 30 { 1.0 } else { 0.0 };
                group.value[c][y][x] = edge + 0.2 * noisy * (noise(4 + c, x, y) - 0.5);
                group.variance[c][y][x] = noisy * (2e-3 + 2e-3 * noise(7 + c, x, y));
            }
        }
    }
    group
}

/// A group, and the part of the distances between patches at which its filter takes them.
struct Definition<'a>(&'a FeatureGroup<3>, f64);

impl Definition<'_> {
    fn steady(&self, x: usize, y: usize) -> f64 {
        let planes = self.0.variance.iter();
        planes
            .map(|plane| around(plane, x, y, 2).sum::<f64>() / 25.0)
            .sum()
    }

    fn noise(&self, x: usize, y: usize) -> f64 {
        let squares = self
            .0
            .value
            .iter()
            .map(|plane| f64::from(plane[y][x]).powi(2));
        self.steady(x, y) + 0.5e-6 * squares.sum::<f64>()
    }

    /// d + 1 of two pixels.
    fn ratio(&self, p: (usize, usize), q: (usize, usize)) -> f64 {
        let planes = self.0.value.iter();
        let squares =
            planes.map(|plane| (f64::from(plane[p.1][p.0]) - f64::from(plane[q.1][q.0])).powi(2));
        (squares.sum::<f64>() / (self.noise(p.0, p.1) + self.noise(q.0, q.1))).min(1e3)
    }

    fn weight(&self, p: (usize, usize), q: (usize, usize)) -> f64 {
        let mut sum = 0.0;
        for dy in 0..5 {
            for dx in 0..5 {
                let moved = |(x, y): (usize, usize)| (x + dx - 2, y + dy - 2);
                sum += self.ratio(moved(p), moved(q));
            }
        }
        (1.0 - self.1 * (sum / 25.0 - 1.0).max(0.0) / 8.0)
            .max(0.0)
            .powi(8)
    }

    /// Feature `c` of a pixel, and the variance it keeps.
    fn filtered(&self, p: (usize, usize), c: usize) -> (f64, f64) {
        let (mut total, mut value, mut variance) = (0.0, 0.0, 0.0);
        for q in (p.1 - 3..=p.1 + 3).flat_map(|y| (p.0 - 3..=p.0 + 3).map(move |x| (x, y))) {
            let weight = self.weight(p, q);
            total += weight;
            value += weight * f64::from(self.0.value[c][q.1][q.0]);
            variance += weight * weight * f64::from(self.0.variance[c][q.1][q.0]);
        }
        (value / total, variance / (total * total))
    }
}

#[test]
fn filtered_features_and_the_variance_they_keep() {
    let input = features();
    let mut outputs = [(); 3].map(|()| Box::new(FilteredGroup::ZERO));
    let [filtered, smoothed, alone] = &mut outputs;
    assert!(prefilter(&input, filtered, Some(smoothed)));
    assert!(prefilter(&input, alone, None));
    assert_eq!(filtered, alone);
    for (output, part) in [(filtered, 1.0), (smoothed, 0.2)] {
        agrees(output, &input, part);
    }
}

fn agrees(output: &FilteredGroup<3>, input: &FeatureGroup<3>, part: f64) {
    let definition = Definition(input, part);
    let (mut kept, mut filtered) = (0, 0);
    for (y, x) in (0..BLOCK_HEIGHT).flat_map(|y| (0..BLOCK_WIDTH).map(move |x| (y, x))) {
        let c = (x + y) % 3;
        let p = (x + PREFILTER_HALO, y + PREFILTER_HALO);
        let (value, variance) = (output.value[c][y][x], output.variance[c][y][x]);
        if definition.steady(p.0, p.1) > 0.0 {
            let expected = definition.filtered(p, c);
            assert!(close(f64::from(value), expected.0, BLOCK), "{x} {y} {c}");
            let tolerance = BLOCK * expected.1;
            assert!(
                close(f64::from(variance), expected.1, tolerance),
                "{x} {y} {c}"
            );
            filtered += 1;
        } else {
            assert_eq!(
                (value, variance),
                (input.value[c][p.1][p.0], 0.0),
                "{x} {y} {c}"
            );
            kept += 1;
        }
    }
    assert!(kept > 100 && filtered > 100);
}
