//! Bands that are denoised apart and stitched are, byte for byte, the frame denoised at once.

use std::fs;
use std::path::Path;

use exr::prelude::*;
use linpred_tests::command::{Ran, denoise, linpred};
use linpred_tests::images::{TestPart, bits, channel_names, everything, half, part, read, write};

const SIZE: (usize, usize) = (45, 211);
const PIXELS: usize = SIZE.0 * SIZE.1;

fn stitch(folder: &Path, bands: &[&str]) -> Ran {
    let mut arguments = vec!["stitch".to_owned()];
    arguments.extend(
        bands
            .iter()
            .map(|band| folder.join(band).to_str().unwrap().to_owned()),
    );
    arguments.extend([
        "-o".to_owned(),
        folder.join("stitched.exr").to_str().unwrap().to_owned(),
    ]);
    linpred(arguments)
}

/// The same image in parts and tiles, in parts and scanlines, and in one part.
fn images() -> Vec<Vec<TestPart>> {
    let named = |name, part| TestPart {
        name: Some(name),
        ..part
    };
    let colours = || {
        part(
            ["R", "G", "B", "A"]
                .map(|c| half(&format!("VL.Combined.{c}"), PIXELS, 1))
                .to_vec(),
        )
    };
    let normals = || {
        part(
            ["X", "Y", "Z"]
                .map(|c| half(&format!("VL.Normal.{c}"), PIXELS, 2))
                .to_vec(),
        )
    };
    vec![
        vec![part(everything(PIXELS))],
        vec![part(everything(PIXELS)).stored(Compression::PIZ, Blocks::Tiles(Vec2(32, 24)))],
        vec![
            named("VL.Combined", colours()),
            named(
                "VL.Normal",
                normals().stored(Compression::ZIP1, Blocks::Tiles(Vec2(20, 12))),
            ),
        ],
    ]
}

#[test]
fn a_stitched_frame_has_the_bits_of_the_whole_frame() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for image in images() {
        write(&folder.join("in.exr"), SIZE, image);
        denoise(folder, "whole.exr", &["--error-layer", "--models-layer"]).succeeds();
        let names = ["b1.exr", "b2.exr", "b3.exr"];
        for (name, band) in names.iter().zip(["1/3", "2/3", "3/3"]) {
            denoise(
                folder,
                name,
                &["--error-layer", "--models-layer", "--band", band],
            )
            .succeeds();
        }
        stitch(folder, &["b3.exr", "b1.exr", "b2.exr"]).succeeds();
        let (whole, stitched) = (
            read(&folder.join("whole.exr")),
            read(&folder.join("stitched.exr")),
        );
        assert_eq!(whole.attributes, stitched.attributes);
        for (index, (a, b)) in whole
            .layer_data
            .iter()
            .zip(&stitched.layer_data)
            .enumerate()
        {
            assert_eq!((&a.attributes, a.encoding), (&b.attributes, b.encoding));
            for name in channel_names(&whole, index) {
                assert_eq!(
                    bits(&whole, index, &name),
                    bits(&stitched, index, &name),
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn a_band_is_a_picture_of_its_rows() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("in.exr"), SIZE, images().remove(0));
    denoise(folder.path(), "b2.exr", &["--band", "2/2"]).succeeds();
    let band = read(&folder.path().join("b2.exr"));
    // 211 rows in blocks of 16 are 14 blocks: 7 in each band; the data window begins at row -5
    assert_eq!(band.layer_data[0].size, Vec2(45, 211 - 112));
    assert_eq!(
        band.layer_data[0].attributes.layer_position,
        Vec2(3, 112 - 5)
    );
}

#[test]
fn bands_that_do_not_make_a_frame_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(&folder.join("in.exr"), SIZE, images().remove(0));
    for (name, band) in [
        ("b1.exr", "1/3"),
        ("b2.exr", "2/3"),
        ("b3.exr", "3/3"),
        ("h2.exr", "2/2"),
    ] {
        denoise(folder, name, &["--band", band]).succeeds();
    }
    stitch(folder, &["b1.exr", "b3.exr"])
        .exits_with(3)
        .complains_about(&["are in no band"]);
    stitch(folder, &["b1.exr", "b2.exr"])
        .exits_with(3)
        .complains_about(&["are in no band"]);
    stitch(folder, &["b2.exr", "b3.exr"])
        .exits_with(3)
        .complains_about(&["topmost band begins"]);
    stitch(folder, &["b1.exr", "b2.exr", "h2.exr"])
        .exits_with(3)
        .complains_about(&["are in two bands"]);
    stitch(folder, &["in.exr"])
        .exits_with(3)
        .complains_about(&["in.exr", "is no band"]);
    denoise(folder, "l3.exr", &["--band", "3/3", "--error-layer"]).succeeds();
    stitch(folder, &["b1.exr", "b2.exr", "l3.exr"])
        .exits_with(3)
        .complains_about(&["not bands of one image"]);
    denoise(folder, "q3.exr", &["--band", "3/3", "--quality", "high"]).succeeds();
    stitch(folder, &["b1.exr", "b2.exr", "q3.exr"])
        .exits_with(3)
        .complains_about(&["b1.exr", "q3.exr", "other settings"]);
    fs::rename(folder.join("in.exr"), folder.join("first.exr")).unwrap();
    write(&folder.join("in.exr"), SIZE, images().remove(1));
    denoise(folder, "i3.exr", &["--band", "3/3"]).succeeds();
    stitch(folder, &["b1.exr", "b2.exr", "i3.exr"])
        .exits_with(3)
        .complains_about(&["b1.exr", "i3.exr", "other inputs"]);
    fs::rename(folder.join("first.exr"), folder.join("in.exr")).unwrap();
    assert!(!folder.join("stitched.exr").exists());
    fs::copy(folder.join("b1.exr"), folder.join("stitched.exr")).unwrap();
    stitch(folder, &["stitched.exr", "b2.exr", "b3.exr"])
        .exits_with(2)
        .complains_about(&["is the input"]);
}

#[test]
fn a_band_that_would_be_empty_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("in.exr"), SIZE, images().remove(0));
    denoise(folder.path(), "b.exr", &["--band", "1/99"])
        .exits_with(2)
        .complains_about(&["every 16 rows", "14 pieces"]);
    denoise(folder.path(), "b.exr", &["--band", "3/2"])
        .exits_with(2)
        .complains_about(&["--band"]);
}
