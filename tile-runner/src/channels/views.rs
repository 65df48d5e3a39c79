//! The views of a stereo or multi-view file, and which channel is of which.
//!
//! OpenEXR knows two ways: parts with an attribute `view`, and one part with an attribute `multiView`, a list of names that stand in the channels' own
//! (`right.R`, `diffuse.right.G`; Blender has `ViewLayer.Combined.right.B`), where a channel with none is of the first view. Some writers leave both out, and
//! have `left` and `right`, or one of them, in the names alone.

use std::sync::Arc;

use crate::exr_file::{ExrFile, Part};

/// What is between the parts of a name.
const BETWEEN: [char; 3] = ['.', '_', '-'];

/// The views that a file has, the one that is shown by default first.
pub(crate) fn of_file(file: &ExrFile) -> Vec<Arc<str>> {
    let mut views: Vec<Arc<str>> = Vec::new();
    let mut add = |view: &str| {
        if !view.is_empty() && !views.iter().any(|known| **known == *view) {
            views.push(view.into());
        }
    };
    for part in file.parts() {
        part.attributes.strings("multiView").for_each(&mut add);
        part.attributes
            .string("view")
            .into_iter()
            .for_each(&mut add);
    }
    if views.is_empty() && ["left", "right"].iter().all(|view| is_in_names(file, view)) {
        views = ["left", "right"].map(Into::into).to_vec();
    }
    // the second eye beside the first, which has no name
    for [first, second] in [["left", "right"], ["right", "left"]] {
        if views.is_empty() && stands_beside(file, second) {
            views = [first, second].map(Into::into).to_vec();
        }
    }
    match views.len() {
        0 | 1 => Vec::new(),
        _ => views,
    }
}

/// Whether the file is of one part, in which a channel of this view stands beside one of the same name without it.
fn stands_beside(file: &ExrFile, view: &str) -> bool {
    let [part] = file.parts() else { return false };
    let names = 0..part.header.channels.list.len();
    let names: Vec<String> = names.map(|channel| part.channel_name(channel)).collect();
    let of_view = of_channels(&names, None, &[view.into()], false);
    let named = of_view.iter().filter(|(view, _)| view.is_some());
    let mut named = named.filter(|(_, name)| ["R", "red", "r"].contains(&name.as_str()));
    named.any(|(_, name)| names.contains(name))
}

/// Whether a part's name, or the layer of a channel's, has this view in it.
fn is_in_names(file: &ExrFile, view: &str) -> bool {
    file.parts().iter().any(|part| {
        let label = part.name.as_deref().filter(|_| file.parts().len() > 1);
        let mut channels = 0..part.header.channels.list.len();
        label.is_some_and(|label| without(label, view).is_some())
            || channels.any(|channel| {
                let name = part.channel_name(channel);
                let layer = name.rsplit_once('.').map(|(layer, _)| layer);
                layer.is_some_and(|layer| layer.split('.').any(|word| word == view))
            })
    })
}

/// The view that a part is of, by its attribute or else by its name, and that name without it.
pub(crate) fn of_part(
    part: &Part,
    label: Option<&str>,
    views: &[Arc<str>],
) -> (Option<Arc<str>>, Option<String>) {
    let stated = part.attributes.string("view");
    let stated = stated.and_then(|view| views.iter().find(|known| ***known == *view));
    let Some(label) = label else {
        return (stated.cloned(), None);
    };
    let named = |view: &&Arc<str>| without(label, view).is_some();
    let view = stated.or_else(|| views.iter().find(named));
    let rest = view.and_then(|view| without(label, view));
    (
        view.cloned(),
        Some(rest.unwrap_or_else(|| label.to_owned())),
    )
}

/// The views that the channels of a part are of, and their names without them. `part` is the part's view; in a file of one part a channel that names none is
/// of the first.
pub(crate) fn of_channels(
    names: &[String],
    part: Option<&Arc<str>>,
    views: &[Arc<str>],
    single: bool,
) -> Vec<(Option<Arc<str>>, String)> {
    let named = |name: &String| {
        let (layer, component) = name.rsplit_once('.')?;
        let mut words: Vec<&str> = layer.split('.').collect();
        let known = |word: &&str| views.iter().find(|view| ***view == **word);
        let at = words.iter().rposition(|word| known(word).is_some())?;
        let view = known(&words[at]).cloned();
        words.remove(at);
        words.push(component);
        Some((view, words.join(".")))
    };
    let default = part.or_else(|| views.first().filter(|_| single)).cloned();
    let view = |name: &String| named(name).unwrap_or_else(|| (default.clone(), name.clone()));
    names.iter().map(view).collect()
}

/// A part's name without a view, which stands at one of its ends or between two others: `rgba_left`, `left.N`.
fn without(label: &str, view: &str) -> Option<String> {
    if label == view {
        return Some(String::new());
    }
    let end = label
        .strip_suffix(view)
        .and_then(|rest| rest.strip_suffix(BETWEEN));
    let start = label
        .strip_prefix(view)
        .and_then(|rest| rest.strip_prefix(BETWEEN));
    let middle = || {
        BETWEEN.iter().find_map(|between| {
            let (before, after) = label.split_once(&format!("{between}{view}{between}"))?;
            Some(format!("{before}{between}{after}"))
        })
    };
    end.or(start).map(str::to_owned).or_else(middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_may_stand_anywhere_in_a_name() {
        let rest = |label: &str| without(label, "left");
        assert_eq!(rest("rgba_left").as_deref(), Some("rgba"));
        assert_eq!(rest("left.N").as_deref(), Some("N"));
        assert_eq!(rest("vl.left.N").as_deref(), Some("vl.N"));
        assert_eq!(rest("left").as_deref(), Some(""));
        assert_eq!(rest("leftover"), None);
        let views: Vec<Arc<str>> = vec!["left".into(), "right".into()];
        let names = ["R", "right.R", "vl.Combined.right.R", "right"].map(str::to_owned);
        let found = of_channels(&names, None, &views, true);
        let found: Vec<_> = found
            .iter()
            .map(|(v, n)| (v.as_deref(), n.as_str()))
            .collect();
        let (left, right) = (Some("left"), Some("right"));
        let wanted = [
            (left, "R"),
            (right, "R"),
            (right, "vl.Combined.R"),
            (left, "right"),
        ];
        assert_eq!(found, wanted);
    }
}
