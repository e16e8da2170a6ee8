//! DSP for x86-64-v3 (AVX2), chosen at run time; the filter uses AVX-512 where it exists.
//!
//! LLVM vectorises most loops over the samples as they are. Three are written by hand, because a
//! vector unit does better another way: the filter in multiply-adds of pairs (`filter`), the order
//! statistics in bytes, four counts a pass (`order_statistics`), and the search for peaks from hill
//! to hill (`peaks`). The loops of a near gain, which are not inlined into the pipeline, are
//! compiled once more for AVX2.

mod filter;
mod groups;
mod order_statistics;
mod peaks;
mod wide_filter;

use core::ops::Range;

use echoloop_dispatch::{V3, dispatch};
use echoloop_dsp::detect;
use echoloop_dsp::loops::SampleLoops;
use echoloop_dsp::near::Near;
use echoloop_dsp::peak::Peaks;
use echoloop_dsp::statistics::{OrderStatistics, Statistics};
use echoloop_dsp::{Echoes, Pipeline, Scratch};

use crate::process_baseline;

dispatch! {
    /// [`Pipeline::process`] in the fastest build that this processor runs.
    pub fn process(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes
        = process_baseline, v3: process_v3;

    /// [`Pipeline::process`] as the compiler vectorises it for x86-64-v3, without the loops written
    /// by hand; those of a near gain, and without v3 all, are built for the baseline.
    ///
    /// For benchmarks and tests: slower than [`process()`], same bytes.
    pub fn process_compiled(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes
        = process_baseline;
}

#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn process_v3(pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
    pipeline.process(Avx2(V3::here()), codes, scratch)
}

/// Loops written by hand, and those of a near gain.
#[derive(Clone, Copy)]
struct Avx2(V3);

impl SampleLoops for Avx2 {
    #[inline(always)]
    fn order_statistics(self, codes: &[u16], _top: u16, guess: &Statistics) -> OrderStatistics {
        // SAFETY: a V3 exists only where AVX2 has been found.
        unsafe { order_statistics::order_statistics(codes, guess) }
    }

    #[inline(always)]
    fn remove_near_baseline(
        self,
        near: &Near<'_>,
        codes: &[u16],
        samples: Range<usize>,
        x: &mut [i16],
    ) {
        // SAFETY: as above.
        unsafe { remove_near_baseline(near, codes, samples, x) };
    }

    #[inline(always)]
    fn level(self, near: &Near<'_>, at: usize, samples: Range<usize>, x: &mut [i16]) {
        // SAFETY: as above.
        unsafe { level(near, at, samples, x) };
    }

    #[inline(always)]
    fn correlate(self, taps: &[i16], padded: &[i16], y: &mut [i16]) {
        // SAFETY: as above.
        unsafe { filter::correlate(taps, padded, y) };
    }

    #[inline(always)]
    fn peaks(self, y: &[i16], threshold: i16, found: &mut Peaks) {
        // SAFETY: as above.
        let first_reaching = |values: &[i16]| unsafe { peaks::first_reaching(values, threshold) };
        detect::peaks_of_hills(first_reaching, y, threshold, found);
    }
}

/// [`Near::remove_baseline`].
#[inline(never)]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn remove_near_baseline(near: &Near<'_>, codes: &[u16], samples: Range<usize>, x: &mut [i16]) {
    near.remove_baseline(codes, samples, x);
}

/// [`Near::level`].
#[inline(never)]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn level(near: &Near<'_>, at: usize, samples: Range<usize>, x: &mut [i16]) {
    near.level(at, samples, x);
}
