//! Images in any format and layout give the bits that the library makes of the same numbers.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use half::f16;
use linpred::image::{Frame, Interleaved};
use linpred::{Feature, ImageSize, Options, OutputRow, Params, Quality, denoise};

use crate::host::{At, FLOAT, FLOAT3, FLOAT4, HALF3, HEIGHT, Host, WIDTH, bits, pixels};

/// The pixels of an image.
fn interleaved<const N: usize>(values: &[f32]) -> Interleaved<'_, N> {
    let size = ImageSize::new(WIDTH, HEIGHT).unwrap();
    Interleaved::new(size, values.as_chunks::<N>().0).unwrap()
}

/// What the library makes of a frame: colour, error, radius, rank, alpha, layers and scalars, each as images.
fn of_the_library(mut frame: Frame<'_>) -> Vec<Vec<f32>> {
    let mut images: Vec<Vec<f32>> = vec![Vec::new(); 7];
    let mut keep = |_: usize, row: &OutputRow| {
        for x in 0..WIDTH {
            images[0].extend(row.colour.iter().map(|plane| plane[x]));
            images[1].push(row.error[x]);
            images[2].push(row.radius[x]);
            images[3].push(row.rank[x]);
            images[4].extend(row.alpha.get(x));
            images[5].extend(row.layers.iter().flatten().map(|plane| plane[x]));
            images[6].extend(row.scalars.iter().map(|plane| plane[x]));
        }
        Ok(())
    };
    let options = Options::new(Params::new(Quality::Fast)).with_threads(NonZeroUsize::MIN);
    denoise(&mut frame, &mut keep, &options, &mut |_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    images
}

#[test]
fn everything_that_an_image_can_have() {
    let mut variance = pixels(2, 3);
    variance[17] = -1.0;
    let images = [
        ("colour", pixels(1, 3)),
        ("variance", variance),
        ("normal", pixels(3, 3)),
        ("normal_variance", pixels(4, 3)),
        ("albedo", pixels(5, 3)),
        ("albedo_variance", pixels(6, 3)),
        ("layer.direct", pixels(7, 3)),
        ("depth", pixels(8, 1)),
        ("depth_variance", pixels(9, 1)),
        ("alpha", pixels(10, 1)),
        ("scalar.mask", pixels(11, 1)),
    ];
    let of = |wanted: &str| &images.iter().find(|(name, _)| *name == wanted).unwrap().1[..];
    let three = |name: &str| interleaved::<3>(of(name));
    let one = |name: &str| interleaved::<1>(of(name));
    let frame = Frame::new(three("colour"))
        .and_then(|frame| frame.with_variance(three("variance")))
        .and_then(|frame| {
            frame.with_feature_and_variance(
                Feature::Normal,
                three("normal"),
                three("normal_variance"),
            )
        })
        .and_then(|frame| {
            frame.with_feature_and_variance(
                Feature::Albedo,
                three("albedo"),
                three("albedo_variance"),
            )
        })
        .and_then(|frame| {
            frame.with_feature_and_variance(Feature::Depth, one("depth"), one("depth_variance"))
        })
        .and_then(|frame| frame.with_layer("direct", three("layer.direct")))
        .and_then(|frame| frame.with_alpha(one("alpha")))
        .and_then(|frame| frame.with_scalar("mask", one("scalar.mask")));
    let wanted = of_the_library(frame.unwrap());

    let host = Host::new();
    // in another order, which must not matter
    for (name, pixels) in images.iter().rev() {
        let format = if pixels.len() == WIDTH * HEIGHT {
            FLOAT
        } else {
            FLOAT3
        };
        host.image(name, pixels, format).ok();
    }
    let names = [
        "colour",
        "error",
        "radius",
        "rank",
        "alpha",
        "layer.direct",
        "scalar.mask",
    ];
    let mut outputs = wanted
        .iter()
        .map(|image| vec![f32::NAN; image.len()])
        .collect::<Vec<_>>();
    for (name, output) in names.iter().zip(&mut outputs) {
        let format = if output.len() == WIDTH * HEIGHT {
            FLOAT
        } else {
            FLOAT3
        };
        host.output(name, output, format).ok();
    }
    host.execute().ok();
    for ((name, is), should) in names.iter().zip(&outputs).zip(&wanted) {
        assert!(bits(is) == bits(should), "{name}");
    }
}

#[test]
fn halves_of_samples_in_half_floats_with_gaps_and_a_fourth_number() {
    let to_half = |values: &[f32]| {
        values
            .iter()
            .copied()
            .map(f16::from_f32)
            .collect::<Vec<_>>()
    };
    let (a, b) = (to_half(&pixels(1, 3)), to_half(&pixels(2, 3)));
    let floats = |halves: &[f16]| {
        halves
            .iter()
            .map(|half| half.to_f32())
            .collect::<Vec<f32>>()
    };
    let (a_floats, b_floats) = (floats(&a), floats(&b));
    let colour: Vec<f32> = a_floats
        .iter()
        .zip(&b_floats)
        .map(|(a, b)| 0.5 * (a + b))
        .collect();
    let frame = Frame::new(interleaved::<3>(&colour)).and_then(|frame| {
        frame.with_halves(interleaved::<3>(&a_floats), interleaved::<3>(&b_floats))
    });
    let wanted = of_the_library(frame.unwrap()).swap_remove(0);

    // rows of four numbers a pixel, and one pixel more
    let mut rgba = Vec::new();
    for row in colour.chunks_exact(3 * WIDTH) {
        rgba.extend(
            row.chunks_exact(3)
                .flat_map(|p| [p[0], p[1], p[2], f32::NAN]),
        );
        rgba.extend([f32::NAN; 4]);
    }
    let host = Host::new();
    let rows = At {
        row_stride: 16 * (WIDTH + 1),
        ..At::default()
    };
    host.set("color", rgba.as_ptr().cast(), FLOAT4, (WIDTH, HEIGHT), rows)
        .ok();
    for (name, half) in [("half_a", &a), ("half_b", &b)] {
        host.set(
            name,
            half.as_ptr().cast(),
            HALF3,
            (WIDTH, HEIGHT),
            At::default(),
        )
        .ok();
    }
    let mut clean = vec![f16::NAN; colour.len()];
    host.set_output(
        "output",
        clean.as_mut_ptr().cast(),
        HALF3,
        (WIDTH, HEIGHT),
        At::default(),
    )
    .ok();
    host.execute().ok();
    assert!(clean == to_half(&wanted));
}
