//! What a piece of work costs the process: time of the processor, of the wall, and memory.

use std::time::Instant;

use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};

/// Cost of a piece of work.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Cost {
    /// Seconds of all threads, user and system.
    pub(crate) cpu: f64,
    /// Seconds.
    pub(crate) wall: f64,
    /// Largest resident set of the process so far, MiB; 0 where the system does not say.
    pub(crate) peak_mib: f64,
    /// Resident set before the work, MiB.
    pub(crate) before_mib: f64,
}

/// Runs `work` and says what it cost.
pub(crate) fn measure<T>(work: impl FnOnce() -> T) -> (T, Cost) {
    let before_mib = status("VmRSS:");
    let (cpu, wall) = (process_seconds(), Instant::now());
    let result = work();
    let cost = Cost {
        cpu: process_seconds() - cpu,
        wall: wall.elapsed().as_secs_f64(),
        peak_mib: status("VmHWM:"),
        before_mib,
    };
    (result, cost)
}

fn process_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// A line of `/proc/self/status`, in MiB.
fn status(name: &str) -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix(name));
    let kib = line.and_then(|rest| rest.trim().strip_suffix("kB"));
    kib.and_then(|kib| kib.trim().parse::<f64>().ok())
        .map_or(0.0, |kib| kib / 1024.0)
}
