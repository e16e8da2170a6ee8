//! Slices filled block by block, a block being a register's numbers.

use super::key::STEP;

/// Fills `z` with the blocks that `next` gives; the last block is cut to fit.
#[inline(always)]
pub(super) fn fill<const LANES: usize>(z: &mut [f32], mut next: impl FnMut(&mut [f32; LANES])) {
    let (blocks, rest) = z.as_chunks_mut();
    for block in blocks {
        next(block);
    }
    if !rest.is_empty() {
        let mut last = [0.0; LANES];
        next(&mut last);
        rest.copy_from_slice(&last[..rest.len()]);
    }
}

/// Counters of the first block, times [`STEP`].
#[inline(always)]
pub(super) fn counters<const LANES: usize>() -> [u32; LANES] {
    std::array::from_fn(|n| (n as u32).wrapping_mul(STEP))
}
