//! The FLIP of `linpred compare` is that of its authors' program, whatever the tiles, threads and memory.

use linpred_tests::images::noise;

use super::compare_agrees_with_the_definition::{Files, Planes, Size, channels, planes};

/// Agreement with the map of the authors' program, which is in single precision as ours is: what they round differently.
const AGREEMENT: f64 = 1e-6;

fn flip(size: Size, image: &Planes, reference: &Planes) -> f64 {
    let files = Files::new(size, channels(image), channels(reference), None);
    files.json(&[])["flip"].as_f64().expect("a number")
}

/// Pieces of noise with lamps among them, each channel its own.
fn reference(size: Size, seed: u32) -> Planes {
    planes(size, |k, x, y| {
        let i = y * size.0 + x;
        let lamp = if noise(seed, i / 3) > 0.96 { 40.0 } else { 1.0 };
        noise(seed + 1 + k as u32, i / 5) * lamp
    })
}

/// The same with noise of its own.
fn image(size: Size, seed: u32) -> Planes {
    let reference = reference(size, seed);
    planes(size, |k, x, y| {
        let i = y * size.0 + x;
        reference[k][i] * (0.5 + noise(seed + 4 + k as u32, i))
    })
}

#[test]
fn flip_is_that_of_the_authors_program() {
    // `flip-evaluator` 1.7 by `python3 flip_agrees_with_its_authors.py`, which is beside this file: 7, 7, 2 and 2 exposures
    let theirs = [
        ((97, 61), 1, 0.166097378),
        ((64, 32), 2, 0.165612481),
        ((9, 5), 3, 0.188899541),
        ((1, 40), 4, 0.220827688),
    ];
    for (size, seed, expected) in theirs {
        let own = flip(size, &image(size, seed), &reference(size, seed));
        println!("{size:?}: {own} {expected}");
        assert!(
            (own - expected).abs() < AGREEMENT,
            "{size:?}: {own} {expected}"
        );
    }
}

#[test]
fn equal_images_have_none_and_one_pixel_makes_some() {
    let size = (40, 40);
    let reference = reference(size, 5);
    assert_eq!(flip(size, &reference, &reference), 0.0);
    let mut other = reference.clone();
    other[1][20 * 40 + 20] *= 1.25;
    let one = flip(size, &other, &reference);
    other[1][5 * 40 + 5] *= 1.25;
    let two = flip(size, &other, &reference);
    assert!(0.0 < one && one < two && two < 0.01, "{one} {two}");
}

/// A grey image with one pixel of another colour.
fn grey(size: Size, at: (usize, usize), colour: [f32; 3]) -> Planes {
    planes(size, |k, x, y| if (x, y) == at { colour[k] } else { 0.4 })
}

#[test]
fn a_pixel_counts_the_same_wherever_it_is() {
    // ends of the tiles of 64 x 32 pixels that FLIP is worked out in, and their middle; none as near to a border as filters reach
    let (size, nowhere) = ((150, 75), (200, 0));
    let reference = grey(size, nowhere, [0.0; 3]);
    let figures = [(30, 15), (63, 31), (64, 32), (127, 31), (73, 54), (128, 63)].map(|at| {
        let image = grey(size, at, [0.4, 0.2, 0.6]);
        flip(size, &image, &reference)
    });
    println!("{figures:?}");
    // sums of the same errors in another order
    let same = |figure: &f64| (figure / figures[0] - 1.0).abs() < 1e-12;
    assert!(figures[0] > 1e-4 && figures.iter().all(same), "{figures:?}");
}

#[test]
fn neither_threads_nor_memory_change_a_digit() {
    let size = (150, 75);
    let input = image(size, 20);
    let (a, f) = (image(size, 7), reference(size, 7));
    let files = Files::new(size, channels(&a), channels(&f), Some(&input));
    let json = |options: &[&str]| files.json(&[&["--input", "in.exr"], options].concat());
    let expected = json(&["--threads", "1"]);
    for threads in ["2", "3", "16"] {
        assert_eq!(json(&["--threads", threads]), expected, "{threads} threads");
    }
    // with less than all of them would take
    assert_eq!(json(&["--threads", "512", "--max-memory", "24M"]), expected);
    files
        .run(&["--threads", "512", "--max-memory", "8M"])
        .exits_with(4)
        .complains_about(&["--max-memory is 8.0 MiB"]);
    // nor does what else is measured beside an image
    assert_eq!(files.json(&[])["flip"], expected["flip"]);
    assert_eq!(flip(size, &input, &f), expected["input"]["flip"]);
}

#[test]
fn pixels_that_are_not_finite_are_left_out_and_spoil_no_neighbour() {
    let size = (40, 40);
    let f = reference(size, 5);
    let mut a = f.clone();
    a[0][3] = f32::NAN;
    a[2][20 * 40 + 20] = f32::INFINITY;
    let mut hole = f.clone();
    hole[1][30 * 40 + 7] = f32::NAN;
    assert_eq!(flip(size, &a, &hole), 0.0);
    // beside a hole, a difference is seen as if both images were black there
    a = f.clone();
    a[1][30 * 40 + 9] += 0.5;
    let beside = flip(size, &a, &hole);
    let mut black = f.clone();
    black.iter_mut().for_each(|plane| plane[30 * 40 + 7] = 0.0);
    a[0][30 * 40 + 7] = f32::NAN;
    assert_eq!(beside, flip(size, &a, &black));
    assert!(beside > 0.0);
    let nothing = planes(size, |_, _, _| f32::NAN);
    let files = Files::new(size, channels(&nothing), channels(&f), None);
    assert!(files.json(&[])["flip"].is_null());
}

#[test]
fn negative_radiance_is_black_and_any_finite_radiance_is_measured() {
    let size = (30, 30);
    let reference = reference(size, 5);
    let with = |value: f32| {
        let mut image = reference.clone();
        image
            .iter_mut()
            .for_each(|plane| plane[15 * 30 + 15] = value);
        flip(size, &image, &reference)
    };
    assert_eq!(with(-3.0), with(0.0));
    assert_eq!(with(f32::MAX), with(1e6));
    assert!(with(0.0) > 0.0 && with(1e6) > 0.0);
}

#[test]
fn a_reference_that_is_mostly_black_is_measured_and_a_black_one_is_not() {
    let size = (40, 40);
    let lit = |value: f32| planes(size, |_, x, _| if x < 10 { value } else { 0.0 });
    assert_eq!(flip(size, &lit(0.5), &lit(0.5)), 0.0);
    let darker = flip(size, &lit(0.3), &lit(0.5));
    assert!(darker > 0.01 && darker < 0.5, "{darker}");
    let files = Files::new(size, channels(&lit(0.5)), channels(&lit(0.0)), None);
    assert!(files.json(&[])["flip"].is_null());
}
