//! What is compared.

use clap::ValueEnum;
use linpred_core::{Params, Quality};

/// A way to make an image less noisy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, ValueEnum)]
pub(crate) enum Method {
    /// The image as it came.
    Noisy,
    /// Mean of 5 x 5 pixels.
    Box,
    /// Joint bilateral filter on the features.
    Bilateral,
    /// Guided filter on the features.
    Guided,
    /// Non-local means of the colour with its variances.
    Nlm,
    /// linpred --quality fast.
    Fast,
    /// linpred --quality balanced.
    Balanced,
    /// linpred --quality high.
    High,
    /// linpred with a model at every pixel: what weighted local regression costs.
    PerPixel,
    /// LPR's formulas to the letter.
    Literal,
    /// WLR's formulas to the letter.
    Wlr,
    /// Open Image Denoise, quality fast, albedo and normal.
    OidnFast,
    /// The same, quality high.
    Oidn,
    /// Quality fast, albedo and normal denoised first.
    OidnFastPrefiltered,
    /// Quality high, likewise.
    OidnPrefiltered,
}

impl Method {
    /// Its name on the command line and in tables.
    pub(crate) fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// Open Image Denoise's quality, and whether features are denoised first, for the methods that are it.
    pub(crate) fn oidn(self) -> Option<(&'static str, bool)> {
        match self {
            Self::OidnFast => Some(("fast", false)),
            Self::Oidn => Some(("high", false)),
            Self::OidnFastPrefiltered => Some(("fast", true)),
            Self::OidnPrefiltered => Some(("high", true)),
            _ => None,
        }
    }

    /// linpred's parameters, for the methods that are linpred.
    pub(crate) fn params(self) -> Option<Params> {
        let every_pixel = Params::default().with_coverage(1024);
        match self {
            Self::Fast => Some(Params::new(Quality::Fast)),
            Self::Balanced => Some(Params::new(Quality::Balanced)),
            Self::High => Some(Params::new(Quality::High)),
            Self::PerPixel => Some(every_pixel),
            Self::Literal => Some(Params::literal()),
            Self::Wlr => Some(Params::wlr()),
            _ => None,
        }
    }
}
