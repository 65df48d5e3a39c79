//! The channels of one or more files under the names that people use for them.
//!
//! A channel's full name is `layer.component` (`ViewLayer.Denoising Albedo.R`). Multi-part files may keep the layer in the
//! part's name and only the component in the channel's: both spellings find it.

use std::sync::Arc;

use crate::error::Error;
use crate::exr_file::ExrFile;

/// A channel of one of the input files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChannelRef {
    /// Position in the list of input files; 0 is the noisy image.
    pub file: usize,
    /// Part of that file.
    pub part: usize,
    /// Channel of that part, in file order.
    pub channel: usize,
}

/// A channel and one of its names.
#[derive(Clone, Debug)]
pub struct NamedChannel {
    /// Which channel.
    pub at: ChannelRef,
    /// Everything before the last dot; empty for a bare `R`.
    pub layer: String,
    /// Everything after the last dot.
    pub component: String,
}

impl NamedChannel {
    fn new(at: ChannelRef, full: &str) -> Self {
        let (layer, component) = full.rsplit_once('.').unwrap_or(("", full));
        Self {
            at,
            layer: layer.to_owned(),
            component: component.to_owned(),
        }
    }

    /// The name with its layer.
    pub fn full(&self) -> String {
        if self.layer.is_empty() {
            self.component.clone()
        } else {
            format!("{}.{}", self.layer, self.component)
        }
    }
}

/// The input files and their channels by name.
#[derive(Clone, Debug, Default)]
pub struct ChannelNames {
    files: Vec<Arc<ExrFile>>,
    names: Vec<NamedChannel>,
}

impl ChannelNames {
    /// The channels of `main`.
    pub fn new(main: Arc<ExrFile>) -> Self {
        let mut names = Self::default();
        names.add(main);
        names
    }

    /// Adds a file and gives its position. Lookups without a file see only file 0.
    pub fn add(&mut self, file: Arc<ExrFile>) -> usize {
        let index = self.files.len();
        for part in file.parts() {
            for channel in 0..part.header.channels.list.len() {
                let at = ChannelRef {
                    file: index,
                    part: part.index,
                    channel,
                };
                let own = part.channel_name(channel);
                let multi_part = file.parts().len() > 1;
                for full in spellings(
                    &own,
                    part.name.as_deref().filter(|_| multi_part),
                    part.index == 0,
                ) {
                    self.names.push(NamedChannel::new(at, &full));
                }
            }
        }
        self.files.push(file);
        index
    }

    /// The input files.
    pub fn files(&self) -> &[Arc<ExrFile>] {
        &self.files
    }

    /// Every name in a file, in file order.
    pub fn in_file(&self, file: usize) -> impl Iterator<Item = &NamedChannel> {
        self.names.iter().filter(move |name| name.at.file == file)
    }

    /// The layers of a file, each once, in file order.
    pub fn layers(&self, file: usize) -> Vec<&str> {
        let mut layers: Vec<&str> = Vec::new();
        for name in self.in_file(file) {
            if !layers.contains(&name.layer.as_str()) {
                layers.push(&name.layer);
            }
        }
        layers
    }

    /// The channels of a layer whose components are those of the first of `sets` that is complete. Component names are
    /// compared without regard to case.
    pub fn components<const N: usize>(
        &self,
        file: usize,
        layer: &str,
        sets: &[[&str; N]],
    ) -> Option<[ChannelRef; N]> {
        sets.iter().find_map(|set| {
            let found = set.map(|component| {
                self.in_file(file)
                    .find(|name| {
                        name.layer == layer && name.component.eq_ignore_ascii_case(component)
                    })
                    .map(|name| name.at)
            });
            found
                .iter()
                .all(Option::is_some)
                .then(|| found.map(|at| at.expect("all are there")))
        })
    }

    /// The channel of this full name.
    pub fn channel(&self, file: usize, full: &str) -> Option<ChannelRef> {
        self.in_file(file)
            .find(|name| name.full() == full)
            .map(|name| name.at)
    }

    /// The full name of a channel.
    pub fn name(&self, at: ChannelRef) -> String {
        let name = self.names.iter().find(|name| name.at == at);
        name.map(NamedChannel::full).unwrap_or_default()
    }

    /// Where a channel is, for messages: file, part, channel.
    pub fn place(&self, at: ChannelRef) -> String {
        let file = &self.files[at.file];
        let part = &file.parts()[at.part];
        format!(
            "{}: {}: channel {:?}",
            file.path().display(),
            part.label(),
            part.channel_name(at.channel)
        )
    }

    /// The channel of another file that has the same name as `at`.
    pub fn twin(&self, at: ChannelRef, file: usize) -> Result<ChannelRef, Error> {
        let name = self.name(at);
        self.channel(file, &name).ok_or_else(|| {
            Error::Invalid(format!(
                "{}: no channel {name:?}",
                self.files[file].path().display()
            ))
        })
    }
}

/// The names of a channel: with the part's name before it unless it is there already; bare too in the first part.
fn spellings(own: &str, part: Option<&str>, first: bool) -> Vec<String> {
    match part {
        None => vec![own.to_owned()],
        Some(part)
            if own
                .strip_prefix(part)
                .is_some_and(|rest| rest.starts_with('.')) =>
        {
            vec![own.to_owned()]
        }
        Some(part) if first => vec![own.to_owned(), format!("{part}.{own}")],
        Some(part) => vec![format!("{part}.{own}")],
    }
}

#[cfg(test)]
mod tests {
    use super::spellings;

    #[test]
    fn a_part_name_is_put_before_a_channel_once() {
        assert_eq!(
            spellings("VL.Depth.Z", Some("VL.Depth"), false),
            ["VL.Depth.Z"]
        );
        assert_eq!(spellings("R", Some("diffuse"), false), ["diffuse.R"]);
        assert_eq!(spellings("R", Some("rgba"), true), ["R", "rgba.R"]);
        assert_eq!(spellings("R", None, true), ["R"]);
    }
}
