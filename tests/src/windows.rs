//! Windows of features with a chosen condition number, and the order in which rings enter a fit.

use nalgebra::DMatrix;

/// Half-width of a window.
pub const RADIUS: i32 = 9;
/// Pixels of a window.
pub const WINDOW_PIXELS: usize = 361;

/// Offsets of a window's pixels in the order in which they enter: ring by ring, each ring in raster order.
pub fn ring_order() -> Vec<(i32, i32)> {
    let mut offsets: Vec<(i32, i32)> = (-RADIUS..=RADIUS)
        .flat_map(|y| (-RADIUS..=RADIUS).map(move |x| (x, y)))
        .collect();
    offsets.sort_by_key(|(x, y)| x.abs().max(y.abs()));
    offsets
}

/// Pixels of the square of half-width `radius`.
pub fn pixels_within(radius: usize) -> usize {
    (2 * radius + 1).pow(2)
}

/// A small seeded generator (SplitMix64, Steele et al. 2014), so that a study can be repeated to the bit.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A generator of its own for each seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform among `0..count`.
    pub fn below(&mut self, count: usize) -> usize {
        (self.uniform() * count as f64) as usize
    }

    /// Normal with mean 0 and variance 1, to the accuracy of a sum of twelve uniforms.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// Regressors and responses of one window, f32 as every fit is given them, in [`ring_order`].
#[derive(Clone, Debug)]
pub struct Window<const T: usize> {
    /// The intercept's 1, then local features in [-1, 1].
    pub z: Vec<[f32; T]>,
    /// Three responses.
    pub y: Vec<[f32; 3]>,
}

impl<const T: usize> Window<T> {
    /// A window whose features have singular values from 1 to 1 / `condition`, log-spaced and mixed by a rotation so
    /// that no scaling of the columns mends them; responses of 1 plus an affine function of the features that
    /// moves along the strong and the weak directions alike, plus noise of a tenth.
    pub fn with_condition(condition: f64, random: &mut Random) -> Self {
        let features = T - 1;
        let mut normal = |rows, columns| DMatrix::from_fn(rows, columns, |_, _| random.normal());
        let basis = normal(WINDOW_PIXELS, features).qr().q();
        let rotation = normal(features, features).qr().q();
        let slopes = normal(features, 3);
        let noise = normal(WINDOW_PIXELS, 3);
        let steps = (features.max(2) - 1) as f64;
        let scaled = DMatrix::from_fn(WINDOW_PIXELS, features, |i, j| {
            basis[(i, j)] * condition.powf(-(j as f64) / steps)
        });
        let mut z = scaled * rotation;
        let largest = z.amax();
        z /= largest;
        let y = &basis * slopes * 5.0 + noise * 0.1;
        Self {
            z: (0..WINDOW_PIXELS)
                .map(|i| core::array::from_fn(|j| if j == 0 { 1.0 } else { z[(i, j - 1)] as f32 }))
                .collect(),
            y: (0..WINDOW_PIXELS)
                .map(|i| core::array::from_fn(|c| 1.0 + y[(i, c)] as f32))
                .collect(),
        }
    }

    /// The largest response, the unit of prediction errors.
    pub fn largest_response(&self) -> f64 {
        let all = self.y.iter().flatten();
        all.fold(0.0, |largest, v| f64::from(v.abs()).max(largest))
    }
}
