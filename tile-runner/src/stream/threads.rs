//! The threads that compute.

use std::num::NonZeroUsize;
use std::ops::Deref;
use std::thread::{Builder, JoinHandle};

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::Error;

/// As many threads as there are processors, or fewer if fewer are asked for: more take memory and are no faster. As many as are asked for where the system does not tell.
pub fn threads_to_use(asked: Option<NonZeroUsize>) -> NonZeroUsize {
    match std::thread::available_parallelism() {
        Ok(processors) => asked.map_or(processors, |asked| asked.min(processors)),
        Err(_) => asked.unwrap_or(NonZeroUsize::MIN),
    }
}

/// Bytes of stack that `threads` threads touch.
pub(crate) fn stack_bytes(threads: u64) -> u64 {
    threads.saturating_mul(STACK as u64)
}

/// Bytes of stack that a thread touches (the core declares 30 KiB; measured with what calls it).
const STACK: usize = 256 << 10;

/// Threads that compute. They have ended once this is dropped: rayon's own pool leaves them to end when they will, and a program that unloads
/// the library by then takes their code away.
pub(crate) struct Threads {
    // dropped first, which tells the threads to end
    pool: ThreadPool,
    _running: Running,
}

impl Deref for Threads {
    type Target = ThreadPool;

    fn deref(&self) -> &ThreadPool {
        &self.pool
    }
}

/// Threads that were told to end when this is dropped.
#[derive(Default)]
struct Running(Vec<JoinHandle<()>>);

impl Drop for Running {
    fn drop(&mut self) {
        for thread in self.0.drain(..) {
            // what panicked in it has reached the caller through the pool
            let _ = thread.join();
        }
    }
}

/// Threads that compute.
pub(crate) fn pool(threads: NonZeroUsize) -> Result<Threads, Error> {
    let mut running = Running::default();
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .spawn_handler(|thread| {
            let named = Builder::new().name("linpred compute".into());
            running.0.push(named.spawn(move || thread.run())?);
            Ok(())
        })
        .build()
        .map_err(|e| Error::Budget(format!("can't start {threads} threads: {e}")))?;
    Ok(Threads {
        pool,
        _running: running,
    })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    static ENDED: AtomicUsize = AtomicUsize::new(0);

    /// Is dropped by a thread that ends, which takes it a while.
    struct Ends;

    impl Drop for Ends {
        fn drop(&mut self) {
            (0..10_000).for_each(|_| std::thread::yield_now());
            ENDED.fetch_add(1, Ordering::Relaxed);
        }
    }

    thread_local! {
        static ENDS: Ends = const { Ends };
    }

    #[test]
    fn threads_have_ended_once_they_are_dropped() {
        let threads = pool(NonZeroUsize::MIN.saturating_add(2)).unwrap_or_else(|e| panic!("{e}"));
        threads.broadcast(|_| ENDS.with(|_| {}));
        drop(threads);
        assert_eq!(ENDED.load(Ordering::Relaxed), 3);
    }
}
