//! Signals ask a job to stop; it does so at the next row, and leaves nothing half-written.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// The number of the signal that asked to stop; 0 as long as none has.
static SIGNAL: AtomicUsize = AtomicUsize::new(0);

/// A flag that is set by Ctrl-C, SIGTERM, or the end of the terminal. A process without signal handling runs on without it.
pub(crate) fn on_signals() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    if let Err(error) = watch(&stop) {
        tracing::warn!("signals are not handled: {error}");
    }
    stop
}

#[cfg(unix)]
fn watch(stop: &Arc<AtomicBool>) -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::flag;
    for signal in [SIGHUP, SIGINT, SIGTERM] {
        // the actions run in this order: who sees the flag finds the number
        flag::register_usize(signal, &SIGNAL, signal as usize)?;
        flag::register(signal, stop.clone())?;
    }
    Ok(())
}

#[cfg(not(unix))]
fn watch(stop: &Arc<AtomicBool>) -> Result<(), ctrlc::Error> {
    /// What C calls Ctrl-C on every system.
    const SIGINT: usize = 2;
    let stop = stop.clone();
    ctrlc::set_handler(move || {
        SIGNAL.store(SIGINT, Ordering::SeqCst);
        stop.store(true, Ordering::SeqCst);
    })
}

/// The exit code of a job that was asked to stop: 128 and the signal's number, which is what a shell makes of a process that a signal ended.
pub(crate) fn exit_code() -> u8 {
    match SIGNAL.load(Ordering::SeqCst) {
        0 => 1,
        signal => 128 + signal as u8,
    }
}

/// Has a write beyond the size that a file may have (`ulimit -f`) fail as on a full disk, which removes what is half-written. Without a
/// handler the system ends the process.
pub(crate) fn let_writes_fail_at_the_size_limit() {
    #[cfg(unix)]
    // refused, it leaves the process as it was
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
}
