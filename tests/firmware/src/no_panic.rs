//! The panic handler that must not be linked: it calls a function that does not exist, so a program with it links only if the
//! optimiser has proven that no panic is reachable.

use core::panic::PanicInfo;

unsafe extern "C" {
    fn a_panic_is_reachable() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { a_panic_is_reachable() }
}
