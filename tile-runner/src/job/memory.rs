//! What a run will hold in memory, planned before anything is allocated.

use std::fmt;

use crate::error::{Error, Mebibytes};
use crate::row::RowLayout;
use crate::sampling::{Measurement, Scratch};
use crate::stream::pipeline::{self, Options};

/// What a run may use when nothing else is said: what a render node has to spare.
pub const DEFAULT_MEMORY_LIMIT: u64 = 2 << 30;

/// The memory of a run, by what it is for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MemoryPlan {
    entries: Vec<(String, u64)>,
}

impl MemoryPlan {
    /// Adds a use of memory.
    pub fn add(&mut self, what: impl Into<String>, bytes: u64) {
        self.entries.push((what.into(), bytes));
    }

    /// What uses how many bytes.
    pub fn entries(&self) -> &[(String, u64)] {
        &self.entries
    }

    /// The sum, saturating.
    pub fn total(&self) -> u64 {
        self.entries
            .iter()
            .fold(0, |sum, (_, bytes)| sum.saturating_add(*bytes))
    }

    /// [`Error::OverLimit`], naming what costs most, if the sum is above `limit`.
    pub fn check(&self, limit: u64) -> Result<(), Error> {
        if self.total() <= limit {
            return Ok(());
        }
        let most = self.entries.iter().max_by_key(|(_, bytes)| *bytes);
        let most = most.map_or(String::new(), |(what, bytes)| {
            format!("{what}: {}", Mebibytes(*bytes))
        });
        Err(Error::OverLimit {
            needed: self.total(),
            limit,
            most,
        })
    }
}

/// Asks for what [`denoise`](crate::denoise) takes of memory for such an image, beside the source and the sink, before it takes it: an allocation that fails ends the process.
///
/// [`Error::OverLimit`] if it is more than `limit` bytes, [`Error::Budget`] if the system does not give it.
pub fn check_memory(layout: &RowLayout, options: &Options, limit: u64) -> Result<(), Error> {
    let mut plan = MemoryPlan::default();
    let (width, threads) = (layout.size.width(), options.threads);
    plan.add(
        format!("rows of {width} pixels on {threads} threads"),
        pipeline::bytes(layout, options),
    );
    plan.check(limit)?;
    check_available(&plan, threads.get())
}

/// The same for [`measure`](crate::sampling::measure) and the map that is planned with it, which `scratch` is put aside in.
pub fn check_memory_of_map(
    layout: &RowLayout,
    options: &Options,
    scratch: &Scratch,
    limit: u64,
) -> Result<(), Error> {
    let (size, threads) = (layout.size, options.threads);
    let mut plan = MemoryPlan::default();
    plan.add(
        format!("rows of {} pixels on {threads} threads", size.width()),
        pipeline::bytes(layout, options).saturating_add(Measurement::bytes(size)),
    );
    if let Scratch::Memory = scratch {
        // memory that grows takes up to twice what it holds
        let bytes = Measurement::bytes_aside(size).saturating_mul(2);
        plan.add("what is put aside of every pixel", bytes);
    }
    plan.check(limit)?;
    check_available(&plan, threads.get())
}

/// Address space of a thread's stack: what the standard library asks for.
const STACK: u64 = 2 << 20;

/// Asks the system for what `plan` and `threads` threads will take, and gives it back. [`Error::Budget`] where it can't be had: an allocation
/// that fails on the way would end the process, and leave a `.part` behind.
pub(super) fn check_available(plan: &MemoryPlan, threads: usize) -> Result<(), Error> {
    let bytes = plan
        .total()
        .saturating_add(STACK.saturating_mul(threads as u64));
    let mut probe: Vec<u8> = Vec::new();
    let reserved = usize::try_from(bytes).is_ok_and(|bytes| probe.try_reserve_exact(bytes).is_ok());
    // or else the compiler may leave out an allocation that nobody looks at
    std::hint::black_box(&mut probe);
    match reserved {
        true => Ok(()),
        false => Err(Error::Budget(format!(
            "the system does not give {} of memory (ulimit -v, or a container's limit); fewer threads or a lower limit take less",
            Mebibytes(bytes)
        ))),
    }
}

impl fmt::Display for MemoryPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (what, bytes) in &self.entries {
            writeln!(f, "{:>12}  {what}", Mebibytes(*bytes))?;
        }
        write!(f, "{:>12}  in all", Mebibytes(self.total()))
    }
}

/// The most bytes of memory that this process has had resident, where the system tells: Linux does.
pub(super) fn peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_over_the_limit_names_what_costs_most() {
        let mut plan = MemoryPlan::default();
        plan.add("small things", 1 << 20);
        plan.add("DWAB blocks", 480 << 20);
        assert!(plan.check(481 << 20).is_ok());
        let message = plan.check(256 << 20).unwrap_err().to_string();
        assert!(message.contains("DWAB blocks: 480.0 MiB"), "{message}");
    }
}
