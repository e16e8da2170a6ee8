//! Search for the first sample that reaches the threshold.

use core::arch::x86_64::{
    _mm256_cmpgt_epi16, _mm256_loadu_si256, _mm256_movemask_epi8, _mm256_packs_epi16,
    _mm256_permute4x64_epi64, _mm256_set1_epi16,
};

/// Index of the first value that is not below `threshold`, reading 32 at a time.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(super) fn first_reaching(values: &[i16], threshold: i16) -> Option<usize> {
    let (blocks, rest) = values.as_chunks::<32>();
    let limit = _mm256_set1_epi16(threshold);
    for (i, block) in blocks.iter().enumerate() {
        // SAFETY: both halves of 32 values are read; the loads need no alignment.
        let (first, second) = unsafe {
            (
                _mm256_loadu_si256(block.as_ptr().cast()),
                _mm256_loadu_si256(block.as_ptr().add(16).cast()),
            )
        };
        let below =
            _mm256_packs_epi16(_mm256_cmpgt_epi16(limit, first), _mm256_cmpgt_epi16(limit, second));
        // Packing works within 128-bit lanes, so the middle two quarters have to change places.
        let below = _mm256_movemask_epi8(_mm256_permute4x64_epi64::<0b11_01_10_00>(below)) as u32;
        if below != u32::MAX {
            return Some(32 * i + below.trailing_ones() as usize);
        }
    }
    rest.iter().position(|&value| value >= threshold).map(|i| 32 * blocks.len() + i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_dispatch::has_v3;

    #[test]
    fn the_first_value_at_the_threshold_is_found_wherever_it_lies() {
        if !echoloop_needs::avx2(has_v3()) {
            return;
        }
        for threshold in [i16::MIN, -3, 1, 500, i16::MAX] {
            let below = threshold.saturating_sub(1);
            for length in 0..150 {
                for at in 0..length {
                    let mut values = vec![below; length];
                    values[at..].iter_mut().step_by(3).for_each(|value| *value = threshold);
                    let expected = values.iter().position(|&value| value >= threshold);
                    // SAFETY: AVX2 has been found.
                    assert_eq!(unsafe { first_reaching(&values, threshold) }, expected);
                }
                // SAFETY: AVX2 has been found.
                let none = unsafe { first_reaching(&vec![below; length], threshold) };
                assert_eq!(none.is_none(), below < threshold || length == 0);
            }
        }
    }
}
