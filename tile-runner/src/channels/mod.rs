//! Which channel plays which role.
//!
//! [`ChannelNames`] lists the channels of the input files under every name that people use for them; the presets know what each renderer calls
//! them; [`Roles`] is what comes of both, and of what a user asks for.

pub(crate) mod identifiers;
pub(crate) mod motion;
pub(crate) mod names;
pub(crate) mod presets;
pub(crate) mod roles;
pub(crate) mod samples;
pub(crate) mod variance;
pub(crate) mod views;

pub use names::{ChannelNames, ChannelRef, NamedChannel};
pub use presets::{PRESET_NAMES, Preset, Role};
pub use roles::layers::Layer;
pub use roles::{
    Assignment, FeatureChannels, FeatureRequest, FurtherChannels, Mapping, NamedFeature,
    RoleRequest, Roles,
};
pub use samples::Samples;
pub use variance::{Count, Meaning, Variance};
