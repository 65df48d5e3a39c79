//! Arbitrary channel names through the presets and `--map`: every role gets channels that exist, or there is an error.
//!
//! The first byte chooses the preset. Lines follow: those that begin with `+` are values of `--map`, the others are channels.

#![no_main]

use std::collections::BTreeSet;

use libfuzzer_sys::fuzz_target;
use linpred::channels::{Mapping, Preset, RoleRequest};
use linpred::job::{Input, InputRequest};
use linpred_tests::images::{float, half, part, write};

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
    let (maps, names): (Vec<&str>, Vec<&str>) = text
        .lines()
        .filter(|line| !line.is_empty())
        .partition(|line| line.starts_with('+'));
    // A file's channels have names of their own, of at most 255 letters.
    let names: BTreeSet<&str> = names
        .into_iter()
        .filter(|name| name.len() < 256)
        .take(24)
        .collect();
    if names.is_empty() {
        return;
    }
    let channels = names.iter().zip(0..).map(|(name, seed)| match choice & 1 {
        0 => half(name, 2, seed),
        _ => float(name, 2, seed),
    });
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    write(file.path(), (2, 1), vec![part(channels.collect())]);
    let request = InputRequest::new(file.path()).with_roles(RoleRequest {
        preset: Preset::named(PRESETS[usize::from(choice >> 1) % PRESETS.len()]),
        map: maps
            .iter()
            .filter_map(|map| Mapping::parse(&map[1..]).ok())
            .collect(),
        ..RoleRequest::default()
    });
    let Ok(input) = Input::open(&request) else {
        return;
    };
    let colour: BTreeSet<_> = input.roles.colour.into_iter().collect();
    assert!(colour.len() == 3 || colour.len() == 1, "{:?}", input.roles);
    for assignment in &input.roles.assignments {
        assert!(!assignment.channels.is_empty());
        for at in &assignment.channels {
            assert!(
                at.file == 0 && at.part == 0 && at.channel < names.len(),
                "{assignment:?}"
            );
        }
    }
});
