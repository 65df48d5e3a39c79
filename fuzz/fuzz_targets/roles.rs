//! Arbitrary channel names through the presets and `--map`: every role gets channels that exist, or there is an error.
//!
//! The first byte chooses the preset. Lines follow: those that begin with `+` are values of `--map`, with `*` of `--layers`; `@` is an attribute of the part, `#`
//! begins the next part, of that name; the others are channels.

#![no_main]

use std::collections::BTreeSet;

use exr::prelude::{AttributeValue, Text};
use libfuzzer_sys::fuzz_target;
use linpred::channels::{ChannelRef, Mapping, Preset, RoleRequest};
use linpred::job::{Input, InputRequest};
use linpred_tests::images::{float, half, part, write, TestPart};

const PRESETS: [&str; 7] = [
    "",
    "blender",
    "mitsuba",
    "pbrt",
    "renderman",
    "arnold",
    "tungsten",
];

fuzz_target!(|data: &[u8]| {
    let Some((&choice, rest)) = data.split_first() else {
        return;
    };
    let text: String = rest
        .iter()
        .map(|&b| {
            if b == b'\n' || (32..127).contains(&b) {
                b as char
            } else {
                '.'
            }
        })
        .collect();
    let lines = || text.lines().filter(|line| line.len() < 256 && !line.is_empty());
    let of = |mark: char| lines().filter_map(move |line| line.strip_prefix(mark));
    let mut parts: Vec<Described> = vec![Described::default()];
    for line in lines().take(64) {
        let last = parts.len() - 1;
        match line.split_at_checked(1) {
            Some(("#", name)) if parts.len() < 4 => parts.push(Described::named(name)),
            Some(("@", text)) => parts[last].attributes.extend(text.split_once('=')),
            Some(("+" | "*" | "#", _)) => {}
            _ => {
                parts[last].channels.insert(line);
            }
        }
    }
    parts.retain(|part| !part.channels.is_empty());
    if parts.is_empty() {
        return;
    }
    let counts: Vec<usize> = parts.iter().map(|part| part.channels.len()).collect();
    let several = parts.len() > 1;
    let written = parts.iter().zip(0..).map(|(described, n)| {
        let channels = described.channels.iter().zip(0..).map(|(name, seed)| match choice & 1 {
            0 => half(name, 2, seed),
            _ => float(name, 2, seed),
        });
        TestPart {
            name: several.then(|| part_name(described.name, n)),
            attributes: described.attributes(),
            ..part(channels.collect())
        }
    });
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    write(file.path(), (2, 1), written.collect());
    let roles = RoleRequest {
        preset: Preset::named(PRESETS[usize::from(choice >> 1) % PRESETS.len()]),
        map: of('+').filter_map(|map| Mapping::parse(map).ok()).collect(),
        ..RoleRequest::default()
    };
    let request = InputRequest::new(file.path())
        .with_roles(roles)
        .with_layers(of('*').map(|layer| format!("*{layer}")).collect());
    let Ok(pictures) = Input::open_all(&request) else {
        return;
    };
    for input in pictures {
        check(&input, &counts);
    }
});

/// Names of parts, four of each kind, so that no two of a file are alike.
const PART_NAMES: [[&str; 4]; 5] = [
    ["rgba", "rgba_right", "right.rgba", "rgba.left"],
    ["N", "N_left", "right_N", "N.right"],
    ["left", "right", "VL.Combined", "VL.Noisy Image"],
    ["", "depth", "albedo", "variance"],
    ["VL.right.Combined", "VL2.Combined", "beauty", "id"],
];

/// A name for the `n`-th part, chosen by what the bytes call it.
fn part_name(called: &str, n: usize) -> &'static str {
    let kind = called.bytes().map(usize::from).sum::<usize>();
    PART_NAMES[kind % PART_NAMES.len()][n]
}

/// A part as the bytes describe it.
#[derive(Default)]
struct Described<'a> {
    name: &'a str,
    attributes: Vec<(&'a str, &'a str)>,
    channels: BTreeSet<&'a str>,
}

impl<'a> Described<'a> {
    fn named(name: &'a str) -> Self {
        Self {
            name,
            ..Self::default()
        }
    }

    /// Those that say something of roles, and of the others text.
    fn attributes(&self) -> Vec<(&'static str, AttributeValue)> {
        let known = |(name, value): &(&str, &str)| {
            let text = AttributeValue::Text((*value).into());
            Some(match *name {
                "view" => ("view", text),
                "views" => {
                    let views = value.split(',').map(Text::new_or_panic).collect();
                    ("multiView", AttributeValue::TextVector(views))
                }
                "crypto" => ("cryptomatte/1/name", text),
                "blender" => ("BlenderMultiChannel", text),
                "pbrt" => ("samplesPerPixel", AttributeValue::I32(value.len() as i32)),
                "noise" => ("linpredNoiseOfInput", text),
                "version" => ("linpredVersion", text),
                _ => return None,
            })
        };
        self.attributes.iter().filter_map(known).collect()
    }
}

/// Every role has channels that exist, and no channel is written to by two.
fn check(input: &Input, counts: &[usize]) {
    let exists = |at: &ChannelRef| at.file == 0 && at.part < counts.len() && at.channel < counts[at.part];
    let colour: BTreeSet<_> = input.roles.colour.into_iter().collect();
    assert!(colour.len() == 3 || colour.len() == 1, "{:?}", input.roles);
    for assignment in &input.roles.assignments {
        assert!(!assignment.channels.is_empty());
        assert!(assignment.channels.iter().all(exists), "{assignment:?}");
    }
    assert!(input.roles.target.iter().chain(&input.roles.alpha_target).all(exists));
    let layers = input.layers.iter().flat_map(|layer| &layer.channels);
    let mut targets: Vec<&ChannelRef> = colour.iter().chain(layers).chain(&input.roles.alpha).collect();
    let all = targets.len();
    targets.sort();
    targets.dedup();
    assert_eq!(all, targets.len(), "{input:?}");
}
