//! How many threads compute.

use std::num::NonZeroUsize;

use crate::threads_to_use;

/// [`threads_to_use`]; says so where that is less than was asked for.
pub(crate) fn to_use(asked: Option<NonZeroUsize>) -> NonZeroUsize {
    let used = threads_to_use(asked);
    if let Some(asked) = asked.filter(|&asked| asked > used) {
        tracing::info!(
            "--threads {asked}: {used} are used, one on each processor; more take memory and are no faster"
        );
    }
    used
}
