//! Sizes that have been checked once, so that nothing after needs to.

/// The size of an image in pixels: never empty, and small enough that a pixel count fits `u64`
/// and a row's byte count fits `usize`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    width: usize,
    height: usize,
}

impl ImageSize {
    /// `None` when a side is 0 or above 2^31 - 1 (what an EXR data window can express).
    pub fn new(width: usize, height: usize) -> Option<Self> {
        let fits = |side: usize| (1..=i32::MAX as usize).contains(&side);
        (fits(width) && fits(height)).then_some(Self { width, height })
    }

    /// Columns.
    pub fn width(self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(self) -> usize {
        self.height
    }

    /// Columns times rows.
    pub fn pixels(self) -> u64 {
        self.width as u64 * self.height as u64
    }
}

/// Bytes of `rows` rows of `planes` planes of `f32`, saturating.
pub(crate) fn plane_bytes(size: ImageSize, rows: usize, planes: usize) -> u64 {
    (size.width() as u64)
        .saturating_mul(size_of::<f32>() as u64)
        .saturating_mul(rows as u64)
        .saturating_mul(planes as u64)
}
