//! Lanes: `L` cells are worked on side by side, one in each lane of the processor's registers. Their types, loops whose body works on all
//! lanes at once, and what keeps those fast.
//!
//! Every function on a cell's or a block's way is `inline(always)`, however large. A caller compiles the whole way into one function of its
//! own that carries the instruction set (`#[target_feature(enable = "avx2")]`, chosen when the program runs): code that was left outside it
//! would be compiled for the least that the target has, and called through memory in the middle of a loop. The optimiser's own judgement
//! depends on sizes and changes with its versions; this does not.

use core::ops::{AddAssign, Mul, Range};
use core::sync::atomic::{Ordering, compiler_fence};

use crate::tile::CHANNELS;

/// A value of each lane.
pub(crate) type Lanes<const L: usize> = [f32; L];
/// `N` values of each lane, those of one index side by side.
pub(crate) type Vector<const N: usize, const L: usize> = [Lanes<L>; N];
/// `N x N` values of each lane.
pub(crate) type Matrix<const N: usize, const L: usize> = [Vector<N, L>; N];
/// Red, green and blue of each lane.
pub(crate) type Rgb<const L: usize> = Vector<CHANNELS, L>;
/// [`Lanes`] in double precision, in which fits add up.
pub(crate) type WideLanes<const L: usize> = [f64; L];
/// [`Vector`] in double precision.
pub(crate) type WideVector<const N: usize, const L: usize> = [WideLanes<L>; N];
/// [`Matrix`] in double precision.
pub(crate) type WideMatrix<const N: usize, const L: usize> = [WideVector<N, L>; N];

/// Memory that vector loads like.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Aligned<A>(pub(crate) A);

/// Ends an iteration of a loop over pixels, terms or features.
///
/// The lanes of one pixel lie side by side in memory, those of the next do not: vector instructions are for lanes. LLVM's
/// loop vectoriser sees the unrolled lanes as so many strided streams, goes across pixels instead and gathers
/// (measured with AVX-512: the whole cell several times slower). A fence, which becomes no instruction, keeps it out.
/// An iterator that does this by itself reads better and takes 0.6 % more instructions.
#[inline(always)]
pub(crate) fn lanes_stay_innermost() {
    compiler_fence(Ordering::SeqCst);
}

/// Adds `left(p) * right(p)[j]` to `sums[j]`, for j of `range` and `N` pixels p in their order.
///
/// Four sums at a time stay in registers over all the pixels.
#[inline(always)]
pub(crate) fn add_products<'a, A, const W: usize, const N: usize, const L: usize>(
    sums: &mut [[A; L]; W],
    range: Range<usize>,
    left: impl Fn(usize) -> &'a [A; L],
    right: impl Fn(usize) -> &'a [[A; L]; W],
) where
    A: Copy + AddAssign + Mul<Output = A> + 'a,
{
    let mut j = range.start;
    while j + 4 <= range.end {
        add_block::<A, 4, W, N, L>(sums, j, &left, &right);
        j += 4;
    }
    match range.end.saturating_sub(j) {
        1 => add_block::<A, 1, W, N, L>(sums, j, &left, &right),
        2 => add_block::<A, 2, W, N, L>(sums, j, &left, &right),
        3 => add_block::<A, 3, W, N, L>(sums, j, &left, &right),
        _ => {}
    }
}

/// The same for the `K` sums from `j` on.
#[inline(always)]
fn add_block<'a, A, const K: usize, const W: usize, const N: usize, const L: usize>(
    sums: &mut [[A; L]; W],
    j: usize,
    left: &impl Fn(usize) -> &'a [A; L],
    right: &impl Fn(usize) -> &'a [[A; L]; W],
) where
    A: Copy + AddAssign + Mul<Output = A> + 'a,
{
    let Some(sums) = sums
        .get_mut(j..)
        .and_then(|sums| sums.first_chunk_mut::<K>())
    else {
        debug_assert!(false, "{K} sums from {j} of {W}");
        return;
    };
    let mut block = *sums;
    for p in 0..N {
        let by = left(p);
        if let Some(values) = right(p)
            .get(j..)
            .and_then(|values| values.first_chunk::<K>())
        {
            for (sum, value) in block.iter_mut().zip(values) {
                for l in 0..L {
                    sum[l] += by[l] * value[l];
                }
            }
        }
        lanes_stay_innermost();
    }
    *sums = block;
    lanes_stay_innermost();
}
