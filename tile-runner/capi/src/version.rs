//! Which version this is.

use std::ffi::{CStr, c_char};

/// The version of the header: with another first or second number, calls may have to be changed.
pub const LINPRED_VERSION_MAJOR: u32 = 0;
/// The second number.
pub const LINPRED_VERSION_MINOR: u32 = 1;
/// The third number.
pub const LINPRED_VERSION_PATCH: u32 = 0;

const TEXT: &CStr =
    match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(text) => text,
        Err(_) => panic!("a version holds no zero"),
    };

/// The version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn linpred_version() -> *const c_char {
    TEXT.as_ptr()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_has_the_version_of_the_package() {
        let header =
            format!("{LINPRED_VERSION_MAJOR}.{LINPRED_VERSION_MINOR}.{LINPRED_VERSION_PATCH}");
        assert_eq!(header, env!("CARGO_PKG_VERSION"));
        assert_eq!(TEXT.to_str().unwrap(), header);
    }
}
