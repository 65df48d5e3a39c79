//! `linpred compare` computes the figures that its help promises.

use std::path::Path;

use exr::prelude::FlatSamples;
use linpred_tests::command::{Ran, linpred};
use linpred_tests::images::{NamedSamples, colour, constant, float, noise, part, write};
use serde_json::Value;

pub(super) type Size = (usize, usize);

const SIZE: Size = (31, 17);
const PIXELS: usize = SIZE.0 * SIZE.1;

/// Three channels, row by row.
pub(super) type Planes = [Vec<f32>; 3];

pub(super) fn planes(size: Size, value: impl Fn(usize, usize, usize) -> f32) -> Planes {
    [0, 1, 2].map(|k| {
        let pixels = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
        pixels.map(|(x, y)| value(k, x, y)).collect()
    })
}

pub(super) fn channels(planes: &Planes) -> Vec<NamedSamples> {
    let named = ["R", "G", "B"].into_iter().zip(planes);
    named
        .map(|(name, plane)| (name.into(), FlatSamples::F32(plane.clone())))
        .collect()
}

/// Noise with specks of both kinds, of every strength so that many are near the bounds of what counts as one, and a dark corner.
fn render(size: Size, seed: u32) -> Planes {
    planes(size, |k, x, y| {
        let i = y * size.0 + x;
        let strength = noise(seed + 1, i);
        let light = match noise(seed, i) {
            high if high > 0.85 => 1.0 + 5.0 * strength,
            low if low < 0.15 => 0.7 * strength,
            _ => 0.6 + 0.6 * noise(seed + 3, i / 3),
        };
        let dark = x < size.0 / 3 && y < size.1 / 2;
        light * (0.8 + 0.1 * k as f32) * if dark { 0.01 } else { 1.0 }
    })
}

/// Smoother than [`render`], and here and there as dark as its pinholes.
fn truth(size: Size) -> Planes {
    planes(size, |k, x, y| {
        let wave = (x as f32 * 0.37).sin() * (y as f32 * 0.21).cos();
        0.75 + 0.7 * wave + 0.05 * k as f32 + if (x + 2 * y) % 53 == 0 { 6.0 } else { 0.0 }
    })
}

pub(super) struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    /// a.exr, f.exr and, if there is one, in.exr.
    pub(super) fn new(
        size: Size,
        a: Vec<NamedSamples>,
        f: Vec<NamedSamples>,
        input: Option<&Planes>,
    ) -> Self {
        let files = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        write(&files.path("a.exr"), size, vec![part(a)]);
        write(&files.path("f.exr"), size, vec![part(f)]);
        if let Some(input) = input {
            write(&files.path("in.exr"), size, vec![part(channels(input))]);
        }
        files
    }

    pub(super) fn path(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join(name)
    }

    pub(super) fn run(&self, options: &[&str]) -> Ran {
        let mut arguments = vec!["compare".into(), self.path("a.exr"), self.path("f.exr")];
        arguments.extend(options.iter().map(|&option| match option.split_once('.') {
            // a file of this folder
            Some((_, "exr" | "png")) => self.path(option),
            _ => option.into(),
        }));
        linpred(arguments)
    }

    pub(super) fn json(&self, options: &[&str]) -> Value {
        let options = [options, &["--json"]].concat();
        serde_json::from_str(&self.run(&options).succeeds().stdout()).unwrap()
    }
}

fn compare(a: Vec<NamedSamples>, f: Vec<NamedSamples>) -> Value {
    Files::new(SIZE, a, f, None).json(&[])
}

#[track_caller]
fn assert_close(actual: &Value, expected: f64) {
    let actual = actual.as_f64().expect("a number");
    assert!(
        (actual - expected).abs() <= 1e-9 * expected.abs().max(1e-3),
        "{actual} {expected}"
    );
}

/// The measures, from their definitions.
struct Definition<'a> {
    size: Size,
    a: &'a Planes,
    f: &'a Planes,
    variance: f64,
}

impl Definition<'_> {
    /// The mean of a function of each sample of both images.
    fn mean(&self, of: impl Fn(f64, f64) -> f64) -> f64 {
        let pairs = self.a.iter().flatten().zip(self.f.iter().flatten());
        let finite = pairs.filter(|(a, f)| a.is_finite() && f.is_finite());
        mean(finite.map(|(&a, &f)| of(f64::from(a), f64::from(f))))
    }

    fn figures(&self) -> Vec<(&'static str, f64)> {
        let srgb = |x: f64| match x.clamp(0.0, 1.0) {
            x if x <= 0.0031308 => 12.92 * x,
            x => 1.055 * x.powf(1.0 / 2.4) - 0.055,
        };
        let relative = |a: f64, f: f64| ((a - f).powi(2) - self.variance) / (f * f + 0.01);
        let tonemapped = self.mean(|a, f| (srgb(a) - srgb(f)).powi(2));
        let local = self.local();
        let off = local.iter().map(|b| f64::from(u8::from(b.abs() > 0.05)));
        vec![
            ("rmse", self.mean(relative)),
            ("mse", self.mean(|a, f| (a - f).powi(2))),
            ("psnr", -10.0 * tonemapped.max(1e-12).log10()),
            ("mean", self.mean(|a, _| a)),
            ("energy", self.mean(|a, _| a) / self.mean(|_, f| f)),
            ("bias", mean(local.iter().copied())),
            ("off5", mean(off)),
            ("top1", self.top1()),
            (
                "pinholes",
                self.specks(|p, m, low, _| p < 0.4 * m && p < 0.5 * low),
            ),
            (
                "sparks",
                self.specks(|p, m, _, high| p > 2.5 * m && p > 2.0 * high),
            ),
        ]
    }

    fn luminance(&self, planes: &Planes, x: usize, y: usize) -> f64 {
        let i = y * self.size.0 + x;
        let [r, g, b] = [0, 1, 2].map(|k| f64::from(planes[k][i]));
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    /// The luminances of both images within `radius` of a pixel, mirrored at the borders, where both are finite.
    fn around(&self, x: usize, y: usize, radius: isize) -> Vec<(f64, f64)> {
        let (mut pairs, (w, h)) = (Vec::new(), self.size);
        for v in y as isize - radius..=y as isize + radius {
            for u in x as isize - radius..=x as isize + radius {
                let (u, v) = (mirrored(u, w), mirrored(v, h));
                pairs.push((self.luminance(self.a, u, v), self.luminance(self.f, u, v)));
            }
        }
        pairs.retain(|(a, f)| a.is_finite() && f.is_finite());
        pairs
    }

    /// Every pixel that is finite in both images.
    fn pixels(&self) -> Vec<(usize, usize)> {
        let all = (0..self.size.1).flat_map(|y| (0..self.size.0).map(move |x| (x, y)));
        all.filter(|&(x, y)| !self.around(x, y, 0).is_empty())
            .collect()
    }

    fn local(&self) -> Vec<f64> {
        let pixels = self.pixels().into_iter();
        let boxes = pixels.map(|(x, y)| self.around(x, y, 8));
        let means = boxes.map(|b| (mean(b.iter().map(|p| p.0)), mean(b.iter().map(|p| p.1))));
        means.map(|(a, f)| (a - f) / (f + 0.01)).collect()
    }

    /// Luminances of the reference where it is finite, in order.
    fn sorted_reference(&self) -> Vec<f64> {
        let all = (0..self.size.1).flat_map(|y| (0..self.size.0).map(move |x| (x, y)));
        let all = all.map(|(x, y)| self.luminance(self.f, x, y));
        let mut all: Vec<f64> = all.filter(|f| f.is_finite()).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    fn top1(&self) -> f64 {
        let sorted = self.sorted_reference();
        let position = 0.99 * (sorted.len() - 1) as f64;
        let (low, high) = (
            sorted[position.floor() as usize],
            sorted[position.ceil() as usize],
        );
        let least = low + (high - low) * position.fract();
        let pixels = self.pixels().into_iter();
        let pairs = pixels.map(|(x, y)| self.around(x, y, 0)[0]);
        let bright: Vec<(f64, f64)> = pairs.filter(|pair| pair.1 >= least).collect();
        mean(bright.iter().map(|p| p.0)) / mean(bright.iter().map(|p| p.1))
    }

    /// Specks per megapixel: `is` one by the pixel, the median, the darkest and the brightest.
    fn specks(&self, is: impl Fn(f64, f64, f64, f64) -> bool) -> f64 {
        let level = 0.02 * mean(self.sorted_reference().into_iter());
        let speck = |&(x, y): &(usize, usize)| {
            let mut medians: Vec<f64> = self.around(x, y, 2).iter().map(|p| p.0).collect();
            medians.sort_by(f64::total_cmp);
            let n = medians.len();
            let median = (medians[n / 2] + medians[(n - 1) / 2]) / 2.0;
            let reference = self.around(x, y, 1);
            let low = reference.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
            let high = reference.iter().map(|p| p.1).fold(0.0, f64::max);
            let pixel = self.around(x, y, 0)[0].0;
            is(pixel + level, median + level, low + level, high + level)
        };
        let pixels = self.pixels();
        pixels.iter().filter(|at| speck(at)).count() as f64 / pixels.len() as f64 * 1e6
    }

    #[track_caller]
    fn assert(&self, figures: &Value) {
        for (name, expected) in self.figures() {
            println!("{:?} {name}: {} {expected}", self.size, figures[name]);
            assert_close(&figures[name], expected);
        }
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    sum / count
}

/// Mirrored at both ends with the ends repeated, one step at a time.
fn mirrored(mut position: isize, length: usize) -> usize {
    let length = length as isize;
    while !(0..length).contains(&position) {
        position = if position < 0 {
            -1 - position
        } else {
            2 * length - 1 - position
        };
    }
    position as usize
}

#[test]
fn every_figure_is_as_defined_at_every_size() {
    let sizes = [(61, 47), SIZE, (16, 40), (40, 9), (3, 2), (1, 7), (1, 1)];
    let mut specks = [0.0, 0.0];
    for size in sizes {
        let (a, f) = (render(size, 5), truth(size));
        let figures = Files::new(size, channels(&a), channels(&f), None).json(&[]);
        let variance = 0.0;
        let definition = Definition {
            size,
            a: &a,
            f: &f,
            variance,
        };
        definition.assert(&figures);
        assert_close(&figures["reference_mean"], definition.mean(|_, f| f));
        for (sum, name) in specks.iter_mut().zip(["pinholes", "sparks"]) {
            *sum += figures[name].as_f64().unwrap();
        }
    }
    assert!(specks.iter().all(|&specks| specks > 1000.0), "{specks:?}");
}

#[test]
fn the_references_own_variance_is_taken_off() {
    let (a, f) = (render(SIZE, 7), truth(SIZE));
    let mut reference = channels(&f);
    reference.extend(["R", "G", "B"].map(|c| constant(&format!("variance.{c}"), PIXELS, 0.015625)));
    let figures = compare(channels(&a), reference);
    let variance = 0.015625;
    let definition = Definition {
        size: SIZE,
        a: &a,
        f: &f,
        variance,
    };
    definition.assert(&figures);
    assert_eq!(figures["reference_has_variance"], true);
}

#[test]
fn the_input_is_measured_like_the_image_and_the_gain_is_between_them() {
    let (a, f, input) = (render(SIZE, 7), truth(SIZE), render(SIZE, 50));
    let files = Files::new(SIZE, channels(&a), channels(&f), Some(&input));
    let figures = files.json(&["--input", "in.exr"]);
    let variance = 0.0;
    let definition = |a| Definition {
        size: SIZE,
        a,
        f: &f,
        variance,
    };
    definition(&a).assert(&figures);
    definition(&input).assert(&figures["input"]);
    assert!(figures["input"]["flip"].is_f64(), "{figures}");
    let rmse = |of: &Value| of["rmse"].as_f64().unwrap();
    assert_close(&figures["gain"], rmse(&figures["input"]) / rmse(&figures));
    let text = files.run(&["--input", "in.exr"]).succeeds().stdout();
    let (table, rest) = text.split_once("\ngain").expect("a gain");
    let (heading, lines) = table.split_once('\n').expect("a heading");
    assert!(heading.ends_with("image         input"), "{heading}");
    for line in lines.lines() {
        // a name of up to 10 letters, then a number in each column
        let numbers = [&line[10..24], &line[24..38]];
        let numbers = numbers.map(|number| number.trim().parse::<f64>());
        assert!(numbers.iter().all(Result::is_ok), "{line}");
    }
    let own = format!("{:.6}", definition(&a).mean(|_, f| f));
    assert!(
        rest.contains(&format!("the reference's mean radiance: {own}\n")),
        "{rest}"
    );
    let alone = files.run(&[]).succeeds().stdout();
    assert!(
        !alone.contains("input") && !alone.contains("gain"),
        "{alone}"
    );
}

#[test]
fn the_worst_pixel_is_where_it_was_put_and_what_is_not_a_number_is_counted() {
    let mut image = colour(PIXELS);
    let at = |value: f32, here: bool, other: f32| if here { value } else { other };
    let channel = |name: &str, value: &dyn Fn(usize) -> f32| -> NamedSamples {
        (
            name.into(),
            FlatSamples::F32((0..PIXELS).map(value).collect()),
        )
    };
    image[0] = channel("R", &|i| at(40.0, i == 5 * SIZE.0 + 7, noise(1, i)));
    image[1] = channel("G", &|i| at(f32::NAN, i < 3, noise(2, i)));
    let figures = compare(image, colour(PIXELS));
    assert_eq!(
        (&figures["worst"][0]["x"], &figures["worst"][0]["y"]),
        (&7.into(), &5.into())
    );
    assert_eq!(
        (
            &figures["worst_places"][0]["x"],
            &figures["worst_places"][0]["width"]
        ),
        (&0.into(), &31.into())
    );
    assert_eq!(figures["non_finite"], 3);
}

#[test]
fn pixels_that_are_not_finite_take_part_in_no_figure() {
    let (mut a, mut f) = (render(SIZE, 7), truth(SIZE));
    // so many that medians and boxes of any number of pixels are taken
    let missing: Vec<usize> = (0..PIXELS).filter(|&i| noise(90, i) < 0.2).collect();
    for (&i, value) in missing.iter().zip([f32::NAN, f32::INFINITY].iter().cycle()) {
        a[1][i] = *value;
    }
    f[2][12 * SIZE.0 + 20] = f32::NEG_INFINITY;
    let figures = compare(channels(&a), channels(&f));
    let variance = 0.0;
    Definition {
        size: SIZE,
        a: &a,
        f: &f,
        variance,
    }
    .assert(&figures);
    assert_eq!(figures["non_finite"], missing.len() + 1);
    let nothing = planes(SIZE, |_, _, _| f32::NAN);
    let figures = compare(channels(&nothing), channels(&f));
    assert_eq!(figures["non_finite"], 3 * PIXELS);
    assert!(figures["rmse"].is_null() && figures["bias"].is_null());
}

#[test]
fn images_of_different_sizes_are_refused_with_both_sizes() {
    let files = Files::new(SIZE, colour(PIXELS), colour(PIXELS), None);
    let other = |size: Size| vec![part(colour(size.0 * size.1))];
    write(&files.path("in.exr"), (30, 17), other((30, 17)));
    files
        .run(&["--input", "in.exr"])
        .exits_with(3)
        .complains_about(&["in.exr is 30 x 17 pixels", "f.exr is 31 x 17"]);
    write(&files.path("f.exr"), (31, 16), other((31, 16)));
    files
        .run(&[])
        .exits_with(3)
        .complains_about(&["31 x 17", "31 x 16"]);
}

#[test]
fn what_takes_more_memory_than_it_may_is_refused_before_anything_is_written() {
    let files = Files::new(SIZE, colour(PIXELS), colour(PIXELS), None);
    files
        .run(&["--max-memory", "11M", "--picture", "seen.png"])
        .exits_with(4)
        .complains_about(&["--max-memory is 11.0 MiB"]);
    let left = std::fs::read_dir(files.folder.path()).unwrap().count();
    assert_eq!(left, 2, "the two images");
    files
        .run(&["--max-memory", "16M", "--picture", "seen.png"])
        .succeeds();
}

#[test]
fn the_heatmap_is_a_picture_of_the_images_size() {
    let other = (7..).zip(["R", "G", "B"]);
    let other = other
        .map(|(seed, name)| float(name, PIXELS, seed))
        .collect();
    let files = Files::new(SIZE, colour(PIXELS), other, None);
    files.run(&["--heatmap", "heat.png"]).succeeds();
    assert_eq!(Picture::read(&files.path("heat.png")).size, SIZE);
}

struct Picture {
    size: Size,
    pixels: Vec<u8>,
}

impl Picture {
    fn read(path: &Path) -> Self {
        let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut pixels).unwrap();
        Self {
            size: (frame.width as usize, frame.height as usize),
            pixels,
        }
    }

    fn at(&self, x: usize, y: usize) -> [u8; 3] {
        let start = 3 * (y * self.size.0 + x);
        [0, 1, 2].map(|k| self.pixels[start + k])
    }
}

const GREY: [u8; 3] = [96; 3];

/// An image of one colour, `odd` at one pixel.
fn flat(size: Size, value: f32, at: (usize, usize), odd: f32) -> Planes {
    planes(size, |_, x, y| if (x, y) == at { odd } else { value })
}

#[test]
fn the_picture_shows_input_image_reference_error_and_the_worst_places() {
    let size = (200, 70);
    let at = (70, 40);
    let a = flat(size, 0.5, at, 1.0);
    let f = flat(size, 0.5, at, 0.0);
    let input = flat(size, 2.0, at, f32::NAN);
    let files = Files::new(size, channels(&a), channels(&f), Some(&input));
    files
        .run(&["--input", "in.exr", "--picture", "seen.png"])
        .succeeds();
    let picture = Picture::read(&files.path("seen.png"));
    // four images of 200 and three gaps of 4; two places of 3 x 128 + 2 x 4 beside each other, 16 apart
    assert_eq!(picture.size, (812, 70 + 3 * (16 + 128)));
    let half = [188; 3];
    let (white, black, cyan) = ([255; 3], [0; 3], [0, 255, 255]);
    let panel = |i: usize, (x, y): (usize, usize)| picture.at(i * 204 + x, y);
    for (i, (usual, odd)) in [(white, cyan), (half, white), (half, black), (black, white)]
        .into_iter()
        .enumerate()
    {
        assert_eq!((panel(i, (0, 0)), panel(i, at)), (usual, odd), "panel {i}");
    }
    assert_eq!(picture.at(201, 3), GREY);
    // the worst place begins at (64, 32): the odd pixel is its (6, 8), and 4 x 4 pixels large
    for (i, (usual, odd)) in [(white, cyan), (half, white), (half, black)]
        .into_iter()
        .enumerate()
    {
        let place = |x: usize, y: usize| picture.at(i * 132 + x, 70 + 16 + y);
        assert_eq!((place(24, 32), place(27, 35)), (odd, odd), "panel {i}");
        assert_eq!((place(23, 32), place(28, 35)), (usual, usual), "panel {i}");
    }
    assert_eq!(picture.at(300, 70 + 8), GREY);
    let left = std::fs::read_dir(files.folder.path()).unwrap().count();
    assert_eq!(left, 4, "three images and a picture");
}

#[test]
fn a_picture_without_input_of_one_pixel_is_that_pixel_three_times_and_its_place() {
    let pixel = flat((1, 1), 0.5, (9, 9), 0.0);
    let files = Files::new((1, 1), channels(&pixel), channels(&pixel), None);
    files.run(&["--picture", "seen.png"]).succeeds();
    let picture = Picture::read(&files.path("seen.png"));
    assert_eq!(picture.size, (260, 1 + 16 + 128));
    let row = [0, 5, 10, 11].map(|x| picture.at(x, 0));
    assert_eq!(row, [[188; 3], [188; 3], [0; 3], GREY]);
    assert_eq!(
        [picture.at(3, 20), picture.at(4, 20), picture.at(132, 17)],
        [[188; 3], GREY, [188; 3]]
    );
}

#[test]
fn a_picture_that_fails_on_the_way_leaves_nothing_behind() {
    let files = Files::new(SIZE, colour(PIXELS), colour(PIXELS), None);
    let reference = std::fs::read(files.path("f.exr")).unwrap();
    std::fs::write(files.path("f.exr"), &reference[..reference.len() - 200]).unwrap();
    files.run(&["--picture", "seen.png"]).exits_with(3);
    files.run(&["--picture", "a.exr"]).exits_with(2);
    let left = std::fs::read_dir(files.folder.path()).unwrap().count();
    assert_eq!(left, 2, "the two images");
}

#[cfg(target_os = "linux")]
#[test]
fn figures_that_cannot_be_written_are_an_error_unless_nobody_reads_them() {
    let files = Files::new(SIZE, colour(PIXELS), colour(PIXELS), None);
    let compare = |out: std::process::Stdio| {
        let mut command = std::process::Command::new(linpred_tests::command::linpred_path());
        command
            .arg("compare")
            .args(["a.exr", "f.exr"].map(|name| files.path(name)));
        let ran = command.stdout(out).output().expect("linpred runs");
        (
            ran.status.code(),
            String::from_utf8_lossy(&ran.stderr).into_owned(),
        )
    };
    let full = std::fs::File::options().write(true).open("/dev/full");
    let (code, said) = compare(full.unwrap().into());
    assert_eq!(code, Some(1), "{said}");
    assert!(
        said.contains("cannot write to standard output: No space"),
        "{said}"
    );
    let (reader, closed) = std::io::pipe().unwrap();
    drop(reader);
    assert_eq!(compare(closed.into()), (Some(0), String::new()));
}
