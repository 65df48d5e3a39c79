//! What denoising a file will hold in memory, and how to stay within a limit.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;

use crate::exr_file::Part;
use crate::exr_file::codec::blocks_while_coding;
use crate::job::{Input, JobOptions};
use crate::memory::MemoryPlan;
use crate::overlap::ROWS_IN_FLIGHT;
use crate::pipeline;
use crate::rewrite::{Fill, Rewrite};
use crate::row::{InputRow, OutputRow};

/// The program itself, its tables and what the allocator keeps back (measured: 5 to 8 MiB).
const PROGRAM: u64 = 10 << 20;

/// How a job runs: what of it can be given up to save memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Threads that compute.
    pub threads: NonZeroUsize,
    /// Rows read ahead, and rows waiting to be written; with 0 one thread reads, computes and writes in turn.
    pub rows_in_flight: usize,
}

/// The fastest schedule that keeps within the limit of `options`, and its plan; the most frugal one if none does, which
/// [`MemoryPlan::check`] tells.
pub fn schedule(input: &Input, rewrite: &Rewrite, options: &JobOptions) -> (Schedule, MemoryPlan) {
    let mut frugal = schedules(options.pipeline.threads).into_iter();
    let mut schedule = Schedule {
        threads: NonZeroUsize::MIN,
        rows_in_flight: 0,
    };
    loop {
        schedule = frugal.next().unwrap_or(schedule);
        let plan = memory_plan(input, rewrite, schedule);
        if plan.total() <= options.memory_limit || frugal.len() == 0 {
            return (schedule, plan);
        }
    }
}

/// Schedules from the fastest to the most frugal.
fn schedules(threads: NonZeroUsize) -> Vec<Schedule> {
    let mut all = Vec::new();
    if threads.get() > 1 {
        for rows_in_flight in [ROWS_IN_FLIGHT, 8, 2] {
            all.push(Schedule {
                threads,
                rows_in_flight,
            });
        }
    }
    let mut fewer = Some(threads);
    while let Some(threads) = fewer {
        all.push(Schedule {
            threads,
            rows_in_flight: 0,
        });
        fewer = NonZeroUsize::new(threads.get() / 2);
    }
    all
}

/// What denoising `input` will hold in memory: file blocks, and the pipeline's bands of rows.
pub fn memory_plan(input: &Input, rewrite: &Rewrite, schedule: Schedule) -> MemoryPlan {
    let mut plan = MemoryPlan::default();
    plan.add("the program", PROGRAM);
    add_reading(&mut plan, input);
    add_writing(&mut plan, input, rewrite);
    let layout = input.layout();
    plan.add("computing", pipeline::bytes(&layout, schedule.threads));
    if schedule.rows_in_flight > 0 {
        // those in the channel, one being filled or emptied, and one more in the hand of the pipeline
        let rows = schedule.rows_in_flight as u64 + 2;
        let row = InputRow::bytes(&layout).saturating_add(OutputRow::bytes(&layout));
        plan.add(
            "rows read ahead and written behind",
            row.saturating_mul(rows),
        );
    }
    plan
}

fn add_reading(plan: &mut MemoryPlan, input: &Input) {
    let files = input.names.files();
    let mut channels: BTreeMap<(usize, usize), BTreeSet<usize>> = BTreeMap::new();
    for at in input.channels() {
        channels
            .entry((at.file, at.part))
            .or_default()
            .insert(at.channel);
    }
    let mut coding = vec![0; files.len()];
    for ((file, part), channels) in channels {
        let part = &files[file].parts()[part];
        let list = &part.header.channels.list;
        let kept: usize = channels
            .iter()
            .map(|&channel| list[channel].sample_type.bytes_per_sample())
            .sum();
        let pixel = part.header.channels.bytes_per_pixel.max(1) as u64;
        let bytes = part.block_row_bytes() / pixel * kept as u64;
        let what = format!("{} of the channels of {}", channels.len(), describe(part));
        plan.add(format!("reading {what}"), bytes);
        coding[file] = coding[file].max(coding_bytes(part));
    }
    for part in input.file().parts() {
        coding[0] = coding[0].max(coding_bytes(part));
    }
    for (file, bytes) in files.iter().zip(coding) {
        let largest = file.parts().iter().max_by_key(|part| coding_bytes(part));
        let what = largest.map_or(String::new(), describe);
        plan.add(format!("decoding and encoding {what}"), bytes);
    }
    let chunks = files
        .iter()
        .flat_map(|file| file.parts())
        .map(|part| part.header.chunk_count as u64);
    // 8 bytes of the input's table, 8 of the output's
    plan.add("offset tables", chunks.sum::<u64>().saturating_mul(16));
}

/// Blocks are coded one at a time (see `ExrFile::codec`).
fn coding_bytes(part: &Part) -> u64 {
    let blocks = blocks_while_coding(part.header.compression);
    part.block_bytes().saturating_mul(blocks)
}

fn add_writing(plan: &mut MemoryPlan, input: &Input, rewrite: &Rewrite) {
    for part in &rewrite.rewritten {
        let source = &input.file().parts()[part.index];
        let (width, height) = (part.header.layer_size.0, part.header.layer_size.1);
        let rows = part.grid.block_height().min(height) as u64;
        let pixels = rows.saturating_mul(width as u64);
        plan.add(
            format!("denoised rows of {}", source.label()),
            pixels.saturating_mul(part.denoised_bytes()),
        );
        let new = &part.header.channels;
        let block = pixels
            .saturating_mul(new.bytes_per_pixel as u64)
            .div_ceil(part.grid.columns() as u64);
        let keeps = part.fills.iter().any(|f| matches!(f, Fill::Input(_)));
        let old = match (
            keeps,
            source.grid.block_height() == part.grid.block_height(),
        ) {
            (false, _) => 0,
            (true, false) => source.block_row_bytes(),
            (true, true) if source.header.channels == *new => 0,
            (true, true) => source.block_bytes(),
        };
        let bytes = block.saturating_add(old);
        plan.add(format!("writing {}", describe(source)), bytes);
    }
}

fn describe(part: &Part) -> String {
    format!(
        "{} ({} blocks of {} rows x {} channels)",
        part.label(),
        part.header
            .compression
            .to_string()
            .replace(" compression", ""),
        part.grid.block_height().min(part.header.layer_size.1),
        part.header.channels.list.len()
    )
}
