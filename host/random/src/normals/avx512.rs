//! Normals by table look-ups in AVX-512 registers; its multiply-adds of bytes give whole sums.

use core::arch::x86_64::{
    __m512i, _mm512_add_epi32, _mm512_and_si512, _mm512_cvtepi32_ps, _mm512_dpbusd_epi32,
    _mm512_loadu_si512, _mm512_mask_sub_epi8, _mm512_movepi8_mask, _mm512_mul_ps,
    _mm512_mullo_epi32, _mm512_set1_epi8, _mm512_set1_epi32, _mm512_set1_ps, _mm512_setzero_si512,
    _mm512_shuffle_epi8, _mm512_srli_epi16, _mm512_srli_epi32, _mm512_storeu_ps, _mm512_xor_si512,
};

use super::atoms::{COARSE, FINE, PER_SIGMA, WEIGHTS};
use super::blocks::{counters, fill};
use super::key::{Key, MIX, STEP};

/// Numbers per vector.
const LANES: usize = 16;

/// [`normals()`](super::normals()) for AVX-512.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
pub(super) fn normals(key: Key, z: &mut [f32]) {
    let tables = Tables::new();
    let first = counters::<LANES>();
    // SAFETY: 64 bytes are read of an array of 64.
    let mut spread = unsafe { _mm512_loadu_si512(first.as_ptr().cast()) };
    let step = _mm512_set1_epi32(STEP.wrapping_mul(LANES as u32).cast_signed());
    fill(z, |block| {
        tables.normals(word(key, spread), block);
        spread = _mm512_add_epi32(spread, step);
    });
}

/// [`Key::word`] of sixteen counters, given as multiples of [`STEP`].
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn word(Key([outer, inner]): Key, spread: __m512i) -> __m512i {
    let all = |x: u32| _mm512_set1_epi32(x.cast_signed());
    let x = _mm512_xor_si512(spread, all(outer));
    let x = _mm512_xor_si512(x, _mm512_srli_epi32::<16>(x));
    let x = _mm512_add_epi32(x, all(inner));
    let x = _mm512_mullo_epi32(x, all(MIX[0]));
    let x = _mm512_xor_si512(x, _mm512_srli_epi32::<15>(x));
    let x = _mm512_mullo_epi32(x, all(MIX[1]));
    _mm512_xor_si512(x, _mm512_srli_epi32::<15>(x))
}

/// Tables of `atoms.rs` in registers, repeated for each quarter.
struct Tables {
    fine: __m512i,
    coarse: __m512i,
    weights: [__m512i; 2],
}

impl Tables {
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
    fn new() -> Self {
        let four_times = |table: [i8; 16]| {
            let all = [table; 4];
            // SAFETY: 64 bytes are read of an array of 64.
            unsafe { _mm512_loadu_si512(all.as_ptr().cast()) }
        };
        let weights = |row: [u8; 4]| _mm512_set1_epi32(u32::from_le_bytes(row).cast_signed());
        Self {
            fine: four_times(FINE),
            coarse: four_times(std::array::from_fn(|b| COARSE[b % 8])),
            weights: WEIGHTS.map(weights),
        }
    }

    /// The normals of sixteen words.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
    fn normals(&self, words: __m512i, z: &mut [f32; LANES]) {
        let (low, zero) = (_mm512_set1_epi8(0x0f), _mm512_setzero_si512());
        let fine = _mm512_shuffle_epi8(self.fine, _mm512_and_si512(words, low));
        // A byte of 128 or more makes the part negative.
        let fine = _mm512_mask_sub_epi8(fine, _mm512_movepi8_mask(words), zero, fine);
        let high = _mm512_and_si512(_mm512_srli_epi16::<4>(words), low);
        let coarse = _mm512_shuffle_epi8(self.coarse, high);
        let sums = _mm512_dpbusd_epi32(zero, self.weights[0], fine);
        let sums = _mm512_dpbusd_epi32(sums, self.weights[1], coarse);
        let normals = _mm512_mul_ps(_mm512_cvtepi32_ps(sums), _mm512_set1_ps(PER_SIGMA));
        // SAFETY: z holds as many numbers as are written.
        unsafe { _mm512_storeu_ps(z.as_mut_ptr(), normals) };
    }
}
