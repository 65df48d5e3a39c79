//! What the papers claim of a picture, tried on it: see `tests/bench/papers/README.md`, whose `run.py` calls this.
//!
//!     cargo run --release -p linpred-tests --bin papers -- choice NOISY.exr REFERENCE.exr [TWICE.exr SAMPLES]
//!     cargo run --release -p linpred-tests --bin papers -- validation NOISY.exr REFERENCE.exr
//!     cargo run --release -p linpred-tests --bin papers -- map NOISY.exr REFERENCE.exr MAP.exr
//!
//! Tables go to standard output as CSV. `TWICE.exr` has the samples of `NOISY.exr`, `SAMPLES` of each pixel, and as many more.

mod choice;
mod picture;
mod statistics;
mod validation;
mod whole;

use std::env;
use std::error::Error;
use std::path::Path;

use exr::prelude::FlatSamples;
use linpred_core::Params;
use linpred_tests::images::{part, write};
use linpred_tests::windows::Random;

use crate::picture::{Picture, Prepared, Reference};
use crate::validation::{Estimate, Fitted, Seconds, time};
use crate::whole::{Predicted, Windows, predict};

/// Windows whose time is taken, and how often.
const TIMED: usize = 25;
const ROUNDS: usize = 200;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["choice", noisy, reference] => choices(noisy, reference, None),
        ["choice", noisy, reference, twice, samples] => {
            choices(noisy, reference, Some((twice, samples.parse()?)))
        }
        ["validation", noisy, reference] => validations(noisy, reference),
        ["map", noisy, reference, map] => write_map(noisy, reference, map),
        _ => Err("expected: choice|validation|map NOISY.exr REFERENCE.exr ...; the head of tests/src/bin/papers/main.rs says what".into()),
    }
}

fn read(noisy: &str, reference: &str) -> Result<(Picture, Reference), Box<dyn Error>> {
    let picture = Picture::read(Path::new(noisy))?;
    let reference_file = Reference::read(Path::new(reference))?;
    if reference_file.colour.len() != picture.colour.len() {
        return Err(format!("{noisy} and {reference} differ in size").into());
    }
    Ok((picture, reference_file))
}

fn choices(noisy: &str, reference: &str, twice: Option<(&str, f32)>) -> Result<(), Box<dyn Error>> {
    let (picture, reference) = read(noisy, reference)?;
    let other = match twice {
        Some((path, samples)) => Some(picture.rest_of(&Picture::read(Path::new(path))?, samples)),
        None => None,
    };
    println!("{}", choice::COLUMNS);
    for row in choice::rows(&picture, other.as_ref(), &reference) {
        println!("{row}");
    }
    Ok(())
}

fn validations(noisy: &str, reference: &str) -> Result<(), Box<dyn Error>> {
    let (picture, reference) = read(noisy, reference)?;
    let prepared = Prepared::new(&picture, true);
    let windows = Windows::new(&prepared, Params::literal());
    let input: Vec<[f64; 3]> = picture.colour.iter().map(|c| c.map(f64::from)).collect();
    println!("estimate,rmse,models per pixel,mean rank");
    println!("input,{:.6},,", reference.relative_error(&input));
    for (name, estimate) in Estimate::ALL {
        let whole = predict(&prepared, &windows, &reference, estimate);
        let radiance: Vec<[f64; 3]> = whole.pixels.iter().map(Predicted::radiance).collect();
        println!(
            "{name},{:.6},{:.4},{:.3}",
            reference.relative_error(&radiance),
            whole.models as f64 / whole.pixels.len() as f64,
            whole.ranks as f64 / whole.models as f64,
        );
    }
    times(&picture, &windows);
    Ok(())
}

/// Prints ratios of seconds: of the least that each way took, for what disturbs a measurement only makes it longer.
fn times(picture: &Picture, windows: &Windows) {
    let mut random = Random::new(1);
    let windows: Vec<Box<dyn Fitted>> = (0..TIMED)
        .map(|_| {
            windows
                .around(random.below(picture.width), random.below(picture.height))
                .2
        })
        .collect();
    let rounds: Vec<Seconds> = (0..ROUNDS).map(|_| time(&windows)).collect();
    let least = |of: fn(&Seconds) -> f64| rounds.iter().map(of).fold(f64::INFINITY, f64::min);
    let (fits, iterative, cross) = (
        least(|s| s.fits),
        least(|s| s.iterative),
        least(|s| s.cross),
    );
    let alone = (cross - fits) / (iterative - fits);
    println!("time: cross validation over iterative,{alone:.2},,");
    println!("time: the same with the fits,{:.2},,", cross / iterative);
    let share = (iterative - fits) / iterative;
    println!("time: iterative validation's share of that with fits,{share:.3},,");
}

/// The picture by iterative validation, and what its models' errors are: estimated, and by the reference.
fn write_map(noisy: &str, reference: &str, map: &str) -> Result<(), Box<dyn Error>> {
    let (picture, reference) = read(noisy, reference)?;
    let prepared = Prepared::new(&picture, true);
    let windows = Windows::new(&prepared, Params::literal());
    let whole = predict(&prepared, &windows, &reference, Estimate::Iterative);
    let plane = |name: &str, of: &dyn Fn(&Predicted) -> f64| {
        let values = whole.pixels.iter().map(|pixel| of(pixel) as f32);
        (name.to_owned(), FlatSamples::F32(values.collect()))
    };
    let channels = vec![
        plane("R", &|pixel| pixel.radiance()[0]),
        plane("G", &|pixel| pixel.radiance()[1]),
        plane("B", &|pixel| pixel.radiance()[2]),
        plane("estimated", &|pixel| pixel.of_models()[0]),
        plane("true", &|pixel| pixel.of_models()[1]),
        plane("rank", &|pixel| pixel.of_models()[2]),
    ];
    let size = (picture.width, picture.height);
    write(Path::new(map), size, vec![part(channels)]);
    Ok(())
}
