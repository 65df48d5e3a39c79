//! Colours as FLIP sees them: linear RGB to opponent colours, which are filtered, to L*a*b*, which are compared.

/// Linear RGB with the primaries of Rec. 709 to XYZ, white at (1, 1, 1): the fractions of the authors' program, over its white of D65.
const TO_XYZ: [[f32; 3]; 3] = [
    over(
        24_577_794.0,
        [10_135_552.0, 8_788_810.0, 4_435_075.0],
        1.052_156_925,
    ),
    over(12_288_897.0, [2_613_072.0, 8_788_810.0, 887_015.0], 1.0),
    over(
        73_733_382.0,
        [1_425_312.0, 8_788_810.0, 70_074_185.0],
        0.918_357_670,
    ),
];
/// That program's way back from XYZ.
const FROM_XYZ: [[f32; 3]; 3] = [
    over(1.0, [3.241_003_275, -1.537_398_934, -0.498_615_861], 1.0),
    over(1.0, [-0.969_224_334, 1.875_930_071, 0.041_554_224], 1.0),
    over(1.0, [0.055_639_423, -0.204_011_202, 1.057_148_933], 1.0),
];
/// XYZ of that white.
const WHITE: [f32; 3] = over(1.0, [0.950_428_545, 1.0, 1.088_900_371], 1.0);

/// Below the cube of this, L*a*b* goes on in a straight line (CIE 15).
const LINEAR: f32 = 6.0 / 29.0;
const SLOPE: f32 = 1.0 / (3.0 * LINEAR * LINEAR);
const OFFSET: f32 = 4.0 / 29.0;

const fn over(denominator: f64, row: [f64; 3], factor: f64) -> [f32; 3] {
    let scale = factor / denominator;
    [
        (row[0] * scale) as f32,
        (row[1] * scale) as f32,
        (row[2] * scale) as f32,
    ]
}

#[inline(always)]
fn times(matrix: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    // not `map`, which is not inlined everywhere
    let dot = |row: [f32; 3]| row[0] * v[0] + row[1] * v[1] + row[2] * v[2];
    [dot(matrix[0]), dot(matrix[1]), dot(matrix[2])]
}

/// Linear RGB, 0 to 1, as Y, X - Y and Y - Z.
///
/// FLIP defines 116 Y - 16, 500 (X - Y) and 200 (Y - Z). Its filters keep an even image as it is, so that these factors can be left out before and after.
#[inline(always)]
pub(super) fn opponent(rgb: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = times(&TO_XYZ, rgb);
    [y, x - y, y - z]
}

/// L*, and a* and b* times L* / 100 for the Hunt effect, of opponent colours that were filtered, brought back to RGB within 0..1 first.
#[inline(always)]
pub(super) fn hunt_adjusted([y, red_green, blue_yellow]: [f32; 3]) -> [f32; 3] {
    let xyz = [
        (y + red_green) * WHITE[0],
        y * WHITE[1],
        (y - blue_yellow) * WHITE[2],
    ];
    let [red, green, blue] = times(&FROM_XYZ, xyz);
    let clamped = |value: f32| value.clamp(0.0, 1.0);
    let [x, y, z] = times(&TO_XYZ, [clamped(red), clamped(green), clamped(blue)]);
    let [x, y, z] = [compressed(x), compressed(y), compressed(z)];
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    [lightness, 500.0 * (x - y) * hunt, 200.0 * (y - z) * hunt]
}

/// HyAB: the difference of L*, and the distance of the others.
#[inline(always)]
pub(super) fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [lightness, red_green, blue_yellow] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    lightness.abs() + (red_green * red_green + blue_yellow * blue_yellow).sqrt()
}

/// The nonlinearity of L*a*b*, for 0 to 1.
#[inline(always)]
fn compressed(t: f32) -> f32 {
    if t > LINEAR * LINEAR * LINEAR {
        cube_root(t)
    } else {
        SLOPE * t + OFFSET
    }
}

/// Within 3e-7 for normal numbers above 0. Without a branch, so that several run side by side; `f32::cbrt` doubles the time of all of FLIP.
#[inline(always)]
fn cube_root(t: f32) -> f32 {
    // a third of the exponent; the constant makes it right within 4 % (W. Kahan)
    let mut root = f32::from_bits(t.to_bits() / 3 + 709_921_077);
    for _ in 0..2 {
        // Halley's step, which cubes the error
        let cube = root * root * root;
        root = root * (cube + 2.0 * t) / (2.0 * cube + t);
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_roots_are_those_of_the_standard_library() {
        for i in 1..=100_000 {
            let t = i as f32 * 1e-5;
            let expected = f64::from(t).cbrt();
            let error = (f64::from(cube_root(t)) / expected - 1.0).abs();
            assert!(error < 3e-7, "{t}: {error}");
        }
    }

    #[test]
    fn white_is_100_black_0_and_neither_has_colour() {
        for (value, lightness) in [(1.0, 100.0), (0.0, 0.0)] {
            let seen = hunt_adjusted(opponent([value; 3]));
            let expected = [lightness, 0.0, 0.0];
            assert!(distance(seen, expected) < 1e-3, "{seen:?}");
        }
    }

    #[test]
    fn the_way_to_opponent_colours_and_back_is_the_way_to_lab() {
        // sRGB red: L* 53.24, a* 80.09, b* 67.20 (D65)
        let [l, a, b] = hunt_adjusted(opponent([1.0, 0.0, 0.0]));
        let expected = [53.24, 80.09 * 0.5324, 67.20 * 0.5324];
        assert!(distance([l, a, b], expected) < 0.05, "{l} {a} {b}");
    }
}
