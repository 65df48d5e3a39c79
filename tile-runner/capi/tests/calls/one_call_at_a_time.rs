//! A denoiser that is at work refuses other calls: from a function that it called, and from another thread. Others do not notice.

use std::ffi::{CStr, c_void};
use std::sync::Barrier;

use linpred_c::linpred_status::{LINPRED_ERROR_BUSY, LINPRED_ERROR_CANCELLED, LINPRED_OK};
use linpred_c::{
    linpred_denoiser, linpred_execute, linpred_free, linpred_message, linpred_unset_image,
};

use crate::host::{FLOAT3, Host, bits, pixels};

/// Calls the denoiser that calls it, in every way; true if each is refused.
unsafe extern "C" fn calls_back(user: *mut c_void, _rows: usize, _of: usize) -> bool {
    let denoiser = user.cast::<linpred_denoiser>();
    let mut handle = denoiser;
    // SAFETY: it is not freed, since it is at work
    let (statuses, message) = unsafe {
        let statuses = [
            linpred_execute(denoiser),
            linpred_unset_image(denoiser, c"colour".as_ptr()),
            linpred_free(&raw mut handle),
        ];
        (statuses, CStr::from_ptr(linpred_message(denoiser)))
    };
    statuses == [LINPRED_ERROR_BUSY; 3]
        && handle == denoiser
        && message == c"another call with this denoiser is at work"
}

unsafe extern "C" fn stops(_user: *mut c_void, rows: usize, of: usize) -> bool {
    rows < of / 2
}

#[test]
fn from_its_own_function() {
    let host = Host::new();
    let (colour, mut clean) = (pixels(1, 3), pixels(2, 3));
    host.image("colour", &colour, FLOAT3).ok();
    host.output("colour", &mut clean, FLOAT3).ok();
    host.progress(Some(calls_back), host.0.cast()).ok();
    host.execute().ok();
}

#[test]
fn which_can_stop_it() {
    let host = Host::new();
    let (colour, mut clean) = (pixels(1, 3), pixels(2, 3));
    host.image("colour", &colour, FLOAT3).ok();
    host.output("colour", &mut clean, FLOAT3).ok();
    host.progress(Some(stops), std::ptr::null_mut()).ok();
    host.execute()
        .fails(LINPRED_ERROR_CANCELLED, "stopped before the end");
    host.progress(None, std::ptr::null_mut()).ok();
    host.execute().ok();
}

/// Waits for the other thread, twice.
unsafe extern "C" fn waits(user: *mut c_void, rows: usize, _of: usize) -> bool {
    // SAFETY: the barrier outlives the run
    let barrier = unsafe { &*user.cast::<Barrier>() };
    if rows == 1 {
        barrier.wait();
        barrier.wait();
    }
    true
}

/// A handle that threads share.
struct Shared(*mut linpred_denoiser);

// SAFETY: any thread may call with it
unsafe impl Sync for Shared {}

#[test]
fn from_another_thread() {
    let host = Host::new();
    let (colour, mut clean) = (pixels(1, 3), pixels(2, 3));
    let barrier = Barrier::new(2);
    host.image("colour", &colour, FLOAT3).ok();
    host.output("colour", &mut clean, FLOAT3).ok();
    host.progress(Some(waits), (&raw const barrier).cast_mut().cast())
        .ok();
    let shared = Shared(host.0);
    let shared = &shared;
    std::thread::scope(|scope| {
        // SAFETY: the images are there until the end of the scope
        let at_work = scope.spawn(move || unsafe { linpred_execute(shared.0) });
        barrier.wait();
        // SAFETY: as above
        let refused = unsafe { linpred_execute(shared.0) };
        barrier.wait();
        assert_eq!(
            (refused, at_work.join().unwrap()),
            (LINPRED_ERROR_BUSY, LINPRED_OK)
        );
    });
}

#[test]
fn others_do_not_notice() {
    let colour = pixels(1, 3);
    let denoise = || {
        let (host, mut clean) = (Host::new(), vec![0.0; colour.len()]);
        host.image("colour", &colour, FLOAT3).ok();
        host.output("colour", &mut clean, FLOAT3).ok();
        host.execute().ok();
        bits(&clean)
    };
    let alone = denoise();
    std::thread::scope(|scope| {
        let both = [scope.spawn(denoise), scope.spawn(denoise)];
        assert!(
            both.map(|one| one.join().unwrap())
                .iter()
                .all(|clean| *clean == alone)
        );
    });
}
