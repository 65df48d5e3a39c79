//! Samples per pixel: what the user says, what the header says, what a channel says.

use std::fmt;

use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::variance::Count;
use crate::exr_file::Part;

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
    // Blender's pass is the fraction of the total that a pixel took
    let fraction = name.ends_with("Debug Sample Count.X");
    let (scale, origin) = match total {
        Some((total, from)) if fraction => (total, format!("channel {name:?} times {from}")),
        _ => (1.0, format!("channel {name:?}")),
    };
    Some(Samples {
        count: Count::Channel { at, scale },
        origin,
    })
}

/// Whether an attribute of this name states samples per pixel.
pub(crate) fn is_attribute(name: &str) -> bool {
    INT_ATTRIBUTES.contains(&name) || cycles_layer(name).is_some()
}

/// What stands before `samples` in an attribute of Cycles, `cycles.<view layer>.samples`: the view layer and a dot.
fn cycles_layer(name: &str) -> Option<&str> {
    let own = name.strip_prefix("cycles.")?.strip_suffix("samples")?;
    own.ends_with('.').then_some(own)
}

/// The samples per pixel that a part's attributes state.
fn attribute(part: &Part, prefix: &str) -> Option<(f32, String)> {
    let int = INT_ATTRIBUTES.iter().find_map(|name| {
        let count = part.attributes.int(name)?;
        (count > 0).then(|| (count as f32, format!("attribute {name:?}")))
    });
    int.or_else(|| {
        part.attributes.iter().find_map(|attribute| {
            let name = std::str::from_utf8(&attribute.name).ok()?;
            let own = cycles_layer(name)?;
            if !(prefix.is_empty() || own == prefix) {
                return None;
            }
            let count: u32 = std::str::from_utf8(&attribute.value)
                .ok()?
                .trim()
                .parse()
                .ok()?;
            (count > 0).then(|| (count as f32, format!("attribute {name:?}")))
        })
    })
}
