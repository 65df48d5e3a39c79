//! Sizes of memory as people write them.

use crate::Error;

/// Parses a size: a number of bytes, or one with K, M, G or T after it (powers of 1024). [`Error::Usage`] otherwise.
pub fn parse_size(text: &str) -> Result<u64, Error> {
    let usage = || Error::Usage(format!("{text:?} is not a size; write 256M or 2G"));
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let power = match text[digits.len()..]
        .to_ascii_uppercase()
        .trim_end_matches('B')
        .trim_end_matches('I')
    {
        "" => 0,
        "K" => 1,
        "M" => 2,
        "G" => 3,
        "T" => 4,
        _ => return Err(usage()),
    };
    let number: u64 = digits.parse().map_err(|_| usage())?;
    number
        .checked_mul(1 << (10 * power))
        .filter(|&bytes| bytes > 0)
        .ok_or_else(usage)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_as_people_write_them() {
        for (text, bytes) in [
            ("512", 512),
            ("256M", 256 << 20),
            ("2G", 2 << 30),
            ("1GiB", 1 << 30),
            ("3kb", 3 << 10),
        ] {
            assert_eq!(parse_size(text).unwrap(), bytes, "{text}");
        }
        for text in ["", "M", "-1", "12Q", "0", "99999999999T"] {
            assert!(parse_size(text).is_err(), "{text}");
        }
    }
}
