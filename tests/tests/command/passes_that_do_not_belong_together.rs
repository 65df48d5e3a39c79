//! Passes that cannot be merged end in a sentence that names them, and leave nothing behind; a merge keeps to its plan.

use std::fs;
use std::path::{Path, PathBuf};

use exr::prelude::*;
use linpred_tests::command::{Ran, denoise_file, linpred};
use linpred_tests::images::{TestPart, colour, constant, float, part, write};
use linpred_tests::passes::Picture;

const PICTURE: Picture = Picture {
    size: (40, 48),
    scene: 1,
};

/// A folder with two good passes in it.
struct Place {
    folder: tempfile::TempDir,
    passes: Vec<PathBuf>,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let passes = PICTURE.write_passes(folder.path(), &[4, 6]);
        Self { folder, passes }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Merges the good passes with others.
    fn merge(&self, others: &[&Path], options: &[&str]) -> Ran {
        let passes = self.passes.iter().map(PathBuf::as_path);
        self.merge_only(
            &passes.chain(others.iter().copied()).collect::<Vec<_>>(),
            options,
        )
    }

    fn merge_only(&self, passes: &[&Path], options: &[&str]) -> Ran {
        let mut arguments = vec![
            "merge".into(),
            "-o".into(),
            self.path("all.exr").into_os_string(),
        ];
        arguments.extend(passes.iter().map(|path| path.as_os_str().to_owned()));
        arguments.extend(options.iter().map(Into::into));
        linpred(arguments)
    }

    /// Merging them with another that is written here is refused, in these words, and leaves nothing behind.
    #[track_caller]
    fn refuses(&self, other: TestPart, size: (usize, usize), words: &[&str]) {
        write(&self.path("other.exr"), size, vec![other]);
        let ran = self.merge(&[&self.path("other.exr")], &[]).exits_with(3);
        ran.complains_about(words).complains_about(&["other.exr"]);
        self.has_no_output();
    }

    #[track_caller]
    fn has_no_output(&self) {
        for name in ["all.exr", "all.exr.part"] {
            assert!(!self.path(name).exists(), "{name}");
        }
    }
}

/// A third pass of a picture.
fn third(picture: Picture) -> TestPart {
    picture.part(|_| (10..15).collect())
}

#[test]
fn passes_that_belong_together_are_merged_and_denoised() {
    let place = Place::new();
    write(&place.path("other.exr"), PICTURE.size, vec![third(PICTURE)]);
    let ran = place.merge(&[&place.path("other.exr")], &["--log-format", "json"]);
    let ran = ran.succeeds();
    ran.complains_about(&[
        "\"merged\"",
        "\"passes\":3",
        "\"samples\":15.0",
        "\"lost\":0",
    ]);
    denoise_file(&place.path("all.exr"), &place.path("clean.exr"), &[]).succeeds();
    let clean = place.path("clean.exr");
    place
        .merge(&[&clean], &[])
        .exits_with(3)
        .complains_about(&["clean.exr was denoised by linpred"]);
}

#[test]
fn a_pass_that_is_missing_or_truncated() {
    let place = Place::new();
    place
        .merge(&[&place.path("none.exr")], &[])
        .exits_with(3)
        .complains_about(&["cannot read", "none.exr"]);
    let whole = fs::read(&place.passes[1]).unwrap();
    for length in [0, 100, whole.len() / 2, whole.len() - 1] {
        fs::write(place.path("2.exr"), &whole[..length]).unwrap();
        let ran = place.merge(&[], &[]).exits_with(3);
        ran.complains_about(&["2.exr"]);
        place.has_no_output();
    }
}

#[test]
fn a_pass_of_another_size_or_with_other_channels() {
    let place = Place::new();
    let wider = Picture {
        size: (41, 48),
        scene: 1,
    };
    place.refuses(
        third(wider),
        wider.size,
        &["41 x 48 pixels at (3, -5)", "40 x 48"],
    );
    let mut more = third(PICTURE);
    more.channels
        .push(constant("diffuse.R", PICTURE.pixels(), 1.0));
    let words = ["has no channel \"diffuse.R\", which"];
    place.refuses(more, PICTURE.size, &words);
    let mut fewer = third(PICTURE);
    fewer.channels.retain(|(name, _)| name != "Z");
    place.refuses(fewer, PICTURE.size, &["has no channel \"Z\", which"]);
}

#[test]
fn a_pass_that_holds_something_else_in_a_channel() {
    let place = Place::new();
    let (a, b) = (place.path("a.exr"), place.path("b.exr"));
    let mask = [
        FlatSamples::F32(vec![1.0; PICTURE.pixels()]),
        FlatSamples::U32(vec![1; PICTURE.pixels()]),
    ];
    for (n, (path, mask)) in [&a, &b].into_iter().zip(mask).enumerate() {
        let mut pass = PICTURE.part(|_| (4 * n..4 * n + 4).collect());
        pass.channels.push(("mask".into(), mask));
        write(path, PICTURE.size, vec![pass]);
    }
    let words = [
        "channel \"mask\"",
        "a.exr",
        "b.exr",
        "holds",
        "integers",
        "a mean",
    ];
    let ran = place.merge_only(&[&a, &b], &[]).exits_with(3);
    ran.complains_about(&words);
    place.has_no_output();
}

#[test]
fn a_pass_of_another_scene() {
    let place = Place::new();
    let other = Picture {
        scene: 2,
        ..PICTURE
    };
    let words = [
        "is not of one picture with the other passes",
        "by albedo or normal they differ at",
    ];
    place.refuses(third(other), PICTURE.size, &words);
}

#[test]
fn a_pass_of_the_same_scene_in_another_light() {
    let place = Place::new();
    let mut brighter = third(PICTURE);
    for (name, samples) in &mut brighter.channels {
        if let ("R" | "G" | "B", FlatSamples::F32(values)) = (name.as_str(), samples) {
            values.iter_mut().for_each(|value| *value *= 3.0);
        }
    }
    let words = ["is not of one picture", "by colour they differ at"];
    place.refuses(brighter, PICTURE.size, &words);
}

#[test]
fn samples_that_would_count_twice() {
    let place = Place::new();
    let first = place.passes[0].clone();
    place
        .merge(&[&first], &[])
        .exits_with(2)
        .complains_about(&["1.exr", "are one file: its samples would count twice"]);
    fs::copy(&first, place.path("copy.exr")).unwrap();
    place
        .merge(&[&place.path("copy.exr")], &[])
        .exits_with(3)
        .complains_about(&["1.exr", "copy.exr", "hold the same pixels"]);
    // the same samples, stored in another way
    let again = PICTURE.part(|_| (0..4).collect());
    let again = again.stored(Compression::PIZ, Blocks::Tiles(Vec2(16, 16)));
    place.refuses(again, PICTURE.size, &["hold the same pixels", "1.exr"]);
    place.merge(&[], &[]).succeeds();
    fs::rename(place.path("all.exr"), place.path("two.exr")).unwrap();
    place
        .merge_only(&[&place.path("two.exr"), &first], &[])
        .exits_with(3)
        .complains_about(&["two.exr", "1.exr", "have a pass in common"]);
    place.has_no_output();
}

#[test]
fn passes_that_do_not_say_how_many_samples_they_have() {
    let place = Place::new();
    let (a, b) = (place.path("a.exr"), place.path("b.exr"));
    for (path, seed) in [(&a, 1), (&b, 7)] {
        let channels = ["R", "G", "B"].into_iter().zip(seed..);
        let channels = channels.map(|(name, seed)| float(name, PICTURE.pixels(), seed));
        write(path, PICTURE.size, vec![part(channels.collect())]);
    }
    place
        .merge_only(&[&a, &b], &[])
        .exits_with(3)
        .complains_about(&["does not state the samples per pixel", "--spp N"]);
    place.merge_only(&[&a, &b], &["--spp", "4"]).succeeds();
}

#[test]
fn an_output_that_cannot_be_one() {
    let place = Place::new();
    let (first, second) = (&place.passes[0], &place.passes[1]);
    let merge = |output: &Path| {
        let words = [Path::new("merge"), first, second, Path::new("-o"), output];
        linpred(words).exits_with(2)
    };
    merge(second).complains_about(&["the output", "is the input"]);
    merge(&place.path("all.png")).complains_about(&["call it", "all.exr"]);
    linpred(["merge", "-o", "all.exr"]).exits_with(2);
}

#[test]
fn a_merge_uses_no_more_memory_than_planned() {
    let place = Place::new();
    let size = (8192, 40);
    let wide = Picture { size, scene: 1 };
    for compression in [Compression::ZIP16, Compression::PIZ] {
        let mut paths = Vec::new();
        for n in 0..3 {
            let path = place.path(&format!("wide{n}.exr"));
            let mut channels = colour(wide.pixels());
            for (component, k) in ["X", "Y", "Z"].into_iter().zip(n * 20 + 9..) {
                channels.push(float(&format!("N.{component}"), wide.pixels(), k));
            }
            for (k, (_, samples)) in (n * 20..).zip(&mut channels) {
                *samples = float("", wide.pixels(), k).1;
            }
            let part = part(channels).stored(compression, Blocks::ScanLines);
            write(&path, size, vec![part]);
            paths.push(path);
        }
        let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
        let options = ["--spp", "2", "--log-format", "json"];
        let dry = place.merge_only(&paths, &["--spp", "2", "--dry-run"]);
        let planned = dry.succeeds().planned_bytes();
        let ran = place.merge_only(&paths, &options).succeeds();
        let log = ran.stderr();
        let line = log.lines().find(|line| line.contains("\"merged\""));
        let json: serde_json::Value = serde_json::from_str(line.unwrap()).unwrap();
        let Some(peak) = json["peak_bytes"].as_u64() else {
            assert!(!Path::new("/proc/self/status").exists(), "{json}");
            println!("this system does not tell the peak of a process's memory: not compared");
            return;
        };
        println!("{compression}: {peak} of {planned}");
        assert!(
            peak <= planned && planned <= 2 * peak,
            "{compression}: {peak} of {planned}"
        );
        let limit = (planned - (1 << 20)).to_string();
        let tight = place.merge_only(&paths, &["--spp", "2", "--max-memory", &limit]);
        tight.exits_with(4).complains_about(&["--max-memory is"]);
    }
}
