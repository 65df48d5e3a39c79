//! The Haar wavelets of PIZ, in place.

/// Words of one channel, `step` apart; a `f32` is two of them, each transformed by itself.
pub(super) struct Plane<'a> {
    words: &'a mut [u16],
    columns: usize,
    rows: usize,
    step: usize,
}

impl<'a> Plane<'a> {
    pub(super) fn new(words: &'a mut [u16], columns: usize, rows: usize, step: usize) -> Self {
        Self {
            words,
            columns,
            rows,
            step,
        }
    }

    /// Transforms the plane, whose values are at most `last`.
    pub(super) fn encode(&mut self, last: u16) {
        match last < 1 << 14 {
            true => self.levels(small),
            false => self.levels(modular),
        }
    }

    /// Halves the resolution again and again; a pair becomes its mean, which stays, and its difference.
    fn levels(&mut self, pair: impl Fn(u16, u16) -> (u16, u16)) {
        let mut near = 1;
        while 2 * near <= self.columns.min(self.rows) {
            let far = 2 * near;
            let (whole_columns, whole_rows) = (self.columns / far * far, self.rows / far * far);
            for y in (0..whole_rows).step_by(far) {
                for x in (0..whole_columns).step_by(far) {
                    self.pair((x, y), (x + near, y), &pair);
                    self.pair((x, y + near), (x + near, y + near), &pair);
                    self.pair((x, y), (x, y + near), &pair);
                    self.pair((x + near, y), (x + near, y + near), &pair);
                }
                if self.columns & near != 0 {
                    self.pair((whole_columns, y), (whole_columns, y + near), &pair);
                }
            }
            if self.rows & near != 0 {
                for x in (0..whole_columns).step_by(far) {
                    self.pair((x, whole_rows), (x + near, whole_rows), &pair);
                }
            }
            near = far;
        }
    }

    fn pair(
        &mut self,
        a: (usize, usize),
        b: (usize, usize),
        pair: impl Fn(u16, u16) -> (u16, u16),
    ) {
        let at = |(x, y): (usize, usize)| (y * self.columns + x) * self.step;
        let (a, b) = (at(a), at(b));
        (self.words[a], self.words[b]) = pair(self.words[a], self.words[b]);
    }
}

/// Mean and difference of values below 2^14, where neither leaves 16 bits.
fn small(a: u16, b: u16) -> (u16, u16) {
    let (a, b) = (a as i16, b as i16);
    (((a + b) >> 1) as u16, (a - b) as u16)
}

/// Mean and difference of any values, modulo 2^16.
fn modular(a: u16, b: u16) -> (u16, u16) {
    const HALF: u16 = 1 << 15;
    let shifted = i32::from(a.wrapping_add(HALF));
    let difference = shifted - i32::from(b);
    let mean = ((shifted + i32::from(b)) >> 1) as u16;
    let mean = mean.wrapping_add(if difference < 0 { HALF } else { 0 });
    (mean, difference as u16)
}
