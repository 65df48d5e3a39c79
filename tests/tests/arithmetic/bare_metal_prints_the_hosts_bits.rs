//! On a Cortex-M7 with no allocator, and no way to panic, the core computes the bits that it computes here.

use std::collections::HashMap;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;

use linpred_tests::tile_checksum::{
    Memory, SEED, checksum_of_blocks, checksum_of_cell, checksum_of_fits,
};

const FLASH_BAR: u32 = 256 * 1024;
const RAM_BAR: u32 = 512 * 1024;
/// What `run.sh` exits with when a tool is missing.
const TOOL_MISSING: i32 = 3;

/// `name 0x...` lines of the firmware.
fn numbers(output: &str) -> HashMap<&str, u32> {
    let pairs = output.lines().filter_map(|line| line.split_once(" 0x"));
    pairs
        .filter_map(|(name, hex)| Some((name, u32::from_str_radix(hex, 16).ok()?)))
        .collect()
}

/// The firmware's panic handler calls a function that does not exist: that it links is the proof that core does not panic.
#[test]
fn and_fits_its_flash_and_ram() {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("firmware/run.sh");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("firmware");
    let run = Command::new("sh")
        .arg(script)
        .env("CARGO_TARGET_DIR", &target)
        .output()
        .expect("a shell");
    let (output, errors) = (
        String::from_utf8_lossy(&run.stdout),
        String::from_utf8_lossy(&run.stderr),
    );
    if run.status.code() == Some(TOOL_MISSING) {
        // not eprintln: the harness would hide it
        writeln!(
            std::io::stderr(),
            "NOT RUN, the firmware needs tools that this machine lacks: {errors}"
        )
        .unwrap();
        return;
    }
    assert!(run.status.success(), "{output}{errors}");
    let numbers = numbers(&output);
    let instructions = |what: &str| 40 * u64::from(numbers[what]);
    println!(
        "flash {} static {} stack {} instructions: fits {} blocks {} cell {}",
        numbers["flash"],
        numbers["static"],
        numbers["stack"],
        instructions("ticks_fits"),
        instructions("ticks_blocks"),
        instructions("ticks_cell"),
    );
    let mut memory = Box::new(Memory::EMPTY);
    let fits = checksum_of_fits(SEED);
    let blocks = checksum_of_blocks(&mut memory, fits);
    let cell = checksum_of_cell(&mut memory, blocks);
    let theirs = ["fits", "blocks", "cell"].map(|what| numbers[what]);
    assert_eq!(theirs, [fits, blocks, cell], "{output}");
    assert!(numbers["flash"] <= FLASH_BAR, "{output}");
    assert!(numbers["static"] + numbers["stack"] <= RAM_BAR, "{output}");
}
