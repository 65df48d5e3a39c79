//! On a Cortex-M7 with no allocator, and no way to panic, the core computes the bits that it computes here.

use std::collections::HashMap;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;

use linpred_tests::tile_checksum::{Memory, checksum_of_tile};

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
    println!(
        "flash {} static {} stack {} instructions {}",
        numbers["flash"],
        numbers["static"],
        numbers["stack"],
        40 * u64::from(numbers["ticks"])
    );
    let checksum = checksum_of_tile(&mut Box::new(Memory::EMPTY));
    assert_eq!(numbers["checksum"], checksum, "{output}");
    assert!(numbers["flash"] <= FLASH_BAR, "{output}");
    assert!(numbers["static"] + numbers["stack"] <= RAM_BAR, "{output}");
}
