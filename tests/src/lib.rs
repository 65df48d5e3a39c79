//! Oracles, strategies and tolerances for the tests of linpred.

pub mod oracle;
pub mod windows;
