//! Every bad input ends in a sentence that names what is wrong, and in its exit code; nothing half-written is left behind.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use linpred::exr_file::attributes::RawHeader;
use linpred_tests::command::{Ran, denoise_file, linpred, linpred_path};
use linpred_tests::images::{colour, everything, float, half, part, uint, write};

const SIZE: (usize, usize) = (40, 48);
const PIXELS: usize = SIZE.0 * SIZE.1;

/// A folder with a good image in it.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        let place = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        write(&place.input(), SIZE, vec![part(everything(PIXELS))]);
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn input(&self) -> PathBuf {
        self.path("in.exr")
    }

    /// Denoises the input; whatever happens, no part of an output may remain.
    fn denoise(&self, options: &[&str]) -> Ran {
        self.denoise_to(&self.path("out.exr"), options)
    }

    fn denoise_to(&self, output: &Path, options: &[&str]) -> Ran {
        let ran = denoise_file(&self.input(), output, options);
        let left: Vec<_> = fs::read_dir(self.folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| name.ends_with(".part"))
            .collect();
        assert!(left.is_empty(), "left behind: {left:?}");
        ran
    }

    /// Changes the header of the input; the offsets that follow it stay what they were.
    fn patch_header(&self, change: impl FnOnce(&mut RawHeader)) {
        let bytes = fs::read(self.input()).unwrap();
        let mut header = RawHeader::parse(&bytes).unwrap().unwrap();
        let rest = &bytes[header.length..];
        change(&mut header);
        let mut patched = RawHeader::encode(header.version, &header.parts);
        patched.extend_from_slice(rest);
        fs::write(self.input(), patched).unwrap();
    }
}

#[test]
fn a_file_that_is_not_there() {
    let place = Place::new();
    fs::remove_file(place.input()).unwrap();
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["in.exr", "No such file"]);
}

#[test]
fn a_file_that_is_not_an_exr() {
    let place = Place::new();
    fs::write(place.input(), "this is a text, not a picture").unwrap();
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["in.exr", "not an EXR file"]);
}

#[test]
fn an_empty_file() {
    let place = Place::new();
    fs::write(place.input(), "").unwrap();
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["in.exr", "empty"]);
}

#[test]
fn a_folder() {
    let place = Place::new();
    fs::remove_file(place.input()).unwrap();
    fs::create_dir(place.input()).unwrap();
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["in.exr", "not a regular file"]);
}

#[test]
fn a_file_cut_off_anywhere() {
    let place = Place::new();
    let whole = fs::read(place.input()).unwrap();
    let header = RawHeader::parse(&whole).unwrap().unwrap().length;
    for (length, words) in [
        (header / 2, "truncated inside the header"),
        (header + 9, "truncated inside the offset tables"),
        (whole.len() - 1, "rows 32 to 47"),
        (whole.len() / 2, "rows 16 to 31"),
    ] {
        fs::write(place.input(), &whole[..length]).unwrap();
        place
            .denoise(&[])
            .exits_with(3)
            .complains_about(&["in.exr", words]);
        assert!(!place.path("out.exr").exists());
    }
}

#[test]
fn an_offset_that_was_never_filled_in() {
    let place = Place::new();
    let mut bytes = fs::read(place.input()).unwrap();
    let header = RawHeader::parse(&bytes).unwrap().unwrap().length;
    bytes[header + 8..header + 16].fill(0);
    fs::write(place.input(), bytes).unwrap();
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["part 0", "rows 16 to 31", "never written"]);
}

#[test]
fn offsets_that_point_to_another_block_or_nowhere() {
    let place = Place::new();
    let good = fs::read(place.input()).unwrap();
    let header = RawHeader::parse(&good).unwrap().unwrap().length;
    let mut swapped = good.clone();
    swapped.copy_within(header..header + 8, header + 8);
    fs::write(place.input(), swapped).unwrap();
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["rows 16 to 31", "not where the offset table says"]);
    let mut beyond = good;
    beyond[header..header + 8].copy_from_slice(&u64::MAX.to_le_bytes());
    fs::write(place.input(), beyond).unwrap();
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["rows 0 to 15", "beyond the end"]);
}

#[test]
fn compressed_data_that_is_not() {
    let place = Place::new();
    let mut bytes = fs::read(place.input()).unwrap();
    let end = bytes.len();
    bytes[end - 600..].fill(0x55);
    fs::write(place.input(), bytes).unwrap();
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["in.exr", "part 0", "rows 32 to 47", "ZIP"]);
}

/// A few changed bytes once made the decoder ask the system for terabytes, which ended the process without a word.
#[test]
fn a_dwa_block_that_announces_terabytes() {
    let place = Place::new();
    let mut image = part(everything(PIXELS));
    image.encoding.compression = exr::prelude::Compression::DWAA(None);
    write(&place.input(), SIZE, vec![image]);
    let good = fs::read(place.input()).unwrap();
    let header = RawHeader::parse(&good).unwrap().unwrap().length;
    let offset = u64::from_le_bytes(good[header..header + 8].try_into().unwrap()) as usize;
    for counter in [1, 6, 7, 8, 9] {
        let mut bytes = good.clone();
        // behind the block's row and length, the sixth byte of the counter
        bytes[offset + 8 + counter * 8 + 5] = 1;
        fs::write(place.input(), bytes).unwrap();
        place
            .denoise(&[])
            .exits_with(3)
            .complains_about(&["rows 0 to 31", "announces more data"]);
    }
}

#[test]
fn a_colour_that_is_missing() {
    let place = Place::new();
    write(
        &place.input(),
        SIZE,
        vec![part(vec![float("R", PIXELS, 1), float("G", PIXELS, 2)])],
    );
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["no colour channels (R G B)", "\"G\" \"R\""]);
}

#[test]
fn a_colour_that_may_be_one_of_several() {
    let place = Place::new();
    let channels = ["key", "fill"]
        .iter()
        .flat_map(|layer| ["R", "G", "B"].map(|c| half(&format!("{layer}.{c}"), PIXELS, 1)));
    write(&place.input(), SIZE, vec![part(channels.collect())]);
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["\"fill\", \"key\"", "--map colour="]);
    place.denoise(&["--map", "colour=key"]).succeeds();
}

#[test]
fn a_colour_of_integers() {
    let place = Place::new();
    write(
        &place.input(),
        SIZE,
        vec![part(["R", "G", "B"].map(|c| uint(c, PIXELS)).to_vec())],
    );
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["part 0", "channel \"B\"", "integers"]);
}

#[test]
fn halves_of_different_sizes() {
    let place = Place::new();
    let other = place.path("other.exr");
    write(
        &other,
        (SIZE.0 - 1, SIZE.1),
        vec![part(colour((SIZE.0 - 1) * SIZE.1))],
    );
    place
        .denoise(&["--other-half", other.to_str().unwrap()])
        .exits_with(3)
        .complains_about(&["other.exr", "channel \"R\"", "data window"]);
}

#[test]
fn halves_that_are_the_same_file() {
    let place = Place::new();
    let input = place.input();
    place
        .denoise(&["--other-half", input.to_str().unwrap()])
        .exits_with(2)
        .complains_about(&["itself"]);
}

#[test]
fn deep_data() {
    let place = Place::new();
    place.patch_header(|header| {
        header.version |= 1 << 11;
        header.parts[0].set("type", "string", b"deepscanline".to_vec());
        header.parts[0].set("compression", "compression", vec![2]);
    });
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["in.exr", "part 0", "deep"]);
}

#[test]
fn subsampled_channels() {
    let place = Place::new();
    place.patch_header(|header| {
        let mut list = header.parts[0]
            .value("channels", "chlist")
            .unwrap()
            .to_vec();
        // the first channel is "A": name, zero, type, linearity and padding, then the two samplings
        list[10..14].copy_from_slice(&2_i32.to_le_bytes());
        header.parts[0].set("channels", "chlist", list);
    });
    place
        .denoise(&[])
        .exits_with(3)
        .complains_about(&["part 0", "channel \"A\"", "subsampled"]);
}

#[test]
fn a_header_that_asks_for_more_memory_than_the_budget() {
    let place = Place::new();
    place
        .denoise(&["--max-memory", "100K"])
        .exits_with(4)
        .complains_about(&["--max-memory is 0.1 MiB", "most of it is"]);
    place.patch_header(|header| {
        let window: Vec<u8> = [0, 0, 1 << 29, 47]
            .iter()
            .flat_map(|v: &i32| v.to_le_bytes())
            .collect();
        header.parts[0].set("dataWindow", "box2i", window);
    });
    place
        .denoise(&[])
        .exits_with(4)
        .complains_about(&["memory", "MiB"]);
}

#[test]
fn an_output_that_is_the_input_under_any_name() {
    let place = Place::new();
    let before = fs::read(place.input()).unwrap();
    let input = place.input();
    place
        .denoise_to(&input, &[])
        .exits_with(2)
        .complains_about(&["is the input"]);
    fs::hard_link(&input, place.path("hard.exr")).unwrap();
    place
        .denoise_to(&place.path("hard.exr"), &[])
        .exits_with(2)
        .complains_about(&["hard.exr"]);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&input, place.path("soft.exr")).unwrap();
        place
            .denoise_to(&place.path("soft.exr"), &[])
            .exits_with(2)
            .complains_about(&["soft.exr"]);
    }
    assert_eq!(fs::read(input).unwrap(), before);
}

#[test]
fn an_output_that_cannot_be_written() {
    let place = Place::new();
    place
        .denoise_to(&place.path("no/such/folder/out.exr"), &[])
        .exits_with(1)
        .complains_about(&["cannot write", "no/such/folder/out.exr"]);
    fs::create_dir(place.path("folder.exr")).unwrap();
    place
        .denoise_to(&place.path("folder.exr"), &[])
        .exits_with(2)
        .complains_about(&["not a file"]);
}

#[test]
fn a_full_disk() {
    let place = Place::new();
    let (small, input) = (place.path("small"), place.input());
    fs::create_dir(&small).unwrap();
    let script = "mount -t tmpfs -o size=16k none \"$1\" || exit 99\n\"$2\" denoise \"$3\" -o \"$1/out.exr\"\ncode=$?\nls \"$1\"\nexit $code";
    let ran = std::process::Command::new("unshare")
        .args([
            "--user",
            "--map-root-user",
            "--mount",
            "sh",
            "-c",
            script,
            "sh",
        ])
        .args([&small, linpred_path(), &input])
        .output();
    let Ok(ran) = ran
        .map_err(|error| error.to_string())
        .and_then(|ran| match ran.status.code() {
            Some(code @ (0..=4)) if !String::from_utf8_lossy(&ran.stderr).contains("unshare:") => {
                Ok((code, ran))
            }
            _ => Err(String::from_utf8_lossy(&ran.stderr).into_owned()),
        })
    else {
        // not eprintln: the harness would hide it
        writeln!(
            std::io::stderr(),
            "NOT TESTED: this machine lets no test mount a small disk (unshare, tmpfs)"
        )
        .unwrap();
        return;
    };
    let (code, ran) = ran;
    let stderr = String::from_utf8_lossy(&ran.stderr);
    assert_eq!(code, 1, "{stderr}");
    assert!(
        stderr.contains("out.exr: No space left on device"),
        "{stderr}"
    );
    assert_eq!(ran.stdout, b"", "left behind");
}

#[test]
fn an_output_that_another_process_is_writing() {
    let place = Place::new();
    let unfinished = place.path("out.exr.part");
    let held = fs::File::create(&unfinished).unwrap();
    held.lock().unwrap();
    let (input, output) = (place.input(), place.path("out.exr"));
    linpred([Path::new("denoise"), &input, Path::new("-o"), &output])
        .exits_with(1)
        .complains_about(&["out.exr", "another process is writing it"]);
    assert!(unfinished.exists() && !output.exists());
    // the lock dies with its process: what a killed job left is replaced (not by closing alone: a child that another test is
    // starting may hold a copy of the handle)
    held.unlock().unwrap();
    place.denoise(&[]).succeeds();
    assert!(output.exists());
}

#[test]
fn second_moments_in_half_precision_and_those_without_a_sample_count() {
    let place = Place::new();
    let mut channels = colour(PIXELS);
    channels.extend(["R", "G", "B"].map(|c| half(&format!("m2.{c}"), PIXELS, 7)));
    write(&place.input(), SIZE, vec![part(channels)]);
    let map = ["--map", "second-moment=m2"];
    place
        .denoise(&[&map[..], &["--spp", "8"]].concat())
        .exits_with(3)
        .complains_about(&["\"m2.R\"", "half precision", "--map variance=none"]);
    let mut channels = colour(PIXELS);
    channels.extend(["R", "G", "B"].map(|c| float(&format!("m2.{c}"), PIXELS, 7)));
    write(&place.input(), SIZE, vec![part(channels)]);
    place
        .denoise(&map)
        .exits_with(3)
        .complains_about(&["\"m2.R\"", "--spp N"]);
    place
        .denoise(&[&map[..], &["--spp", "8"]].concat())
        .succeeds();
}

#[test]
fn a_map_that_names_nothing() {
    let place = Place::new();
    place
        .denoise(&["--map", "albedo=kd"])
        .exits_with(2)
        .complains_about(&["--map albedo=kd", "\"albedo.R\""]);
    place
        .denoise(&["--map", "albdo=kd"])
        .exits_with(2)
        .complains_about(&["role=channel", "albedo"]);
    place
        .denoise(&["--layers", "nothing*"])
        .exits_with(2)
        .complains_about(&["--layers nothing*"]);
}
