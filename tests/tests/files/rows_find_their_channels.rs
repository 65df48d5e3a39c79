//! The two ends of the pipeline: what a source reads from the file, and where a sink puts what it is given.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use exr::prelude::*;
use linpred::image::{ExrSink, OutputOptions};
use linpred::job::{Input, InputRequest};
use linpred::{InputRow, OutputRow, RowSink, RowSource, VarianceKind};
use linpred_tests::command::denoise_file;
use linpred_tests::images::{
    NamedSamples, TestPart, channel_names, colour, constant, everything, half, noise, part, read,
    write,
};

const SIZE: (usize, usize) = (37, 41);
const PIXELS: usize = SIZE.0 * SIZE.1;
const LIMIT: u64 = 1 << 30;

fn open(path: &Path, layers: &[&str]) -> Input {
    let layers = layers.iter().map(|layer| (*layer).to_owned()).collect();
    Input::open(&InputRequest::new(path).with_layers(layers)).unwrap()
}

/// A sink for what denoising `input` gives.
fn sink(input: &Input, output: &Path, extra: OutputOptions) -> ExrSink {
    let stop = Arc::new(AtomicBool::new(false));
    input.sink(output, extra, LIMIT, stop).unwrap()
}

/// Every row of a source.
fn rows(input: &Input) -> Vec<InputRow> {
    let mut source = input.source(LIMIT).unwrap();
    let layout = source.layout();
    (0..layout.size.height())
        .map(|y| {
            let mut row = InputRow::new(&layout);
            source.read_row(y, &mut row).unwrap();
            row
        })
        .collect()
}

/// Writes an output whose planes are constants, distinct by role.
fn write_constants(input: &Input, output: &Path, extra: OutputOptions) {
    let mut sink = sink(input, output, extra);
    let plane = |value| vec![value; SIZE.0];
    let mut row = OutputRow::default();
    row.colour = [plane(0.5), plane(1.5), plane(2.5)];
    row.error = plane(3.0);
    row.radius = plane(4.0);
    row.rank = plane(5.0);
    let layout = input.layout();
    row.alpha = plane(0.75);
    row.scalars = vec![plane(7.0); layout.scalars];
    row.layers = (0..layout.layers as u8)
        .map(|n| [0.0, 0.25, 0.5].map(|k| plane(8.0 + f32::from(n) + k)))
        .collect();
    for y in 0..SIZE.1 {
        sink.write_row(y, &row).unwrap();
    }
    sink.finish().unwrap();
}

fn value(image: &FlatImage, part: usize, name: &str) -> f32 {
    let channels = &image.layer_data[part].channel_data.list;
    let channel = channels
        .iter()
        .find(|c| c.name.eq(name))
        .unwrap_or_else(|| panic!("no {name}"));
    let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
    assert!(values.iter().all(|v| *v == values[0]), "{name}");
    values[0]
}

#[test]
fn rows_hold_the_samples_of_the_file_whatever_its_layout() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    let mut first: Option<Vec<InputRow>> = None;
    for compression in [
        Compression::Uncompressed,
        Compression::ZIP16,
        Compression::PIZ,
    ] {
        for blocks in [
            Blocks::ScanLines,
            Blocks::Tiles(Vec2(16, 9)),
            Blocks::Tiles(Vec2(64, 64)),
        ] {
            for line_order in [LineOrder::Increasing, LineOrder::Decreasing] {
                let mut image = part(everything(PIXELS));
                image.encoding = Encoding {
                    compression,
                    blocks,
                    line_order,
                };
                write(&path, SIZE, vec![image]);
                let rows = rows(&open(&path, &[]));
                let expected = |y: usize, x: usize, seed| noise(seed, y * SIZE.0 + x);
                for (y, row) in rows.iter().enumerate() {
                    for x in 0..SIZE.0 {
                        assert_eq!(row.colour[1][x], expected(y, x, 2));
                        assert_eq!(row.variance[2][x], expected(y, x, 12));
                        assert_eq!(row.features[6][x], expected(y, x, 13));
                        let albedo_green = f16::from_f32(expected(y, x, 24)).to_f32();
                        assert_eq!(row.features[4][x], albedo_green);
                    }
                }
                assert_eq!(*first.get_or_insert_with(|| rows.clone()), rows);
            }
        }
    }
}

#[test]
fn two_halves_are_averaged_and_their_difference_is_the_variance() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
    // noise: of one sign here and of the other there
    let image = |values: [f32; 2], scale: f32| {
        let of = |name: &str, scale: f32| {
            let samples = (0..PIXELS).map(|i| scale * values[i % 2]).collect();
            (name.to_owned(), FlatSamples::F32(samples))
        };
        let mut channels: Vec<NamedSamples> = ["R", "G", "B"].map(|c| of(c, 1.0)).to_vec();
        channels.push(of("Z", scale));
        vec![part(channels)]
    };
    write(&path, SIZE, image([1.0, 2.0], 10.0));
    write(&other, SIZE, image([2.0, 1.0], 10.0));
    let request = InputRequest::new(path).with_other_half(Some(other));
    let input = Input::open(&request).unwrap();
    assert_eq!(
        input.source(LIMIT).unwrap().layout().variance,
        VarianceKind::OfHalves
    );
    let row = &rows(&input)[0];
    assert_eq!((row.colour[0][0], row.variance[0][0]), (1.5, 0.25));
    assert_eq!(
        (row.features[6][0], row.feature_variances[6][0]),
        (15.0, 25.0)
    );
}

#[test]
fn a_mono_image_fills_three_equal_planes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.exr");
    write(&path, SIZE, vec![part(vec![half("Y", PIXELS, 4)])]);
    let row = &rows(&open(&path, &[]))[7];
    assert_eq!(row.colour[0], row.colour[1]);
    assert_eq!(row.colour[0], row.colour[2]);
    assert_eq!(
        row.colour[0][3],
        f16::from_f32(noise(4, 7 * SIZE.0 + 3)).to_f32()
    );
}

#[test]
fn every_plane_of_the_output_goes_to_its_own_channel() {
    let folder = tempfile::tempdir().unwrap();
    let (path, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    let mut channels = everything(PIXELS);
    for layer in ["diffuse", "light_key", "light_fill"] {
        channels.extend(["R", "G", "B"].map(|c| half(&format!("{layer}.{c}"), PIXELS, 3)));
    }
    write(&path, SIZE, vec![part(channels)]);
    let input = open(&path, &["diffuse", "light_*"]);
    write_constants(
        &input,
        &output,
        OutputOptions {
            error: true,
            models: true,
            ..OutputOptions::default()
        },
    );
    let image = read(&output);
    let values = [
        "R",
        "G",
        "B",
        "linpred.error",
        "linpred.radius",
        "linpred.rank",
        "diffuse.R",
        "diffuse.B",
    ];
    assert_eq!(
        values.map(|name| value(&image, 0, name)),
        [0.5, 1.5, 2.5, 3.0, 4.0, 5.0, 8.0, 8.5]
    );
    // file order: light_fill before light_key
    assert_eq!(value(&image, 0, "light_fill.G"), 9.25);
    assert_eq!(value(&image, 0, "light_key.G"), 10.25);
}

#[test]
fn layers_in_parts_of_their_own_are_written_there() {
    let folder = tempfile::tempdir().unwrap();
    let (path, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    let named = |name, channels| TestPart {
        name: Some(name),
        ..part(channels)
    };
    let parts = vec![
        named(
            "VL.Diffuse",
            ["R", "G", "B"]
                .map(|c| half(&format!("VL.Diffuse.{c}"), PIXELS, 1))
                .to_vec(),
        ),
        named(
            "VL.Combined",
            ["R", "G", "B"]
                .map(|c| half(&format!("VL.Combined.{c}"), PIXELS, 2))
                .to_vec(),
        ),
        named("VL.Depth", vec![constant("VL.Depth.Z", PIXELS, 1e10)]),
    ];
    write(&path, SIZE, parts);
    let input = open(&path, &["Diffuse"]);
    write_constants(&input, &output, OutputOptions::default());
    let image = read(&output);
    assert_eq!(value(&image, 0, "VL.Diffuse.G"), 8.25);
    assert_eq!(value(&image, 1, "VL.Combined.G"), 1.5);
    assert_eq!(value(&image, 2, "VL.Depth.Z"), 1e10);
    assert_eq!(channel_names(&image, 0).len(), 3);
}

#[test]
fn layers_that_do_not_sum_to_the_colour_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let (path, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    let image = |wrong: f32| {
        let mut channels: Vec<NamedSamples> =
            ["R", "G", "B"].map(|c| constant(c, PIXELS, 0.75)).to_vec();
        for (layer, value) in [("diffuse", 0.5), ("specular", 0.25 + wrong)] {
            channels
                .extend(["R", "G", "B"].map(|c| constant(&format!("{layer}.{c}"), PIXELS, value)));
        }
        vec![part(channels)]
    };
    let denoise = || denoise_file(&path, &output, &["--layers", "diffuse,spec*"]).succeeds();
    write(&path, SIZE, image(0.0));
    assert!(!denoise().stderr().contains("do not sum"));
    write(&path, SIZE, image(0.125));
    denoise().complains_about(&["INFO", "diffuse specular are not parts of the colour"]);
}

#[test]
fn a_colour_beyond_half_precision_is_clamped_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (path, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    write(
        &path,
        SIZE,
        vec![part(["R", "G", "B"].map(|c| half(c, PIXELS, 1)).to_vec())],
    );
    let input = open(&path, &[]);
    let mut sink = sink(&input, &output, OutputOptions::default());
    let mut row = OutputRow::default();
    row.colour = [(); 3].map(|()| vec![1e6; SIZE.0]);
    for y in 0..SIZE.1 {
        sink.write_row(y, &row).unwrap();
    }
    assert_eq!(sink.finish().unwrap(), 3 * PIXELS as u64);
    assert_eq!(value(&read(&output), 0, "R"), 65504.0);
}

#[test]
fn an_unfinished_sink_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (path, output) = (folder.path().join("in.exr"), folder.path().join("out.exr"));
    write(&path, SIZE, vec![part(colour(PIXELS))]);
    let input = open(&path, &[]);
    let sink = sink(&input, &output, OutputOptions::default());
    assert!(folder.path().join("out.exr.part").exists());
    drop(sink);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
