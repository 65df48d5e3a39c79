//! An output in the memory of images, in the same rows, has the bits of one with memory of its own; one that would overwrite what is still to be read is refused.

use linpred_c::linpred_status::LINPRED_ERROR_ARGUMENT;

use crate::host::{At, FLOAT, FLOAT3, HEIGHT, Host, WIDTH, bits, pixels};

/// Colour and alpha in pixels of five numbers, of which the fifth is nobody's.
const RGBA: At = At {
    byte_offset: 0,
    pixel_stride: 20,
    row_stride: 0,
};
const ALPHA: At = At {
    byte_offset: 12,
    ..RGBA
};

const SIZE: (usize, usize) = (WIDTH, HEIGHT);

fn host(image: &[f32], albedo: &[f32]) -> Host {
    let host = Host::new();
    host.set("colour", image.as_ptr().cast(), FLOAT3, SIZE, RGBA)
        .ok();
    host.set("alpha", image.as_ptr().cast(), FLOAT, SIZE, ALPHA)
        .ok();
    host.image("albedo", albedo, FLOAT3).ok();
    host
}

#[test]
fn in_place_has_the_bits_of_elsewhere() {
    let (mut image, mut albedo) = (pixels(1, 5), pixels(2, 3));
    let fifths = bits(
        &image
            .iter()
            .copied()
            .skip(4)
            .step_by(5)
            .collect::<Vec<f32>>(),
    );
    let (mut colour, mut alpha) = (vec![0.0; WIDTH * HEIGHT * 3], vec![0.0; WIDTH * HEIGHT]);
    let elsewhere = host(&image, &albedo);
    elsewhere.output("colour", &mut colour, FLOAT3).ok();
    elsewhere.output("alpha", &mut alpha, FLOAT).ok();
    elsewhere.execute().ok();

    let in_place = host(&image, &albedo);
    in_place
        .set_output("alpha", image.as_mut_ptr().cast(), FLOAT, SIZE, ALPHA)
        .ok();
    in_place.output("colour", &mut albedo, FLOAT3).ok();
    in_place.execute().ok();
    assert!(
        bits(&albedo) == bits(&colour),
        "the colour in the albedo's place"
    );
    let alphas: Vec<f32> = image.iter().copied().skip(3).step_by(5).collect();
    assert!(bits(&alphas) == bits(&alpha), "the alpha in its own place");
    let left: Vec<f32> = image.iter().copied().skip(4).step_by(5).collect();
    assert_eq!(bits(&left), fifths, "what is nobody's");
}

#[test]
fn what_is_still_to_be_read_is_not_overwritten() {
    let (mut image, albedo) = (pixels(1, 5), pixels(2, 3));
    let host = host(&image, &albedo);
    let one_below = At {
        byte_offset: 20 * WIDTH,
        ..RGBA
    };
    let narrower = At {
        pixel_stride: 12,
        ..RGBA
    };
    for at in [one_below, narrower] {
        host.set_output("colour", image.as_mut_ptr().cast(), FLOAT3, SIZE, at)
            .ok();
        let words =
            "the output \"colour\" overlaps rows of the image \"colour\" that are read later";
        host.execute().fails(LINPRED_ERROR_ARGUMENT, words);
    }
}
