//! Products of coefficients and regressors that stay finite.

/// The dot product, summed in order.
pub(crate) fn dot<const T: usize>(a: &[f32; T], b: &[f32; T]) -> f32 {
    let mut sum = 0.0;
    for (a, b) in a.iter().zip(b) {
        sum += a * b;
    }
    sum
}

/// The dot product, no step of which leaves f32; 0 if an element is not finite.
pub(crate) fn finite_dot<const T: usize>(a: &[f32; T], b: &[f32; T]) -> f32 {
    let sum = dot(a, b);
    if sum.is_finite() {
        return sum;
    }
    let mut sum = 0.0f32;
    for (a, b) in a.iter().zip(b) {
        if !a.is_finite() || !b.is_finite() {
            return 0.0;
        }
        sum = (sum + (a * b).clamp(f32::MIN, f32::MAX)).clamp(f32::MIN, f32::MAX);
    }
    sum
}
