//! Mirrors a render up to any size, block by block, so that large inputs need neither memory nor a renderer.
//!
//!     cargo run --release -p linpred-tests --bin mirror -- scene.exr large.exr 16384 4096 zip|tiled|parts|piz|dwaa
//!
//! `parts` writes one part per layer of channels, part after part, as Blender does. The render repeats, so each different block
//! is compressed once.

use std::collections::{BTreeMap, HashMap};
use std::error::Error;
use std::fs::File;
use std::io::BufWriter;

use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock, enumerate_ordered_header_block_indices};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use exr::meta::{BlockDescription, attribute::ChannelList};
use exr::prelude::*;

fn main() -> std::result::Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [render, output, width, height, layout] = arguments.as_slice() else {
        return Err("expected: render.exr output.exr width height zip|tiled|parts|piz|dwaa".into());
    };
    let size = Vec2(width.parse()?, height.parse()?);
    let image = linpred_tests::images::read(render.as_ref());
    let render = &image.layer_data[0];
    let headers = headers(render, size, layout)?;
    let file = BufWriter::new(File::create(output)?);
    exr::block::write(file, headers.clone(), true, |meta, writer| {
        let mut mirror = Mirror {
            render,
            compressed: HashMap::new(),
        };
        for (index, block) in enumerate_ordered_header_block_indices(&meta.headers) {
            writer.write_chunk(index, mirror.chunk(&meta.headers, block)?)?;
        }
        Ok(())
    })?;
    Ok(())
}

type Render = Layer<AnyChannels<FlatSamples>>;

/// The headers of the mirrored file.
fn headers(
    render: &Render,
    size: Vec2<usize>,
    layout: &str,
) -> std::result::Result<exr::meta::Headers, Box<dyn Error>> {
    let (compression, tile) = match layout {
        "zip" | "parts" => (Compression::ZIP16, None),
        "tiled" => (Compression::ZIP16, Some(Vec2(64, 64))),
        "piz" => (Compression::PIZ, None),
        "dwaa" => (Compression::DWAA(None), None),
        other => return Err(format!("{other}: expected zip, tiled, parts, piz or dwaa").into()),
    };
    let mut parts: BTreeMap<&str, Vec<ChannelDescription>> = BTreeMap::new();
    let names: Vec<String> = channel_names(render);
    for (name, channel) in names.iter().zip(&render.channel_data.list) {
        let layer = name.rsplit_once('.').map_or("beauty", |(layer, _)| layer);
        let part = if layout == "parts" { layer } else { "beauty" };
        let kind = match channel.sample_data {
            FlatSamples::F16(_) => SampleType::F16,
            FlatSamples::F32(_) => SampleType::F32,
            FlatSamples::U32(_) => SampleType::U32,
        };
        let description = ChannelDescription::named(name.as_str(), kind);
        parts.entry(part).or_default().push(description);
    }
    let several = parts.len() > 1;
    let header = |(name, channels): (&str, Vec<ChannelDescription>)| {
        let blocks = tile.map_or(BlockDescription::ScanLines, |tile_size| {
            BlockDescription::Tiles(exr::meta::attribute::TileDescription {
                tile_size,
                level_mode: exr::meta::attribute::LevelMode::Singular,
                rounding_mode: exr::math::RoundingMode::Down,
            })
        });
        let mut own = LayerAttributes {
            other: render.attributes.other.clone(),
            ..LayerAttributes::default()
        };
        own.layer_name = several.then(|| Text::from(name));
        let window = IntegerBounds::new(Vec2(0, 0), size);
        Header::new(
            "beauty".into(),
            size,
            ChannelList::new(channels.into()).list,
        )
        .with_encoding(compression, blocks, LineOrder::Increasing)
        .with_shared_attributes(ImageAttributes::new(window))
        .with_attributes(own)
    };
    Ok(parts.into_iter().map(header).collect())
}

fn channel_names(render: &Render) -> Vec<String> {
    let list = &render.channel_data.list;
    list.iter()
        .map(|channel| channel.name.to_string())
        .collect()
}

/// Makes chunks, each different one once.
struct Mirror<'a> {
    render: &'a Render,
    /// By part, place in the period of the repetition, and size.
    compressed: HashMap<(usize, usize, usize, usize, usize), CompressedBlock>,
}

impl Mirror<'_> {
    fn chunk(&mut self, headers: &[Header], index: BlockIndex) -> exr::error::Result<Chunk> {
        let period = Vec2(2 * self.render.size.0, 2 * self.render.size.1);
        let (at, size) = (index.pixel_position, index.pixel_size);
        let key = (
            index.layer,
            at.0 % period.0,
            at.1 % period.1,
            size.0,
            size.1,
        );
        if !self.compressed.contains_key(&key) {
            let data = self.samples(&headers[index.layer], index);
            let chunk = UncompressedBlock { index, data }.compress_to_chunk(headers)?;
            self.compressed.insert(key, chunk.compressed_block);
        }
        let mut compressed_block = self.compressed[&key].clone();
        match &mut compressed_block {
            CompressedBlock::ScanLine(block) => block.y_coordinate = at.1 as i32,
            CompressedBlock::Tile(block) => {
                block.coordinates.tile_index = at / headers[index.layer].max_block_pixel_size();
            }
            _ => unreachable!("flat blocks were asked for"),
        }
        Ok(Chunk {
            layer_index: index.layer,
            compressed_block,
        })
    }

    /// The samples of a block: for each line, for each channel.
    fn samples(&self, header: &Header, index: BlockIndex) -> Vec<u8> {
        let list = &self.render.channel_data.list;
        let channels: Vec<&FlatSamples> = header
            .channels
            .list
            .iter()
            .map(|c| {
                let same = |channel: &&AnyChannel<FlatSamples>| channel.name == c.name;
                &list
                    .iter()
                    .find(same)
                    .expect("the render's channel")
                    .sample_data
            })
            .collect();
        let mut bytes = Vec::new();
        for y in index.pixel_position.1..index.pixel_position.1 + index.pixel_size.1 {
            let row = mirrored(y, self.render.size.1) * self.render.size.0;
            for samples in &channels {
                for x in index.pixel_position.0..index.pixel_position.0 + index.pixel_size.0 {
                    let at = row + mirrored(x, self.render.size.0);
                    match samples {
                        FlatSamples::F16(values) => bytes.extend(values[at].to_ne_bytes()),
                        FlatSamples::F32(values) => bytes.extend(values[at].to_ne_bytes()),
                        FlatSamples::U32(values) => bytes.extend(values[at].to_ne_bytes()),
                    }
                }
            }
        }
        bytes
    }
}

/// `position` in the endless repetition of 0..length and its mirror image.
fn mirrored(position: usize, length: usize) -> usize {
    let inside = position % (2 * length);
    inside.min(2 * length - 1 - inside)
}
