//! The channels of one or more files under the names that people use for them.
//!
//! A channel's full name is `layer.component` (`ViewLayer.Denoising Albedo.R`). Multi-part files may keep the layer in the
//! part's name and only the component in the channel's: both spellings find it. A view's name (`left`) may stand anywhere in either; lookups do without.

use std::sync::Arc;

use crate::channels::identifiers::is_identifier;
use crate::channels::views;
use crate::error::Error;
use crate::exr_file::{ExrFile, Part};

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
    /// The view that the channel is of, whose name is left out of the layer's; `None` in a file without views, and for what all views share.
    pub view: Option<Arc<str>>,
}

impl NamedChannel {
    fn new(at: ChannelRef, full: &str, view: Option<Arc<str>>) -> Self {
        let (layer, component) = full.rsplit_once('.').unwrap_or(("", full));
        Self {
            at,
            layer: layer.to_owned(),
            component: component.to_owned(),
            view,
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
    /// The views of the first file, the one that is shown by default first; none of most files.
    views: Vec<Arc<str>>,
    names: Vec<NamedChannel>,
    /// The names as they stand in the files, with and without the part's.
    stored: Vec<NamedChannel>,
}

impl ChannelNames {
    /// The channels of `main`.
    pub fn new(main: Arc<ExrFile>) -> Self {
        let mut names = Self {
            views: views::of_file(&main),
            ..Self::default()
        };
        names.add(main);
        names
    }

    /// Adds a file and gives its position. Lookups without a file see only file 0.
    pub fn add(&mut self, file: Arc<ExrFile>) -> usize {
        let index = self.files.len();
        let multi_part = file.parts().len() > 1;
        let views = views::of_file(&file);
        let parts: Vec<NamedPart> = (file.parts().iter())
            .map(|part| NamedPart::new(part, multi_part, &views))
            .collect();
        for (part, named) in file.parts().iter().zip(&parts) {
            let bare = !multi_part || named.holds_bare_names(&parts);
            let label = named.label.as_deref();
            let names: Vec<&str> = named.channels.iter().map(|(_, n)| n.as_str()).collect();
            for (channel, (view, name)) in named.channels.iter().enumerate() {
                let at = ChannelRef {
                    file: index,
                    part: part.index,
                    channel,
                };
                for full in spellings(name, label, bare) {
                    let spelt = NamedChannel::new(at, &full, view.clone());
                    self.names.push(spelt);
                }
                if let Some((stem, component)) = triple_of(name, &names) {
                    for layer in spellings(&stem, label, bare) {
                        self.names.push(NamedChannel {
                            at,
                            layer,
                            component: component.clone(),
                            view: view.clone(),
                        });
                    }
                }
                let (own, part) = (part.channel_name(channel), part.name.as_deref());
                for full in spellings(&own, part.filter(|_| multi_part), true) {
                    self.stored.push(NamedChannel::new(at, &full, view.clone()));
                }
            }
        }
        self.files.push(file);
        index
    }

    /// The views of the noisy image, by the names that its header gives them; empty for most.
    pub fn views(&self) -> &[Arc<str>] {
        &self.views
    }

    /// The same without the channels of all views but `view`.
    pub fn of_view(&self, view: &str) -> Self {
        let seen = |name: &&NamedChannel| name.view.as_deref().is_none_or(|own| own == view);
        Self {
            files: self.files.clone(),
            views: self.views.clone(),
            names: self.names.iter().filter(seen).cloned().collect(),
            stored: self.stored.clone(),
        }
    }

    /// The view that a channel is of.
    pub(crate) fn view(&self, at: ChannelRef) -> Option<Arc<str>> {
        let name = self.names.iter().find(|name| name.at == at);
        name.and_then(|name| name.view.clone())
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
        let inside = |name: &&NamedChannel| name.at.file == file && name.layer == layer;
        let own = self.names.iter().filter(inside);
        let stored = self.stored.iter().filter(inside);
        complete(own, sets).or_else(|| complete(stored, sets))
    }

    /// The channel of this full name, as it stands in the file or without its view.
    pub fn channel(&self, file: usize, full: &str) -> Option<ChannelRef> {
        let called = |name: &&NamedChannel| name.at.file == file && name.full() == full;
        let own = self.names.iter().find(called);
        let found = own.or_else(|| self.stored.iter().find(called));
        // V-Ray's root channels begin with a dot
        let dotted = || self.channel(file, full.strip_prefix('.')?);
        found.map(|name| name.at).or_else(dotted)
    }

    /// The full name of a channel, as it stands in the file but for a leading part's.
    pub fn name(&self, at: ChannelRef) -> String {
        let own = self.files[at.file].parts()[at.part].channel_name(at.channel);
        let name = self.stored.iter().rfind(|name| name.at == at);
        match own.starts_with('.') {
            true => own,
            false => name.map(NamedChannel::full).unwrap_or(own),
        }
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

/// A part and its channels by the names that lookups use, without views.
struct NamedPart {
    index: usize,
    label: Option<String>,
    channels: Vec<(Option<Arc<str>>, String)>,
}

impl NamedPart {
    fn new(part: &Part, multi_part: bool, views: &[Arc<str>]) -> Self {
        let named = part.name.as_deref().filter(|_| multi_part);
        let (view, label) = views::of_part(part, named, views);
        let channels = 0..part.header.channels.list.len();
        let own: Vec<String> = channels.map(|channel| part.channel_name(channel)).collect();
        Self {
            index: part.index,
            label,
            channels: views::of_channels(&own, view.as_ref(), views, !multi_part),
        }
    }

    fn view(&self) -> Option<&Arc<str>> {
        self.channels.first().and_then(|(view, _)| view.as_ref())
    }

    /// How likely its bare channels are those of the picture, the smaller the likelier: by its name; by that of another part they would be features.
    fn rank(&self) -> usize {
        let label = self.label.as_deref().unwrap_or_default();
        let last = label
            .rsplit('.')
            .next()
            .unwrap_or(label)
            .to_ascii_lowercase();
        if last.is_empty() || PICTURES.contains(&last.as_str()) {
            0
        } else {
            1 + usize::from(is_no_picture(label))
        }
    }

    /// Whether it is the part of its view, among all `parts`, whose channels go by their bare names. A part that all views share is none in a file that
    /// has views.
    fn holds_bare_names(&self, parts: &[Self]) -> bool {
        let alike = parts.iter().filter(|part| part.view() == self.view());
        let best = alike.min_by_key(|part| (part.rank(), part.index));
        let shared = self.view().is_none() && parts.iter().any(|part| part.view().is_some());
        !shared && best.is_some_and(|best| best.index == self.index)
    }
}

/// Names of parts, in lower case, that hold the picture.
const PICTURES: [&str; 10] = [
    "rgba", "rgb", "beauty", "combined", "ci", "color", "colour", "main", "image", "final",
];

/// Words, in lower case, that are all of a name's letters or begin them where a layer is no picture.
const NO_PICTURES: [&str; 22] = [
    "n",
    "ns",
    "nn",
    "z",
    "p",
    "normal",
    "shnormal",
    "bumpnormal",
    "albedo",
    "diffusealbedo",
    "denoising",
    "depth",
    "position",
    "variance",
    "mse",
    "halfa",
    "halfb",
    "crypto",
    "uv",
    "motion",
    "vector",
    "mask",
];

/// Whether a layer or part of this name holds features, their noise or numbers, and no picture.
pub(crate) fn is_no_picture(name: &str) -> bool {
    let last = name.rsplit('.').next().unwrap_or(name);
    let letters = last.chars().filter(char::is_ascii_alphabetic);
    let word: String = letters.map(|c| c.to_ascii_lowercase()).collect();
    let known = |known: &str| word == known || (known.len() > 3 && word.starts_with(known));
    NO_PICTURES.iter().any(|name| known(name)) || word.ends_with("variance") || is_identifier(name)
}

/// The channels among `names` of the first of `sets` that is complete.
fn complete<'a, const N: usize>(
    names: impl Iterator<Item = &'a NamedChannel>,
    sets: &[[&str; N]],
) -> Option<[ChannelRef; N]> {
    let names: Vec<&NamedChannel> = names.collect();
    sets.iter().find_map(|set| {
        let found = set.map(|component| {
            let called = |name: &&&NamedChannel| name.component.eq_ignore_ascii_case(component);
            names.iter().find(called).map(|name| name.at)
        });
        let all = found.iter().all(Option::is_some);
        all.then(|| found.map(|at| at.expect("all are there")))
    })
}

/// Endings of three channels that belong together, in the names of renderers that put no dot before them.
const ENDINGS: [[&str; 3]; 3] = [["red", "green", "blue"], ["r", "g", "b"], ["x", "y", "z"]];

/// The layer and the component of a channel such as `Nx` or `albedo_red`, where `names` have the other two.
fn triple_of(name: &str, names: &[&str]) -> Option<(String, String)> {
    let lower = name.to_ascii_lowercase();
    let has = |wanted: &str| names.iter().any(|name| name.eq_ignore_ascii_case(wanted));
    ENDINGS.iter().find_map(|endings| {
        let ending = endings.iter().find(|ending| lower.ends_with(**ending))?;
        let stem = &lower[..lower.len() - ending.len()];
        let layer = stem.trim_end_matches(['_', '-', ':', '/', ' ']);
        let last = layer.rsplit('.').next().unwrap_or(layer);
        let whole = !last.is_empty() && endings.iter().all(|e| has(&format!("{stem}{e}")));
        whole.then(|| (name[..layer.len()].to_owned(), (*ending).to_owned()))
    })
}

/// The names of a channel: with the part's name before it unless it is there already; bare too in the part that holds those.
fn spellings(own: &str, part: Option<&str>, bare: bool) -> Vec<String> {
    match part {
        None | Some("") => vec![own.to_owned()],
        Some(part)
            if own
                .strip_prefix(part)
                .is_some_and(|rest| rest.starts_with('.')) =>
        {
            vec![own.to_owned()]
        }
        Some(part) if bare => vec![own.to_owned(), format!("{part}.{own}")],
        Some(part) => vec![format!("{part}.{own}")],
    }
}

#[cfg(test)]
mod tests {
    use super::{spellings, triple_of};

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

    #[test]
    fn channels_whose_names_end_alike_are_a_layer() {
        let of = |name: &str, names: &[&str]| triple_of(name, names);
        let layer = |layer: &str, component: &str| Some((layer.to_owned(), component.to_owned()));
        assert_eq!(of("Nsx", &["Nsx", "Nsy", "Nsz"]), layer("Ns", "x"));
        assert_eq!(of("Nsx", &["Nsx", "Nsy"]), None);
        let albedo = ["albedo_red", "albedo_green", "albedo_blue"];
        assert_eq!(of("albedo_green", &albedo), layer("albedo", "green"));
        assert_eq!(
            of("vl.AlbedoB", &["vl.AlbedoR", "vl.AlbedoG", "vl.AlbedoB"]),
            layer("vl.Albedo", "b")
        );
        assert_eq!(of("R", &["R", "G", "B"]), None);
        assert_eq!(of("vl.R", &["vl.R", "vl.G", "vl.B"]), None);
    }
}
