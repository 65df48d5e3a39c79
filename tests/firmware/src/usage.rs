//! What the program takes of the machine: flash, RAM, stack, time.

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    static __sdata: u32;
    static __edata: u32;
    static __sidata: u32;
    static __euninit: u32;
    static _stack_start: u32;
    static _stack_end: u32;
}

const RAM_ORIGIN: u32 = 0x2000_0000;
const SYSTICK_CONTROL: *mut u32 = 0xe000_e010 as *mut u32;
const SYSTICK_RELOAD: *mut u32 = 0xe000_e014 as *mut u32;
const SYSTICK_CURRENT: *mut u32 = 0xe000_e018 as *mut u32;
const SYSTICK_MASK: u32 = 0x00ff_ffff;

/// Starts the 24-bit system timer on the processor's clock; its first reading.
pub(crate) fn start_ticks() -> u32 {
    // SAFETY: the timer's registers exist on every Cortex-M7, and nothing else uses them.
    unsafe {
        SYSTICK_RELOAD.write_volatile(SYSTICK_MASK);
        SYSTICK_CURRENT.write_volatile(0);
        SYSTICK_CONTROL.write_volatile(0b101);
        SYSTICK_CURRENT.read_volatile()
    }
}

/// Ticks since a reading, less than 2^24. QEMU with `-icount shift=0` takes a nanosecond for an instruction, and the board's clock
/// is 25 MHz, so a tick is 40 instructions.
pub(crate) fn ticks_since(start: u32) -> u32 {
    // SAFETY: as above. The timer counts down.
    let now = unsafe { SYSTICK_CURRENT.read_volatile() };
    start.wrapping_sub(now) & SYSTICK_MASK
}

/// Bytes of flash: code, constants, the vector table and what is copied to RAM at the start.
pub(crate) fn flash() -> u32 {
    (&raw const __sidata) as u32 + (&raw const __edata) as u32 - (&raw const __sdata) as u32
}

/// Bytes of RAM that statics take.
pub(crate) fn static_ram() -> u32 {
    (&raw const __euninit) as u32 - RAM_ORIGIN
}

/// Bytes of stack that were written since the start, which paints all of it.
pub(crate) fn stack_high_water() -> u32 {
    let top = &raw const _stack_start;
    let mut lowest = &raw const _stack_end;
    // SAFETY: from its end to its start the stack is RAM that the startup code has painted.
    unsafe {
        while lowest < top && lowest.read_volatile() == STACK_PAINT_VALUE {
            lowest = lowest.add(1);
        }
    }
    top as u32 - lowest as u32
}
