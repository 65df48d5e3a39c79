//! Samples per pixel: what the user says, what the header says, what a channel says.

use std::fmt;

use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::variance::Count;
use crate::exr_file::Part;
use crate::exr_file::attributes::{Attribute, Attributes};

/// Attributes that hold the samples per pixel as an int.
const INT_ATTRIBUTES: [&str; 3] = ["spp", "samplesPerPixel", "sampleCount"];

/// The samples per pixel and who said so.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    /// How many.
    pub count: Count,
    /// Where that is from, for `inspect`.
    pub origin: String,
}

impl fmt::Display for Samples {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.count {
            Count::Fixed(count) => write!(f, "{count} ({})", self.origin),
            Count::Channel { scale, .. } if scale != 1.0 => {
                write!(f, "per pixel, up to {scale} ({})", self.origin)
            }
            Count::Channel { .. } => write!(f, "per pixel ({})", self.origin),
        }
    }
}

/// Finds the samples per pixel: what the user says, then a channel, then an attribute of one of `parts`, of the view layer whose channels begin with `prefix`.
pub(crate) fn find(
    spp: Option<u32>,
    channel: Option<ChannelRef>,
    names: &ChannelNames,
    parts: &[&Part],
    prefix: &str,
) -> Option<Samples> {
    if let Some(spp) = spp {
        return Some(Samples {
            count: Count::Fixed(spp as f32),
            origin: "as asked".into(),
        });
    }
    let total = parts.iter().find_map(|part| attribute(part, prefix));
    let Some(at) = channel else {
        return total.map(|(count, origin)| Samples {
            count: Count::Fixed(count),
            origin,
        });
    };
    let name = names.name(at);
    let (scale, origin) = match total {
        Some((total, from)) if is_fraction(&name) => {
            (total, format!("channel {name:?} times {from}"))
        }
        _ => (1.0, format!("channel {name:?}")),
    };
    Some(Samples {
        count: Count::Channel { at, scale },
        origin,
    })
}

/// Whether a channel of this name holds fractions of a total: Blender's pass does.
pub(crate) fn is_fraction(name: &str) -> bool {
    name.ends_with("Debug Sample Count.X")
}

/// Whether an attribute of this name states samples per pixel.
pub(crate) fn is_attribute(name: &str) -> bool {
    INT_ATTRIBUTES.contains(&name) || cycles_layer(name).is_some()
}

/// The samples per pixel that the attribute of this name states, which is an int or, of Cycles, a text; never 0.
pub(crate) fn stated(attributes: &Attributes, name: &str) -> Option<u32> {
    let int = attributes.int(name).and_then(|count| count.try_into().ok());
    let text = || attributes.string(name)?.trim().parse().ok();
    int.or_else(text).filter(|count| *count > 0)
}

/// Has an attribute that states samples per pixel state so many.
pub(crate) fn state(attributes: &mut Attributes, of: &Attribute, count: u32) {
    let name = String::from_utf8_lossy(&of.name);
    match (&of.kind[..], i32::try_from(count)) {
        (b"int", Ok(count)) => attributes.set(&name, "int", count.to_le_bytes().to_vec()),
        (b"string", _) => attributes.set(&name, "string", count.to_string().into_bytes()),
        _ => {}
    }
}

/// What stands before `samples` in an attribute of Cycles, `cycles.<view layer>.samples`: the view layer and a dot.
fn cycles_layer(name: &str) -> Option<&str> {
    let own = name.strip_prefix("cycles.")?.strip_suffix("samples")?;
    own.ends_with('.').then_some(own)
}

/// The samples per pixel that a part's attributes state.
fn attribute(part: &Part, prefix: &str) -> Option<(f32, String)> {
    let named = |name: &str| {
        let count = stated(&part.attributes, name)?;
        Some((count as f32, format!("attribute {name:?}")))
    };
    let int = INT_ATTRIBUTES.iter().find_map(|name| {
        part.attributes.int(name)?;
        named(name)
    });
    int.or_else(|| {
        part.attributes.iter().find_map(|attribute| {
            let name = std::str::from_utf8(&attribute.name).ok()?;
            let own = cycles_layer(name)?;
            let is_own = prefix.is_empty() || own == prefix;
            named(name).filter(|_| is_own)
        })
    })
}
