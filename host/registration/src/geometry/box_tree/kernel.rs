//! Comparisons of eight numbers.

/// As many as a vector of AVX2 holds.
pub(in crate::geometry) const WIDE: usize = 8;

/// Comparisons of eight numbers in the instructions of a processor.
pub(crate) trait LaneKernel: Copy {
    /// One bit a lane: whether it is at most `limit`.
    fn at_most(self, lanes: &[f32; WIDE], limit: f32) -> u32;

    /// The least lane, which is replaced by [`u32::MAX`]; all lanes below that differ.
    fn take_least(self, lanes: &mut [u32; WIDE]) -> u32;
}

/// [`LaneKernel`] for every processor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

impl LaneKernel for Portable {
    #[inline(always)]
    fn at_most(self, lanes: &[f32; WIDE], limit: f32) -> u32 {
        lanes
            .iter()
            .enumerate()
            .fold(0, |bits, (lane, value)| bits | u32::from(*value <= limit) << lane)
    }

    #[inline(always)]
    fn take_least(self, lanes: &mut [u32; WIDE]) -> u32 {
        let least = lanes.iter().fold(u32::MAX, |a, &b| a.min(b));
        *lanes = lanes.map(|lane| if lane == least { u32::MAX } else { lane });
        least
    }
}

#[cfg(target_arch = "x86_64")]
mod v3 {
    use std::arch::x86_64::{
        __m128i, _CMP_LE_OQ, _mm_cvtsi128_si32, _mm_min_epu32, _mm_shuffle_epi32,
        _mm256_castsi256_si128, _mm256_cmp_ps, _mm256_cmpeq_epi32, _mm256_extracti128_si256,
        _mm256_loadu_ps, _mm256_loadu_si256, _mm256_movemask_ps, _mm256_or_si256,
        _mm256_set1_epi32, _mm256_set1_ps, _mm256_storeu_si256,
    };

    use echoloop_dispatch::V3;

    use super::LaneKernel;

    impl LaneKernel for V3 {
        #[inline(always)]
        fn at_most(self, lanes: &[f32; 8], limit: f32) -> u32 {
            // SAFETY: a V3 exists only where AVX2 has been found. Eight f32 are the 32 bytes that
            // are read; no alignment is asked for.
            unsafe {
                let compared = _mm256_cmp_ps::<_CMP_LE_OQ>(
                    _mm256_loadu_ps(lanes.as_ptr()),
                    _mm256_set1_ps(limit),
                );
                _mm256_movemask_ps(compared) as u32
            }
        }

        #[inline(always)]
        fn take_least(self, lanes: &mut [u32; 8]) -> u32 {
            // SAFETY: as above; the eight u32 are the 32 bytes that are read and written.
            unsafe {
                let all = _mm256_loadu_si256(lanes.as_ptr().cast());
                let four =
                    _mm_min_epu32(_mm256_castsi256_si128(all), _mm256_extracti128_si256::<1>(all));
                let least = least_of_four(four);
                let taken = _mm256_cmpeq_epi32(all, _mm256_set1_epi32(least as i32));
                _mm256_storeu_si256(lanes.as_mut_ptr().cast(), _mm256_or_si256(all, taken));
                least
            }
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn least_of_four(lanes: __m128i) -> u32 {
        let two = _mm_min_epu32(lanes, _mm_shuffle_epi32::<0b01_00_11_10>(lanes));
        _mm_cvtsi128_si32(_mm_min_epu32(two, _mm_shuffle_epi32::<0b10_11_00_01>(two))) as u32
    }
}
