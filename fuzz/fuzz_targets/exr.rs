//! Arbitrary bytes as a file: `inspect` and `denoise` end in a picture or in an error, within the memory that they may use.
//!
//! Bytes that do not begin as an EXR file does describe one: parts, views, attributes, names and samples, and at the end bytes of it that are changed.

#![no_main]

use std::collections::BTreeSet;
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use exr::prelude::{AttributeValue, Blocks, Compression, Text, Vec2};
use libfuzzer_sys::fuzz_target;
use linpred::exr_file::attributes::MAGIC;
use linpred::job::{denoise, inspect, Input, InputRequest, JobOptions};
use linpred::Options;
use linpred_core::{Params, Quality};
use linpred_tests::images::{constant, float, half, part, uint, write, TestPart};

/// Bytes of memory that a file may ask for.
const MEMORY: u64 = 32 << 20;
/// Pixels beyond which a picture takes longer than a fuzzer should wait.
const PIXELS: usize = 1 << 12;

/// Layers and channels as renderers write them, and some that they do not.
const NAMES: [&str; 24] = [
    "R", "G", "B", "A", "Y", "Z", "X", "red", "green", "blue", "N.X", "N.Y", "N.Z", "albedo.R", "albedo.G", "albedo.B",
    "variance.R", "variance.G", "variance.B", "Combined.R", "Noisy Image.R", "right.R", "id", ".Z",
];
const PARTS: [&str; 6] = ["rgba", "N", "left", "rgba_right", "VL.Combined", "depth"];
const VIEWS: [&str; 3] = ["left", "right", "centre"];

/// Bytes as decisions; 0 once there are none.
struct Choices<'a>(std::slice::Iter<'a, u8>);

impl Choices<'_> {
    fn next(&mut self) -> usize {
        self.0.next().copied().unwrap_or(0).into()
    }

    fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.next() % all.len()]
    }
}

/// Writes the file that `data` describes. A part without channels of its own has one.
fn write_described(path: &Path, data: &[u8]) {
    let mut choices = Choices(data.iter());
    let size = (1 + choices.next() % 48, 1 + choices.next() % 48);
    let pixels = size.0 * size.1;
    let count = 1 + choices.next() % 3;
    let parts = (0..count).map(|index| {
        let mut names = BTreeSet::new();
        let prefix = choices.one_of(&["", "", "VL.", "left.", "VL.right."]);
        for _ in 0..1 + choices.next() % 12 {
            names.insert(format!("{prefix}{}", choices.one_of(&NAMES)));
        }
        let value = choices.one_of(&[-1.0, 0.0, 1.0, f32::NAN, f32::INFINITY, 1e30]);
        let channels = names.iter().map(|name| match choices.next() % 5 {
            0 => half(name, pixels, index as u32),
            1 => constant(name, pixels, value),
            2 => uint(name, pixels),
            _ => float(name, pixels, 7 * index as u32 + 1),
        });
        let mut described = part(channels.collect());
        if count > 1 {
            // parts must be told apart
            described.name = Some(PARTS[(2 * index + choices.next() % 2) % PARTS.len()]);
        }
        let compressions = [
            Compression::ZIP16,
            Compression::PIZ,
            Compression::Uncompressed,
            Compression::RLE,
            Compression::PXR24,
        ];
        let blocks = match choices.next() % 3 {
            0 => Blocks::Tiles(Vec2(1 + choices.next() % 40, 1 + choices.next() % 40)),
            _ => Blocks::ScanLines,
        };
        let text = |text: &str| AttributeValue::Text(text.into());
        let mut attributes = Vec::new();
        for _ in 0..choices.next() % 4 {
            attributes.push(match choices.next() % 7 {
                0 => ("view", text(choices.one_of(&VIEWS))),
                1 => {
                    let views = VIEWS[..1 + choices.next() % 3].iter();
                    let views = views.map(|view| Text::new_or_panic(*view)).collect();
                    ("multiView", AttributeValue::TextVector(views))
                }
                2 => ("BlenderMultiChannel", text("V2.55")),
                3 => ("cryptomatte/1/name", text(choices.one_of(&NAMES))),
                4 => ("samplesPerPixel", AttributeValue::I32(choices.next() as i32)),
                5 => ("linpredNoiseOfInput", text("variance.R, variance.G")),
                _ => ("generatedBy", text("Mitsuba")),
            });
        }
        described.attributes = attributes;
        described.stored(choices.one_of(&compressions), blocks)
    });
    let parts: Vec<TestPart> = parts.collect();
    write(path, size, parts);
    let mut bytes = std::fs::read(path).expect("it was written");
    for _ in 0..choices.next() % 4 {
        let place = (choices.next() << 8 | choices.next()) % bytes.len();
        bytes[place] ^= choices.next() as u8;
    }
    std::fs::write(path, bytes).expect("it was written before");
}

fuzz_target!(|data: &[u8]| {
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    match data.first_chunk::<4>() == Some(&MAGIC) {
        true => file.write_all(data).expect("a temporary file takes bytes"),
        false => write_described(file.path(), data),
    }
    let request = InputRequest::new(file.path()).with_memory_limit(Some(MEMORY));
    let described = inspect(&request).is_ok();
    let Ok(pictures) = Input::open_all(&request) else {
        return;
    };
    assert!(described, "what can be opened can be described");
    let pixels = pictures.iter().map(|picture| picture.width().saturating_mul(picture.height()));
    if pixels.fold(0, usize::saturating_add) > PIXELS {
        return;
    }
    let pipeline = Options::new(Params::new(Quality::Fast)).with_threads(NonZeroUsize::MIN);
    let options = JobOptions::new(pipeline).with_memory_limit(MEMORY);
    let output = file.path().with_extension("out.exr");
    let stop = Arc::new(AtomicBool::new(false));
    let result = denoise(&pictures, &output, &options, &stop, &mut |_| ());
    let written = output.exists();
    if written {
        let again = Input::open_all(&InputRequest::new(&output));
        assert!(again.is_ok(), "{again:?}");
        std::fs::remove_file(&output).expect("it was there");
    }
    assert_eq!(result.is_ok(), written, "{result:?}");
});
