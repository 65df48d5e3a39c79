//! A file that is made anew, row by row, in the likeness of another: parts of scanlines, stored with ZIP, with channels of their own.

use std::path::Path;

use exr::meta::BlockDescription;
use exr::meta::attribute::{
    ChannelDescription, ChannelList, Compression, LineOrder, SampleType, Text,
};
use exr::meta::header::Header;

use crate::channels::samples;
use crate::error::Error;
use crate::exr_file::Part;
use crate::exr_file::attributes::{Attributes, FLAG_LONG_NAMES, FLAG_MULTI_PART};
use crate::exr_file::chunk::ChunkShape;
use crate::exr_file::compression::{SharedCodec, chunks_while_coding};
use crate::exr_file::grid::ChunkGrid;
use crate::exr_file::writer::{ExrWriter, OutputPart};
use crate::image::chunk::{Lines, encode_samples, write_chunk};
use crate::image::rewrite::{ZIP16_CODE, encode_channels};

/// The version of the format that is written, without its flags.
const VERSION: u32 = 2;

/// Attributes of the other part that say how it is stored, or show what it holds.
const NOT_KEPT: [&str; 8] = [
    "chunkCount",
    "deepImageState",
    "dwaCompressionLevel",
    "maxSamplesPerPixel",
    "preview",
    "tiles",
    "type",
    "version",
];

/// Attributes that tell parts and views of a file apart.
const OF_SEVERAL: [&str; 3] = ["name", "view", "multiView"];

/// A part that is to be written.
#[derive(Clone, Debug)]
pub(crate) struct NewPart {
    header: Header,
    attributes: Attributes,
    grid: ChunkGrid,
    /// Where each channel stands in the file, which sorts them by their names.
    order: Vec<usize>,
}

impl NewPart {
    /// A part with the windows and the attributes of `like`, but for those that tell of its storage, its samples per pixel and what linpred did to it, and with string
    /// attributes `marks`. Its channels are in any order, and no two have one name.
    ///
    /// [`Error::Invalid`] for a name that the format does not allow.
    pub(crate) fn like(
        like: &Part,
        channels: &[(String, SampleType)],
        marks: &[(&str, String)],
    ) -> Result<Self, Error> {
        let mut list = Vec::new();
        for (position, (name, kind)) in channels.iter().enumerate() {
            let text = Text::new_or_none(name)
                .ok_or_else(|| Error::Invalid(format!("channel {name:?} cannot be written")))?;
            list.push((ChannelDescription::new(text, *kind, true), position));
        }
        list.sort_by(|(a, _), (b, _)| a.name.bytes().cmp(b.name.bytes()));
        let mut order = vec![0; list.len()];
        for (place, (_, position)) in list.iter().enumerate() {
            order[*position] = place;
        }
        let list: Vec<ChannelDescription> = list.into_iter().map(|(channel, _)| channel).collect();
        let mut header = like.header.clone();
        header.channels = ChannelList::new(list.into());
        header.compression = Compression::ZIP16;
        header.line_order = LineOrder::Increasing;
        header.blocks = BlockDescription::ScanLines;
        header.deep = false;
        let lines = Compression::ZIP16.scan_lines_per_block();
        let grid = ChunkGrid::new(header.data_window(), header.blocks, lines);
        header.chunk_count = grid.rows();
        let mut attributes = kept(&like.attributes);
        attributes.set("channels", "chlist", encode_channels(&header.channels));
        attributes.set("compression", "compression", vec![ZIP16_CODE]);
        attributes.set("lineOrder", "lineOrder", vec![0]);
        for (name, value) in marks {
            attributes.set(name, "string", value.clone().into_bytes());
        }
        Ok(Self {
            header,
            attributes,
            grid,
            order,
        })
    }

    /// Its attributes, to be added to.
    pub(crate) fn attributes_mut(&mut self) -> &mut Attributes {
        &mut self.attributes
    }
}

/// The attributes of a part that are true of another one of the same picture.
fn kept(of: &Attributes) -> Attributes {
    let mut attributes = of.clone();
    for attribute in of.iter() {
        let name = String::from_utf8_lossy(&attribute.name);
        let ours = name.starts_with("linpred");
        if ours || NOT_KEPT.contains(&&*name) || samples::is_attribute(&name) {
            attributes.remove(&name);
        }
    }
    attributes
}

/// A file in the making. Nothing exists under its name before [`finish`](Self::finish).
#[derive(Debug)]
pub(crate) struct NewImage {
    writer: ExrWriter,
    codec: SharedCodec,
    parts: Vec<Filling>,
}

/// A part, and how far it has been filled.
#[derive(Debug)]
struct Filling {
    part: NewPart,
    /// Rows that have been taken.
    rows: usize,
    /// The chunk that is being filled.
    chunk: Vec<u8>,
}

impl NewImage {
    /// Begins a file with one part like `like` (see [`NewPart::like`]), which may be one of several parts or views of its file: of them the new one says nothing.
    ///
    /// [`Error::Invalid`] for a name that the format does not allow, [`Error::Usage`] or [`Error::Write`] if the file cannot be created.
    pub(crate) fn create(
        path: &Path,
        like: &Part,
        channels: &[(String, SampleType)],
        marks: &[(&str, String)],
    ) -> Result<Self, Error> {
        let mut part = NewPart::like(like, channels, marks)?;
        for name in OF_SEVERAL {
            part.attributes.remove(name);
        }
        Self::of_parts(path, vec![part])
    }

    /// Begins a file with these parts, at least one, which have names if they are several. [`Error::Usage`] or [`Error::Write`] if it cannot be created.
    pub(crate) fn of_parts(path: &Path, parts: Vec<NewPart>) -> Result<Self, Error> {
        let multi_part = parts.len() > 1;
        let channels = parts.iter().flat_map(|part| &part.header.channels.list);
        let long = channels.map(|channel| channel.name.bytes().len()).max() > Some(31);
        let mut version = VERSION;
        version |= if multi_part { FLAG_MULTI_PART } else { 0 };
        version |= if long { FLAG_LONG_NAMES } else { 0 };
        let outputs = parts.iter().map(|part| part.output(multi_part)).collect();
        let filling = |part| Filling {
            part,
            rows: 0,
            chunk: Vec::new(),
        };
        Ok(Self {
            writer: ExrWriter::create(path, version, outputs)?,
            codec: SharedCodec::default(),
            parts: parts.into_iter().map(filling).collect(),
        })
    }

    /// Bytes of memory that writing a part takes which is like `like` with these channels, beside the rows that are given.
    pub(crate) fn bytes(like: &Part, channels: &[(String, SampleType)]) -> u64 {
        let size = like.header.layer_size;
        let lines = Compression::ZIP16.scan_lines_per_block();
        let samples = channels.iter().map(|(_, kind)| kind.bytes_per_sample());
        let chunk = (size.0 as u64)
            .saturating_mul(lines.min(size.1) as u64)
            .saturating_mul(samples.sum::<usize>() as u64);
        let coding = 1 + chunks_while_coding(Compression::ZIP16);
        // the offset table, and the copy of it that is written
        let table = (size.1.div_ceil(lines) as u64).saturating_mul(16);
        chunk.saturating_mul(coding).saturating_add(table)
    }

    /// Takes the next row of a file of one part (see [`write_part_row`](Self::write_part_row)).
    pub(crate) fn write_row(&mut self, planes: &[&[f32]]) -> Result<(), Error> {
        self.write_part_row(0, planes)
    }

    /// Takes the next row of a part, from the top: a plane of the data window's width for each channel, in the order in which they were given. Integers lie in their plane
    /// with their bits. [`Error::Write`] if the file cannot be written.
    pub(crate) fn write_part_row(&mut self, part: usize, planes: &[&[f32]]) -> Result<(), Error> {
        let filling = &mut self.parts[part];
        let NewPart {
            header,
            grid,
            order,
            ..
        } = &filling.part;
        let row = grid.chunk_row(filling.rows);
        let bounds = grid.bounds(0, row);
        let line = filling.rows - bounds.position.1 as usize;
        let bytes = bounds.size.area() * header.channels.bytes_per_pixel;
        filling.chunk.resize(bytes, 0);
        let lines = Lines::new(&header.channels, bounds);
        for (&channel, plane) in order.iter().zip(planes) {
            let kind = header.channels.list[channel].sample_type;
            encode_samples(kind, plane, &mut filling.chunk[lines.range(channel, line)]);
        }
        filling.rows += 1;
        if line + 1 < bounds.size.1 {
            return Ok(());
        }
        let place = (part, 0, row);
        write_chunk(
            &mut self.writer,
            &self.codec,
            header,
            *grid,
            place,
            &mut filling.chunk,
        )
    }

    /// Completes the file, all of whose rows have been taken, and gives it its name.
    pub(crate) fn finish(self) -> Result<(), Error> {
        self.writer.finish()
    }
}

impl NewPart {
    /// The part as the writer of a file of one or of several parts wants it.
    fn output(&self, multi_part: bool) -> OutputPart {
        let mut attributes = self.attributes.clone();
        if multi_part {
            let chunks = self.header.chunk_count as i32;
            attributes.set("chunkCount", "int", chunks.to_le_bytes().to_vec());
            attributes.set("type", "string", b"scanlineimage".to_vec());
        }
        OutputPart {
            attributes,
            shape: ChunkShape {
                multi_part,
                tiled: false,
                deep: false,
            },
            grid: self.grid,
            chunks: self.header.chunk_count,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exr_file::ExrFile;
    use exr::prelude::{
        AnyChannel, AnyChannels, AttributeValue, Blocks, Encoding, FlatSamples, Image,
        LayerAttributes, WritableImage,
    };
    use exr::prelude::{Layer, Vec2};

    /// A tiled file in PIZ with a count of samples, at (3, -5), and what it is like.
    fn other(path: &Path) -> ExrFile {
        let mut attributes = LayerAttributes::named("noisy");
        attributes.layer_position = Vec2(3, -5);
        attributes.comments = Some("a comment".into());
        let samples = AttributeValue::I32(16);
        attributes.other.insert("samplesPerPixel".into(), samples);
        let encoding = Encoding {
            compression: Compression::PIZ,
            blocks: Blocks::Tiles(Vec2(8, 8)),
            line_order: LineOrder::Increasing,
        };
        let channel = AnyChannel::new("R", FlatSamples::F32(vec![1.0; 40 * 20]));
        let channels = AnyChannels::sort([channel].into_iter().collect());
        let layer = Layer::new((40, 20), attributes, encoding, channels);
        let image = Image::from_layer(layer);
        image.write().non_parallel().to_file(path).unwrap();
        ExrFile::open(path).unwrap()
    }

    #[test]
    fn a_new_image_has_the_window_of_another_and_channels_of_its_own() {
        let folder = std::env::temp_dir().join(format!("linpred-new-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("new.exr");
        let other = other(&folder.join("other.exr"));
        let channels = [("b", SampleType::F32), ("a", SampleType::U32)];
        let channels = channels.map(|(name, kind)| (name.to_owned(), kind));
        let mark = ("linpredVersion", "0".to_owned());
        let mut image = NewImage::create(&path, &other.parts()[0], &channels, &[mark]).unwrap();
        let floats: Vec<f32> = (0..40).map(|x| x as f32 / 7.0).collect();
        for y in 0..20 {
            let integers = vec![0x7f80_0001 + y; 40];
            let planes = [&floats[..], bytemuck::cast_slice(&integers)];
            assert!(!path.exists(), "before row {y}");
            image.write_row(&planes).unwrap();
        }
        image.finish().unwrap();
        let read = exr::prelude::read_all_flat_layers_from_file(&path).unwrap();
        let [layer] = &read.layer_data[..] else {
            panic!("one part")
        };
        assert_eq!(layer.attributes.layer_position, Vec2(3, -5));
        assert_eq!(layer.attributes.comments, Some("a comment".into()));
        assert_eq!(layer.attributes.layer_name, None);
        assert!(
            !layer
                .attributes
                .other
                .contains_key(&Text::from("samplesPerPixel"))
        );
        let [a, b] = &layer.channel_data.list[..] else {
            panic!("two channels")
        };
        let integers = (0..20).flat_map(|y| vec![0x7f80_0001 + y; 40]);
        assert_eq!(a.sample_data, FlatSamples::U32(integers.collect()));
        assert_eq!(b.sample_data, FlatSamples::F32(floats.repeat(20)));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
