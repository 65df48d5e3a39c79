//! The arithmetic of linpred.
#![no_std]
#![forbid(unsafe_code)]

mod dot;
mod eigen;
mod float;
mod normal;
mod params;
mod prior;
mod rls;

pub use eigen::SymmetricEigen;
pub use normal::{Gram, NormalEquations, NotFinite, Solution};
pub use params::{Params, Quality};
pub use prior::{CHANNELS, Prior};
pub use rls::{Rls, Taken};
