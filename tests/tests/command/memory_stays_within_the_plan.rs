//! A run keeps to the plan that `--dry-run` prints, and a tighter `--max-memory` changes how it runs, not what it writes.

use std::fs;
use std::path::Path;

use exr::prelude::*;
use linpred_tests::command::{denoise, linpred};
use linpred_tests::images::{TestPart, everything, part, write};

/// Bytes that `--dry-run` plans.
fn planned(folder: &Path, options: &[&str]) -> u64 {
    let options = [options, &["--dry-run"]].concat();
    denoise(folder, "unused.exr", &options)
        .succeeds()
        .planned_bytes()
}

/// Denoises, and returns the most bytes that were in use, where the system tells.
fn peak(folder: &Path, output: &str, options: &[&str]) -> Option<u64> {
    let json = ["--quality", "fast", "--log-format", "json"];
    let json = denoise(folder, output, &[&json[..], options].concat())
        .succeeds()
        .report();
    let peak = json["peak_bytes"].as_u64();
    assert_eq!(
        peak.is_some(),
        Path::new("/proc/self/status").exists(),
        "{json}"
    );
    peak
}

fn image(size: (usize, usize), compression: Compression, blocks: Blocks) -> TestPart {
    part(everything(size.0 * size.1)).stored(compression, blocks)
}

#[test]
fn a_run_uses_no_more_memory_than_planned_and_not_much_less_where_it_is_large() {
    let folder = tempfile::tempdir().unwrap();
    let tiles = Blocks::Tiles(Vec2(64, 64));
    for (size, compression, blocks) in [
        ((64, 40), Compression::ZIP16, Blocks::ScanLines),
        ((8192, 60), Compression::ZIP16, Blocks::ScanLines),
        ((8192, 60), Compression::ZIP16, tiles),
        ((4096, 60), Compression::PIZ, Blocks::ScanLines),
        ((4096, 60), Compression::DWAA(None), Blocks::ScanLines),
    ] {
        write(
            &folder.path().join("in.exr"),
            size,
            vec![image(size, compression, blocks)],
        );
        for threads in ["1", "2"] {
            let options = ["--threads", threads];
            let planned = planned(folder.path(), &options);
            let Some(peak) = peak(folder.path(), "out.exr", &options) else {
                println!("this system does not tell the peak of a process's memory: not compared");
                return;
            };
            let case = format!("{size:?} {compression} {blocks:?} {threads}: {peak} of {planned}");
            println!("{case}");
            assert!(peak <= planned, "{case}");
            assert!(size.0 < 4096 || planned <= 2 * peak, "{case}");
        }
    }
}

#[test]
fn frames_that_help_are_in_the_plan() {
    let folder = tempfile::tempdir().unwrap();
    for (compression, blocks) in [
        (Compression::ZIP16, Blocks::ScanLines),
        (Compression::PIZ, Blocks::Tiles(Vec2(64, 64))),
    ] {
        let size = (4096, 60);
        let path = |name: &str| folder.path().join(name).display().to_string();
        let others = ["before.exr", "after.exr", "next.exr"].map(path);
        for file in others.iter().map(String::as_str).chain([&*path("in.exr")]) {
            write(
                Path::new(file),
                size,
                vec![image(size, compression, blocks)],
            );
        }
        let [before, after, next] = others.each_ref().map(String::as_str);
        let options = [
            ["--temporal", "--before", before],
            ["--after", after, "--after"],
        ];
        let options = [&options.concat()[..], &[next]].concat();
        for threads in ["1", "2"] {
            let options = [&options[..], &["--threads", threads]].concat();
            let planned = planned(folder.path(), &options);
            let Some(peak) = peak(folder.path(), "out.exr", &options) else {
                println!("this system does not tell the peak of a process's memory: not compared");
                return;
            };
            let case = format!("{compression} {threads}: {peak} of {planned}");
            println!("{case}");
            assert!(peak <= planned && planned <= 2 * peak, "{case}");
        }
    }
}

#[test]
fn a_map_of_samples_takes_no_more_memory_than_denoising() {
    let folder = tempfile::tempdir().unwrap();
    let mut image = image((4096, 60), Compression::ZIP16, Blocks::ScanLines);
    image.attributes.push(("spp", AttributeValue::I32(4)));
    write(&folder.path().join("in.exr"), (4096, 60), vec![image]);
    let plan = planned(folder.path(), &["--threads", "2", "--quality", "fast"]);
    let path = |name: &str| folder.path().join(name).display().to_string();
    let limit = plan.to_string();
    let map = |options: &[&str]| {
        let (input, output) = (path("in.exr"), path("map.exr"));
        let files = ["sample-map", &input, "-o", &output, "--budget", "2"];
        let limit = ["--threads", "2", "--max-memory", &limit];
        linpred([&files[..], &limit, options].concat()).succeeds()
    };
    let own = map(&["--dry-run"]).planned_bytes();
    assert!(own <= plan, "{own} {plan}");
    assert!(!folder.path().join("map.exr").exists());
    map(&[]);
    assert!(folder.path().join("map.exr").exists());
}

#[test]
fn a_tighter_limit_gives_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let size = (700, 50);
    let image = image(size, Compression::ZIP16, Blocks::ScanLines);
    write(&folder.path().join("in.exr"), size, vec![image]);
    if std::thread::available_parallelism().is_ok_and(|processors| processors.get() == 1) {
        println!("one processor: there are no more threads than one to plan for");
        return;
    }
    let plan = planned(folder.path(), &["--threads", "4"]);
    let frugal = planned(folder.path(), &["--threads", "1"]);
    assert!(frugal < plan, "{frugal} {plan}");
    peak(folder.path(), "ample.exr", &["--threads", "4"]);
    // plans are printed to a tenth of a mebibyte
    let rounding = (1 << 20) / 10;
    for limit in [plan - 2 * rounding, (plan + frugal) / 2, frugal + rounding] {
        let limit = limit.to_string();
        let options = ["--threads", "4", "--max-memory", &limit];
        assert!(planned(folder.path(), &options) < plan);
        peak(folder.path(), "tight.exr", &options);
        let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
        assert!(
            read("ample.exr") == read("tight.exr"),
            "--max-memory {limit}"
        );
    }
}
