//! Guards the `exr` crate against the sizes that a damaged DWA chunk announces.
//!
//! A DWA chunk begins with eleven 64-bit counters. The crate (1.74.2) allocates what they say before it looks at the data: a few
//! changed bytes ask for terabytes, and the process aborts. Found by changing bytes of small files at random.

use exr::meta::attribute::IntegerBounds;

/// Counters of sizes after decompression, by position: unknown bytes, run-length tokens, run-length bytes, AC
/// coefficients, DC coefficients (`DataSizesSingle` in OpenEXR's `internal_dwa_compressor.h`).
const DECODED: [usize; 5] = [1, 6, 7, 8, 9];

/// Whether a compressed DWA chunk of these bounds announces sizes that it can have. A payload too short for its counters is left
/// to the decoder.
pub(crate) fn is_plausible(payload: &[u8], channels: usize, bounds: IntegerBounds) -> bool {
    // the cosine transform works on squares of 8; a run-length code at most doubles its data; a sample has at most 4 bytes
    let padded = |side: usize| side.next_multiple_of(8) as u64;
    let samples = padded(bounds.size.0).saturating_mul(padded(bounds.size.1));
    let limit = samples
        .saturating_mul(channels as u64)
        .saturating_mul(2 * 4);
    DECODED.iter().all(|&position| {
        let counter = payload.get(position * 8..position * 8 + 8);
        let counter = counter.and_then(|bytes| Some(u64::from_le_bytes(bytes.try_into().ok()?)));
        counter.is_none_or(|counter| counter <= limit)
    })
}
