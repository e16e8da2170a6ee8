//! The DSP compiled for the vector unit found at run time.
//!
//! The same source twice: for the baseline processor and for x86-64-v3 (AVX2). LLVM vectorises the
//! loops over the samples as they stand; what a vector unit does better in another way is said by
//! hand: the filter in multiply-adds of pairs (`filter`), the order statistics in bytes, four
//! counts a pass (`ranks`), the search for peaks from hill to hill (`peaks`). The tests check that
//! all give the same bytes. AVX-512 is left alone on purpose: LLVM's code for it has been slower on
//! kernels like these.

use echoloop_dsp::kernel::Portable;
use echoloop_dsp::{Echoes, Pipeline, Scratch};

#[cfg(target_arch = "x86_64")]
mod filter;
#[cfg(target_arch = "x86_64")]
mod peaks;
#[cfg(target_arch = "x86_64")]
mod ranks;

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
        // SAFETY: the features that process_v3 is compiled for have just been found on this
        // processor.
        return unsafe { v3::process(pipeline, codes, scratch) };
    }
    process_baseline(pipeline, codes, scratch)
}

/// [`Pipeline::process`] without the kernels written by hand: x86-64-v3 as the compiler vectorises
/// it; the baseline where there is none.
///
/// For benchmarks and tests: slower than [`process`], same bytes.
pub fn process_compiled(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
    #[cfg(target_arch = "x86_64")]
    if has_v3() {
        // SAFETY: the features that process_compiled is compiled for have just been found on this
        // processor.
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
    use echoloop_dsp::detect::{self, Peaks};
    use echoloop_dsp::kernel::{Kernel, Portable};
    use echoloop_dsp::statistics::{Ranks, Statistics};
    use echoloop_dsp::{Echoes, Pipeline, Scratch};

    use super::{filter, peaks, ranks};

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    pub(super) fn process(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        pipeline.process(Avx2(()), codes, scratch)
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    pub(super) fn process_compiled(
        pipeline: &Pipeline,
        codes: &[u16],
        scratch: &mut Scratch,
    ) -> Echoes {
        pipeline.process(Portable, codes, scratch)
    }

    /// The loops that are said by hand. Made only where the processor has AVX2.
    #[derive(Clone, Copy)]
    struct Avx2(());

    impl Kernel for Avx2 {
        #[inline(always)]
        fn ranks(self, codes: &[u16], _top: u16, guess: &Statistics) -> Ranks {
            // SAFETY: only `process` makes an Avx2, and it runs only where AVX2 has been found.
            unsafe { ranks::ranks(codes, guess) }
        }

        #[inline(always)]
        fn correlate(self, taps: &[i16], padded: &[i16], y: &mut [i16]) {
            // SAFETY: as above.
            unsafe { filter::correlate(taps, padded, y) };
        }

        #[inline(always)]
        fn peaks(self, y: &[i16], threshold: i16, found: &mut Peaks) {
            // SAFETY: as above.
            let first_reaching =
                |values: &[i16]| unsafe { peaks::first_reaching(values, threshold) };
            detect::peaks_of_hills(first_reaching, y, threshold, found);
        }
    }
}
