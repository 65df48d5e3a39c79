//! Small EXR files for the tests, written and read back by the `exr` crate's own whole-image functions.

use std::path::Path;

use exr::prelude::*;

/// A channel: its name and samples, row by row.
pub type NamedSamples = (String, FlatSamples);

/// A part of a test image.
#[derive(Clone, Debug)]
pub struct TestPart {
    /// Its name; needed when there are several.
    pub name: Option<&'static str>,
    /// Its channels, in any order.
    pub channels: Vec<NamedSamples>,
    /// How it is stored.
    pub encoding: Encoding,
    /// Attributes of its own.
    pub attributes: Vec<(&'static str, AttributeValue)>,
}

impl TestPart {
    /// The same part, stored like this.
    pub fn stored(self, compression: Compression, blocks: Blocks) -> Self {
        let encoding = Encoding {
            compression,
            blocks,
            line_order: LineOrder::Increasing,
        };
        Self { encoding, ..self }
    }
}

/// Compressions that keep every bit.
pub const LOSSLESS: [Compression; 5] = [
    Compression::Uncompressed,
    Compression::RLE,
    Compression::ZIP1,
    Compression::ZIP16,
    Compression::PIZ,
];

/// A number in 0..1 that looks random and depends on nothing but its arguments.
pub fn noise(seed: u32, index: usize) -> f32 {
    let mut x = (index as u32).wrapping_mul(0x9E37_79B9) ^ seed.wrapping_mul(0x85EB_CA6B);
    x = (x ^ (x >> 16)).wrapping_mul(0x7FEB_352D);
    x = (x ^ (x >> 15)).wrapping_mul(0x846C_A68B);
    ((x ^ (x >> 16)) >> 8) as f32 / (1 << 24) as f32
}

/// The same of mean 1 and variance 1, never below 0, and skewed as radiance is.
pub fn exponential(seed: u32, index: usize) -> f32 {
    -noise(seed, index).max(1e-9).ln()
}

/// A float channel of noise.
pub fn float(name: &str, pixels: usize, seed: u32) -> NamedSamples {
    (
        name.into(),
        FlatSamples::F32((0..pixels).map(|i| noise(seed, i)).collect()),
    )
}

/// A half channel of noise.
pub fn half(name: &str, pixels: usize, seed: u32) -> NamedSamples {
    (
        name.into(),
        FlatSamples::F16((0..pixels).map(|i| f16::from_f32(noise(seed, i))).collect()),
    )
}

/// A uint channel.
pub fn uint(name: &str, pixels: usize) -> NamedSamples {
    (name.into(), FlatSamples::U32((0..pixels as u32).collect()))
}

/// A float channel of one value.
pub fn constant(name: &str, pixels: usize, value: f32) -> NamedSamples {
    (name.into(), FlatSamples::F32(vec![value; pixels]))
}

/// A float channel whose values are those of a function of column and row.
pub fn plane(
    name: &str,
    size: (usize, usize),
    value: impl Fn(usize, usize) -> f32,
) -> NamedSamples {
    let values = (0..size.0 * size.1).map(|i| value(i % size.0, i / size.0));
    (name.to_owned(), FlatSamples::F32(values.collect()))
}

/// Float channels R, G, B of noise.
pub fn colour(pixels: usize) -> Vec<NamedSamples> {
    ["R", "G", "B"]
        .iter()
        .zip(1..)
        .map(|(name, seed)| float(name, pixels, seed))
        .collect()
}

/// The colour, variances, all features, alpha and an object number: what a renderer writes.
pub fn everything(pixels: usize) -> Vec<NamedSamples> {
    let mut channels = colour(pixels);
    for (seed, name) in (10..).zip(["variance.R", "variance.G", "variance.B", "Z"]) {
        channels.push(float(name, pixels, seed));
    }
    for (seed, name) in (20..).zip(["N.X", "N.Y", "N.Z", "albedo.R", "albedo.G", "albedo.B", "A"]) {
        channels.push(half(name, pixels, seed));
    }
    channels.push(uint("objectId", pixels));
    channels
}

/// One part of scanlines, ZIP.
pub fn part(channels: Vec<NamedSamples>) -> TestPart {
    TestPart {
        name: None,
        channels,
        encoding: Encoding {
            compression: Compression::ZIP16,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        },
        attributes: Vec::new(),
    }
}

/// Writes an image of the given size whose data window begins at (3, -5) in a display window of 100 x 80.
pub fn write(path: &Path, size: (usize, usize), parts: Vec<TestPart>) {
    let mut shared = ImageAttributes::new(IntegerBounds::from_dimensions((100, 80)));
    shared.pixel_aspect = 1.25;
    let layers: Vec<_> = parts
        .into_iter()
        .map(|part| {
            let mut attributes = part.name.map(LayerAttributes::named).unwrap_or_default();
            attributes.layer_position = Vec2(3, -5);
            attributes.comments = Some("a comment".into());
            for (name, value) in part.attributes {
                match (name, value) {
                    ("view", AttributeValue::Text(view)) => attributes.view_name = Some(view),
                    ("multiView", AttributeValue::TextVector(views)) => {
                        attributes.multi_view_names = Some(views);
                    }
                    ("envmap", AttributeValue::EnvironmentMap(kind)) => {
                        attributes.environment_map = Some(kind);
                    }
                    (name, value) => {
                        attributes.other.insert(name.into(), value);
                    }
                }
            }
            let channels = part
                .channels
                .into_iter()
                .map(|(name, data)| AnyChannel::new(name.as_str(), data));
            let channels = AnyChannels::sort(channels.collect());
            Layer::new(size, attributes, part.encoding, channels)
        })
        .collect();
    let image = Image {
        attributes: shared,
        layer_data: Layers::from(layers),
    };
    image
        .write()
        .non_parallel()
        .to_file(path)
        .expect("test image can be written");
}

/// Reads every channel of every part at full resolution.
pub fn read(path: &Path) -> FlatImage {
    exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_file(path)
        .expect("image can be read")
}

/// The samples of a channel of a part as bits, so that NaN and signed zeros compare.
pub fn bits(image: &FlatImage, part: usize, name: &str) -> Vec<u32> {
    let channels = &image.layer_data[part].channel_data.list;
    let channel = channels
        .iter()
        .find(|c| c.name.eq(name))
        .expect("channel is there");
    match &channel.sample_data {
        FlatSamples::F16(values) => values.iter().map(|v| u32::from(v.to_bits())).collect(),
        FlatSamples::F32(values) => values.iter().map(|v| v.to_bits()).collect(),
        FlatSamples::U32(values) => values.clone(),
    }
}

/// The samples of a float channel of the first part of the image in a file.
pub fn values(path: &Path, name: &str) -> Vec<f32> {
    let bits = bits(&read(path), 0, name);
    bits.into_iter().map(f32::from_bits).collect()
}

/// The names of a part's channels, in file order.
pub fn channel_names(image: &FlatImage, part: usize) -> Vec<String> {
    image.layer_data[part]
        .channel_data
        .list
        .iter()
        .map(|c| c.name.to_string())
        .collect()
}
