//! Denoises Monte Carlo renders by linear predictions from what a renderer knows with little noise: normal, albedo, depth.
//!
//! # A tour
//!
//! - **Buffers in memory.** [`denoise`] takes the rows of a [`RowSource`], from top to bottom, and gives denoised ones to a [`RowSink`]. The source's
//!   [`RowLayout`] says what an [`InputRow`] holds; [`Options`] say what to compute, a [`Report`] what was done. Memory grows with the width of the image,
//!   not with its height.
//! - **Rows as they become ready.** [`push`] turns that round: a renderer hands rows over, and an iterator gives denoised ones.
//! - **Slow ends.** [`overlap`] reads ahead of the pipeline and writes behind it.
//! - **Files.** [`job`] does what the commands do: an EXR file is denoised into another, inspected, compared, put together of bands.
//!   [`channels`] says which of its channels plays which role.
//! - **What is in an image.** [`survey`] goes through the stages before the fit and counts what a run will skip.
//!
//! The same input and [`Params`] give the same bits, whatever the threads, the processor's instruction set, or the order in which rows became ready.
//!
//! # Example
//!
//! A row with noise, pushed 40 times:
//!
//! ```
//! use linpred::{ImageSize, InputRow, Options, RowLayout, VarianceKind, push};
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let size = ImageSize::new(50, 40).ok_or("empty")?;
//!     let layout = RowLayout::new(size, VarianceKind::OfMean);
//!     let mut row = InputRow::new(&layout);
//!     for channel in 0..3 {
//!         for x in 0..50 {
//!             row.colour[channel][x] = if x % 2 == 0 { 0.9 } else { 1.1 };
//!             row.variance[channel][x] = 0.01;
//!         }
//!     }
//!     let (mut push, denoised) = push::start(layout, Options::default())?;
//!     let pulled = std::thread::spawn(move || denoised.collect::<Result<Vec<_>, _>>());
//!     while push.next_row() < 40 {
//!         push.push_row(push.next_row(), &row)?;
//!     }
//!     let rows = pulled.join().expect("no panic")?;
//!     let (y, middle) = &rows[20];
//!     assert_eq!(*y, 20);
//!     assert!((middle.colour[0][25] - 1.0).abs() < 0.05);
//!     Ok(())
//! }
//! ```
//!
//! # Features
//!
//! `cli` (on by default) is for the command `linpred` and brings the crates that only it needs. A program switches it off. `serde` derives
//! `Serialize` for what inspecting and comparing find.

pub mod channels;
#[cfg(feature = "cli")]
pub mod cli;
mod error;
pub mod exr_file;
mod geometry;
pub mod image;
pub mod job;
mod row;
mod stream;

pub use error::{Error, Remedy, Setting};
pub use geometry::ImageSize;
pub use linpred_core::{FEATURE_NAMES, FEATURES, Feature, Formulas, Params, Quality};
pub use row::{InputRow, OutputRow, RowLayout, RowSink, RowSource, VarianceKind};
pub use stream::pipeline::{Options, denoise};
pub use stream::report::{Counts, Report};
pub use stream::{overlap, push, survey};

/// The README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
