//! Matched filter with multiply-adds of pairs, by AVX2 and, where it exists, AVX-512.

use core::arch::x86_64::{
    __m256i, _mm256_add_epi32, _mm256_blend_epi16, _mm256_loadu_si256, _mm256_madd_epi16,
    _mm256_set1_epi32, _mm256_slli_epi32, _mm256_srli_epi32, _mm256_storeu_si256,
};

use echoloop_dispatch::has_avx512;
use echoloop_dsp::filter::{self, BLOCK};

use super::groups::in_groups;
use super::wide_filter;

/// Number of blocks of outputs computed at a time: there are registers for that many sums.
const BLOCKS: usize = 4;

/// [`filter::correlate`], bit for bit: 128 outputs at a time where there is AVX-512, then 64, then
/// 16.
///
/// Per pair of taps and 16 outputs one load of x and two `vpmaddwd`:
///
/// ```text
/// y[n]     += h[2j]·x[n+2j]   + h[2j+1]·x[n+2j+1]      n even
/// y[n + 1] += h[2j−1]·x[n+2j] + h[2j]·x[n+2j+1]        h[−1] = 0
/// ```
///
/// The second line needs the last tap to be zero. If Σ abs(h) < 1, sums cannot round to +1, and no
/// saturation is needed. Other taps go to the portable form.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(super) fn correlate(taps: &[i16], padded: &[i16], y: &mut [i16]) {
    // SAFETY: AVX-512 is used where it has just been found.
    unsafe { correlate_by(has_avx512(), taps, padded, y) }
}

/// [`correlate`], with AVX-512 too if `wide`.
///
/// # Safety
///
/// `wide` may be true only where [`has_avx512`] is.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
unsafe fn correlate_by(wide: bool, taps: &[i16], padded: &[i16], y: &mut [i16]) {
    let weight: u32 = taps.iter().map(|&h| u32::from(h.unsigned_abs())).sum();
    if weight > 0x7fff || taps.last() != Some(&0) || !taps.len().is_multiple_of(2) {
        return filter::correlate(taps, padded, y);
    }
    let mut done = 0;
    if wide {
        // SAFETY: the caller vouches for AVX-512; there are two taps or more, an even number.
        done = unsafe { wide_filter::blocks(taps, padded, y) };
    }
    // SAFETY: as above.
    unsafe {
        done += blocks::<BLOCKS>(taps, &padded[done..], &mut y[done..]);
        blocks::<1>(taps, &padded[done..], &mut y[done..]);
    }
}

/// Filters all groups of `B` blocks that `padded` and `y` hold; returns the number of outputs.
///
/// # Safety
///
/// There are two taps or more, an even number.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
unsafe fn blocks<const B: usize>(taps: &[i16], padded: &[i16], y: &mut [i16]) -> usize {
    // SAFETY: the caller vouches for the taps, `in_groups` for samples and room.
    in_groups(B * BLOCK, taps, padded, y, |x, y| unsafe { group::<B>(taps, x, y) })
}

/// Filters `B` blocks of outputs.
///
/// # Safety
///
/// `x` points to `taps.len() + 16·B` samples, `y` to room for `16·B`. There are two taps or more,
/// an even number.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
unsafe fn group<const B: usize>(taps: &[i16], x: *const i16, y: *mut i16) {
    let half_lsb = _mm256_set1_epi32(1 << 14);
    let (mut even, mut odd) = ([half_lsb; B], [half_lsb; B]);
    let mut add = |j: usize, of_even: __m256i, of_odd: __m256i| {
        for b in 0..B {
            // SAFETY: the last sample read is 2·(taps/2 − 1) + 16·(B − 1) + 15, which the caller
            // vouches for.
            let x = unsafe { _mm256_loadu_si256(x.add(2 * j + BLOCK * b).cast()) };
            even[b] = _mm256_add_epi32(even[b], _mm256_madd_epi16(x, of_even));
            odd[b] = _mm256_add_epi32(odd[b], _mm256_madd_epi16(x, of_odd));
        }
    };
    // SAFETY: taps 0 and 1 and, for j from 1, taps 2j − 1 to 2j + 1 are among them.
    unsafe {
        let h = taps.as_ptr();
        add(0, pair(h), _mm256_slli_epi32::<16>(pair(h)));
        for j in 1..taps.len() / 2 {
            add(j, pair(h.add(2 * j)), pair(h.add(2 * j - 1)));
        }
    }
    for b in 0..B {
        // Bits 15 to 30 are the rounded output: even outputs go to the low half of a lane, odd ones
        // to the high half.
        let rounded = _mm256_blend_epi16::<0xaa>(
            _mm256_srli_epi32::<15>(even[b]),
            _mm256_slli_epi32::<1>(odd[b]),
        );
        // SAFETY: y has room for 16·B.
        unsafe { _mm256_storeu_si256(y.add(BLOCK * b).cast(), rounded) };
    }
}

/// A tap and the next one in every lane: one broadcasting load.
///
/// # Safety
///
/// `taps` points to two.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
unsafe fn pair(taps: *const i16) -> __m256i {
    // SAFETY: the caller vouches for both.
    _mm256_set1_epi32(unsafe { taps.cast::<i32>().read_unaligned() })
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::filter::PADDING;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use echoloop_dispatch::has_v3;

    /// Taps whose magnitudes add up to exactly `weight`, random signs, and a last zero where
    /// `closed`.
    fn taps(rng: &mut ChaCha8Rng, count: usize, weight: u32, closed: bool) -> Vec<i16> {
        let used = count - usize::from(closed);
        let mut magnitudes = vec![0u32; used];
        for _ in 0..8 {
            magnitudes[rng.random_range(0..used)] += weight / 8;
        }
        magnitudes[0] += weight % 8;
        let sign = |rng: &mut ChaCha8Rng| if rng.random() { 1 } else { -1 };
        let signed =
            magnitudes.into_iter().map(|m| (m as i32 * sign(rng)).clamp(-0x8000, 0x7fff) as i16);
        signed.chain(std::iter::repeat_n(0, usize::from(closed))).collect()
    }

    #[test]
    fn outputs_are_those_of_the_portable_form_up_to_the_whole_scale_and_beyond() {
        if !echoloop_needs::avx2(has_v3()) {
            return;
        }
        let widths: &[bool] =
            if echoloop_needs::avx512(has_avx512()) { &[false, true] } else { &[false] };
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        for i in 0..4_000 {
            let count = 2 * rng.random_range(1..=64);
            let weight = [0x7fff, 0x8000, 0x7ffe, 100][i % 4];
            let taps = taps(&mut rng, count, weight, i % 8 < 6);
            let samples = rng.random_range(0..if i / 8 % 2 == 0 { 200 } else { 2401 });
            let extremes = i % 3 == 0;
            let sample = |rng: &mut ChaCha8Rng| match extremes {
                true => [i16::MIN, i16::MAX][usize::from(rng.random::<bool>())],
                false => rng.random(),
            };
            // Sometimes fewer samples than the outputs need, and room that is no whole block.
            let missing = if i % 5 == 0 { rng.random_range(0..PADDING + 300) } else { 0 };
            let given = (samples + count + PADDING).saturating_sub(missing);
            let room = if i % 7 == 0 { samples } else { samples.next_multiple_of(BLOCK) };
            let padded: Vec<i16> = (0..given).map(|_| sample(&mut rng)).collect();
            let untouched = vec![7; room + 2 * BLOCK];
            let mut expected = untouched.clone();
            filter::correlate(&taps, &padded, &mut expected[..room]);
            for &wide in widths {
                let mut y = untouched.clone();
                // SAFETY: AVX2 has been found, and AVX-512 where it is asked for.
                unsafe { correlate_by(wide, &taps, &padded, &mut y[..room]) };
                assert_eq!(y, expected, "case {i}: {count} taps, {samples}, AVX-512: {wide}");
            }
        }
    }
}
