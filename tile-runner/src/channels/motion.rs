//! Motion vectors and positions of renderers, as ours.

/// Which components of a layer are a motion vector, and which way they count.
///
/// Ours count pixels to the right and down, from where a pixel is in this frame to where what it shows is in the other one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Axes {
    /// The component to the right and that down, or up; spellings, best first.
    pub(crate) components: &'static [[&'static str; 2]],
    /// What makes them ours: 1, or -1 for one that counts the other way.
    pub(crate) signs: [f32; 2],
}

impl Axes {
    /// Those of files that are written for linpred.
    pub(crate) const OURS: Self = Self {
        components: &[["X", "Y"]],
        signs: [1.0, 1.0],
    };
}

/// Makes a row of vectors, right and down, of one that is stored by other `signs`. A vector of which one component is not finite is not known.
pub(crate) fn to_ours(vectors: &mut [Vec<f32>; 2], signs: [f32; 2]) {
    let [right, down] = vectors;
    for (x, y) in right.iter_mut().zip(down) {
        let ours = (signs[0] * *x, signs[1] * *y);
        let known = ours.0.is_finite() && ours.1.is_finite();
        (*x, *y) = if known { ours } else { (f32::NAN, f32::NAN) };
    }
}

/// Makes unknown the positions of pixels that show nothing: renderers leave them at the origin (Cycles as rendered, pbrt by its source), where no mean of samples comes to
/// lie but by chance.
pub(crate) fn forget_origins(position: &mut [Vec<f32>; 3]) {
    let [x, y, z] = position;
    for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
        if [*x, *y, *z] == [0.0; 3] {
            [*x, *y, *z] = [f32::NAN; 3];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{forget_origins, to_ours};

    #[test]
    fn only_the_whole_origin_is_nothing() {
        let mut row = [vec![0.0, 0.0], vec![-0.0, 0.0], vec![0.0, 1.0]];
        forget_origins(&mut row);
        assert!(row.iter().all(|plane| plane[0].is_nan()));
        assert_eq!(row.each_ref().map(|plane| plane[1]), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn half_a_vector_is_none() {
        let mut row = [
            vec![1.0, f32::NAN, 2.0, f32::INFINITY],
            vec![3.0, 1.0, f32::NEG_INFINITY, 0.0],
        ];
        to_ours(&mut row, [1.0, -1.0]);
        assert_eq!([row[0][0], row[1][0]], [1.0, -3.0]);
        assert!(
            row.iter()
                .all(|plane| plane[1..].iter().all(|v| v.is_nan()))
        );
    }
}
