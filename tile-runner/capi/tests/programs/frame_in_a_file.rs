//! The frame of the examples in a file, denoised as the command line does.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use exr::prelude::*;
use linpred::job::{Input, InputRequest, JobOptions, denoise};
use linpred::{Options, Params, Quality};

use crate::installed::folder;

pub(crate) const WIDTH: usize = 64;
pub(crate) const HEIGHT: usize = 48;

/// scene_random() of examples/scene.h.
pub(crate) fn random(n: u32) -> f32 {
    let mut n = n.wrapping_add(1).wrapping_mul(0x9E37_79B9);
    n = (n ^ (n >> 16)).wrapping_mul(0x7FEB_352D);
    n = (n ^ (n >> 15)).wrapping_mul(0x846C_A68B);
    ((n ^ (n >> 16)) >> 8) as f32 / 16_777_216.0
}

/// scene_render() of examples/scene.h: colour, variance, albedo, normal, depth.
fn render(x: usize, y: usize) -> [f32; 13] {
    let is_floor = y >= HEIGHT / 2;
    let is_dark = (x / 8 + y / 8) % 2 == 1;
    let light = 0.5 + x as f32 / 128.0;
    let mut pixel = [0.0; 13];
    for c in 0..3 {
        let albedo = if is_dark {
            0.25
        } else {
            0.5 + 0.125 * c as f32
        };
        let noise = random(((y * WIDTH + x) * 3 + c) as u32);
        pixel[c] = albedo * light * (0.5 + noise);
        pixel[3 + c] = (albedo * light) * (albedo * light) / 12.0;
        pixel[6 + c] = albedo;
    }
    pixel[9 + if is_floor { 1 } else { 2 }] = 1.0;
    pixel[12] = if is_floor { 64.0 - y as f32 } else { 40.0 };
    pixel
}

const NAMES: [&str; 13] = [
    "R",
    "G",
    "B",
    "variance.R",
    "variance.G",
    "variance.B",
    "albedo.R",
    "albedo.G",
    "albedo.B",
    "N.X",
    "N.Y",
    "N.Z",
    "Z",
];

/// The checksum of the colour that the command `linpred denoise --quality high` writes, as the examples print it.
pub(crate) fn checksum_of_the_file(name: &str) -> String {
    let folder = folder(name);
    let (noisy, clean) = (folder.join("noisy.exr"), folder.join("clean.exr"));
    let pixels: Vec<_> = (0..WIDTH * HEIGHT)
        .map(|i| render(i % WIDTH, i / WIDTH))
        .collect();
    let channels = NAMES.iter().enumerate().map(|(k, name)| {
        let values = pixels.iter().map(|pixel| pixel[k]).collect();
        AnyChannel::new(*name, FlatSamples::F32(values))
    });
    let channels = AnyChannels::sort(channels.collect());
    let layer = Layer::new(
        (WIDTH, HEIGHT),
        LayerAttributes::default(),
        Encoding::UNCOMPRESSED,
        channels,
    );
    Image::from_layer(layer).write().to_file(&noisy).unwrap();

    let pictures = Input::open_all(&InputRequest::new(&noisy)).unwrap();
    let options = Options::new(Params::new(Quality::High)).with_threads(NonZeroUsize::MIN);
    let stop = Arc::new(AtomicBool::new(false));
    denoise(
        &pictures,
        &clean,
        &JobOptions::new(options),
        &stop,
        &mut |_| {},
    )
    .unwrap();

    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer();
    let image = image.all_attributes().from_file(&clean).unwrap();
    let channels = &image.layer_data.channel_data.list;
    let [red, green, blue] = ["R", "G", "B"].map(|name| {
        let channel = channels
            .iter()
            .find(|channel| channel.name.eq(name))
            .unwrap();
        channel.sample_data.values_as_f32().collect::<Vec<f32>>()
    });
    let pixels = (0..WIDTH * HEIGHT).flat_map(|i| [red[i], green[i], blue[i]]);
    format!("{:016x}\n", checksum(pixels))
}

/// scene_checksum() of examples/scene.h.
pub(crate) fn checksum(values: impl IntoIterator<Item = f32>) -> u64 {
    let bytes = values.into_iter().flat_map(f32::to_le_bytes);
    bytes.fold(0xCBF2_9CE4_8422_2325, |sum: u64, byte| {
        (sum ^ u64::from(byte)).wrapping_mul(0x100_0000_01B3)
    })
}
