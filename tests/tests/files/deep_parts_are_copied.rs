//! A deep part beside the colours is not decoded: its blocks come out byte for byte, from a whole run and from stitched bands.
//!
//! The file is put together by hand: the `exr` crate does not write deep data.

use std::fs;
use std::path::Path;

use exr::prelude::f16;
use linpred::exr_file::attributes::{Attributes, FLAG_MULTI_PART, RawHeader};
use linpred_tests::command::{denoise, linpred};
use linpred_tests::images::noise;

const WIDTH: usize = 5;
const HEIGHT: usize = 7;
/// Version field flag: some part is deep.
const FLAG_DEEP: u32 = 1 << 11;

fn ints(values: &[i32]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}

/// A channel list: names, and 1 for half or 2 for float.
fn channels(list: &[(&str, i32)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (name, kind) in list {
        bytes.extend(name.bytes());
        bytes.push(0);
        bytes.extend(ints(&[*kind, 0, 1, 1]));
    }
    bytes.push(0);
    bytes
}

/// A part without compression, whose blocks are rows.
fn attributes(name: &str, kind: &str, list: &[(&str, i32)]) -> Attributes {
    let window = ints(&[0, 0, WIDTH as i32 - 1, HEIGHT as i32 - 1]);
    let one = 1_f32.to_le_bytes().to_vec();
    let mut part = Attributes::default();
    part.set("channels", "chlist", channels(list));
    part.set("compression", "compression", vec![0]);
    part.set("dataWindow", "box2i", window.clone());
    part.set("displayWindow", "box2i", window);
    part.set("lineOrder", "lineOrder", vec![0]);
    part.set("pixelAspectRatio", "float", one.clone());
    part.set("screenWindowCenter", "v2f", vec![0; 8]);
    part.set("screenWindowWidth", "float", one);
    part.set("name", "string", name.into());
    part.set("type", "string", kind.into());
    part.set("chunkCount", "int", ints(&[HEIGHT as i32]));
    part
}

/// A row of red, green and blue.
fn flat_chunk(part: i32, y: usize) -> Vec<u8> {
    let samples = (0..3 * WIDTH).map(|i| f16::from_f32(noise(1, y * 3 * WIDTH + i)).to_le_bytes());
    let payload: Vec<u8> = samples.flatten().collect();
    [ints(&[part, y as i32, payload.len() as i32]), payload].concat()
}

/// A row of depths; pixel x has x + y of them.
fn deep_chunk(part: i32, y: usize) -> Vec<u8> {
    let mut counted = 0;
    let table: Vec<i32> = (0..WIDTH)
        .map(|x| {
            counted += (x + y) as i32;
            counted
        })
        .collect();
    let samples = (0..counted).flat_map(|i| (i as f32 + y as f32).to_le_bytes());
    let (table, samples): (Vec<u8>, Vec<u8>) = (ints(&table), samples.collect());
    let sizes = [table.len(), samples.len(), samples.len()].map(|size| (size as u64).to_le_bytes());
    [ints(&[part, y as i32]), sizes.concat(), table, samples].concat()
}

/// A file of a flat and a deep part, the deep one `deep`.
fn file(deep: usize) -> Vec<u8> {
    let colour = attributes("beauty", "scanlineimage", &[("B", 1), ("G", 1), ("R", 1)]);
    let mut depth = attributes("deep", "deepscanline", &[("Z", 2)]);
    depth.set("version", "int", ints(&[1]));
    depth.set(
        "maxSamplesPerPixel",
        "int",
        ints(&[(WIDTH + HEIGHT) as i32]),
    );
    let mut parts = vec![colour, depth];
    if deep == 0 {
        parts.reverse();
    }
    let mut bytes = RawHeader::encode(2 | FLAG_MULTI_PART | FLAG_DEEP, &parts);
    let mut offset = bytes.len() + 2 * HEIGHT * 8;
    let mut chunks = Vec::new();
    for part in 0..2 {
        for y in 0..HEIGHT {
            let chunk = match part == deep {
                true => deep_chunk(part as i32, y),
                false => flat_chunk(part as i32, y),
            };
            bytes.extend((offset as u64).to_le_bytes());
            offset += chunk.len();
            chunks.extend(chunk);
        }
    }
    bytes.extend(chunks);
    bytes
}

#[track_caller]
fn assert_deep_chunks(path: &Path, deep: usize) {
    let bytes = fs::read(path).unwrap();
    let header = RawHeader::parse(&bytes).unwrap().unwrap();
    for y in 0..HEIGHT {
        let entry = header.length + (deep * HEIGHT + y) * 8;
        let offset = u64::from_le_bytes(bytes[entry..entry + 8].try_into().unwrap()) as usize;
        let expected = deep_chunk(deep as i32, y);
        assert!(bytes[offset..].starts_with(&expected), "row {y}");
    }
}

#[test]
fn a_deep_part_comes_out_byte_for_byte_wherever_it_stands() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let run = |output: &str, options: &[&str]| {
        denoise(folder.path(), output, options).succeeds();
    };
    for deep in [0, 1] {
        fs::write(path("in.exr"), file(deep)).unwrap();
        assert_deep_chunks(&path("in.exr"), deep);
        run("out.exr", &[]);
        assert_deep_chunks(&path("out.exr"), deep);
        run("1.exr", &["--band", "1/2"]);
        run("2.exr", &["--band", "2/2"]);
        let bands = [path("1.exr"), path("2.exr")];
        let mut arguments = vec!["stitch".into()];
        arguments.extend(bands.map(|band| band.into_os_string()));
        arguments.extend(["-o".into(), path("stitched.exr").into_os_string()]);
        linpred(arguments).succeeds();
        assert_deep_chunks(&path("stitched.exr"), deep);
        assert!(fs::read(path("stitched.exr")).unwrap() == fs::read(path("out.exr")).unwrap());
    }
}

#[test]
fn a_deep_part_cut_short_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    let bytes = file(1);
    fs::write(&input, &bytes[..bytes.len() - 3]).unwrap();
    denoise(folder.path(), "out.exr", &[])
        .exits_with(3)
        .complains_about(&["in.exr", "\"deep\"", "row"]);
    assert!(!output.exists() && !folder.path().join("out.exr.part").exists());
}
