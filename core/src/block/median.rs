//! Medians of 3 x 3 values, for a row at a time.

/// Medians of the 3 x 3 values of three rows: the i-th is that of columns i to i + 2.
///
/// Each column is sorted once for the three medians that it is part of. The median of nine is that of the largest of the lowest, the
/// median of the middle ones and the lowest of the largest (Smith, Implementing median filters in XC4000E FPGAs, 1996).
#[inline(always)]
pub(crate) fn medians_3x3<const W: usize, const N: usize>(rows: [&[f32; W]; 3]) -> [f32; N] {
    const { assert!(N + 2 <= W) }
    let [mut low, mut middle, mut high] = [[0.0; W]; 3];
    for x in 0..W {
        let [above, row, below] = rows.map(|row| row[x]);
        let (a, b) = (min(above, row), max(above, row));
        (low[x], high[x]) = (min(a, below), max(b, below));
        middle[x] = max(a, min(b, below));
    }
    let mut medians = [0.0; N];
    for x in 0..N {
        let lowest = max(max(low[x], low[x + 1]), low[x + 2]);
        let middle = median(middle[x], middle[x + 1], middle[x + 2]);
        let highest = min(min(high[x], high[x + 1]), high[x + 2]);
        medians[x] = median(lowest, middle, highest);
    }
    medians
}

#[inline(always)]
fn median(a: f32, b: f32, c: f32) -> f32 {
    max(min(a, b), min(max(a, b), c))
}

/// Not `f32::min`, whose care for NaN costs.
#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_the_fifth_of_the_sorted_nine() {
        let mut state = 1u32;
        for _ in 0..2000 {
            let rows: [[f32; 5]; 3] = core::array::from_fn(|_| {
                core::array::from_fn(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    // few values, so that many are equal
                    (state >> 28) as f32
                })
            });
            let medians: [f32; 3] = medians_3x3([&rows[0], &rows[1], &rows[2]]);
            for (x, median) in medians.into_iter().enumerate() {
                let mut nine: [f32; 9] = core::array::from_fn(|i| rows[i / 3][x + i % 3]);
                nine.sort_unstable_by(f32::total_cmp);
                assert_eq!(median, nine[4]);
            }
        }
    }
}
