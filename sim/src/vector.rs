//! The DSP compiled for the vector unit found at run time.
//!
//! The same source twice: for the baseline processor and for x86-64-v3 (AVX2). LLVM vectorises all stages but one: it does
//! not find the multiply-add of pairs in the matched filter, so that one is said by hand. The tests check
//! that both give the same bytes. AVX-512 is left alone on purpose: LLVM's code for it has been slower on kernels like these.

use echoloop_dsp::kernel::Portable;
use echoloop_dsp::{Echoes, Pipeline, Scratch};

/// Whether this processor runs the x86-64-v3 build.
pub fn has_v3() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("bmi1")
            && std::arch::is_x86_feature_detected!("bmi2")
            && std::arch::is_x86_feature_detected!("lzcnt")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

/// [`Pipeline::process`], the fastest build this processor runs.
pub fn process(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
    #[cfg(target_arch = "x86_64")]
    if has_v3() {
        // SAFETY: the features that process_v3 is compiled for have just been found on this processor.
        return unsafe { v3::process(pipeline, codes, scratch) };
    }
    process_baseline(pipeline, codes, scratch)
}

/// [`Pipeline::process`] without the kernel written by hand: x86-64-v3 as the compiler vectorises it; the baseline where there is none.
///
/// For benchmarks and tests: slower than [`process`], same bytes.
pub fn process_compiled(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
    #[cfg(target_arch = "x86_64")]
    if has_v3() {
        // SAFETY: the features that process_compiled is compiled for have just been found on this processor.
        return unsafe { v3::process_compiled(pipeline, codes, scratch) };
    }
    process_baseline(pipeline, codes, scratch)
}

/// [`Pipeline::process`] as compiled for the target's baseline.
pub fn process_baseline(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
    pipeline.process(Portable, codes, scratch)
}

#[cfg(target_arch = "x86_64")]
mod v3 {
    use std::arch::x86_64::{
        __m256i, _mm256_add_epi32, _mm256_loadu_si256, _mm256_madd_epi16, _mm256_packs_epi32, _mm256_set1_epi32,
        _mm256_srai_epi32, _mm256_storeu_si256, _mm256_unpackhi_epi32, _mm256_unpacklo_epi32,
    };

    use echoloop_dsp::filter::BLOCK;
    use echoloop_dsp::kernel::{Kernel, Portable};
    use echoloop_dsp::{Echoes, Pipeline, Scratch};

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    pub(super) fn process(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        pipeline.process(MultiplyAddPairs(()), codes, scratch)
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    pub(super) fn process_compiled(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        pipeline.process(Portable, codes, scratch)
    }

    /// The filter sixteen outputs at a time with `vpmaddwd`. Made only where the processor has it.
    #[derive(Clone, Copy)]
    struct MultiplyAddPairs(());

    impl Kernel for MultiplyAddPairs {
        #[inline(always)]
        fn correlate(self, taps: &[i16], padded: &[i16], y: &mut [i16]) {
            // SAFETY: only `process` makes a MultiplyAddPairs, and it runs only where AVX2 has been found.
            unsafe { correlate(taps, padded, y) };
        }
    }

    /// [`echoloop_dsp::filter::correlate`].
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn correlate(taps: &[i16], padded: &[i16], y: &mut [i16]) {
        let windows = padded.windows(taps.len() + BLOCK).step_by(BLOCK);
        for (y, window) in y.as_chunks_mut().0.iter_mut().zip(windows) {
            block(taps, window, y);
        }
    }

    /// For each pair of taps, `h0·x[n] + h1·x[n+1]` of the even outputs, then of the odd.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn block(taps: &[i16], window: &[i16], y: &mut [i16; BLOCK]) {
        let half_lsb = _mm256_set1_epi32(1 << 14);
        let (mut even, mut odd) = (half_lsb, half_lsb);
        for (pair, x) in taps.chunks_exact(2).zip(window.windows(BLOCK + 1).step_by(2)) {
            let taps = _mm256_set1_epi32(i32::from(pair[1]) << 16 | i32::from(pair[0] as u16));
            even = _mm256_add_epi32(even, _mm256_madd_epi16(load(x), taps));
            odd = _mm256_add_epi32(odd, _mm256_madd_epi16(load(&x[1..]), taps));
        }
        // Unpacking and packing work within 128-bit lanes and so undo each other: even and odd interleave in order.
        let (even, odd) = (_mm256_srai_epi32(even, 15), _mm256_srai_epi32(odd, 15));
        let rounded = _mm256_packs_epi32(_mm256_unpacklo_epi32(even, odd), _mm256_unpackhi_epi32(even, odd));
        // SAFETY: sixteen i16 are the 32 bytes that are written; no alignment is asked for.
        unsafe { _mm256_storeu_si256(y.as_mut_ptr().cast(), rounded) };
    }

    /// The first sixteen of `x`; the caller's windows are never shorter.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn load(x: &[i16]) -> __m256i {
        let x: &[i16; BLOCK] = x.first_chunk().unwrap_or(&[0; BLOCK]);
        // SAFETY: sixteen i16 are the 32 bytes that are read; no alignment is asked for.
        unsafe { _mm256_loadu_si256(x.as_ptr().cast()) }
    }
}
