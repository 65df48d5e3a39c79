//! What denoising a file will hold in memory, and how to stay within a limit.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;

use exr::meta::attribute::Compression;
use exr::meta::header::Header;
use linpred_core::Params;

use crate::channels::names::ChannelRef;
use crate::error::Error;
use crate::exr_file::Part;
use crate::exr_file::compression::{CODEC_AT_REST, chunks_while_coding, coded_at_once};
use crate::exr_file::grid::ChunkGrid;
use crate::image::rewrite::{Fill, Rewrite, RewrittenPart};
use crate::image::source::ExrSource;
use crate::job::input::{Input, rewrite};
use crate::job::memory::MemoryPlan;
use crate::job::options::JobOptions;
use crate::row::{InputRow, OutputRow};
use crate::stream::overlap::ROWS_IN_FLIGHT;
use crate::stream::pipeline::{self, Options};
use crate::stream::rows_of_cells::best_rows;
use crate::stream::survey;
use crate::temporal::Temporal;

/// The program itself, its tables and what the allocator keeps back (measured: 5 to 8 MiB).
const PROGRAM: u64 = 10 << 20;

/// What the allocator keeps back of the chunks and rows of a frame that helps (measured: 2 MiB at 4096 columns, beyond what the program's share covers).
const KEPT_BACK: u64 = 3 << 20;

/// Bytes of rows that are held of a frame that helps at most. A camera that rolls by 2 degrees from a frame to the next takes as many at 4096 columns.
const HELD_BYTES: u64 = 64 << 20;

/// Rows of a frame that helps which are held at least: what most motion takes.
const FEWEST_ROWS_HELD: usize = 16;

/// How a job runs: what of it can be given up to save memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Threads that compute.
    pub threads: NonZeroUsize,
    /// Rows read ahead, and rows waiting to be written; with 0 one thread reads, computes and writes in turn.
    pub rows_in_flight: usize,
    /// Rows of cells that are worked on together: more keep more threads busy where an image is narrow.
    pub cell_rows: NonZeroUsize,
    /// Whether chunks are decoded and encoded at once, each with working memory of its own, or in turn.
    pub codes_at_once: bool,
    /// Rows that are held at most of each frame that helps (see [`Temporal::holding`]).
    pub rows_held: usize,
}

impl Schedule {
    /// Threads that compute, read and write.
    pub fn all_threads(self) -> usize {
        self.threads.get() + if self.rows_in_flight > 0 { 2 } else { 0 }
    }

    /// Threads that compute each of so many pictures, which are denoised side by side.
    pub(super) fn threads_of_each(self, pictures: usize) -> NonZeroUsize {
        let threads = NonZeroUsize::new(self.threads.get() / pictures);
        threads.unwrap_or(NonZeroUsize::MIN)
    }
}

/// How [`denoise`](super::denoise) would run the pictures of a file, and what it would hold in memory. [`Error::Unsupported`] if what is to be denoised holds integers.
pub fn plan(pictures: &[Input], options: &JobOptions) -> Result<(Schedule, MemoryPlan), Error> {
    let rewrite = rewrite(pictures, options.output, &[])?;
    Ok(schedule(pictures, &rewrite, options))
}

/// The fastest schedule that keeps within the limit of `options`, and its plan; the most frugal one if none does, which
/// [`MemoryPlan::check`] tells.
pub(crate) fn schedule(
    pictures: &[Input],
    rewrite: &Rewrite,
    options: &JobOptions,
) -> (Schedule, MemoryPlan) {
    let threads = options.pipeline.threads;
    let frugal = Schedule {
        threads: NonZeroUsize::MIN,
        rows_in_flight: 0,
        cell_rows: NonZeroUsize::MIN,
        codes_at_once: false,
        rows_held: FEWEST_ROWS_HELD,
    };
    let params = options.pipeline.params;
    let plan = |schedule| (schedule, memory_plan(pictures, rewrite, params, schedule));
    let fits = |(_, plan): &(Schedule, MemoryPlan)| plan.total() <= options.memory_limit;
    let held = rows_held(pictures);
    schedules(
        threads,
        best_cell_rows(pictures, threads),
        may_code_at_once(pictures, rewrite),
    )
    .into_iter()
    .flat_map(|schedule| {
        let held = held.iter();
        held.map(move |&rows_held| Schedule {
            rows_held,
            ..schedule
        })
    })
    .map(plan)
    .find(fits)
    .unwrap_or_else(|| plan(frugal))
}

/// Rows of each frame that helps, that are worth holding: as many as may be wanted at once, as far as [`HELD_BYTES`] go, or parts of that.
fn rows_held(pictures: &[Input]) -> Vec<usize> {
    let helped = pictures
        .iter()
        .filter(|picture| picture.helpers().next().is_some());
    let most = helped.map(|picture| {
        let layout = picture.layout_in_sequence();
        let affordable = (HELD_BYTES / InputRow::bytes(&layout).max(1)) as usize;
        Temporal::<ExrSource>::most_rows(&layout).min(affordable)
    });
    let most = most.max().unwrap_or(0);
    let halves = std::iter::successors(Some(most), |rows| Some(rows / 2));
    let mut all: Vec<usize> = halves.take_while(|rows| *rows > FEWEST_ROWS_HELD).collect();
    all.push(FEWEST_ROWS_HELD);
    all
}

/// Rows of cells that are best worked on together: what suits the widest of the pictures suits the others, too, which have a few lanes idle at worst.
fn best_cell_rows(pictures: &[Input], threads: NonZeroUsize) -> NonZeroUsize {
    let rows = pictures
        .iter()
        .map(|picture| best_rows(&picture.computed_layout(), threads));
    rows.min().unwrap_or(NonZeroUsize::MIN)
}

/// Schedules from the fastest to the most frugal, with the fewest rows held.
fn schedules(threads: NonZeroUsize, cell_rows: NonZeroUsize, at_once: bool) -> Vec<Schedule> {
    let one = NonZeroUsize::MIN;
    let fewer = |n: &NonZeroUsize| NonZeroUsize::new(n.get() / 2);
    let cell_rows = || std::iter::successors(Some(cell_rows), fewer);
    let schedule = |threads, rows_in_flight, cell_rows, codes_at_once| Schedule {
        threads,
        rows_in_flight,
        cell_rows,
        codes_at_once,
        rows_held: FEWEST_ROWS_HELD,
    };
    let mut all = Vec::new();
    if threads > one {
        for codes_at_once in [true, false].into_iter().filter(|own| at_once || !own) {
            all.extend(cell_rows().map(|rows| {
                let in_flight = ROWS_IN_FLIGHT.saturating_mul(rows.get());
                schedule(threads, in_flight, rows, codes_at_once)
            }));
        }
        for in_flight in [8, 2] {
            all.push(schedule(threads, in_flight, one, false));
        }
    }
    all.extend(cell_rows().map(|rows| schedule(threads, 0, rows, false)));
    let halves = std::iter::successors(fewer(&threads), fewer);
    all.extend(halves.map(|threads| schedule(threads, 0, one, false)));
    all
}

/// Whether every compression that is decoded or encoded allows it.
fn may_code_at_once(pictures: &[Input], rewrite: &Rewrite) -> bool {
    let helpers = pictures.iter().flat_map(Input::helpers);
    let read = pictures.iter().chain(helpers).flat_map(|input| {
        let files = input.names.files();
        let channels = input.channels_to_read().into_iter();
        channels.map(|at| &files[at.file].parts()[at.part].header)
    });
    let written = rewrite.rewritten.iter().map(|part| &part.header);
    read.chain(written)
        .all(|header| coded_at_once(header.compression))
}

/// What denoising the pictures of a file will hold in memory: file chunks, and the pipelines' bands of rows.
pub(super) fn memory_plan(
    pictures: &[Input],
    rewrite: &Rewrite,
    params: Params,
    schedule: Schedule,
) -> MemoryPlan {
    let mut plan = MemoryPlan::default();
    plan.add("the program", PROGRAM);
    let Some(first) = pictures.first() else {
        return plan;
    };
    add_tables(&mut plan, first);
    // they share the codecs of the files, and the output
    add_coding(
        &mut plan,
        pictures,
        &rewrite.rewritten,
        schedule.codes_at_once,
    );
    add_writing(&mut plan, first, rewrite);
    let threads = schedule.threads_of_each(pictures.len());
    add_neighbours(&mut plan, pictures, schedule, threads);
    for input in pictures {
        add_reading(&mut plan, input);
        let layout = input.computed_layout();
        let options = Options::new(params)
            .with_threads(threads)
            .with_cell_rows(schedule.cell_rows);
        plan.add("computing", pipeline::bytes(&layout, &options));
        let row = InputRow::bytes(&layout).saturating_add(OutputRow::bytes(&layout));
        if schedule.rows_in_flight > 0 {
            // those in the channel, one being filled or emptied, and one more in the hand of the pipeline
            let rows = schedule.rows_in_flight as u64 + 2;
            plan.add(
                "rows read ahead and written behind",
                row.saturating_mul(rows),
            );
        }
        if layout.size != input.size() || pictures.len() > 1 {
            plan.add("rows put in their place", row.saturating_mul(4));
        }
    }
    plan
}

/// What the frames that help the pictures take: they are read like the pictures' own, each by a codec of its own or all by the picture's, and what is found in them is kept for some rows.
fn add_neighbours(
    plan: &mut MemoryPlan,
    pictures: &[Input],
    schedule: Schedule,
    threads: NonZeroUsize,
) {
    for picture in pictures {
        let Some(of) = &picture.neighbours else {
            continue;
        };
        let mut coding = largest_coding(picture);
        for frame in picture.helpers() {
            add_tables(plan, frame);
            add_reading(plan, frame);
            plan.add("open files", CODEC_AT_REST + KEPT_BACK);
            if schedule.codes_at_once {
                add_coding(plan, std::slice::from_ref(frame), &[], true);
            } else if largest_coding(frame) > coding {
                plan.add("decoding larger chunks", largest_coding(frame) - coding);
                coding = largest_coding(frame);
            }
        }
        let (before, after) = (of.before.len(), of.after.len());
        if before + after > 0 {
            let layout = picture.layout_in_sequence();
            plan.add(
                format!("following pixels through {before} frames before and {after} after"),
                Temporal::<ExrSource>::bytes(&layout, [before, after], schedule.rows_held, threads),
            );
        }
    }
}

/// Working memory to decode the largest chunk of what is read of a picture.
fn largest_coding(input: &Input) -> u64 {
    let files = input.names.files();
    let channels = input.channels_to_read().into_iter();
    let parts = channels.map(|at| coding_bytes(&files[at.file].parts()[at.part]));
    parts.max().unwrap_or(0)
}

/// What looking at some rows of `input` holds in memory, those of its halves beside its own.
pub(super) fn look_plan(input: &Input) -> MemoryPlan {
    let mut plan = MemoryPlan::default();
    add_tables(&mut plan, input);
    add_reading(&mut plan, input);
    add_reading(&mut plan, input);
    add_coding(&mut plan, std::slice::from_ref(input), &[], true);
    let row = InputRow::bytes(&input.layout());
    plan.add("rows", row.saturating_mul(4));
    plan
}

/// How many of `threads` threads a survey of `input` takes to stay within `limit` bytes of memory, one if it cannot, and its plan.
pub(super) fn survey_plan(
    input: &Input,
    threads: NonZeroUsize,
    limit: u64,
) -> (NonZeroUsize, MemoryPlan) {
    let plan = |threads| {
        let mut plan = MemoryPlan::default();
        plan.add("the program", PROGRAM);
        add_tables(&mut plan, input);
        add_reading(&mut plan, input);
        add_coding(&mut plan, std::slice::from_ref(input), &[], true);
        plan.add("computing", survey::bytes(&input.layout(), threads));
        (threads, plan)
    };
    std::iter::successors(Some(threads), |threads| {
        NonZeroUsize::new(threads.get() / 2)
    })
    .map(plan)
    .find(|(_, plan)| plan.total() <= limit)
    .unwrap_or_else(|| plan(NonZeroUsize::MIN))
}

/// What comparing the images `inputs` will hold in memory, `computing` bytes beside what reading them takes.
pub(super) fn compare_plan(inputs: &[&Input], computing: u64) -> MemoryPlan {
    let mut plan = MemoryPlan::default();
    plan.add("the program", PROGRAM);
    for input in inputs {
        add_tables(&mut plan, input);
        add_reading(&mut plan, input);
        add_coding(&mut plan, std::slice::from_ref(*input), &[], true);
    }
    plan.add("computing", computing);
    plan
}

/// What merging the passes `inputs`, of each of which these channels are read, will hold in memory, with what `writing` the output and its rows take.
pub(super) fn merge_plan(
    inputs: &[(&Input, Vec<ChannelRef>)],
    writing: u64,
    rows: u64,
) -> MemoryPlan {
    let mut plan = MemoryPlan::default();
    plan.add("the program", PROGRAM);
    let mut coded: Vec<&Part> = Vec::new();
    for (input, channels) in inputs {
        add_tables(&mut plan, input);
        for part in input.file().parts() {
            let own = channels.iter().filter(|at| at.part == part.index);
            let own: BTreeSet<usize> = own.map(|at| at.channel).collect();
            if !own.is_empty() {
                add_reading_of(&mut plan, part, &own);
                coded.push(part);
            }
        }
    }
    let at_rest = CODEC_AT_REST.saturating_mul(inputs.len() as u64);
    plan.add("open files", at_rest);
    // one codec decodes them in turn
    if let Some(largest) = coded.iter().max_by_key(|part| coding_bytes(part)) {
        let what = format!("decoding {}", describe(largest));
        plan.add(what, coding_bytes(largest));
    }
    plan.add("writing", writing);
    plan.add("rows that are merged", rows);
    plan
}

fn add_reading(plan: &mut MemoryPlan, input: &Input) {
    let files = input.names.files();
    let mut channels: BTreeMap<(usize, usize), BTreeSet<usize>> = BTreeMap::new();
    for at in input.channels_to_read() {
        channels
            .entry((at.file, at.part))
            .or_default()
            .insert(at.channel);
    }
    for ((file, part), channels) in channels {
        add_reading_of(plan, &files[file].parts()[part], &channels);
    }
}

/// The row of chunks of a part that is read, as far as these channels are kept of it.
fn add_reading_of(plan: &mut MemoryPlan, part: &Part, channels: &BTreeSet<usize>) {
    let list = &part.header.channels.list;
    let kept: usize = channels
        .iter()
        .map(|&channel| list[channel].sample_type.bytes_per_sample())
        .sum();
    let pixel = part.header.channels.bytes_per_pixel.max(1) as u64;
    let bytes = part.chunk_row_bytes() / pixel * kept as u64;
    let what = format!("{} of the channels of {}", channels.len(), describe(part));
    plan.add(format!("reading {what}"), bytes);
}

fn add_tables(plan: &mut MemoryPlan, input: &Input) {
    let files = input.names.files().iter();
    let chunks = files
        .flat_map(|file| file.parts())
        .map(|part| part.header.chunk_count as u64);
    // 8 bytes of the input's table, 8 of the output's
    plan.add("offset tables", chunks.sum::<u64>().saturating_mul(16));
}

/// Working memory of the codecs: one for each file that is read, which codes the output too unless that has its own.
fn add_coding(plan: &mut MemoryPlan, pictures: &[Input], written: &[RewrittenPart], at_once: bool) {
    let Some(first) = pictures.first() else {
        return;
    };
    let files = first.names.files();
    let mut read: Vec<Vec<Coding>> = vec![Vec::new(); files.len()];
    for at in pictures.iter().flat_map(Input::channels_to_read) {
        read[at.file].push(Coding::of_part(&files[at.file].parts()[at.part]));
    }
    let written = written.iter().map(|part| {
        let bytes = written_chunk_bytes(part);
        // what is kept of a chunk is decoded by the same codec
        let source = coding_bytes(&files[0].parts()[part.index]);
        let coding = bytes.saturating_mul(chunks_while_coding(part.header.compression));
        Coding {
            bytes: coding.max(source),
            what: describe_output(&files[0].parts()[part.index], part),
        }
    });
    let written: Vec<Coding> = written.collect();
    if !at_once {
        read[0].extend_from_slice(&written);
    }
    let mut add = |what: &str, all: &[Coding]| {
        if let Some(largest) = all.iter().max_by_key(|coding| coding.bytes) {
            plan.add(format!("{what} {}", largest.what), largest.bytes);
        }
    };
    for all in &read {
        add(
            if at_once {
                "decoding"
            } else {
                "decoding and encoding"
            },
            all,
        );
    }
    if at_once {
        add("encoding", &written);
    }
}

/// Working memory to code a chunk, and of what.
#[derive(Clone)]
struct Coding {
    bytes: u64,
    what: String,
}

impl Coding {
    fn of_part(part: &Part) -> Self {
        Self {
            bytes: coding_bytes(part),
            what: describe(part),
        }
    }
}

/// Bytes of the largest chunk of a part that is written.
fn written_chunk_bytes(part: &RewrittenPart) -> u64 {
    let first = part.grid.bounds(0, 0).size;
    let pixels = (first.0 as u64).saturating_mul(first.1 as u64);
    pixels.saturating_mul(part.header.channels.bytes_per_pixel as u64)
}

/// Working memory to code a chunk of a part as it is in the input.
fn coding_bytes(part: &Part) -> u64 {
    let chunks = chunks_while_coding(part.header.compression);
    part.chunk_bytes().saturating_mul(chunks)
}

fn add_writing(plan: &mut MemoryPlan, input: &Input, rewrite: &Rewrite) {
    for part in &rewrite.rewritten {
        let source = &input.file().parts()[part.index];
        let (width, height) = (part.header.layer_size.0, part.header.layer_size.1);
        let rows = part.grid.chunk_height().min(height) as u64;
        let pixels = rows.saturating_mul(width as u64);
        plan.add(
            format!("denoised rows of {}", source.label()),
            pixels.saturating_mul(part.denoised_bytes()),
        );
        let new = &part.header.channels;
        let chunk = pixels
            .saturating_mul(new.bytes_per_pixel as u64)
            .div_ceil(part.grid.columns() as u64);
        let keeps = part.fills.iter().any(|f| matches!(f, Fill::Input(_)));
        let old = match (
            keeps,
            source.grid.chunk_height() == part.grid.chunk_height(),
        ) {
            (false, _) => 0,
            (true, false) => source.chunk_row_bytes(),
            (true, true) if source.header.channels == *new => 0,
            (true, true) => source.chunk_bytes(),
        };
        let bytes = chunk.saturating_add(old);
        let what = describe_output(source, part);
        plan.add(format!("writing {what}"), bytes);
    }
}

/// A part as it is in the input.
fn describe(part: &Part) -> String {
    describe_chunks(&part.label(), &part.header, part.grid)
}

/// The same part as it is written.
fn describe_output(source: &Part, written: &RewrittenPart) -> String {
    describe_chunks(&source.label(), &written.header, written.grid)
}

fn describe_chunks(label: &str, header: &Header, grid: ChunkGrid) -> String {
    let compression = match header.compression {
        Compression::Uncompressed => "uncompressed".to_owned(),
        Compression::ZIP1 | Compression::ZIP16 => "zip".to_owned(),
        other => other.to_string().replace(" compression", ""),
    };
    format!(
        "{label} ({compression}, chunks of {} rows x {} channels)",
        grid.chunk_height().min(header.layer_size.1),
        header.channels.list.len()
    )
}
