//! Matched filter with the multiply-adds of AVX-512, which multiply and add up in one instruction.

use core::arch::x86_64::{
    __m512i, _mm512_dpwssd_epi32, _mm512_loadu_si512, _mm512_mask_blend_epi16, _mm512_set1_epi32,
    _mm512_slli_epi32, _mm512_srli_epi32, _mm512_storeu_si512,
};

use super::groups::in_groups;

/// Number of outputs that a register holds.
const LANES: usize = 32;

/// Number of registers of outputs computed at a time: with fewer, a multiply-add waits for the last
/// one.
const REGISTERS: usize = 4;

/// Mask of the odd lanes of 16 bits.
const ODD: u32 = 0xaaaa_aaaa;

/// Filters all groups of 128 outputs that `padded` and `y` hold; returns the number of outputs.
///
/// Equal to `filter` bit for bit, for the taps that are described there: sums are exact, so the
/// order of additions does not matter.
///
/// # Safety
///
/// There are two taps or more, an even number.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
pub(super) unsafe fn blocks(taps: &[i16], padded: &[i16], y: &mut [i16]) -> usize {
    // SAFETY: the caller vouches for the taps, `in_groups` for samples and room.
    in_groups(REGISTERS * LANES, taps, padded, y, |x, y| unsafe { group(taps, x, y) })
}

/// Filters 128 outputs.
///
/// # Safety
///
/// `x` points to `taps.len() + 128` samples, `y` to room for 128. There are two taps or more, an
/// even number.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
unsafe fn group(taps: &[i16], x: *const i16, y: *mut i16) {
    let half_lsb = _mm512_set1_epi32(1 << 14);
    let (mut even, mut odd) = ([half_lsb; REGISTERS], [half_lsb; REGISTERS]);
    let mut add = |j: usize, of_even: __m512i, of_odd: __m512i| {
        for r in 0..REGISTERS {
            // SAFETY: the last sample read is 2·(taps/2 − 1) + 127, which the caller vouches for.
            let x = unsafe { _mm512_loadu_si512(x.add(2 * j + LANES * r).cast()) };
            even[r] = _mm512_dpwssd_epi32(even[r], x, of_even);
            odd[r] = _mm512_dpwssd_epi32(odd[r], x, of_odd);
        }
    };
    // SAFETY: taps 0 and 1 and, for j from 1, taps 2j − 1 to 2j + 1 are among them.
    unsafe {
        let h = taps.as_ptr();
        add(0, pair(h), _mm512_slli_epi32::<16>(pair(h)));
        for j in 1..taps.len() / 2 {
            add(j, pair(h.add(2 * j)), pair(h.add(2 * j - 1)));
        }
    }
    for r in 0..REGISTERS {
        let (even, odd) = (_mm512_srli_epi32::<15>(even[r]), _mm512_slli_epi32::<1>(odd[r]));
        let rounded = _mm512_mask_blend_epi16(ODD, even, odd);
        // SAFETY: y has room for 128.
        unsafe { _mm512_storeu_si512(y.add(LANES * r).cast(), rounded) };
    }
}

/// A tap and the next one in every lane.
///
/// # Safety
///
/// `taps` points to two.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
unsafe fn pair(taps: *const i16) -> __m512i {
    // SAFETY: the caller vouches for both.
    _mm512_set1_epi32(unsafe { taps.cast::<i32>().read_unaligned() })
}
