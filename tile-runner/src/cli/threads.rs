//! How many threads compute.

use std::num::NonZeroUsize;

/// As many as there are processors, or fewer if fewer are asked for.
pub(crate) fn to_use(asked: Option<NonZeroUsize>) -> NonZeroUsize {
    let Ok(processors) = std::thread::available_parallelism() else {
        return asked.unwrap_or(NonZeroUsize::MIN);
    };
    if let Some(asked) = asked.filter(|&asked| asked > processors) {
        tracing::info!(
            "--threads {asked}: {processors} are used, one on each processor; more take memory and are no faster"
        );
    }
    asked.map_or(processors, |asked| asked.min(processors))
}
