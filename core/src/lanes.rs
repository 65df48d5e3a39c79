//! How loops whose body works on several lanes are kept what they are.

use core::sync::atomic::{Ordering, compiler_fence};

/// Ends an iteration of a loop over pixels, terms or features.
///
/// The lanes of one pixel lie side by side in memory, those of the next do not: vector instructions are for lanes. LLVM's
/// loop vectoriser sees the unrolled lanes as so many strided streams, goes across pixels instead and gathers
/// (measured with AVX-512: the whole cell several times slower). A fence, which becomes no instruction, keeps it out.
#[inline(always)]
pub(crate) fn lanes_stay_innermost() {
    compiler_fence(Ordering::SeqCst);
}
