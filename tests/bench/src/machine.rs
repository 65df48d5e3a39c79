//! Where and when a measurement was made.

use std::process::Command;
use std::time::SystemTime;

/// Processor and how many of its threads there are to use.
pub(crate) fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| {
        let (name, value) = line.split_once(':')?;
        (name.trim() == "model name").then(|| value.trim().to_owned())
    });
    let model = model.unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{model} x{threads}")
}

/// Year, month and day, UTC.
pub(crate) fn date() -> String {
    let now = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    now.chars().take(10).collect()
}

/// The commit that was built from, as far as git knows.
pub(crate) fn revision() -> String {
    let output = Command::new("git")
        .args(["describe", "--always", "--dirty"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output();
    let text = output.ok().and_then(|o| String::from_utf8(o.stdout).ok());
    text.map_or_else(String::new, |text| text.trim().to_owned())
}

/// A name for a folder: letters and digits in lower case, hyphens for the rest.
pub(crate) fn folder_name() -> String {
    let name = processor().to_lowercase();
    let words = name.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    format!("{}-{}", date(), words.join("-"))
}
