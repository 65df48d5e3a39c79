//! Work without the interpreter that Python still watches over: Ctrl-C stops it, and progress is told.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use linpred::Error;
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;

use crate::errors::raise;

/// How long a signal may wait.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Progress is told at most so many times, and at the end.
const STEPS: usize = 100;

/// Tells how many rows are done, and says whether to go on: the progress of what runs in the library.
pub(crate) fn go_on<'a>(
    stop: &'a AtomicBool,
    tell: &'a mut (dyn FnMut(usize) + Send),
) -> impl FnMut(usize) -> ControlFlow<()> + 'a {
    move |rows| {
        tell(rows);
        match stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

/// Runs `work` on a thread of its own. It is given a flag that asks it to stop, and tells how many rows are done. Meanwhile this thread calls `progress` with (rows
/// done, of all), for which the work waits, and lets Python handle its signals. What either raises stops the work, and is raised once it has ended.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    rows: usize,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Arc<AtomicBool>, &mut (dyn FnMut(usize) + Send)) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let stop = &Arc::new(AtomicBool::new(false));
    let look = |done: Option<usize>| {
        let attached = Python::try_attach(|py| -> PyResult<()> {
            py.check_signals()?;
            if let (Some(done), Some(progress)) = (done, progress) {
                progress.call1(py, (done, rows))?;
            }
            Ok(())
        });
        // an interpreter that is shutting down runs nothing more
        attached.unwrap_or_else(|| Err(raise(Error::Cancelled)))
    };
    py.detach(|| {
        std::thread::scope(|scope| {
            let (tell, told) = channel();
            let (heard, go_on) = channel();
            let wanted = progress.is_some();
            let mut next = 0;
            let mut tell_rows = move |done| {
                if wanted && (done >= next || done == rows) {
                    next = done + rows.div_ceil(STEPS);
                    // an exception is to end the work here, not some rows later
                    let _ = tell.send(done).is_ok() && go_on.recv().is_ok();
                }
            };
            let run = move || work(stop, &mut tell_rows);
            let worker = std::thread::Builder::new()
                .spawn_scoped(scope, run)
                .map_err(|error| {
                    PyMemoryError::new_err(format!("can't start a thread: {error}"))
                })?;
            let mut raised = Ok(());
            loop {
                let done = match told.recv_timeout(LOOK_EVERY) {
                    Ok(done) => Some(done),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                if raised.is_ok() {
                    raised = look(done);
                    stop.store(raised.is_err(), Ordering::Relaxed);
                }
                if done.is_some() {
                    // the work may have panicked meanwhile, which joining it tells
                    let _ = heard.send(());
                }
            }
            let result = match worker.join() {
                Ok(result) => result,
                Err(panic) => std::panic::resume_unwind(panic),
            };
            raised?;
            result.map_err(raise)
        })
    })
}
