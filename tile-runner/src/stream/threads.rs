//! The threads that compute.

use std::num::NonZeroUsize;

use rayon::ThreadPool;

use crate::error::Error;

/// Bytes of stack that `threads` threads touch.
pub(crate) fn stack_bytes(threads: u64) -> u64 {
    threads.saturating_mul(STACK as u64)
}

/// Bytes of stack that a thread touches (the core declares 30 KiB; measured with what calls it).
const STACK: usize = 256 << 10;

/// Threads that compute.
pub(crate) fn pool(threads: NonZeroUsize) -> Result<ThreadPool, Error> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .build();
    pool.map_err(|e| Error::Budget(format!("can't start {threads} threads: {e}")))
}
