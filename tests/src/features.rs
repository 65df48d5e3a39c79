//! How a feature varies over the pixels of a window or a tile: what renderers, and rounding, put into features.

use proptest::prelude::{Just, Strategy};
use proptest::sample::select;

use crate::windows::Random;

/// A way to vary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Noise in [-1, 1].
    Random,
    /// A position.
    Horizontal,
    /// The other position.
    Vertical,
    /// Two values, an object's edge through the middle.
    Edge,
    /// 0.5 everywhere, but for the last bit at random.
    EqualButLastBit,
    /// The feature before it, in another unit.
    Collinear,
    /// The feature before it, and noise of 1e-6 of it.
    NearlyCollinear,
    /// One value everywhere but at one pixel.
    ConstantButOnePixel,
    /// One value everywhere.
    Constant,
    /// Noise of 1e-30.
    Tiny,
    /// Noise of 1e-40, below the smallest normal float.
    Denormal,
    /// 0 and -0.
    NegativeZero,
    /// Noise of 1e15, the largest magnitude that counts as finite.
    Huge,
}

/// All whose magnitude stays within 1.
const WITHIN_ONE: [Feature; 12] = [
    Feature::Random,
    Feature::Horizontal,
    Feature::Vertical,
    Feature::Edge,
    Feature::EqualButLastBit,
    Feature::Collinear,
    Feature::NearlyCollinear,
    Feature::ConstantButOnePixel,
    Feature::Constant,
    Feature::Tiny,
    Feature::Denormal,
    Feature::NegativeZero,
];

/// A pixel, as its features see it.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Column, from -1 at the left to 1 at the right.
    pub x: f32,
    /// Row, from -1 to 1.
    pub y: f32,
    /// Whether it is the one pixel that is unlike all others.
    pub is_odd: bool,
}

impl Feature {
    /// The value at a pixel where the feature before it has the value `before`.
    pub fn value(self, place: Place, before: f32, random: &mut Random) -> f32 {
        let noise = (2.0 * random.uniform() - 1.0) as f32;
        match self {
            Self::Random => noise,
            Self::Horizontal => place.x,
            Self::Vertical => place.y,
            Self::Edge => f32::from(i8::from(2.0 * place.x > place.y) * 2 - 1),
            Self::EqualButLastBit if noise > 0.0 => 0.5f32.next_up(),
            Self::EqualButLastBit => 0.5,
            Self::Collinear => 0.5 * before,
            Self::NearlyCollinear => before * (1.0 + 1e-6 * noise),
            Self::ConstantButOnePixel => f32::from(u8::from(place.is_odd)),
            Self::Constant => 0.7,
            Self::Tiny => 1e-30 * noise,
            Self::Denormal => 1e-40 * noise,
            Self::NegativeZero => 0.0f32.copysign(noise),
            Self::Huge => 1e15 * noise,
        }
    }
}

/// Features whose magnitude stays within 1.
pub fn within_one() -> impl Strategy<Value = Feature> {
    select(&WITHIN_ONE[..])
}

/// Features of any magnitude.
pub fn any_magnitude() -> impl Strategy<Value = Feature> {
    proptest::prop_oneof![12 => within_one(), 1 => Just(Feature::Huge)]
}
