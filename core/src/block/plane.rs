//! Blocks of an image: their size, their planes, and runs of columns whose length the compiler knows, so that there is no check for it
//! to prove away, and whole registers to fill.

/// Columns of a block: with those around it that the prefilter compares, [`BLOCK_COLUMNS`].
pub const BLOCK_WIDTH: usize = 41;
/// Rows of a block.
pub const BLOCK_HEIGHT: usize = 19;
/// Columns of a block's planes, which fill registers of 4, 8 or 16 floats; those from [`BLOCK_WIDTH`] on hold nothing of use.
pub const BLOCK_COLUMNS: usize = 48;
/// A plane of a block.
pub type BlockPlane = [[f32; BLOCK_COLUMNS]; BLOCK_HEIGHT];
/// A row of it.
pub(crate) type BlockRow = [f32; BLOCK_COLUMNS];

/// The `N` columns from `first` on; they lie within the row.
#[inline(always)]
pub(crate) fn columns<const N: usize>(row: &[f32], first: usize) -> &[f32; N] {
    debug_assert!(
        first + N <= row.len(),
        "{N} columns from {first} of {}",
        row.len()
    );
    row.get(first..)
        .and_then(<[f32]>::first_chunk)
        .unwrap_or(const { &[0.0; N] })
}

/// The `N` columns from `first` on of row `y` of a plane; they lie within it.
#[inline(always)]
pub(crate) fn columns_of<const N: usize, const W: usize>(
    plane: &[[f32; W]],
    y: usize,
    first: usize,
) -> &[f32; N] {
    debug_assert!(y < plane.len(), "row {y} of {}", plane.len());
    match plane.get(y) {
        Some(row) => columns(row, first),
        None => const { &[0.0; N] },
    }
}
