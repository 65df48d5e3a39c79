//! Layers that hold numbers of things (objects, materials), which no arithmetic may touch.

use crate::channels::names::ChannelRef;
use crate::exr_file::ExrFile;
use exr::meta::attribute::SampleType;

/// Names of channels and layers, in lower case and without what is no letter, that renderers give to identifiers.
const NAMES: [&str; 18] = [
    "id",
    "ids",
    "assetid",
    "faceid",
    "indexma",
    "indexob",
    "instanceid",
    "materialid",
    "materialindex",
    "meshid",
    "nodeid",
    "objectid",
    "objectindex",
    "primid",
    "primitiveid",
    "renderid",
    "shapeid",
    "surfaceid",
];

/// Whether a channel or a layer of this name holds identifiers: one of the parts of its name is that of some.
pub(crate) fn is_identifier(name: &str) -> bool {
    name.split('.').any(|word| {
        let letters = word.chars().filter(char::is_ascii_alphabetic);
        let word: String = letters.map(|c| c.to_ascii_lowercase()).collect();
        NAMES.contains(&word.as_str()) || word.starts_with("crypto")
    })
}

/// The layers of Cryptomatte hashes that a file's header names (`cryptomatte/<key>/name`, Cryptomatte specification 1.2): each, and each followed by digits.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cryptomattes(Vec<String>);

impl Cryptomattes {
    pub(crate) fn of(file: &ExrFile) -> Self {
        let attributes = file.parts().iter().flat_map(|part| part.attributes.iter());
        let named = attributes.filter(|attribute| {
            attribute.name.starts_with(b"cryptomatte/") && attribute.name.ends_with(b"/name")
        });
        let names = named.filter_map(|attribute| std::str::from_utf8(&attribute.value).ok());
        Self(names.map(str::to_owned).collect())
    }

    /// Whether a layer is one of them, by its whole name or what stands after its first or last dots.
    pub(crate) fn has(&self, layer: &str) -> bool {
        let called = |layer: &str, name: &str| {
            let rest = layer.strip_prefix(name);
            rest.is_some_and(|rest| rest.bytes().all(|b| b.is_ascii_digit()))
        };
        let tails = std::iter::successors(Some(layer), |layer| Some(layer.split_once('.')?.1));
        let mut tails = tails.filter(|tail| !tail.is_empty());
        tails.any(|tail| {
            let names = self.0.iter().filter(|name| !name.is_empty());
            names.into_iter().any(|name| {
                let short = name.rsplit('.').next().unwrap_or(name);
                called(tail, name) || called(tail, short)
            })
        })
    }
}

/// Whether a channel holds integers.
pub(crate) fn is_integer(file: &ExrFile, at: ChannelRef) -> bool {
    file.parts()[at.part].sample_type(at.channel) == SampleType::U32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_told_by_the_words_of_their_names() {
        for name in [
            "id",
            "ViewLayer.IndexOB.X",
            "objectId",
            "material_id",
            "CryptoObject00.r",
        ] {
            assert!(is_identifier(name), "{name}");
        }
        for name in ["R", "video", "diffuse.R", "fluid.density", "Z"] {
            assert!(!is_identifier(name), "{name}");
        }
        let cryptomattes = Cryptomattes(vec!["uCryptoAsset".into(), "vl.Thing".into()]);
        for layer in ["uCryptoAsset", "uCryptoAsset01", "vl.Thing00", "Thing00"] {
            assert!(cryptomattes.has(layer), "{layer}");
        }
        assert!(!cryptomattes.has("Things") && !cryptomattes.has("diffuse"));
    }
}
