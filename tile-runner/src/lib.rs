//! Denoises Monte Carlo renders by linear predictions from what a renderer knows with little noise: normal, albedo, depth.
//!
//! # A tour
//!
//! - **Buffers in memory.** [`image::Frame`] makes rows of a renderer's buffers, whatever their layout.
//! - **Rows.** [`denoise`] takes the rows of a [`RowSource`], from top to bottom, and gives denoised ones to a [`RowSink`]. The source's
//!   [`RowLayout`] says what an [`InputRow`] holds; [`Options`] say what to compute, a [`Report`] what was done. Memory grows with the width of the image,
//!   not with its height.
//! - **Rows as they become ready.** [`steps`] turns that round: a loop of the caller's is told whenever a row is wanted, and whenever one is denoised.
//! - **Slow ends.** [`overlap`] reads ahead of the pipeline and writes behind it.
//! - **Files.** [`job`] does what the commands do: an EXR file is denoised into another, inspected, compared, put together of bands.
//!   [`channels`] says which of its channels plays which role.
//! - **Where more samples would help.** [`sampling`] makes the map of samples that a renderer should take next, of rows or of files.
//! - **What is in an image.** [`survey`] goes through the stages before the fit and counts what a run will skip.
//!
//! The same input and [`Params`] give the same bits, whatever the threads, the processor's instruction set, or the order in which rows became ready.
//!
//! # Example
//!
//! ```
//! use linpred::image::{Frame, Interleaved};
//! use linpred::{Feature, ImageSize, Options, denoise};
//!
//! fn main() -> Result<(), linpred::Error> {
//!     let size = ImageSize::new(64, 48).expect("not empty");
//!     let (radiance, normal) = (vec![[0.5; 3]; 64 * 48], vec![[0.0, 0.0, 1.0]; 64 * 48]);
//!     let mut frame = Frame::new(Interleaved::new(size, &radiance)?)?
//!         .with_feature(Feature::Normal, Interleaved::new(size, &normal)?)?;
//!     let mut clean = Vec::new();
//!     let mut keep = |_y: usize, row: &linpred::OutputRow| {
//!         let [red, green, blue] = &row.colour;
//!         clean.extend((0..red.len()).map(|x| [red[x], green[x], blue[x]]));
//!         Ok(())
//!     };
//!     denoise(&mut frame, &mut keep, &Options::default(), &mut |_rows| std::ops::ControlFlow::Continue(()))?;
//!     assert_eq!(clean, radiance);
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
mod further;
mod geometry;
pub mod image;
pub mod job;
mod quantile;
mod row;
pub mod sampling;
mod stream;
pub mod temporal;

pub use error::{Error, Remedy, Setting};
pub use further::FurtherFeatures;
pub use geometry::ImageSize;
pub use linpred_core::{
    FEATURE_NAMES, FEATURES, FURTHER, Feature, Formulas, MAX_FEATURES, Params, Quality, Sampler,
};
pub use row::{InputRow, Motion, OutputRow, RowLayout, RowSink, RowSource, VarianceKind};
pub use stream::pipeline::{Options, denoise};
pub use stream::report::{Counts, Report};
pub use stream::threads::threads_to_use;
pub use stream::{overlap, steps, survey};

/// The README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
