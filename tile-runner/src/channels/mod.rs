//! Which channel plays which role.

pub mod layers;
pub mod names;
pub mod presets;
pub mod roles;
pub mod samples;
pub mod variance;
