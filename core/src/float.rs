//! The only door to `libm`: what `core` lacks of float arithmetic, the same bits on every machine.

/// Square root, correctly rounded; NaN below 0.
pub(crate) fn sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Square root in double precision, correctly rounded; NaN below 0.
pub(crate) fn sqrt_f64(x: f64) -> f64 {
    libm::sqrt(x)
}

/// Natural logarithm in double precision, within 1 unit in the last place; minus infinity at 0.
pub(crate) fn ln_f64(x: f64) -> f64 {
    libm::log(x)
}

/// The float nearest to `x`, the largest finite one of its sign where it would be infinite.
pub(crate) fn saturate(x: f64) -> f32 {
    x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}

/// Natural logarithm, within 1 unit in the last place; minus infinity at 0.
pub(crate) fn ln(x: f32) -> f32 {
    libm::logf(x)
}

/// Exponential, within 1 unit in the last place.
pub(crate) fn exp(x: f32) -> f32 {
    libm::expf(x)
}
