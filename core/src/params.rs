//! What a user may choose.

/// How well a pixel must be predicted before it gets no model of its own: [`Params::coverage`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Quality {
    /// Well by one model: the papers' sparse placement.
    Fast,
    /// Well by three.
    #[default]
    Balanced,
    /// Well by sixteen.
    High,
}

/// Which formulas fit, choose and blend the models.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Formulas {
    /// This crate's: weighted fits, a risk that takes the noise off, predictions blended by their local error.
    #[default]
    Robust,
    /// Those of LPR (Eq. 1 to 7) to the letter: unweighted fits, the raw validation error, predictions averaged.
    Literal,
    /// Those of WLR (Moon et al. 2014, *Adaptive Rendering based on Weighted Local Regression*, Eq. 6 to 13): a fit of its own at every pixel, within
    /// bandwidths that are least in error. Slow.
    Wlr,
}

impl Formulas {
    /// Whether they are a paper's, kept as a baseline: they know of no fireflies and no clean pixels, predictions are averaged, and what they make of a
    /// pixel is left as it is.
    pub const fn are_published(self) -> bool {
        match self {
            Self::Robust => false,
            Self::Literal | Self::Wlr => true,
        }
    }
}

/// Parameters of the method; shared by every tile of an image.
///
/// ```
/// use linpred_core::{Params, Quality};
///
/// let params = Params::new(Quality::Fast).with_coverage(2);
/// assert_eq!(params.coverage, 2);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Params {
    /// Confidence that a pixel's predictions must add up to before it gets no model of its own; 0 counts as 1.
    ///
    /// A prediction that seems without error counts for up to 2.8, one that is off by half of the pixel's variance for 1, a bad one for next to
    /// nothing; with [published](Formulas::are_published) formulas, each for 1. No pixel has more than 361.
    pub coverage: u16,
    /// C of the perturbation bound: features' singular values below C times the norm of their noise are dropped (WLR
    /// section 4). 0 keeps all.
    pub truncation: f32,
    /// Strength with which a model's gradients are pulled to 0, in pixels of the window: delta of LPR Eq. 3.
    pub gradient_strength: f32,
    /// Strength with which a model's intercept is pulled to the centre's radiance, in pixels of the window.
    pub intercept_strength: f32,
    /// Whether models differ in the features that they see: prefiltered, smoothed more, as rendered.
    pub vary_features: bool,
    /// Which formulas.
    pub formulas: Formulas,
}

impl Params {
    /// The parameters of a quality.
    pub const fn new(quality: Quality) -> Self {
        let coverage = match quality {
            Quality::Fast => 1,
            Quality::Balanced => 3,
            Quality::High => 16,
        };
        Self {
            coverage,
            truncation: 0.75,
            gradient_strength: 0.01,
            intercept_strength: 1e-3,
            vary_features: !matches!(quality, Quality::Fast),
            formulas: Formulas::Robust,
        }
    }

    /// LPR's formulas to the letter, as a baseline: one model per pixel, delta = 0.001, C = 1.
    pub const fn literal() -> Self {
        Self {
            coverage: 1,
            truncation: 1.0,
            gradient_strength: 1e-3,
            intercept_strength: 1e-3,
            vary_features: false,
            formulas: Formulas::Literal,
        }
    }

    /// WLR's formulas to the letter, as a baseline: C = 2, and of a prior no more than what keeps a fit to few pixels from having no solution.
    pub const fn wlr() -> Self {
        Self {
            coverage: 1,
            truncation: 2.0,
            gradient_strength: 1e-4,
            intercept_strength: 0.0,
            vary_features: false,
            formulas: Formulas::Wlr,
        }
    }

    /// The same with another [`coverage`](Self::coverage).
    #[must_use]
    pub const fn with_coverage(mut self, coverage: u16) -> Self {
        self.coverage = coverage;
        self
    }

    /// The same with another [`truncation`](Self::truncation).
    #[must_use]
    pub const fn with_truncation(mut self, truncation: f32) -> Self {
        self.truncation = truncation;
        self
    }

    /// The same with another [`gradient_strength`](Self::gradient_strength).
    #[must_use]
    pub const fn with_gradient_strength(mut self, strength: f32) -> Self {
        self.gradient_strength = strength;
        self
    }

    /// The same with another [`intercept_strength`](Self::intercept_strength).
    #[must_use]
    pub const fn with_intercept_strength(mut self, strength: f32) -> Self {
        self.intercept_strength = strength;
        self
    }

    /// The same with or without [`vary_features`](Self::vary_features).
    #[must_use]
    pub const fn with_vary_features(mut self, vary: bool) -> Self {
        self.vary_features = vary;
        self
    }

    /// The same by other [`formulas`](Self::formulas).
    #[must_use]
    pub const fn with_formulas(mut self, formulas: Formulas) -> Self {
        self.formulas = formulas;
        self
    }
}

impl Default for Params {
    fn default() -> Self {
        Self::new(Quality::default())
    }
}
