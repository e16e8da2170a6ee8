//! Numbers in blocks, as many at a time as a register holds.

use super::key::STEP;

/// Fills `z` by blocks from `next`, the last one in part.
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

/// The counters of the first block, spread.
#[inline(always)]
pub(super) fn counters<const LANES: usize>() -> [u32; LANES] {
    std::array::from_fn(|n| (n as u32).wrapping_mul(STEP))
}
