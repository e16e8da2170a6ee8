//! Normals by table look-ups in AVX2 registers.

use core::arch::x86_64::{
    __m256i, _mm256_add_epi16, _mm256_add_epi32, _mm256_and_si256, _mm256_cvtepi32_ps,
    _mm256_loadu_si256, _mm256_madd_epi16, _mm256_maddubs_epi16, _mm256_mul_ps, _mm256_mullo_epi32,
    _mm256_or_si256, _mm256_set1_epi8, _mm256_set1_epi16, _mm256_set1_epi32, _mm256_set1_ps,
    _mm256_shuffle_epi8, _mm256_sign_epi8, _mm256_srli_epi16, _mm256_srli_epi32, _mm256_storeu_ps,
    _mm256_xor_si256,
};

use super::atoms::{COARSE, FINE, PER_SIGMA, WEIGHTS};
use super::blocks::{counters, fill};
use super::key::{Key, MIX, STEP};

/// Numbers per vector.
const LANES: usize = 8;

/// [`normals()`](super::normals()) for AVX2.
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(super) fn normals(key: Key, z: &mut [f32]) {
    let tables = Tables::new();
    let first = counters::<LANES>();
    // SAFETY: 32 bytes are read of an array of 32.
    let mut spread = unsafe { _mm256_loadu_si256(first.as_ptr().cast()) };
    let step = _mm256_set1_epi32(STEP.wrapping_mul(LANES as u32).cast_signed());
    fill(z, |block| {
        tables.normals(word(key, spread), block);
        spread = _mm256_add_epi32(spread, step);
    });
}

/// [`Key::word`] of eight counters, given as multiples of [`STEP`].
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn word(Key([outer, inner]): Key, spread: __m256i) -> __m256i {
    let all = |x: u32| _mm256_set1_epi32(x.cast_signed());
    let x = _mm256_xor_si256(spread, all(outer));
    let x = _mm256_xor_si256(x, _mm256_srli_epi32::<16>(x));
    let x = _mm256_add_epi32(x, all(inner));
    let x = _mm256_mullo_epi32(x, all(MIX[0]));
    let x = _mm256_xor_si256(x, _mm256_srli_epi32::<15>(x));
    let x = _mm256_mullo_epi32(x, all(MIX[1]));
    _mm256_xor_si256(x, _mm256_srli_epi32::<15>(x))
}

/// Tables of `atoms.rs` in registers, repeated for each half.
struct Tables {
    fine: __m256i,
    coarse: __m256i,
    weights: [__m256i; 2],
}

impl Tables {
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn new() -> Self {
        let twice = |table: [i8; 16]| {
            let both = [table, table];
            // SAFETY: 32 bytes are read of an array of 32.
            unsafe { _mm256_loadu_si256(both.as_ptr().cast()) }
        };
        let weights = |row: [u8; 4]| _mm256_set1_epi32(u32::from_le_bytes(row).cast_signed());
        Self {
            fine: twice(FINE),
            coarse: twice(std::array::from_fn(|b| COARSE[b % 8])),
            weights: WEIGHTS.map(weights),
        }
    }

    /// The normals of eight words.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn normals(&self, words: __m256i, z: &mut [f32; LANES]) {
        let low = _mm256_set1_epi8(0x0f);
        let fine = _mm256_shuffle_epi8(self.fine, _mm256_and_si256(words, low));
        // Takes the sign of the byte; a byte of 0 would make the part 0, hence the 1.
        let fine = _mm256_sign_epi8(fine, _mm256_or_si256(words, _mm256_set1_epi8(1)));
        let high = _mm256_and_si256(_mm256_srli_epi16::<4>(words), low);
        let coarse = _mm256_shuffle_epi8(self.coarse, high);
        let pairs = _mm256_add_epi16(
            _mm256_maddubs_epi16(self.weights[0], fine),
            _mm256_maddubs_epi16(self.weights[1], coarse),
        );
        let sums = _mm256_madd_epi16(pairs, _mm256_set1_epi16(1));
        let normals = _mm256_mul_ps(_mm256_cvtepi32_ps(sums), _mm256_set1_ps(PER_SIGMA));
        // SAFETY: z holds as many numbers as are written.
        unsafe { _mm256_storeu_ps(z.as_mut_ptr(), normals) };
    }
}
