//! Median of 3 x 3 values.

/// Exchanges that leave the median of nine in the middle (Smith, Implementing median filters in XC4000E FPGAs, 1996).
const EXCHANGES: [(usize, usize); 19] = [
    (1, 2),
    (4, 5),
    (7, 8),
    (0, 1),
    (3, 4),
    (6, 7),
    (1, 2),
    (4, 5),
    (7, 8),
    (0, 3),
    (5, 8),
    (4, 7),
    (3, 6),
    (1, 4),
    (2, 5),
    (4, 7),
    (4, 2),
    (6, 4),
    (4, 2),
];

/// Median of the values around column `x` >= 1 and row `y` >= 1 of a plane that reaches one further.
#[inline(always)]
pub(crate) fn median_3x3<const W: usize, const H: usize>(
    values: &[[f32; W]; H],
    x: usize,
    y: usize,
) -> f32 {
    let mut v = [0.0; 9];
    for dy in 0..3 {
        for dx in 0..3 {
            v[3 * dy + dx] = values[y + dy - 1][x + dx - 1];
        }
    }
    for (low, high) in EXCHANGES {
        let (a, b) = (v[low], v[high]);
        v[low] = if a < b { a } else { b };
        v[high] = if a < b { b } else { a };
    }
    v[4]
}
