//! The fits, one file for each member of [`Formulas`](crate::Formulas).

pub(crate) mod lpr;
pub(crate) mod robust;
