//! The core on a Cortex-M7 with nothing but flash and RAM: a checksum of its output bits, and what it cost.
//!
//! No allocator is linked, and no panic.

#![no_std]
#![no_main]

#[path = "../no_panic.rs"]
mod no_panic;
#[path = "../semihosting.rs"]
mod semihosting;
#[path = "../usage.rs"]
mod usage;

#[path = "../../../src/tile_checksum.rs"]
mod tile_checksum;

use cortex_m_rt::entry;
use tile_checksum::{Memory, checksum_of_tile};

#[entry]
fn main() -> ! {
    // `entry` makes a static of a function that is called once a reference to it.
    static mut MEMORY: Memory = Memory::EMPTY;
    let ticks = usage::start_ticks();
    let checksum = checksum_of_tile(MEMORY);
    let ticks = usage::ticks_since(ticks);
    semihosting::print("checksum", checksum);
    semihosting::print("ticks", ticks);
    semihosting::print("flash", usage::flash());
    semihosting::print("static", usage::static_ram());
    semihosting::print("stack", usage::stack_high_water());
    semihosting::exit()
}
