//! No pixel depends on how a file stores it, or on how a run goes about it.
//!
//! The same pixels in any lossless compression, scanlines or tiles of any size, in one part or several, denoised on any number of threads, in
//! any number of bands, within any memory that suffices: the same bits as from one part of scanlines at once.

use std::collections::BTreeMap;
use std::path::Path;

use exr::prelude::{Blocks, Encoding, LineOrder, Vec2};
use linpred_tests::command::{self, Ran, linpred};
use linpred_tests::images::{
    LOSSLESS, NamedSamples, TestPart, bits, channel_names, half, part, read, write,
};
use proptest::prelude::*;
use proptest::sample::select;

const SIZE: (usize, usize) = (70, 60);
const PIXELS: usize = SIZE.0 * SIZE.1;
/// Layers of channels by the names that Blender gives them, and their channels.
const LAYERS: [(&str, &[&str]); 6] = [
    ("VL.Combined", &["R", "G", "B", "A"]),
    ("VL.Denoising Variance", &["R", "G", "B"]),
    ("VL.Denoising Normal", &["X", "Y", "Z"]),
    ("VL.Denoising Albedo", &["R", "G", "B"]),
    ("VL.Denoising Depth", &["Z"]),
    ("VL.Mist", &["Z"]),
];

/// How a file stores the pixels.
#[derive(Clone, Debug)]
enum Layout {
    OnePart(Encoding),
    /// One for each layer, as Blender does; which layer, and how it is stored.
    Parts(Vec<(usize, Encoding)>),
}

/// How it is denoised.
#[derive(Clone, Debug)]
struct Manner {
    threads: usize,
    bands: usize,
    /// From the least memory that it can do with to the most that it can use.
    memory: f64,
}

fn encodings() -> impl Strategy<Value = Encoding> {
    let tiles = prop_oneof![Just(None), (1_usize..=80, 1_usize..=70).prop_map(Some),];
    (select(&LOSSLESS[..]), tiles).prop_map(|(compression, tiles)| Encoding {
        compression,
        blocks: tiles.map_or(Blocks::ScanLines, |(w, h)| Blocks::Tiles(Vec2(w, h))),
        line_order: LineOrder::Increasing,
    })
}

fn layouts() -> impl Strategy<Value = Layout> {
    let order = Just((0..LAYERS.len()).collect::<Vec<_>>()).prop_shuffle();
    let several = (order, prop::collection::vec(encodings(), LAYERS.len()));
    prop_oneof![
        encodings().prop_map(Layout::OnePart),
        several.prop_map(|(order, encodings)| Layout::Parts(
            order.into_iter().zip(encodings).collect()
        )),
    ]
}

fn manners() -> impl Strategy<Value = Manner> {
    (1_usize..=4, 1_usize..=3, 0.0..=1.0).prop_map(|(threads, bands, memory)| Manner {
        threads,
        bands,
        memory,
    })
}

impl Layout {
    fn parts(&self) -> Vec<TestPart> {
        match self {
            Self::OnePart(encoding) => vec![TestPart {
                encoding: *encoding,
                ..part((0..LAYERS.len()).flat_map(channels).collect())
            }],
            Self::Parts(parts) => parts
                .iter()
                .map(|&(layer, encoding)| TestPart {
                    name: Some(LAYERS[layer].0),
                    encoding,
                    ..part(channels(layer))
                })
                .collect(),
        }
    }

    /// Pieces that the image can be cut into.
    fn pieces(&self) -> usize {
        let parts = self.parts();
        let heights = parts.iter().map(|part| match part.encoding.blocks {
            Blocks::ScanLines => part.encoding.compression.scan_lines_per_block(),
            Blocks::Tiles(size) => size.1,
        });
        let unit = heights.fold(1, |unit, height| {
            let mut multiples = (1..=SIZE.1).map(|k| k * unit);
            let common = multiples.find(|multiple| multiple % height == 0);
            common.unwrap_or(SIZE.1).min(SIZE.1)
        });
        SIZE.1.div_ceil(unit)
    }
}

fn channels(layer: usize) -> Vec<NamedSamples> {
    let (layer, components) = LAYERS[layer];
    let names = components
        .iter()
        .map(|component| format!("{layer}.{component}"));
    names.map(|name| half(&name, PIXELS, seed(&name))).collect()
}

/// Tells channels apart.
fn seed(name: &str) -> u32 {
    name.bytes().fold(7, |seed: u32, byte| {
        seed.wrapping_mul(31).wrapping_add(byte.into())
    })
}

fn denoise(folder: &Path, output: &str, options: &[String]) -> Ran {
    let mut all = vec!["--preset=blender", "--quality=fast", "--error-layer"];
    all.extend(options.iter().map(String::as_str));
    command::denoise(folder, output, &all).succeeds()
}

/// Bytes of memory between what a run with these options can use and what it can do with.
fn limit(folder: &Path, threads: usize, share: f64) -> u64 {
    let planned = |threads: usize| {
        let options = ["--dry-run".to_owned(), format!("--threads={threads}")];
        denoise(folder, "unused.exr", &options).planned_bytes()
    };
    let (least, most) = (planned(1), planned(threads));
    // plans are printed to a tenth of a mebibyte
    least + (most.saturating_sub(least) as f64 * share) as u64 + (1 << 17)
}

/// Denoises in bands, and stitches them.
fn run(folder: &Path, layout: &Layout, manner: &Manner) {
    let limit = limit(folder, manner.threads, manner.memory);
    let mut options = vec![
        format!("--threads={}", manner.threads),
        format!("--max-memory={limit}"),
    ];
    let bands = manner.bands.min(layout.pieces());
    if bands == 1 {
        denoise(folder, "out.exr", &options);
        return;
    }
    let mut stitch = vec!["stitch".into()];
    for band in 1..=bands {
        options.push(format!("--band={band}/{bands}"));
        let name = format!("band{band}.exr");
        denoise(folder, &name, &options);
        options.pop();
        stitch.push(folder.join(name).into_os_string());
    }
    stitch.extend(["-o".into(), folder.join("out.exr").into_os_string()]);
    linpred(stitch).succeeds();
}

/// Every channel of every part.
fn pixels(path: &Path) -> BTreeMap<String, Vec<u32>> {
    let image = read(path);
    let parts = 0..image.layer_data.len();
    let channels = parts.flat_map(|part| {
        let names = channel_names(&image, part).into_iter();
        names
            .map(|name| (bits(&image, part, &name), name))
            .collect::<Vec<_>>()
    });
    channels.map(|(bits, name)| (name, bits)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_layout_of_the_file_and_any_manner_of_running_gives_the_same_bits(layout in layouts(), manner in manners()) {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let plain = Layout::OnePart(part(Vec::new()).encoding);
        write(&folder.join("in.exr"), SIZE, plain.parts());
        denoise(folder, "plain.exr", &["--threads=1".to_owned()]);
        write(&folder.join("in.exr"), SIZE, layout.parts());
        run(folder, &layout, &manner);
        let (expected, found) = (pixels(&folder.join("plain.exr")), pixels(&folder.join("out.exr")));
        prop_assert!(expected.keys().eq(found.keys()), "{:?} {:?}", expected.keys(), found.keys());
        for (name, bits) in &expected {
            prop_assert!(*bits == found[name], "{name}");
        }
    }
}
