//! Oracles, strategies and tolerances for the tests of linpred.
