//! What the output file will be: which parts are copied, which are written anew, and what fills their channels.

use exr::meta::attribute::{
    ChannelDescription, ChannelList, Compression, LevelMode, LineOrder, SampleType, Text,
};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, compute_chunk_count};

use crate::channels::identifiers::{Cryptomattes, is_identifier};
use crate::channels::names::ChannelRef;
use crate::error::{Error, Setting};
use crate::exr_file::attributes::{Attributes, FLAG_LONG_NAMES};
use crate::exr_file::grid::ChunkGrid;
use crate::exr_file::writer::OutputPart;
use crate::exr_file::{ExrFile, Part};
use crate::row::OutputRow;

/// Channel with the estimated mean squared error of each pixel, radiance squared.
pub const ERROR_CHANNEL: &str = "linpred.error";
/// Channel with the mean half-width of the prediction windows, pixels.
pub const RADIUS_CHANNEL: &str = "linpred.radius";
/// Channel with the mean local rank of the models.
pub const RANK_CHANNEL: &str = "linpred.rank";
/// Channel with the number of frames that a pixel is made of, its own among them.
pub const FRAMES_CHANNEL: &str = "linpred.frames";

/// How the parts are stored that are written anew; the others are copied as they are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OutputCompression {
    /// As the input stores them; with ZIP where that would lose data of what is added or kept.
    #[default]
    Keep,
    /// Not compressed.
    None,
    /// Run lengths.
    Rle,
    /// Deflate, line by line.
    Zips,
    /// Deflate, 16 lines at a time.
    Zip,
    /// Wavelets and Huffman codes, 32 lines at a time: small for grain, slow.
    Piz,
    /// Cosines, 32 lines at a time. Small, and loses data of channels whose names are those of colours (R, G, B, Y, RY, BY), also of those that are kept: identifiers as Cryptomatte's are
    /// refused.
    Dwaa,
}

impl OutputCompression {
    /// All of them, by the names that OpenEXR's tools have for them.
    pub const NAMES: [(&str, Self); 7] = [
        ("keep", Self::Keep),
        ("zip", Self::Zip),
        ("zips", Self::Zips),
        ("rle", Self::Rle),
        ("piz", Self::Piz),
        ("dwaa", Self::Dwaa),
        ("none", Self::None),
    ];

    /// The compression of that name: [`Error::Setting`] with the names that there are if it is none of them.
    pub fn parse(name: &str) -> Result<Self, Error> {
        let mut all = Self::NAMES.into_iter();
        let found = all.find(|(own, _)| *own == name).map(|(_, found)| found);
        found.ok_or_else(|| Error::Setting {
            setting: Setting::Compression,
            value: name.to_owned(),
            problem: format!(
                "is none that is written; those are {}",
                Self::NAMES.map(|(own, _)| own).join(", ")
            ),
        })
    }

    /// What a header states, and the number that stands for it. `None` to keep the input's.
    fn chosen(self) -> Option<(Compression, u8)> {
        match self {
            Self::Keep => None,
            Self::None => Some((Compression::Uncompressed, 0)),
            Self::Rle => Some((Compression::RLE, 1)),
            Self::Zips => Some((Compression::ZIP1, 2)),
            Self::Zip => Some((Compression::ZIP16, ZIP16_CODE)),
            Self::Piz => Some((Compression::PIZ, 4)),
            Self::Dwaa => Some((Compression::DWAA(None), 8)),
        }
    }
}

/// What goes into the output beside the denoised colour, and how it is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OutputOptions {
    /// [`ERROR_CHANNEL`].
    pub error: bool,
    /// [`RADIUS_CHANNEL`] and [`RANK_CHANNEL`], and [`FRAMES_CHANNEL`] of a frame of a sequence.
    pub models: bool,
    /// How it is stored.
    pub compression: OutputCompression,
}

impl OutputOptions {
    /// The channels of picture `n`, which goes to `picture`.
    fn channels(self, n: usize, picture: &Targets) -> impl Iterator<Item = (String, Fill)> + use<> {
        let error = self.error.then_some((ERROR_CHANNEL, DenoisedPlane::Error));
        let radius = self
            .models
            .then_some((RADIUS_CHANNEL, DenoisedPlane::Radius));
        let rank = self.models.then_some((RANK_CHANNEL, DenoisedPlane::Rank));
        let frames =
            (self.models && picture.frames).then_some((FRAMES_CHANNEL, DenoisedPlane::Frames));
        let prefix = picture.prefix.clone();
        let channels = [error, radius, rank, frames].into_iter().flatten();
        channels.map(move |(name, plane)| (format!("{prefix}{name}"), Fill::Denoised(n, plane)))
    }
}

/// Where the denoised channels of a picture go.
#[derive(Clone, Debug)]
pub struct Targets {
    /// The colour.
    pub colour: [ChannelRef; 3],
    /// The alpha.
    pub alpha: Option<ChannelRef>,
    /// Each layer that is light.
    pub layers: Vec<[ChannelRef; 3]>,
    /// Each channel of layers that are no light.
    pub scalars: Vec<ChannelRef>,
    /// What stands before the names of the added channels: nothing, but in a file of several pictures.
    pub prefix: String,
    /// Whether it is of a frame of a sequence.
    pub frames: bool,
}

impl Targets {
    /// What goes into a channel.
    fn plane(&self, at: ChannelRef) -> Option<DenoisedPlane> {
        if let Some(k) = self.colour.iter().position(|&c| c == at) {
            return Some(DenoisedPlane::Colour(k));
        }
        if self.alpha == Some(at) {
            return Some(DenoisedPlane::Alpha);
        }
        let layers = self.layers.iter().enumerate();
        let mut layers =
            layers.filter_map(|(n, layer)| Some((n, layer.iter().position(|&c| c == at)?)));
        if let Some((n, k)) = layers.next() {
            return Some(DenoisedPlane::Layer(n, k));
        }
        let scalar = self.scalars.iter().position(|&c| c == at);
        scalar.map(DenoisedPlane::Scalar)
    }
}

/// A plane of a row of output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DenoisedPlane {
    /// A component of the denoised colour.
    Colour(usize),
    /// The denoised alpha.
    Alpha,
    /// A component of a denoised layer.
    Layer(usize, usize),
    /// A denoised channel that is no light.
    Scalar(usize),
    /// The estimated error.
    Error,
    /// The models' mean radius.
    Radius,
    /// The models' mean rank.
    Rank,
    /// The frames that a pixel is made of.
    Frames,
}

impl DenoisedPlane {
    /// The plane of a row.
    pub(crate) fn of(self, row: &OutputRow) -> &[f32] {
        match self {
            Self::Colour(k) => &row.colour[k],
            Self::Alpha => &row.alpha,
            Self::Layer(n, k) => &row.layers[n][k],
            Self::Scalar(n) => &row.scalars[n],
            Self::Error => &row.error,
            Self::Radius => &row.radius,
            Self::Rank => &row.rank,
            Self::Frames => &row.frames,
        }
    }

    /// Whether it is a channel that the input lacks.
    fn is_added(self) -> bool {
        matches!(self, Self::Error | Self::Radius | Self::Rank | Self::Frames)
    }
}

/// What fills a channel of a part that is written anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fill {
    /// The input's channel at this position, bit for bit.
    Input(usize),
    /// A plane of a picture of the input.
    Denoised(usize, DenoisedPlane),
}

/// A part that is written anew.
#[derive(Clone, Debug)]
pub struct RewrittenPart {
    /// Its number, in the input as in the output.
    pub index: usize,
    /// Its header in the output.
    pub header: Header,
    /// How it is cut in the output.
    pub grid: ChunkGrid,
    /// What fills each channel.
    pub fills: Vec<Fill>,
}

impl RewrittenPart {
    /// Bytes per pixel of the channels that are not kept.
    pub fn denoised_bytes(&self) -> u64 {
        let channels = self.header.channels.list.iter().zip(&self.fills);
        let denoised = channels.filter(|(_, fill)| !matches!(fill, Fill::Input(_)));
        denoised
            .map(|(channel, _)| channel.sample_type.bytes_per_sample() as u64)
            .sum()
    }
}

/// The output file.
#[derive(Clone, Debug)]
pub struct Rewrite {
    /// The version field.
    pub version: u32,
    /// All parts as they will be written.
    pub parts: Vec<OutputPart>,
    /// Those of them that are not copies.
    pub rewritten: Vec<RewrittenPart>,
    /// The input's row that is the output's first; 0 unless the output is a band of the image.
    pub first_row: usize,
    /// What a user should know about them.
    pub notes: Vec<String>,
}

impl Rewrite {
    /// The output of denoising the pictures of `input` that go to `pictures`, with string attributes `marks` in each part that is written anew.
    /// [`Error::Unsupported`] if something that is to be denoised holds integers.
    pub fn new(
        input: &ExrFile,
        pictures: &[Targets],
        options: OutputOptions,
        marks: &[(&str, String)],
    ) -> Result<Self, Error> {
        let mut output = Self {
            version: input.version(),
            parts: Vec::new(),
            rewritten: Vec::new(),
            first_row: 0,
            notes: Vec::new(),
        };
        for part in input.parts() {
            let fill = |channel| fill_of(part.index, channel, pictures);
            let count = part.header.channels.list.len();
            let fills: Vec<Fill> = (0..count).map(fill).collect();
            if fills.iter().all(|fill| matches!(fill, Fill::Input(_))) {
                output.parts.push(copied(part));
                continue;
            }
            check_types(input, part, &fills)?;
            let mut added = Vec::new();
            for (n, picture) in pictures.iter().enumerate() {
                if picture.colour[0].part == part.index {
                    added.extend(options.channels(n, picture));
                }
            }
            output.rewrite(input, part, fills, (added, options.compression), marks)?;
        }
        Ok(output)
    }

    fn rewrite(
        &mut self,
        input: &ExrFile,
        part: &Part,
        fills: Vec<Fill>,
        (added, compression): (Vec<(String, Fill)>, OutputCompression),
        marks: &[(&str, String)],
    ) -> Result<(), Error> {
        let place = format!("{}: {}", input.path().display(), part.label());
        let mut header = part.header.clone();
        let mut attributes = part.attributes.clone();
        for (name, value) in marks {
            attributes.set(name, "string", value.clone().into_bytes());
        }
        let fills = add_channels(&mut header, &mut attributes, fills, added);
        if header.compression.may_loose_data() {
            self.notes.push(format!(
                "{place}: was stored with {}, which loses data: its noise is not what was rendered",
                header.compression
            ));
        }
        match compression.chosen() {
            None => self.keep_compression(&place, &mut header, &mut attributes, &fills),
            Some((compression, code)) => {
                header.compression = compression;
                attributes.set("compression", "compression", vec![code]);
                self.check_chosen(&place, input, &header, &fills)?;
            }
        }
        if header.line_order == LineOrder::Decreasing {
            self.notes.push(format!(
                "{place}: rows were stored from bottom to top, and are written from top to bottom"
            ));
            header.line_order = LineOrder::Increasing;
            attributes.set("lineOrder", "lineOrder", vec![0]);
        }
        self.drop_levels(&place, &mut header, &mut attributes);
        header.chunk_count =
            compute_chunk_count(header.compression, header.layer_size, header.blocks);
        if attributes.int("chunkCount").is_some() {
            let count = (header.chunk_count as i32).to_le_bytes().to_vec();
            attributes.set("chunkCount", "int", count);
        }
        if header
            .channels
            .list
            .iter()
            .any(|channel| channel.name.bytes().len() > 31)
        {
            self.version |= FLAG_LONG_NAMES;
        }
        let lines = header.compression.scan_lines_per_block();
        let grid = ChunkGrid::new(header.data_window(), header.blocks, lines);
        let chunks = header.chunk_count;
        self.parts.push(OutputPart {
            attributes,
            shape: part.shape,
            grid,
            chunks,
        });
        self.rewritten.push(RewrittenPart {
            index: part.index,
            header,
            grid,
            fills,
        });
        Ok(())
    }

    /// Tells what the compression that was asked for loses of channels that are kept. [`Error::Unsupported`] where those are identifiers.
    fn check_chosen(
        &mut self,
        place: &str,
        input: &ExrFile,
        header: &Header,
        fills: &[Fill],
    ) -> Result<(), Error> {
        let lost = kept_and_lossy(header, fills);
        if lost.is_empty() {
            return Ok(());
        }
        let identifiers = identifiers_of(input, &lost);
        if !identifiers.is_empty() {
            return Err(Error::Unsupported(format!(
                "{place}: {} would lose data of {}, which hold identifiers: choose zip, or a lossless compression",
                header.compression,
                identifiers.join(" ")
            )));
        }
        self.notes.push(format!(
            "{place}: written with {}, as asked for, which loses data of what is kept: {}",
            header.compression,
            lost.join(" ")
        ));
        Ok(())
    }

    /// A lossy compression stays where it only meets what was denoised. It may not touch the added layers, nor, a second
    /// time, channels that are to be kept.
    fn keep_compression(
        &mut self,
        place: &str,
        header: &mut Header,
        attributes: &mut Attributes,
        fills: &[Fill],
    ) {
        if !header.compression.may_loose_data() {
            return;
        }
        let added = fills
            .iter()
            .any(|fill| matches!(fill, Fill::Denoised(_, plane) if plane.is_added()));
        let altered = kept_and_lossy(header, fills);
        let reason = match (added, altered.is_empty()) {
            (true, _) => "so that the added layers lose nothing".to_owned(),
            (false, false) => format!("so that what is kept loses no more: {}", altered.join(" ")),
            (false, true) => return,
        };
        self.notes
            .push(format!("{place}: written with zip compression, {reason}"));
        header.compression = Compression::ZIP16;
        attributes.set("compression", "compression", vec![ZIP16_CODE]);
    }

    fn drop_levels(&mut self, place: &str, header: &mut Header, attributes: &mut Attributes) {
        if let BlockDescription::Tiles(tiles) = &mut header.blocks
            && tiles.level_mode != LevelMode::Singular
        {
            self.notes.push(format!(
                "{place}: smaller levels (mip or rip maps) are left out: they show the noisy image"
            ));
            tiles.level_mode = LevelMode::Singular;
            let size = tiles.tile_size;
            attributes.set("tiles", "tiledesc", encode_tiles(size.0, size.1));
        }
    }
}

/// The value of the `compression` attribute for zip with 16 rows per chunk.
pub(super) const ZIP16_CODE: u8 = 3;

/// The names of the channels that are kept and that the header's compression alters.
fn kept_and_lossy(header: &Header, fills: &[Fill]) -> Vec<String> {
    let dwa = matches!(
        header.compression,
        Compression::DWAA(_) | Compression::DWAB(_)
    );
    let channels = header.channels.list.iter().zip(fills);
    let altered = channels.filter(|(channel, fill)| {
        dwa && matches!(fill, Fill::Input(_)) && dwa_is_lossy_for(&channel.name.to_string())
    });
    altered
        .map(|(channel, _)| channel.name.to_string())
        .collect()
}

/// Which of these channels hold identifiers, by their names or by what the file says of Cryptomattes.
fn identifiers_of(file: &ExrFile, channels: &[String]) -> Vec<String> {
    let cryptomattes = Cryptomattes::of(file);
    let hold = |name: &&String| {
        let layer = name.rsplit_once('.').map_or("", |(layer, _)| layer);
        is_identifier(name) || cryptomattes.has(layer)
    };
    channels.iter().filter(hold).cloned().collect()
}

/// Whether DWA puts a channel of this name through its cosine transform; it recognises colours by their last component
/// (OpenEXR's `sDefaultChannelRules`), and stores the rest without loss. B44 and PXR24 lose nothing the second time.
fn dwa_is_lossy_for(channel: &str) -> bool {
    let component = channel
        .rsplit('.')
        .next()
        .unwrap_or(channel)
        .to_ascii_lowercase();
    matches!(
        component.as_str(),
        "r" | "g" | "b" | "y" | "ry" | "by" | "red" | "grn" | "green" | "blu" | "blue"
    )
}

fn copied(part: &Part) -> OutputPart {
    OutputPart {
        attributes: part.attributes.clone(),
        shape: part.shape,
        grid: part.grid,
        chunks: part.header.chunk_count,
    }
}

fn fill_of(part: usize, channel: usize, pictures: &[Targets]) -> Fill {
    let at = ChannelRef {
        file: 0,
        part,
        channel,
    };
    let pictures = pictures.iter().enumerate();
    let mut planes = pictures.filter_map(|(n, picture)| Some((n, picture.plane(at)?)));
    let plane = planes.next();
    plane.map_or(Fill::Input(channel), |(n, plane)| Fill::Denoised(n, plane))
}

fn check_types(input: &ExrFile, part: &Part, fills: &[Fill]) -> Result<(), Error> {
    let integer = (0..fills.len())
        .find(|&c| !matches!(fills[c], Fill::Input(_)) && part.sample_type(c) == SampleType::U32);
    match integer {
        None => Ok(()),
        Some(channel) => Err(Error::Unsupported(format!(
            "{}: {}: channel {:?} holds integers, which cannot be denoised",
            input.path().display(),
            part.label(),
            part.channel_name(channel)
        ))),
    }
}

/// Adds channels, replacing those of the same name from an earlier run, and keeps the list sorted.
fn add_channels(
    header: &mut Header,
    attributes: &mut Attributes,
    fills: Vec<Fill>,
    added: Vec<(String, Fill)>,
) -> Vec<Fill> {
    if added.is_empty() {
        return fills;
    }
    let old = header.channels.list.iter().cloned().zip(fills);
    let mut list: Vec<(ChannelDescription, Fill)> = old
        .filter(|(channel, _)| {
            added
                .iter()
                .all(|(name, _)| !channel.name.eq(name.as_str()))
        })
        .collect();
    list.extend(added.iter().filter_map(|(name, fill)| {
        // names are those of the input's layers, which were text, before ours
        let text = Text::new_or_none(name)?;
        Some((ChannelDescription::new(text, SampleType::F32, true), *fill))
    }));
    list.sort_by(|(a, _), (b, _)| a.name.bytes().cmp(b.name.bytes()));
    let (channels, fills): (Vec<_>, Vec<_>) = list.into_iter().unzip();
    header.channels = ChannelList::new(channels.into());
    attributes.set("channels", "chlist", encode_channels(&header.channels));
    fills
}

/// The value of the `channels` attribute.
pub(super) fn encode_channels(channels: &ChannelList) -> Vec<u8> {
    let mut bytes = Vec::new();
    for channel in &channels.list {
        bytes.extend_from_slice(channel.name.bytes());
        bytes.push(0);
        let kind: i32 = match channel.sample_type {
            SampleType::U32 => 0,
            SampleType::F16 => 1,
            SampleType::F32 => 2,
        };
        bytes.extend_from_slice(&kind.to_le_bytes());
        bytes.extend_from_slice(&[channel.quantize_linearly.into(), 0, 0, 0]);
        for sampling in [channel.sampling.0, channel.sampling.1] {
            bytes.extend_from_slice(&(sampling as i32).to_le_bytes());
        }
    }
    bytes.push(0);
    bytes
}

/// A tile description of one level.
fn encode_tiles(width: usize, height: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    bytes.extend_from_slice(&(width as u32).to_le_bytes());
    bytes.extend_from_slice(&(height as u32).to_le_bytes());
    bytes.push(0);
    bytes
}
