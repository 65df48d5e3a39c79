//! The core's loops, compiled for what the processor has.
//!
//! The core is portable code without fused multiply-add, so every level gives the same bits; wider registers only
//! make it faster.

use linpred_core::{
    Cells, ColourBlock, FeatureGroup, FilteredGroup, NoiseBlock, NoisyBlock, Params, PreparedBlock,
    Scratch, denoise_cells, estimate_colour_noise, estimate_feature_noise, prefilter, prepare,
};

use crate::row::FEATURES;

/// Features of a tile: position, then those of a row.
pub(crate) const TILE_FEATURES: usize = FEATURES + 2;

/// Cells that a thread denoises side by side: the lanes of the widest registers in double precision.
pub(crate) const LANES: usize = 8;

/// An instruction set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    /// What the target always has.
    Baseline,
    /// AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F, BW, DQ and VL.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Level {
    /// The best that this processor has.
    pub(crate) fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
            {
                return Self::Avx512;
            }
            if is_x86_feature_detected!("avx2") {
                return Self::Avx2;
            }
        }
        Self::Baseline
    }
}

/// Defines a method of [`Level`] that runs a core function compiled for the level.
macro_rules! dispatched {
    ($(#[$doc:meta])* $name:ident $([$($generics:tt)*])? ($($arg:ident: $ty:ty),*) -> $out:ty) => {
        impl Level {
            $(#[$doc])*
            #[cfg_attr(not(target_arch = "x86_64"), inline)]
            pub(crate) fn $name $(<$($generics)*>)? (self, $($arg: $ty),*) -> $out {
                #[cfg(target_arch = "x86_64")]
                {
                    #[target_feature(enable = "avx2")]
                    fn avx2 $(<$($generics)*>)? ($($arg: $ty),*) -> $out { $name($($arg),*) }
                    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
                    fn avx512 $(<$($generics)*>)? ($($arg: $ty),*) -> $out { $name($($arg),*) }
                    match self {
                        Self::Baseline => {}
                        // SAFETY: `detect` gives these levels only where the processor has their instructions.
                        Self::Avx2 => return unsafe { avx2($($arg),*) },
                        // SAFETY: as above.
                        Self::Avx512 => return unsafe { avx512($($arg),*) },
                    }
                }
                $name($($arg),*)
            }
        }
    };
}

dispatched! {
    /// [`linpred_core::prepare`].
    prepare(input: &ColourBlock, output: &mut PreparedBlock) -> ()
}
dispatched! {
    /// [`linpred_core::prefilter`].
    prefilter[const N: usize](input: &FeatureGroup<N>, output: &mut FilteredGroup<N>) -> bool
}
dispatched! {
    /// [`linpred_core::denoise_cells`].
    denoise_cells[C: Cells<TILE_FEATURES>](
        cells: &mut C,
        params: &Params,
        scratch: &mut Scratch<TILE_FEATURES, LANES>
    ) -> ()
}
dispatched! {
    /// [`linpred_core::estimate_colour_noise`].
    estimate_colour_noise(input: &NoisyBlock, output: &mut NoiseBlock) -> ()
}
dispatched! {
    /// [`linpred_core::estimate_feature_noise`].
    estimate_feature_noise(input: &NoisyBlock, output: &mut NoiseBlock) -> ()
}
