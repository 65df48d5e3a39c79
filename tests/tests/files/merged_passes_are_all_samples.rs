//! Merged passes are what one render of all their samples would have been, whatever each pixel has of them in which pass.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use exr::prelude::*;
use linpred::channels::{Role, RoleRequest};
use linpred::exr_file::attributes::RawHeader;
use linpred::job::{Input, InputRequest, MergeRequest, Merged, Merging};
use linpred_tests::images::{
    NamedSamples, TestPart, bits, channel_names, constant, exponential, float, noise, part, read,
    values, write,
};
use linpred_tests::passes::{Picture, Statistics, layers};
use linpred_tests::tolerance::{MERGED_MEAN, MERGED_VARIANCE};

const PICTURE: Picture = Picture {
    size: (37, 34),
    scene: 1,
};

#[track_caller]
fn merge_with(roles: RoleRequest, passes: &[&Path], output: &Path) -> Merged {
    let request = MergeRequest::new(passes.iter().copied()).with_roles(roles);
    let merging = Merging::open(&request).unwrap();
    let mut rows = 0;
    let never = AtomicBool::new(false);
    let merged = merging.write(output, &never, &mut |done| rows = done);
    assert_eq!(rows, merging.height());
    merged.unwrap()
}

#[track_caller]
fn merge(passes: &[PathBuf], output: &Path) -> Merged {
    let passes: Vec<&Path> = passes.iter().map(PathBuf::as_path).collect();
    merge_with(RoleRequest::default(), &passes, output)
}

/// Samples that each of three passes has in a pixel: none, one, two, or more, in all combinations.
fn split(pixel: usize) -> [Vec<usize>; 3] {
    let mut first = 0;
    [pixel % 5, pixel / 5 % 4, pixel / 20 % 3 * 7].map(|count| {
        let taken = first..first + count;
        first += count;
        taken.collect()
    })
}

fn uneven_passes(folder: &Path) -> Vec<PathBuf> {
    (0..3)
        .map(|n| {
            let path = folder.join(format!("pass{n}.exr"));
            write(
                &path,
                PICTURE.size,
                vec![PICTURE.part(|pixel| split(pixel)[n].clone())],
            );
            path
        })
        .collect()
}

fn all(layer: usize, pixel: usize) -> Statistics {
    PICTURE.statistics(layer, pixel, &split(pixel).concat())
}

#[track_caller]
fn check(what: &str, found: f32, wanted: f64, tolerance: f64) {
    let found = f64::from(found);
    let near = (found - wanted).abs() <= tolerance * wanted.abs();
    assert!(
        near || (found.is_nan() && wanted.is_nan()),
        "{what}: {found} {wanted}"
    );
}

#[test]
fn merged_passes_have_the_statistics_of_all_their_samples() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("all.exr");
    let merged = merge(&uneven_passes(folder.path()), &output);
    for (layer, (name, noise)) in layers().enumerate() {
        let (means, variances) = (values(&output, name), values(&output, noise));
        for pixel in 0..PICTURE.pixels() {
            let wanted = all(layer, pixel);
            let what = format!("{name} of pixel {pixel}, {} samples", wanted.count);
            check(&what, means[pixel], wanted.mean, MERGED_MEAN);
            let of_mean = wanted.variance / wanted.count as f64;
            check(&what, variances[pixel], of_mean, MERGED_VARIANCE);
        }
    }
    let counts = (0..PICTURE.pixels()).map(|pixel| all(0, pixel).count as f32);
    assert_eq!(
        values(&output, "sampleCount"),
        counts.clone().collect::<Vec<f32>>()
    );
    assert_eq!((merged.passes, merged.pixels), (3, PICTURE.pixels() as u64));
    assert_eq!((merged.fewest, merged.most, merged.lost), (0.0, 21.0, 0));
    let mean = counts.sum::<f32>() / PICTURE.pixels() as f32;
    assert!((merged.samples - f64::from(mean)).abs() < 1e-5);
}

#[test]
fn the_order_of_the_passes_changes_no_byte() {
    let folder = tempfile::tempdir().unwrap();
    let mut passes = uneven_passes(folder.path());
    let output = folder.path().join("all.exr");
    let mut files = Vec::new();
    for _ in 0..3 {
        passes.rotate_left(1);
        for _ in 0..2 {
            passes.swap(0, 1);
            merge(&passes, &output);
            files.push(fs::read(&output).unwrap());
        }
    }
    assert!(files.iter().all(|file| *file == files[0]));
}

#[test]
fn merging_in_stages_differs_by_rounding() {
    let folder = tempfile::tempdir().unwrap();
    let passes = uneven_passes(folder.path());
    let path = |name: &str| folder.path().join(name);
    merge(&passes, &path("all.exr"));
    merge(&passes[..2], &path("two.exr"));
    merge(&[path("two.exr"), passes[2].clone()], &path("stages.exr"));
    assert_eq!(
        channel_names(&read(&path("all.exr")), 0),
        channel_names(&read(&path("stages.exr")), 0)
    );
    for name in channel_names(&read(&path("all.exr")), 0) {
        let pairs = values(&path("stages.exr"), &name);
        for (found, wanted) in pairs.into_iter().zip(values(&path("all.exr"), &name)) {
            check(&name, found, f64::from(wanted), MERGED_VARIANCE);
        }
    }
}

/// The colour of a renderer that states noise by its channels `noise`: `value` of what a pixel is.
fn renderer(
    noise: [&str; 3],
    first: usize,
    count: usize,
    value: fn(Statistics) -> f64,
) -> TestPart {
    let picture = PICTURE;
    let of = |layer, pixel| {
        let taken: Vec<usize> = (first..first + count).collect();
        picture.statistics(layer, pixel, &taken)
    };
    let plane = |name: &str, layer: usize, value: fn(Statistics) -> f64| {
        let values = (0..picture.pixels()).map(|pixel| value(of(layer, pixel)) as f32);
        (name.to_owned(), FlatSamples::F32(values.collect()))
    };
    let mut channels = Vec::new();
    for (layer, (name, noise)) in ["R", "G", "B"].into_iter().zip(noise).enumerate() {
        channels.push(plane(name, layer, |s| s.mean));
        channels.push(plane(noise, layer, value));
    }
    part(channels)
}

#[test]
fn the_variance_of_one_sample_stays_one_and_pbrt_is_still_known_by_its_sign() {
    let folder = tempfile::tempdir().unwrap();
    let noise = ["Variance.R", "Variance.G", "Variance.B"];
    let mut passes = Vec::new();
    for (name, first, count) in [("a.exr", 0, 8), ("b.exr", 8, 3)] {
        let mut part = renderer(noise, first, count, |s| s.variance);
        let stated = AttributeValue::I32(count as i32);
        part.attributes.push(("samplesPerPixel", stated));
        write(&folder.path().join(name), PICTURE.size, vec![part]);
        passes.push(folder.path().join(name));
    }
    let output = folder.path().join("all.exr");
    merge(&passes, &output);
    let taken: Vec<usize> = (0..11).collect();
    for (layer, name) in noise.into_iter().enumerate() {
        for (pixel, found) in values(&output, name).into_iter().enumerate() {
            let wanted = PICTURE.statistics(layer, pixel, &taken).variance;
            check(name, found, wanted, MERGED_VARIANCE);
        }
    }
    let input = Input::open(&InputRequest::new(&output)).unwrap();
    let variance = input.roles.assignment(Role::Variance).unwrap();
    assert!(
        variance.rule.starts_with("preset pbrt"),
        "{}",
        variance.rule
    );
    assert_eq!(
        input.roles.samples.unwrap().to_string(),
        "per pixel (channel \"sampleCount\")"
    );
    let header = RawHeader::parse(&fs::read(&output).unwrap())
        .unwrap()
        .unwrap();
    assert_eq!(header.parts[0].int("samplesPerPixel"), Some(11));
}

#[test]
fn second_moments_are_averaged() {
    let folder = tempfile::tempdir().unwrap();
    let noise = ["m2_R", "m2_G", "m2_B"];
    let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
    write(&a, PICTURE.size, vec![renderer(noise, 0, 8, |s| s.moment)]);
    write(&b, PICTURE.size, vec![renderer(noise, 8, 8, |s| s.moment)]);
    let roles = RoleRequest {
        spp: Some(8),
        ..RoleRequest::default()
    };
    let output = folder.path().join("all.exr");
    merge_with(roles, &[&a, &b], &output);
    let taken: Vec<usize> = (0..16).collect();
    for (layer, name) in noise.into_iter().enumerate() {
        for (pixel, found) in values(&output, name).into_iter().enumerate() {
            let wanted = PICTURE.statistics(layer, pixel, &taken).moment;
            check(name, found, wanted, MERGED_MEAN);
        }
    }
    assert_eq!(values(&output, "sampleCount"), vec![16.0; PICTURE.pixels()]);
}

/// Embarrassingly, an early version wrote a second channel of that name, which no reader takes.
#[test]
fn a_number_of_samples_that_is_asked_for_takes_the_place_of_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let passes = PICTURE.write_passes(folder.path(), &[3, 4]);
    let roles = RoleRequest {
        spp: Some(5),
        ..RoleRequest::default()
    };
    let output = folder.path().join("all.exr");
    merge_with(roles, &[&passes[0], &passes[1]], &output);
    assert_eq!(values(&output, "sampleCount"), vec![10.0; PICTURE.pixels()]);
    assert_eq!(
        channel_names(&read(&output), 0),
        channel_names(&read(&passes[0]), 0)
    );
}

/// A channel with another value in one pixel.
fn spoil(channels: &mut [NamedSamples], name: &str, pixel: usize, value: f32) {
    let channel = channels.iter_mut().find(|(own, _)| own == name);
    if let Some((_, FlatSamples::F32(values))) = channel {
        values[pixel] = value;
    }
}

#[test]
fn a_pixel_that_is_not_finite_takes_no_part_and_is_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
    let mut first = PICTURE.pass(|_| (0..4).collect());
    spoil(&mut first, "G", 5, f32::NAN);
    spoil(&mut first, "R", 6, f32::INFINITY);
    spoil(&mut first, "sampleCount", 7, f32::NAN);
    spoil(&mut first, "sampleCount", 8, -3.0);
    // the depth of what no ray hit: in one pass, and in both
    spoil(&mut first, "Z", 9, f32::INFINITY);
    spoil(&mut first, "Z", 10, f32::INFINITY);
    let mut second = PICTURE.pass(|_| (4..10).collect());
    spoil(&mut second, "Z", 10, f32::INFINITY);
    write(&a, PICTURE.size, vec![part(first)]);
    write(&b, PICTURE.size, vec![part(second)]);
    let output = folder.path().join("all.exr");
    let merged = merge(&[a, b.clone()], &output);
    assert_eq!(merged.lost, 4);
    let counts = values(&output, "sampleCount");
    assert_eq!(counts[4..10], [10.0, 6.0, 6.0, 6.0, 6.0, 10.0]);
    for name in ["R", "variance.G", "albedo.B", "Z"] {
        let (found, alone) = (values(&output, name), values(&b, name));
        for pixel in 5..9 {
            check(name, found[pixel], f64::from(alone[pixel]), MERGED_VARIANCE);
        }
    }
    let depth = values(&output, "Z");
    assert_eq!((depth[9], depth[10]), (values(&b, "Z")[9], f32::INFINITY));
}

#[test]
fn identifiers_are_those_of_the_pass_with_most_samples() {
    let folder = tempfile::tempdir().unwrap();
    let pixels = PICTURE.pixels();
    let counts = [
        |pixel: usize| 1 + pixel % 3,
        |pixel: usize| 1 + pixel / 3 % 3,
    ];
    let mut passes = Vec::new();
    for (n, count) in counts.iter().enumerate() {
        let mut channels = PICTURE.pass(|pixel| (4 * n..4 * n + count(pixel)).collect());
        // bits of hashes, among them those of NaN
        let hash = |i: usize| f32::from_bits(0x7fa0_0000 + (i * 2 + n) as u32);
        let hashes = FlatSamples::F32((0..pixels).map(hash).collect());
        channels.push(("CryptoObject00.r".into(), hashes));
        let numbers = (0..pixels).map(|i| 0x8000_0000 + (i * 2 + n) as u32);
        channels.push(("objectId".into(), FlatSamples::U32(numbers.collect())));
        let path = folder.path().join(format!("{n}.exr"));
        write(&path, PICTURE.size, vec![part(channels)]);
        passes.push(path);
    }
    let output = folder.path().join("all.exr");
    merge(&passes, &output);
    let merged = read(&output);
    for name in ["CryptoObject00.r", "objectId"] {
        let all = bits(&merged, 0, name);
        let own: Vec<Vec<u32>> = passes
            .iter()
            .map(|pass| bits(&read(pass), 0, name))
            .collect();
        let mut tied = [0, 0];
        for pixel in 0..pixels {
            let [a, b] = counts.map(|count| count(pixel));
            let from = own.iter().position(|bits| bits[pixel] == all[pixel]);
            match a.cmp(&b) {
                std::cmp::Ordering::Greater => assert_eq!(from, Some(0), "{name} {pixel}"),
                std::cmp::Ordering::Less => assert_eq!(from, Some(1), "{name} {pixel}"),
                std::cmp::Ordering::Equal => tied[from.unwrap()] += 1,
            }
        }
        // of equal ones all are from one pass
        assert!(tied.contains(&0) && tied != [0, 0], "{tied:?}");
    }
}

fn blender(seed: u32, fraction: f32) -> TestPart {
    let pixels = PICTURE.pixels();
    let mut channels = Vec::new();
    for layer in ["Front", "Back"] {
        for (component, k) in ["R", "G", "B", "A"].into_iter().zip(0..) {
            channels.push(float(
                &format!("{layer}.Combined.{component}"),
                pixels,
                seed + k,
            ));
        }
        for (component, k) in ["X", "Y", "Z"].into_iter().zip(10..) {
            let name = format!("{layer}.Denoising Normal.{component}");
            channels.push(float(&name, pixels, seed + k));
        }
        let fraction = if layer == "Front" { fraction } else { 1.0 };
        let half = vec![f16::from_f32(fraction); pixels];
        let name = format!("{layer}.Debug Sample Count.X");
        channels.push((name, FlatSamples::F16(half)));
    }
    let mut part = part(channels);
    for (name, samples) in [("cycles.Front.samples", "96"), ("cycles.Back.samples", "8")] {
        part.attributes
            .push((name, AttributeValue::Text(samples.into())));
    }
    part
}

#[test]
fn fractions_of_view_layers_become_counts_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write(&path("a.exr"), PICTURE.size, vec![blender(1, 1.0 / 3.0)]);
    write(&path("b.exr"), PICTURE.size, vec![blender(50, 0.5)]);
    write(&path("c.exr"), PICTURE.size, vec![blender(90, 1.0)]);
    merge(&[path("a.exr"), path("b.exr")], &path("two.exr"));
    // a merged file has its counts in another channel than a pass
    merge(&[path("two.exr"), path("c.exr")], &path("all.exr"));
    let names = channel_names(&read(&path("all.exr")), 0);
    assert!(
        !names.iter().any(|name| name.contains("Debug")),
        "{names:?}"
    );
    let pictures = Input::open_all(&InputRequest::new(path("all.exr"))).unwrap();
    for (picture, (channel, count)) in pictures.iter().zip([
        ("Back.sampleCount.X", 24.0),
        ("Front.sampleCount.X", 32.0 + 48.0 + 96.0),
    ]) {
        let samples = picture.roles.samples.as_ref().unwrap().to_string();
        assert!(samples.contains(channel), "{samples}");
        assert_eq!(
            values(&path("all.exr"), channel),
            vec![count; PICTURE.pixels()]
        );
    }
    assert_eq!(pictures.len(), 2);
}

/// What roles the pictures of a file have, and the views and layers they are of.
fn roles(path: &Path) -> Vec<(String, Vec<String>)> {
    let pictures = Input::open_all(&InputRequest::new(path)).unwrap();
    let of = |picture: &Input| {
        let assigned = picture.roles.assignments.iter();
        let found = assigned.filter(|a| a.role != Role::Samples).map(|a| {
            let names = a.channels.iter().map(|at| picture.names.name(*at));
            format!("{}={}", a.role.name(), names.collect::<Vec<_>>().join(","))
        });
        (picture.roles.label(), found.collect())
    };
    pictures.iter().map(of).collect()
}

/// A stereo picture in parts, one for the colour and one for the normal of each view.
fn stereo(seed: u32) -> Vec<TestPart> {
    let pixels = PICTURE.pixels();
    let of = |name: &'static str, view: &str, channels: [&str; 3], seed: u32| TestPart {
        name: Some(name),
        attributes: vec![
            ("view", AttributeValue::Text(view.into())),
            ("spp", AttributeValue::I32(4)),
        ],
        ..part(
            channels
                .iter()
                .zip(seed..)
                .map(|(c, seed)| float(c, pixels, seed))
                .collect(),
        )
    };
    vec![
        of("rgba_left", "left", ["R", "G", "B"], seed),
        of("N_left", "left", ["X", "Y", "Z"], seed + 10),
        of("rgba_right", "right", ["R", "G", "B"], seed + 20),
        of("N_right", "right", ["X", "Y", "Z"], seed + 30),
    ]
}

#[test]
fn the_roles_of_merged_passes_are_those_of_the_passes() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let pass = |first: usize| vec![PICTURE.part(|_| (first..first + 5).collect())];
    for (n, [a, b]) in [
        [pass(0), pass(5)],
        [vec![blender(1, 0.5)], vec![blender(2, 0.5)]],
        [stereo(1), stereo(100)],
    ]
    .into_iter()
    .enumerate()
    {
        write(&path("a.exr"), PICTURE.size, a);
        write(&path("b.exr"), PICTURE.size, b);
        merge(&[path("a.exr"), path("b.exr")], &path("all.exr"));
        assert_eq!(roles(&path("all.exr")), roles(&path("a.exr")), "{n}");
        for picture in Input::open_all(&InputRequest::new(path("all.exr"))).unwrap() {
            let samples = picture.roles.samples.unwrap().to_string();
            assert!(samples.starts_with("per pixel (channel"), "{n}: {samples}");
        }
    }
}

#[test]
fn a_variance_of_nobody_knows_what_is_left_out_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let mut channels = PICTURE.pass(|_| vec![0, 1]);
    channels.push(float("diffuse_variance.R", PICTURE.pixels(), 9));
    write(&path, PICTURE.size, vec![part(channels)]);
    let merging = Merging::open(&MergeRequest::new([&path])).unwrap();
    let said = format!("{:?}", merging.remarks());
    assert!(said.contains("diffuse_variance.R"), "{said}");
    let output = folder.path().join("all.exr");
    merge(&[path], &output);
    let names = channel_names(&read(&output), 0);
    assert!(
        !names.iter().any(|name| name.contains("diffuse")),
        "{names:?}"
    );
}

#[test]
fn empty_passes_are_alike_without_being_copies() {
    let folder = tempfile::tempdir().unwrap();
    let black = || {
        let mut channels: Vec<NamedSamples> = ["R", "G", "B"]
            .map(|c| constant(c, PICTURE.pixels(), 0.0))
            .to_vec();
        channels.push(constant("sampleCount", PICTURE.pixels(), 4.0));
        vec![part(channels)]
    };
    let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
    write(&a, PICTURE.size, black());
    write(&b, PICTURE.size, black());
    let output = folder.path().join("all.exr");
    merge(&[a, b], &output);
    assert_eq!(values(&output, "sampleCount")[0], 8.0);
}

/// The channels of a real render as a pass of 8 samples per pixel, with the colour of half of its samples; mirrored, if asked.
fn real_pass(half: &str, mirrored: bool) -> Vec<TestPart> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/toasters_16spp.exr");
    let channel = |name: &str, from: &str| {
        let kept = bits(&read(&data), 0, from).into_iter();
        let mut values: Vec<f32> = match from.starts_with("half") || from.starts_with("alb") {
            true => kept
                .map(|bits| f16::from_bits(bits as u16).to_f32())
                .collect(),
            false => kept.map(f32::from_bits).collect(),
        };
        if mirrored {
            values.chunks_mut(128).for_each(<[f32]>::reverse);
        }
        (name.to_owned(), FlatSamples::F32(values))
    };
    let mut channels = Vec::new();
    for component in ["R", "G", "B"] {
        channels.push(channel(component, &format!("{half}.{component}")));
        let albedo = format!("albedo.{component}");
        channels.push(channel(&albedo, &albedo));
    }
    channels.push(constant("sampleCount", 128 * 128, 8.0));
    vec![part(channels)]
}

#[test]
fn passes_of_a_real_render_are_of_one_picture_and_its_mirror_image_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write(&path("a.exr"), (128, 128), real_pass("halfA", false));
    write(&path("b.exr"), (128, 128), real_pass("halfB", false));
    merge(&[path("a.exr"), path("b.exr")], &path("all.exr"));
    write(&path("b.exr"), (128, 128), real_pass("halfB", true));
    let request = MergeRequest::new([path("a.exr"), path("b.exr")]);
    let merging = Merging::open(&request).unwrap();
    let refused = merging.write(&path("odd.exr"), &AtomicBool::new(false), &mut |_| {});
    let message = refused.unwrap_err().to_string();
    assert!(
        message.contains("are not passes of one picture: by albedo or normal"),
        "{message}"
    );
    assert!(!path("odd.exr").exists());
}

#[test]
fn sparse_light_and_few_samples_are_of_one_picture() {
    let folder = tempfile::tempdir().unwrap();
    let pass = |seed: u32| {
        let spark = |i: usize| match noise(seed, i) < 0.1 {
            true => 50.0 * exponential(seed + 1, i),
            false => 0.0,
        };
        let channel = |name: &str| {
            let values = (0..PICTURE.pixels()).map(spark);
            (name.to_owned(), FlatSamples::F32(values.collect()))
        };
        let mut channels = ["R", "G", "B"].map(channel).to_vec();
        channels.push(constant("sampleCount", PICTURE.pixels(), 1.0));
        vec![part(channels)]
    };
    let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
    write(&a, PICTURE.size, pass(1));
    write(&b, PICTURE.size, pass(100));
    merge(&[a, b], &folder.path().join("all.exr"));
}
