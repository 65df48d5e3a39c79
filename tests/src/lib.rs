//! Oracles, strategies and tolerances for the tests of linpred.

pub mod cells;
pub mod command;
pub mod definition;
pub mod features;
pub mod frames;
pub mod images;
pub mod one_window;
pub mod oracle;
pub mod passes;
pub mod strategies;
pub mod tile_checksum;
pub mod tolerance;
pub mod windows;

/// The example of the README compiles and runs.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
