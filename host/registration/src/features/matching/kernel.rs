//! The inner loops, for the processor at hand.
//!
//! LLVM turns the bounds of a box into shuffles of half registers, so for x86-64-v3 they are
//! written by hand: the same operations in the same order, without fused multiply-add, and so the
//! same bytes.

#[cfg(target_arch = "x86_64")]
use echoloop_dispatch::V3;

use super::row::WIDTH;
use super::tree::{Block, Node};

/// One number a query, or one a row of a block.
pub(super) type Lanes = [f32; WIDTH];

/// Bounds of eight lanes at once.
pub(super) trait BoundKernel: Copy {
    /// Squared distances of eight queries to a box.
    fn box_bounds(self, queries: &Block, node: &Node) -> Lanes;

    /// Squared distances of query `lane` to the rows of a block.
    fn row_bounds(self, queries: &Block, lane: usize, block: &Block) -> Lanes;

    /// Mask in which bit l is set when `bounds[l] ≤ limits[l]`.
    fn not_above(self, bounds: &Lanes, limits: &Lanes) -> u32;
}

/// The build for any processor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Portable;

impl BoundKernel for Portable {
    #[inline(always)]
    fn box_bounds(self, queries: &Block, node: &Node) -> Lanes {
        let mut sum = [0.0; WIDTH];
        for (axis, query) in queries.iter().enumerate() {
            for lane in 0..WIDTH {
                let (below, above) = (node.low[axis] - query[lane], query[lane] - node.high[axis]);
                let outside = if below > above { below } else { above };
                let outside = if outside > 0.0 { outside } else { 0.0 };
                sum[lane] += outside * outside;
            }
        }
        sum
    }

    #[inline(always)]
    fn row_bounds(self, queries: &Block, lane: usize, block: &Block) -> Lanes {
        let mut sum = [0.0; WIDTH];
        for (query, rows) in queries.iter().zip(block) {
            for row in 0..WIDTH {
                let difference = query[lane] - rows[row];
                sum[row] += difference * difference;
            }
        }
        sum
    }

    #[inline(always)]
    fn not_above(self, bounds: &Lanes, limits: &Lanes) -> u32 {
        (0..WIDTH).fold(0, |bits, lane| bits | u32::from(bounds[lane] <= limits[lane]) << lane)
    }
}

#[cfg(target_arch = "x86_64")]
impl BoundKernel for V3 {
    #[inline(always)]
    fn box_bounds(self, queries: &Block, node: &Node) -> Lanes {
        // SAFETY: a V3 exists only where AVX2 has been found.
        unsafe { v3::box_bounds(queries, node) }
    }

    #[inline(always)]
    fn row_bounds(self, queries: &Block, lane: usize, block: &Block) -> Lanes {
        // SAFETY: a V3 exists only where AVX2 has been found.
        unsafe { v3::row_bounds(queries, lane, block) }
    }

    #[inline(always)]
    fn not_above(self, bounds: &Lanes, limits: &Lanes) -> u32 {
        // SAFETY: a V3 exists only where AVX2 has been found.
        unsafe { v3::not_above(bounds, limits) }
    }
}

#[cfg(target_arch = "x86_64")]
mod v3 {
    use std::arch::x86_64::{
        __m256, _CMP_LE_OQ, _mm256_add_ps, _mm256_cmp_ps, _mm256_loadu_ps, _mm256_max_ps,
        _mm256_movemask_ps, _mm256_mul_ps, _mm256_set1_ps, _mm256_setzero_ps, _mm256_storeu_ps,
        _mm256_sub_ps,
    };

    use super::{Block, Lanes, Node, WIDTH};

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    pub(super) fn box_bounds(queries: &Block, node: &Node) -> Lanes {
        let mut sum = _mm256_setzero_ps();
        for ((query, &low), &high) in queries.iter().zip(&node.low).zip(&node.high) {
            let query = load(query);
            let below = _mm256_sub_ps(_mm256_set1_ps(low), query);
            let above = _mm256_sub_ps(query, _mm256_set1_ps(high));
            let outside = _mm256_max_ps(_mm256_max_ps(below, above), _mm256_setzero_ps());
            sum = _mm256_add_ps(sum, _mm256_mul_ps(outside, outside));
        }
        store(sum)
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    pub(super) fn row_bounds(queries: &Block, lane: usize, block: &Block) -> Lanes {
        let mut sum = _mm256_setzero_ps();
        for (query, rows) in queries.iter().zip(block) {
            let difference = _mm256_sub_ps(_mm256_set1_ps(query[lane]), load(rows));
            sum = _mm256_add_ps(sum, _mm256_mul_ps(difference, difference));
        }
        store(sum)
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    pub(super) fn not_above(bounds: &Lanes, limits: &Lanes) -> u32 {
        _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(load(bounds), load(limits))) as u32
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn load(lanes: &Lanes) -> __m256 {
        // SAFETY: eight f32 are the 32 bytes that are read; no alignment is asked for.
        unsafe { _mm256_loadu_ps(lanes.as_ptr()) }
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn store(register: __m256) -> Lanes {
        let mut lanes = [0.0; WIDTH];
        // SAFETY: eight f32 are the 32 bytes that are written; no alignment is asked for.
        unsafe { _mm256_storeu_ps(lanes.as_mut_ptr(), register) };
        lanes
    }
}
