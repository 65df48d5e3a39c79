//! Oracles, strategies and tolerances for the tests of linpred.

pub mod command;
pub mod images;
