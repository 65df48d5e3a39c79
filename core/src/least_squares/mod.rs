//! The algebra of the fits: linear models of three channels by weighted, regularised least squares.

mod dot;
pub(crate) mod factor;
pub(crate) mod normal_equations;
pub(crate) mod prior;
pub(crate) mod rls;
pub(crate) mod sums;
