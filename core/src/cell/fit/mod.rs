//! The fits, one file for each member of [`Formulas`](crate::Formulas).

pub(crate) mod lpr;
pub(crate) mod robust;
pub(crate) mod wlr;

use crate::cell::feature_space::Basis;
use crate::cell::model::{Coefficients, Models};
use crate::cell::window::{Colours, Windows};
use crate::params::Params;

/// How windows become models of at most `T` terms, and what fitting layers in the way of the models needs.
pub(crate) trait Fit<const T: usize, const D: usize, const L: usize>: Sized {
    /// Fits each window on the first `T` of its terms, and leaves the local features in the windows. What is
    /// returned beside the models need only serve [`fit_layer`](Self::fit_layer) if there are `layers`.
    fn fit(
        windows: &mut Windows<D, L>,
        basis: &Basis<D, L>,
        params: &Params,
        layers: bool,
    ) -> (Models<T, L>, Self);

    /// The coefficients of a layer's channels, from its radiance in the windows: same half-widths, weights and strengths.
    fn fit_layer(
        &self,
        windows: &Windows<D, L>,
        radius: &[usize; L],
        layer: &Colours<L>,
    ) -> Coefficients<T, L>;
}
