//! The arithmetic of linpred.
#![no_std]
#![forbid(unsafe_code)]

mod params;

pub use params::{Params, Quality};
