//! Words with the debugger, which under QEMU is the terminal ("Semihosting for AArch32 and AArch64", Arm).

use core::arch::asm;

const SYS_WRITE0: u32 = 0x04;
const SYS_EXIT: u32 = 0x18;
const APPLICATION_EXIT: u32 = 0x2_0026;

fn call(operation: u32, argument: u32) {
    // SAFETY: the debugger reads memory only for SYS_WRITE0, whose argument is a terminated string that outlives the call.
    unsafe {
        asm!("bkpt #0xab", inout("r0") operation => _, in("r1") argument, options(nostack));
    }
}

/// Prints `name 0x........` and a newline, without the formatting machinery and its panics.
pub(crate) fn print(name: &str, value: u32) {
    let mut line = [0u8; 32];
    let mut characters = line.iter_mut().take(31);
    let digits = (0..8).map(|i| b"0123456789abcdef"[(value >> (28 - 4 * i)) as usize & 15]);
    let text = name.bytes().chain(*b" 0x").chain(digits).chain([b'\n']);
    for byte in text {
        if let Some(place) = characters.next() {
            *place = byte;
        }
    }
    call(SYS_WRITE0, line.as_ptr() as u32);
}

/// Ends the emulation with success.
pub(crate) fn exit() -> ! {
    loop {
        call(SYS_EXIT, APPLICATION_EXIT);
    }
}
