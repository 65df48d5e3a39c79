//! What is not denoised comes out of `linpred denoise` as it went in.

use std::path::Path;

use exr::prelude::*;
use linpred_tests::command;
use linpred_tests::images::{
    LOSSLESS, TestPart, bits, channel_names, colour, constant, everything, half, part, read, write,
};

const SIZE: (usize, usize) = (70, 83);
const PIXELS: usize = SIZE.0 * SIZE.1;

fn layouts() -> [Blocks; 3] {
    [
        Blocks::ScanLines,
        Blocks::Tiles(Vec2(32, 17)),
        Blocks::Tiles(Vec2(128, 128)),
    ]
}

fn denoise(folder: &Path, options: &[&str]) -> FlatImage {
    command::denoise(folder, "out.exr", options).succeeds();
    read(&folder.join("out.exr"))
}

/// The attributes of a part without those that every output has.
fn without_marks(part: &Layer<AnyChannels<FlatSamples>>) -> LayerAttributes {
    let mut attributes = part.attributes.clone();
    let is_mark = |name: &Text| name.to_string().starts_with("linpred");
    attributes.other.retain(|name, _| !is_mark(name));
    attributes
}

#[track_caller]
fn assert_kept(input: &FlatImage, output: &FlatImage, denoised: &[&str]) {
    assert_eq!(input.layer_data.len(), output.layer_data.len());
    assert_eq!(input.attributes, output.attributes);
    for (index, (before, after)) in input.layer_data.iter().zip(&output.layer_data).enumerate() {
        assert_eq!(before.attributes, without_marks(after), "part {index}");
        assert_eq!(before.size, after.size, "part {index}");
        assert_eq!(channel_names(input, index), channel_names(output, index));
        for name in channel_names(input, index) {
            if !denoised.contains(&name.as_str()) {
                assert_eq!(
                    bits(input, index, &name),
                    bits(output, index, &name),
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn every_lossless_compression_and_layout_keeps_all_bits_and_its_encoding() {
    let folder = tempfile::tempdir().unwrap();
    for compression in LOSSLESS {
        for blocks in layouts() {
            let mut noisy = part(everything(PIXELS));
            noisy.attributes = vec![
                ("spp", AttributeValue::I32(16)),
                ("renderer", AttributeValue::Text("some renderer".into())),
            ];
            write(
                &folder.path().join("in.exr"),
                SIZE,
                vec![noisy.stored(compression, blocks)],
            );
            let input = read(&folder.path().join("in.exr"));
            let output = denoise(folder.path(), &[]);
            assert_kept(&input, &output, &["R", "G", "B", "A"]);
            assert_eq!(input.layer_data[0].encoding, output.layer_data[0].encoding);
        }
    }
}

#[test]
fn every_part_of_a_multi_part_file_is_kept_wherever_the_colour_is() {
    let folder = tempfile::tempdir().unwrap();
    let named = |name, channels| TestPart {
        name: Some(name),
        ..part(channels)
    };
    for blocks in layouts() {
        let normals = ["X", "Y", "Z"].map(|c| half(&format!("VL.Normal.{c}"), PIXELS, 9));
        let colours = ["R", "G", "B", "A"].map(|c| half(&format!("VL.Combined.{c}"), PIXELS, 5));
        let parts = vec![
            named("VL.Depth", vec![constant("VL.Depth.Z", PIXELS, 1e10)]),
            named("VL.Combined", colours.to_vec()).stored(Compression::PIZ, blocks),
            named("VL.Normal", normals.to_vec()).stored(Compression::RLE, blocks),
        ];
        write(&folder.path().join("in.exr"), SIZE, parts);
        let input = read(&folder.path().join("in.exr"));
        let output = denoise(folder.path(), &["--preset", "blender"]);
        assert_kept(
            &input,
            &output,
            &[
                "VL.Combined.R",
                "VL.Combined.G",
                "VL.Combined.B",
                "VL.Combined.A",
            ],
        );
        for (before, after) in input.layer_data.iter().zip(&output.layer_data) {
            assert_eq!(before.encoding, after.encoding);
        }
    }
}

#[test]
fn lossy_compressions_do_not_touch_kept_channels_a_second_time() {
    let folder = tempfile::tempdir().unwrap();
    for compression in [
        Compression::PXR24,
        Compression::B44,
        Compression::B44A,
        Compression::DWAA(None),
        Compression::DWAB(None),
    ] {
        let noisy = part(everything(PIXELS)).stored(compression, Blocks::ScanLines);
        write(&folder.path().join("in.exr"), SIZE, vec![noisy]);
        let input = read(&folder.path().join("in.exr"));
        let output = denoise(folder.path(), &[]);
        assert_kept(&input, &output, &["R", "G", "B", "A"]);
    }
}

#[test]
fn a_lossy_colour_part_stays_lossy_unless_layers_are_added_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let noisy = part(colour(PIXELS)).stored(Compression::DWAA(None), Blocks::ScanLines);
    write(&folder.path().join("in.exr"), SIZE, vec![noisy]);
    let plain = denoise(folder.path(), &[]);
    assert!(matches!(
        plain.layer_data[0].encoding.compression,
        Compression::DWAA(_)
    ));
    let layered = denoise(folder.path(), &["--error-layer", "--models-layer"]);
    assert_eq!(
        layered.layer_data[0].encoding.compression,
        Compression::ZIP16
    );
    assert_eq!(
        channel_names(&layered, 0),
        [
            "B",
            "G",
            "R",
            "linpred.error",
            "linpred.radius",
            "linpred.rank"
        ]
    );
}

#[test]
fn added_layers_leave_the_rest_as_it_is_even_where_they_change_the_blocks() {
    let folder = tempfile::tempdir().unwrap();
    for compression in [
        Compression::PIZ,
        Compression::DWAB(None),
        Compression::PXR24,
    ] {
        for blocks in layouts() {
            let noisy = part(everything(PIXELS)).stored(compression, blocks);
            write(&folder.path().join("in.exr"), SIZE, vec![noisy]);
            let input = read(&folder.path().join("in.exr"));
            let output = denoise(folder.path(), &["--error-layer", "--models-layer"]);
            for name in channel_names(&input, 0) {
                if !["R", "G", "B", "A"].contains(&name.as_str()) {
                    assert_eq!(bits(&input, 0, &name), bits(&output, 0, &name), "{name}");
                }
            }
        }
    }
}

#[test]
fn a_second_run_replaces_the_layers_of_the_first() {
    let folder = tempfile::tempdir().unwrap();
    write(
        &folder.path().join("in.exr"),
        SIZE,
        vec![part(colour(PIXELS))],
    );
    denoise(folder.path(), &["--error-layer"]);
    std::fs::rename(folder.path().join("out.exr"), folder.path().join("in.exr")).unwrap();
    let again = denoise(folder.path(), &["--error-layer"]);
    assert_eq!(channel_names(&again, 0), ["B", "G", "R", "linpred.error"]);
}

#[test]
fn rows_stored_from_bottom_to_top_come_out_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let mut noisy = part(everything(PIXELS));
    noisy.encoding.line_order = LineOrder::Decreasing;
    write(&folder.path().join("in.exr"), SIZE, vec![noisy]);
    let input = read(&folder.path().join("in.exr"));
    assert_kept(&input, &denoise(folder.path(), &[]), &["R", "G", "B", "A"]);
}

#[test]
fn an_image_of_one_channel_is_denoised_into_one_channel() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["Y", "density"] {
        write(
            &folder.path().join("in.exr"),
            SIZE,
            vec![part(vec![half(name, PIXELS, 3)])],
        );
        assert_eq!(channel_names(&denoise(folder.path(), &[]), 0), [name]);
    }
}

#[test]
fn a_picture_without_noise_is_kept_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = everything(PIXELS);
    let replaced = |name: &str| name.starts_with("variance") || name.len() == 1;
    channels.retain(|(name, _)| !replaced(name));
    channels.extend(["R", "G", "B"].map(|c| constant(&format!("variance.{c}"), PIXELS, 0.0)));
    // what varies from pixel to pixel as noise does would be taken for noise
    let smooth = |i: usize| (0.1 * (i % SIZE.0) as f32).sin() + (i / SIZE.0) as f32;
    let smooth: Vec<f32> = (0..PIXELS).map(smooth).collect();
    let samples = |c: &str| (c.to_owned(), FlatSamples::F32(smooth.clone()));
    channels.extend(["R", "G", "B"].map(samples));
    write(&folder.path().join("in.exr"), SIZE, vec![part(channels)]);
    let input = read(&folder.path().join("in.exr"));
    assert_kept(&input, &denoise(folder.path(), &[]), &[]);
}
