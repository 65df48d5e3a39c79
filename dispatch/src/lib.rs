//! The core's kernels, compiled for what the processor has, and chosen when the program runs.
//!
//! [`linpred_core`] is portable code without fused multiply-add, so every instruction set gives the same bits; wider registers only
//! make it faster. Nothing of a kernel's type is left open here but the number of planes of [`prefilter`](InstructionSet::prefilter): they are compiled once, in this crate, and
//! what calls them is compiled in no time.
//!
//! ```
//! use linpred_core::{ColourBlock, WeightBlock};
//! use linpred_dispatch::InstructionSet;
//!
//! let mut weights = Box::new(WeightBlock::EMPTY);
//! InstructionSet::detect().weigh_samples(&ColourBlock::BLACK, &mut weights);
//! ```

use linpred_core::{
    Averaged, BlockPlane, COMPARED_PLANES, Cells, ColourBlock, ComparedRow, DESPECKLE_SPAN,
    FeatureGroup, FilteredGroup, FinishedPlane, FrameRow, LIGHT_PLANES, LitRow, MEASURED_PLANES,
    NoiseBlock, NoisePlane, NoisyBlock, Params, Precisions, RESTORE_SPAN, SMOOTH_SPAN, Scratch,
    Smoothing, SpeckRow, Surroundings, TEMPORAL_SPAN, TILE_FEATURES, WIDE_TILE_FEATURES,
    WeightBlock,
};

/// Cells that a thread denoises side by side: the lanes of the widest registers in double precision.
pub const LANES: usize = 8;

/// An instruction set that this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstructionSet(Known);

/// An instruction set that there is code for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Known {
    /// What the target always has.
    Baseline,
    /// AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F, BW, DQ and VL.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl InstructionSet {
    /// What the target always has: SSE2 on x86-64, NEON on AArch64.
    pub const BASELINE: Self = Self(Known::Baseline);

    /// AVX2, if there is code for it and this processor has it.
    pub fn avx2() -> Option<Self> {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            return Some(Self(Known::Avx2));
        }
        None
    }

    /// AVX-512 F, BW, DQ and VL, if there is code for it and this processor has it.
    pub fn avx512() -> Option<Self> {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
        {
            return Some(Self(Known::Avx512));
        }
        None
    }

    /// The best that this processor has.
    pub fn detect() -> Self {
        Self::avx512().or_else(Self::avx2).unwrap_or(Self::BASELINE)
    }
}

/// Makes a method of [`InstructionSet`] of each of the core's functions. Each instruction set is a module, which the compiler translates beside the others.
macro_rules! kernels {
    ($($(#[$doc:meta])* $name:ident $([$($generics:tt)*])? ($($arg:ident: $ty:ty),*) -> $out:ty;)*) => {
        mod baseline {
            use super::*;
            $(pub(super) fn $name $(<$($generics)*>)? ($($arg: $ty),*) -> $out { linpred_core::$name($($arg),*) })*
        }

        #[cfg(target_arch = "x86_64")]
        mod avx2 {
            use super::*;
            $(#[target_feature(enable = "avx2")]
            pub(super) fn $name $(<$($generics)*>)? ($($arg: $ty),*) -> $out { linpred_core::$name($($arg),*) })*
        }

        #[cfg(target_arch = "x86_64")]
        mod avx512 {
            use super::*;
            $(#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
            pub(super) fn $name $(<$($generics)*>)? ($($arg: $ty),*) -> $out { linpred_core::$name($($arg),*) })*
        }

        impl InstructionSet {
            $($(#[$doc])*
            pub fn $name $(<$($generics)*>)? (self, $($arg: $ty),*) -> $out {
                match self.0 {
                    Known::Baseline => baseline::$name($($arg),*),
                    // SAFETY: there is no such value but where the processor has the instructions.
                    #[cfg(target_arch = "x86_64")]
                    Known::Avx2 => unsafe { avx2::$name($($arg),*) },
                    // SAFETY: as above.
                    #[cfg(target_arch = "x86_64")]
                    Known::Avx512 => unsafe { avx512::$name($($arg),*) },
                }
            })*
        }
    };
}

kernels! {
    /// [`linpred_core::weigh_samples`].
    weigh_samples(input: &ColourBlock, output: &mut WeightBlock) -> ();
    /// [`linpred_core::prefilter`].
    prefilter[const N: usize](
        input: &FeatureGroup<N>,
        output: &mut FilteredGroup<N>,
        smoothed: Option<&mut FilteredGroup<N>>
    ) -> bool;
    /// [`linpred_core::denoise_cells`]. Whose cells they are is not known when it is compiled: it is most of what the compiler does here, and would be made for each.
    denoise_cells(
        cells: &mut dyn Cells<TILE_FEATURES>,
        params: &Params,
        scratch: &mut Scratch<TILE_FEATURES, LANES>
    ) -> ();
    /// [`linpred_core::estimate_colour_noise`].
    estimate_colour_noise(input: &NoisyBlock, output: &mut NoiseBlock) -> ();
    /// [`linpred_core::estimate_feature_noise`].
    estimate_feature_noise(input: &NoisyBlock, output: &mut NoiseBlock) -> ();
    /// [`linpred_core::estimate_further_noise`].
    estimate_further_noise(input: &NoisePlane, output: &mut BlockPlane) -> ();
    /// [`linpred_core::weigh_pixels`].
    weigh_pixels(pass: &Smoothing, input: &Surroundings<'_>, output: &mut Precisions<'_>) -> ();
    /// [`linpred_core::smooth`].
    smooth(
        pass: &Smoothing,
        rows: &[ComparedRow<'_>; SMOOTH_SPAN],
        planes: &mut [FinishedPlane<'_, SMOOTH_SPAN>]
    ) -> ();
    /// [`linpred_core::despeckle`].
    despeckle(input: &SpeckRow<'_>, planes: &mut [FinishedPlane<'_, DESPECKLE_SPAN>]) -> ();
    /// [`linpred_core::compare_light`].
    compare_light(input: &LitRow<'_>, output: [&mut [f32]; LIGHT_PLANES]) -> ();
    /// [`linpred_core::find_factors`].
    find_factors(
        planes: &[[&[f32]; RESTORE_SPAN]; LIGHT_PLANES],
        noisy: &[f32],
        output: &mut [f32]
    ) -> ();
    /// [`linpred_core::compare_own`].
    compare_own(
        own: &FrameRow<'_>,
        known: &[f32],
        output: [&mut [f32]; COMPARED_PLANES]
    ) -> ();
    /// [`linpred_core::compare_frames`].
    compare_frames(
        own: &FrameRow<'_>,
        other: &FrameRow<'_>,
        known: &[f32],
        output: [&mut [f32]; COMPARED_PLANES]
    ) -> ();
    /// [`linpred_core::measure_frame`].
    measure_frame(
        planes: &[[&[f32]; TEMPORAL_SPAN]; COMPARED_PLANES],
        output: &mut [&mut [f32]; MEASURED_PLANES]
    ) -> ();
    /// [`linpred_core::weigh_frames`].
    weigh_frames(
        own: &[&[f32]; MEASURED_PLANES],
        others: &mut [([&[f32]; MEASURED_PLANES], &mut [f32])],
        alike: f32,
        known: bool
    ) -> ();
    /// [`linpred_core::average_frames`].
    average_frames(
        own: &[f32],
        others: &[(&[f32], &[f32])],
        what: Averaged,
        output: &mut [f32]
    ) -> ();
}

/// What denoises tiles with further features: apart, as it takes the compiler as long as all the others.
mod wide {
    use super::*;

    pub(super) fn denoise_cells(
        cells: &mut dyn Cells<WIDE_TILE_FEATURES>,
        params: &Params,
        scratch: &mut Scratch<WIDE_TILE_FEATURES, LANES>,
    ) {
        linpred_core::denoise_cells(cells, params, scratch);
    }

    #[cfg(target_arch = "x86_64")]
    pub(super) mod avx2 {
        use super::*;

        #[target_feature(enable = "avx2")]
        pub(in super::super) fn denoise_cells(
            cells: &mut dyn Cells<WIDE_TILE_FEATURES>,
            params: &Params,
            scratch: &mut Scratch<WIDE_TILE_FEATURES, LANES>,
        ) {
            linpred_core::denoise_cells(cells, params, scratch);
        }
    }
}

impl InstructionSet {
    /// [`linpred_core::denoise_cells`] of tiles with further features. They are compiled for AVX2 at most, which AVX-512 has, too: the compiler has one set less to make, and each costs it
    /// as much as for the others.
    pub fn denoise_wide_cells(
        self,
        cells: &mut dyn Cells<WIDE_TILE_FEATURES>,
        params: &Params,
        scratch: &mut Scratch<WIDE_TILE_FEATURES, LANES>,
    ) {
        #[cfg(target_arch = "x86_64")]
        if self != Self::BASELINE {
            // SAFETY: there is no such value but where the processor has the instructions, and AVX-512 comes with AVX2.
            return unsafe { wide::avx2::denoise_cells(cells, params, scratch) };
        }
        wide::denoise_cells(cells, params, scratch);
    }
}
