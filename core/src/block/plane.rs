//! Runs of columns of a row, whose length the compiler knows: no check for it to prove away, and whole registers to fill.

/// The `N` columns from `first` on; zeros if they go beyond the row.
#[inline(always)]
pub(crate) fn columns<const N: usize>(row: &[f32], first: usize) -> &[f32; N] {
    row.get(first..)
        .and_then(<[f32]>::first_chunk)
        .unwrap_or(const { &[0.0; N] })
}

/// The `N` columns from `first` on of row `y` of a plane; zeros if they go beyond it.
#[inline(always)]
pub(crate) fn columns_of<const N: usize, const W: usize>(
    plane: &[[f32; W]],
    y: usize,
    first: usize,
) -> &[f32; N] {
    match plane.get(y) {
        Some(row) => columns(row, first),
        None => const { &[0.0; N] },
    }
}
