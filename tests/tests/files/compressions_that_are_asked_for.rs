//! `--compression` stores what is denoised as it says, and changes no pixel but where it must; what a run leaves as it was is stored as it was.

use std::path::Path;

use exr::prelude::*;
use linpred_tests::command;
use linpred_tests::images::{
    TestPart, bits, channel_names, colour, constant, everything, float, part, read, write,
};

const SIZE: (usize, usize) = (70, 83);
const PIXELS: usize = SIZE.0 * SIZE.1;

fn store(folder: &Path, noisy: TestPart, compression: Compression, blocks: Blocks) {
    let parts = vec![noisy.stored(compression, blocks)];
    write(&folder.join("in.exr"), SIZE, parts);
}

fn denoise(folder: &Path, compression: &str) -> FlatImage {
    command::denoise(folder, "out.exr", &["--compression", compression]).succeeds();
    read(&folder.join("out.exr"))
}

/// Asserts that two images have the same bits, but for the channels named.
#[track_caller]
fn assert_same(one: &FlatImage, other: &FlatImage, but_for: &[&str]) {
    assert_eq!(channel_names(one, 0), channel_names(other, 0));
    for name in channel_names(one, 0) {
        let same = bits(one, 0, &name) == bits(other, 0, &name);
        assert!(same || but_for.contains(&name.as_str()), "{name}");
    }
}

#[test]
fn every_compression_is_what_the_file_has_and_changes_no_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let asked = [
        ("none", Compression::Uncompressed),
        ("rle", Compression::RLE),
        ("zips", Compression::ZIP1),
        ("zip", Compression::ZIP16),
        ("piz", Compression::PIZ),
    ];
    for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(32, 17))] {
        for stored in [Compression::ZIP16, Compression::PIZ] {
            store(folder.path(), part(everything(PIXELS)), stored, blocks);
            let kept = denoise(folder.path(), "keep");
            assert_eq!(kept.layer_data[0].encoding.compression, stored);
            for (name, compression) in asked {
                let output = denoise(folder.path(), name);
                let encoding = output.layer_data[0].encoding;
                assert_eq!(
                    (encoding.compression, encoding.blocks),
                    (compression, blocks),
                    "{name}"
                );
                assert_same(&output, &kept, &[]);
            }
        }
    }
}

#[test]
fn the_plan_names_what_is_written_by_its_own_compression() {
    let folder = tempfile::tempdir().unwrap();
    let noisy = part(everything(PIXELS));
    store(
        folder.path(),
        noisy,
        Compression::Uncompressed,
        Blocks::ScanLines,
    );
    let options = ["--compression", "piz", "--dry-run"];
    command::denoise(folder.path(), "out.exr", &options).prints(&[
        "writing part 0 (piz, chunks of 32 rows",
        "encoding part 0 (piz, chunks of 32 rows",
    ]);
}

#[test]
fn dwaa_may_lose_data_of_colours_alone_and_says_so_of_those_that_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = colour(PIXELS);
    channels.extend(["R", "G", "B"].map(|c| float(&format!("sheen.{c}"), PIXELS, 9)));
    channels.push(float("height", PIXELS, 10));
    store(
        folder.path(),
        part(channels),
        Compression::ZIP16,
        Blocks::ScanLines,
    );
    let kept = denoise(folder.path(), "keep");
    let run = command::denoise(folder.path(), "out.exr", &["--compression", "dwaa"]).succeeds();
    run.complains_about(&["dwaa", "sheen.R"]);
    let output = read(&folder.path().join("out.exr"));
    assert!(matches!(
        output.layer_data[0].encoding.compression,
        Compression::DWAA(_)
    ));
    assert_same(
        &output,
        &kept,
        &["R", "G", "B", "sheen.R", "sheen.G", "sheen.B"],
    );
}

#[test]
fn dwaa_is_refused_where_it_would_alter_identifiers() {
    let folder = tempfile::tempdir().unwrap();
    let mut channels = colour(PIXELS);
    channels.extend(["R", "G", "B"].map(|c| float(&format!("CryptoObject00.{c}"), PIXELS, 9)));
    store(
        folder.path(),
        part(channels),
        Compression::ZIP16,
        Blocks::ScanLines,
    );
    command::denoise(folder.path(), "out.exr", &["--compression", "dwaa"])
        .exits_with(3)
        .complains_about(&["CryptoObject00.R", "identifiers", "zip"]);
    assert!(!folder.path().join("out.exr").exists());
}

#[test]
fn a_name_that_is_none_is_refused_with_those_that_are() {
    let folder = tempfile::tempdir().unwrap();
    store(
        folder.path(),
        part(colour(PIXELS)),
        Compression::ZIP16,
        Blocks::ScanLines,
    );
    command::denoise(folder.path(), "out.exr", &["--compression", "lzma"])
        .exits_with(2)
        .complains_about(&["lzma", "zips", "dwaa"]);
}

/// Whether the last bytes of two files are the same: those of the payload of the last chunk.
fn ends_alike(one: &Path, other: &Path, bytes: usize) -> bool {
    let [one, other] = [one, other].map(|path| std::fs::read(path).unwrap());
    one[one.len() - bytes..] == other[other.len() - bytes..]
}

#[test]
fn chunks_in_which_nothing_is_noisy_are_copied_as_they_are_stored() {
    let folder = tempfile::tempdir().unwrap();
    let [input, copied, deflated] =
        ["in.exr", "copied.exr", "deflated.exr"].map(|name| folder.path().join(name));
    let run = |stored, output: &str| {
        let mut channels = ["R", "G", "B"].map(|c| constant(c, PIXELS, 0.25)).to_vec();
        channels.push(float("height", PIXELS, 10));
        store(folder.path(), part(channels), stored, Blocks::ScanLines);
        command::denoise(folder.path(), output, &["--compression", "zip"]).succeeds();
    };
    run(Compression::ZIP16, "copied.exr");
    assert!(ends_alike(&input, &copied, 2000));
    // the same pixels, deflated here: not as the writer of the input does it
    run(Compression::PIZ, "deflated.exr");
    assert!(!ends_alike(&copied, &deflated, 2000));
}
