//! A compression that is not decoded is named where the colour is stored with it; a part beside the colour that is comes out byte for byte.
//!
//! The files are of the `exr` crate, which writes none of these: the number in the header is changed afterwards.

use std::fs;
use std::path::Path;

use exr::prelude::{Blocks, Compression, Vec2};
use linpred::exr_file::attributes::RawHeader;
use linpred_tests::command::{denoise, linpred};
use linpred_tests::images::{TestPart, colour, half, part, write};

const SIZE: (usize, usize) = (9, 70);
const PIXELS: usize = SIZE.0 * SIZE.1;
const SUPPORTED: &str =
    "is not supported (supported are none, rle, zips, zip, piz, pxr24, b44, b44a, dwaa, dwab)";

/// Numbers of compressions, what they are called, and one that is cut into chunks alike.
const LATER: [(u8, &str, Compression); 8] = [
    (10, "htj2k256 compression", Compression::DWAB(None)),
    (11, "htj2k32 compression", Compression::PIZ),
    (12, "lj2k compression", Compression::DWAB(None)),
    (12, "lj2k compression", Compression::PIZ),
    (13, "zstd compression", Compression::ZIP1),
    // as some version may cut it
    (13, "zstd compression", Compression::ZIP16),
    (14, "compression number 14", Compression::ZIP16),
    (255, "compression number 255", Compression::PIZ),
];

fn beauty() -> TestPart {
    TestPart {
        name: Some("beauty"),
        ..part(colour(PIXELS))
    }
}

fn other(compression: Compression, blocks: Blocks) -> TestPart {
    let part = part(vec![half("id", PIXELS, 7)]).stored(compression, blocks);
    TestPart {
        name: Some("id"),
        ..part
    }
}

/// Has the header of one part of the file state the compression of this number.
fn restate(path: &Path, part: usize, code: u8) {
    let bytes = fs::read(path).unwrap();
    let mut header = RawHeader::parse(&bytes).unwrap().unwrap();
    header.parts[part].set("compression", "compression", vec![code]);
    let mut patched = RawHeader::encode(header.version, &header.parts);
    patched.extend_from_slice(&bytes[header.length..]);
    fs::write(path, patched).unwrap();
}

/// The number that the header of part `part` of a multi-part file states, and the part's chunks, heads and all.
fn stored(path: &Path, part: usize) -> (u8, Vec<Vec<u8>>) {
    let bytes = fs::read(path).unwrap();
    let header = RawHeader::parse(&bytes).unwrap().unwrap();
    let int = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let count = |part: usize| header.parts[part].int("chunkCount").unwrap() as usize;
    let table = header.length + 8 * (0..part).map(count).sum::<usize>();
    let attributes = &header.parts[part];
    // the part's number, the place, the length
    let head = match attributes.string("type") {
        Some("tiledimage") => 4 + 16 + 4,
        _ => 4 + 4 + 4,
    };
    let chunk = |index| {
        let at = table + 8 * index;
        let offset = u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
        assert_eq!(int(offset), part as i32);
        let length = int(offset + head - 4) as usize;
        bytes[offset..offset + head + length].to_vec()
    };
    let code = attributes.value("compression", "compression").unwrap()[0];
    (code, (0..count(part)).map(chunk).collect())
}

#[track_caller]
fn assert_copied(folder: &Path, parts: Vec<TestPart>, at: usize, code: u8, words: &str) {
    let path = |name: &str| folder.join(name);
    write(&path("in.exr"), SIZE, parts);
    restate(&path("in.exr"), at, code);
    let before = stored(&path("in.exr"), at);
    assert_eq!(before.0, code);
    linpred(["inspect".as_ref(), path("in.exr").as_os_str()])
        .succeeds()
        .prints(&[
            "\"id\"",
            ", copied as it is",
            &format!("not decoded: {words} {SUPPORTED}"),
        ]);
    denoise(folder, "out.exr", &[]).succeeds();
    assert!(stored(&path("out.exr"), at) == before, "{words}");
    if before.1.len() == 1 {
        // not to be cut
        return;
    }
    denoise(folder, "1.exr", &["--band", "1/2"]).succeeds();
    denoise(folder, "2.exr", &["--band", "2/2"]).succeeds();
    let files = ["1.exr", "2.exr", "-o", "stitched.exr"].map(|name| match name {
        "-o" => name.into(),
        _ => path(name).into_os_string(),
    });
    linpred([&["stitch".into()], &files[..]].concat()).succeeds();
    assert!(stored(&path("stitched.exr"), at) == before, "{words}");
}

#[test]
fn a_part_beside_the_colour_is_listed_and_copied_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    for (code, words, like) in LATER {
        let other = other(like, Blocks::ScanLines);
        assert_copied(folder.path(), vec![beauty(), other.clone()], 1, code, words);
        assert_copied(folder.path(), vec![other, beauty()], 0, code, words);
    }
}

#[test]
fn tiles_say_themselves_how_many_there_are() {
    let folder = tempfile::tempdir().unwrap();
    for (code, words, _) in LATER {
        let other = other(Compression::ZIP16, Blocks::Tiles(Vec2(8, 24)));
        assert_copied(folder.path(), vec![beauty(), other], 1, code, words);
    }
}

#[test]
fn a_colour_that_is_stored_so_is_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    for (code, words, like) in LATER {
        let sentence = format!("{words} {SUPPORTED}");
        let lone = part(colour(PIXELS)).stored(like, Blocks::ScanLines);
        let tiled = part(colour(PIXELS)).stored(Compression::ZIP16, Blocks::Tiles(Vec2(8, 24)));
        let several = vec![
            beauty().stored(like, Blocks::ScanLines),
            other(like, Blocks::ScanLines),
        ];
        for parts in [vec![lone], vec![tiled], several] {
            write(&input, SIZE, parts);
            restate(&input, 0, code);
            denoise(folder.path(), "out.exr", &[])
                .exits_with(3)
                .complains_about(&["in.exr", "part 0", &sentence]);
            let left = fs::read_dir(folder.path()).unwrap().count();
            assert_eq!(left, 1, "{words}");
        }
    }
}

#[test]
fn a_number_of_chunks_that_no_height_makes_is_no_reason_to_guess() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.exr");
    write(
        &input,
        SIZE,
        vec![beauty(), other(Compression::ZIP16, Blocks::ScanLines)],
    );
    restate(&input, 1, 14);
    let bytes = fs::read(&input).unwrap();
    let mut header = RawHeader::parse(&bytes).unwrap().unwrap();
    // 70 rows in 6 chunks: 12, 13 or 14 rows each
    header.parts[1].set("chunkCount", "int", 6_i32.to_le_bytes().to_vec());
    let mut patched = RawHeader::encode(header.version, &header.parts);
    patched.extend_from_slice(&bytes[header.length..]);
    fs::write(&input, patched).unwrap();
    denoise(folder.path(), "out.exr", &[])
        .exits_with(3)
        .complains_about(&["in.exr", "part 1", "compression number 14 is not supported"]);
}
