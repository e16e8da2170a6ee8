//! Median and median absolute deviation by counts over bytes, four counts a pass.

use core::arch::x86_64::{
    __m256i, _mm_add_epi64, _mm_cvtsi128_si64, _mm_unpackhi_epi64, _mm256_abs_epi8,
    _mm256_castsi256_si128, _mm256_cmpgt_epi8, _mm256_extracti128_si256, _mm256_loadu_si256,
    _mm256_min_epu8, _mm256_or_si256, _mm256_packs_epi16, _mm256_sad_epu8, _mm256_set1_epi8,
    _mm256_set1_epi16, _mm256_setzero_si256, _mm256_slli_epi64, _mm256_sub_epi8, _mm256_subs_epi8,
    _mm256_subs_epi16, _mm256_xor_si256,
};
use core::mem::MaybeUninit;

use echoloop_dsp::MAX_SAMPLES;
use echoloop_dsp::statistics::{OrderStatistics, Statistics, count_within};

use crate::four_probes;

/// Number of samples that a register holds as bytes.
const LANES: usize = 32;

/// Number of registers that a waveform fills.
const REGISTERS: usize = MAX_SAMPLES.div_ceil(LANES);

const _: () = assert!(REGISTERS <= u8::MAX as usize, "a byte counts one sample of every register");

/// Order statistics of 1 to [`MAX_SAMPLES`] codes, equal to
/// [`echoloop_dsp::statistics::by_counting`] bit for bit.
///
/// The codes are written once as their distance from the guessed median, a byte each. Most noise
/// fits; if it does not, or if a bound is too far away, the codes themselves are counted.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(super) fn order_statistics(codes: &[u16], guess: &Statistics) -> OrderStatistics {
    let mut room = [const { MaybeUninit::uninit() }; REGISTERS];
    let near = Near::new(codes, guess.median, &mut room);
    let at_most = |bounds| near.at_most(bounds);
    let within = |median, bounds| near.within(median, bounds);
    four_probes::order_statistics(codes.len() as u32, guess, at_most, within)
}

/// Waveform, with the distances of its codes from a centre in bytes.
struct Near<'a> {
    codes: &'a [u16],
    centre: i32,
    /// `code − centre`; −128 and 127 stand for all values beyond. The rest of the last register
    /// holds 127.
    bytes: &'a [__m256i],
}

impl<'a> Near<'a> {
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn new(codes: &'a [u16], centre: u16, room: &'a mut [MaybeUninit<__m256i>; REGISTERS]) -> Self {
        let (whole, rest) = codes.as_chunks();
        let mut used = 0;
        for (bytes, codes) in room.iter_mut().zip(whole) {
            bytes.write(narrow(codes, centre));
            used += 1;
        }
        if let (false, Some(bytes)) = (rest.is_empty(), room.get_mut(used)) {
            let mut last = [u16::MAX; LANES];
            last[..rest.len()].copy_from_slice(rest);
            bytes.write(narrow(&last, centre));
            used += 1;
        }
        // SAFETY: the first `used` have just been written.
        let bytes = unsafe { room[..used].assume_init_ref() };
        Self { codes, centre: centre.into(), bytes }
    }

    /// `#{x ≤ bound}` for four rising bounds.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn at_most(&self, bounds: [i32; 4]) -> [u32; 4] {
        let relative = bounds.map(|bound| bound - self.centre);
        if self.fills_up() && relative[0] >= -128 && relative[3] <= 126 {
            self.count(relative, |byte| byte)
        } else {
            count_wide(self.codes, bounds.map(|bound| (0, bound)))
        }
    }

    /// `#{|x − m| ≤ bound}` for four rising bounds, the last not negative.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn within(&self, median: u16, bounds: [i32; 4]) -> [u32; 4] {
        let m = i32::from(median);
        let relative = m - self.centre;
        // The bytes that stand for all values beyond must be further from m than the last bound.
        if self.fills_up()
            && bounds[0] >= -128
            && bounds[3] >= 0
            && bounds[3] + relative.abs() <= 126
        {
            let (middle, most) = (_mm256_set1_epi8(relative as i8), _mm256_set1_epi8(127));
            self.count(bounds, |byte| {
                _mm256_min_epu8(_mm256_abs_epi8(_mm256_subs_epi8(byte, middle)), most)
            })
        } else {
            count_wide(self.codes, bounds.map(|bound| ((m - bound).max(0), m + bound)))
        }
    }

    /// True when the codes that pad the last register, 0xffff, have become 127.
    #[inline(always)]
    fn fills_up(&self) -> bool {
        self.centre <= 0xffff - 127
    }

    /// Number of `of(byte)` that are at most each bound, −128..=126.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn count(&self, bounds: [i32; 4], of: impl Fn(__m256i) -> __m256i) -> [u32; 4] {
        let bounds = bounds.map(|bound| _mm256_set1_epi8(bound as i8));
        let mut above = [_mm256_setzero_si256(); 4];
        for &byte in self.bytes {
            let value = of(byte);
            for (above, bound) in above.iter_mut().zip(bounds) {
                *above = _mm256_sub_epi8(*above, _mm256_cmpgt_epi8(value, bound));
            }
        }
        let all = (LANES * self.bytes.len()) as u32;
        sums(above).map(|above| all - above)
    }
}

/// 32 codes as bytes: `code − centre`, saturating.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn narrow(codes: &[u16; LANES], centre: u16) -> __m256i {
    // Codes are unsigned but saturation is signed: both sides of the difference are moved down by
    // 2¹⁵.
    let sign = _mm256_set1_epi16(i16::MIN);
    let centre = _mm256_set1_epi16((centre ^ 0x8000) as i16);
    // SAFETY: both halves of 32 codes are read; the loads need no alignment.
    let halves = unsafe {
        [
            _mm256_loadu_si256(codes.as_ptr().cast()),
            _mm256_loadu_si256(codes.as_ptr().add(LANES / 2).cast()),
        ]
    };
    let [first, second] =
        halves.map(|half| _mm256_subs_epi16(_mm256_xor_si256(half, sign), centre));
    _mm256_packs_epi16(first, second) // not in order, which does not matter for counts
}

/// Sums of 32 bytes each, below 2¹⁶: all four in one register, 16 bits apart.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn sums(bytes: [__m256i; 4]) -> [u32; 4] {
    let [a, b, c, d] = bytes.map(|bytes| _mm256_sad_epu8(bytes, _mm256_setzero_si256()));
    let low = _mm256_or_si256(a, _mm256_slli_epi64::<16>(b));
    let high = _mm256_or_si256(_mm256_slli_epi64::<32>(c), _mm256_slli_epi64::<48>(d));
    let fours = _mm256_or_si256(low, high);
    let twos = _mm_add_epi64(_mm256_castsi256_si128(fours), _mm256_extracti128_si256::<1>(fours));
    let all = _mm_cvtsi128_si64(_mm_add_epi64(twos, _mm_unpackhi_epi64(twos, twos))) as u64;
    [0, 16, 32, 48].map(|shift| u32::from((all >> shift) as u16))
}

/// Number of codes within each interval, ends included.
#[inline(never)]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn count_wide(codes: &[u16], intervals: [(i32, i32); 4]) -> [u32; 4] {
    intervals.map(|(low, high)| count_within(codes, low, high))
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::statistics::by_counting;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use echoloop_dispatch::has_v3;

    /// Codes of noise of any level and width, sometimes with others far away, and a guess that is
    /// good, bad or wild.
    fn case(rng: &mut ChaCha8Rng) -> (Vec<u16>, Statistics) {
        let (level, width) = (rng.random_range(0..=0xffffu32), 1u32 << rng.random_range(0..17));
        let strays = rng.random_range(0..4) == 0;
        let length =
            if rng.random() { rng.random_range(1..70) } else { rng.random_range(1..=MAX_SAMPLES) };
        let noise = |rng: &mut ChaCha8Rng| {
            (level + rng.random_range(0..width)).saturating_sub(width / 2).min(0xffff)
        };
        let code = |rng: &mut ChaCha8Rng| {
            if strays && rng.random() { rng.random() } else { noise(rng) as u16 }
        };
        let codes: Vec<u16> = (0..length).map(|_| code(rng)).collect();
        let of = by_counting(&codes, 0xffff, &Statistics::default());
        let off = |rng: &mut ChaCha8Rng, value: u16| match rng.random_range(0..3) {
            0 => value,
            1 => value.saturating_add(rng.random_range(0..200)).saturating_sub(100),
            _ => rng.random(),
        };
        let (median, deviation) = (off(rng, of.median.value), off(rng, of.deviation.value));
        (codes, Statistics { median, deviation, ..Statistics::default() })
    }

    #[test]
    fn order_statistics_are_those_of_the_portable_form_whatever_was_guessed() {
        if !echoloop_needs::avx2(has_v3()) {
            return;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for i in 0..20_000 {
            let (codes, guess) = case(&mut rng);
            let expected = by_counting(&codes, 0xffff, &guess);
            // SAFETY: AVX2 has been found.
            assert_eq!(
                unsafe { order_statistics(&codes, &guess) },
                expected,
                "case {i}: {guess:?}, {} codes",
                codes.len()
            );
        }
    }
}
