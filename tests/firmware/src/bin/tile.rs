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
use tile_checksum::{Memory, SEED, checksum_of_blocks, checksum_of_cell, checksum_of_fits};

#[entry]
fn main() -> ! {
    // `entry` makes a static of a function that is called once a reference to it.
    static mut MEMORY: Memory = Memory::EMPTY;
    let start = usage::start_ticks();
    let fits = checksum_of_fits(SEED);
    semihosting::print("ticks_fits", usage::ticks_since(start));
    let start = usage::start_ticks();
    let blocks = checksum_of_blocks(MEMORY, fits);
    semihosting::print("ticks_blocks", usage::ticks_since(start));
    let start = usage::start_ticks();
    let cell = checksum_of_cell(MEMORY, blocks);
    semihosting::print("ticks_cell", usage::ticks_since(start));
    semihosting::print("fits", fits);
    semihosting::print("blocks", blocks);
    semihosting::print("cell", cell);
    semihosting::print("flash", usage::flash());
    semihosting::print("static", usage::static_ram());
    semihosting::print("stack", usage::stack_high_water());
    semihosting::exit()
}
