//! Loops over every sample, and those that a near gain adds: each processor may have its own.

use core::ops::Range;

use crate::rising_gain::near::Near;
use crate::stages::peak::Peaks;
use crate::stages::statistics::{OrderStatistics, Statistics};
use crate::stages::{baseline, detect, filter, statistics};

/// Loops that take nearly all of the time. Each method is plain Rust unless a processor overrides
/// it.
///
/// Every implementation must equal [`Portable`] bit for bit, whatever the input: sums are exact, so
/// only speed can differ.
pub trait SampleLoops: Copy {
    /// Median and median absolute deviation: [`statistics::by_counting`], or anything that gives
    /// the same result.
    #[inline(always)]
    fn order_statistics(self, codes: &[u16], top: u16, guess: &Statistics) -> OrderStatistics {
        statistics::by_counting(codes, top, guess)
    }

    /// [`Statistics::measure`].
    #[inline(always)]
    fn statistics(self, codes: &[u16], shift: u32, guess: &Statistics) -> Statistics {
        Statistics::measure(codes, shift, |codes, top| self.order_statistics(codes, top, guess))
    }

    /// [`baseline::remove`].
    #[inline(always)]
    fn remove_baseline(
        self,
        codes: &[u16],
        clip_code: u16,
        shift: u32,
        ambient: i16,
        x: &mut [i16],
    ) {
        baseline::remove(codes, clip_code, shift, ambient, x);
    }

    /// [`Near::remove_baseline`]. The loops of a near gain are not inlined: most waveforms have
    /// none.
    #[inline(never)]
    fn remove_near_baseline(
        self,
        near: &Near<'_>,
        codes: &[u16],
        samples: Range<usize>,
        x: &mut [i16],
    ) {
        near.remove_baseline(codes, samples, x);
    }

    /// [`Near::level`].
    #[inline(never)]
    fn level(self, near: &Near<'_>, at: usize, samples: Range<usize>, x: &mut [i16]) {
        near.level(at, samples, x);
    }

    /// [`filter::correlate`].
    #[inline(always)]
    fn correlate(self, taps: &[i16], padded: &[i16], y: &mut [i16]) {
        filter::correlate(taps, padded, y);
    }

    /// [`Self::correlate`] for any number of outputs: those beyond whole blocks come from a block
    /// of their own. `padded` holds as many samples as outputs and taps, and one [`filter::BLOCK`]
    /// more.
    #[inline(never)]
    fn correlate_all(self, taps: &[i16], padded: &[i16], y: &mut [i16]) {
        self.correlate(taps, padded, y);
        let (whole, rest) = y.as_chunks_mut::<{ filter::BLOCK }>();
        if rest.is_empty() {
            return;
        }
        let mut last = [0; filter::BLOCK];
        let padded = padded.get(whole.as_flattened().len()..).unwrap_or_default();
        self.correlate(taps, padded, &mut last);
        for (y, last) in rest.iter_mut().zip(last) {
            *y = last;
        }
    }

    /// [`detect::reaches`].
    #[inline(always)]
    fn reaches(self, values: &[i16], threshold: i16) -> bool {
        detect::reaches(values, threshold)
    }

    /// [`detect::peaks`]; a processor overrides it when it can do more than [`Self::reaches`].
    #[inline(always)]
    fn peaks(self, y: &[i16], threshold: i16, found: &mut Peaks) {
        detect::peaks(move |values| self.reaches(values, threshold), y, threshold, found);
    }
}

/// Plain Rust, for every processor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Portable;

impl SampleLoops for Portable {}

/// Plain Rust for processors that take one sample at a time: a single pass for both order
/// statistics instead of several.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scalar;

impl SampleLoops for Scalar {
    #[inline(always)]
    fn order_statistics(self, codes: &[u16], top: u16, guess: &Statistics) -> OrderStatistics {
        statistics::by_histogram(codes, top, guess)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_number_of_outputs_are_as_among_whole_blocks_and_nothing_else_is_written() {
        let taps = [-700, 9_000, 15_000, 3_000, 0, 0];
        let padded: [i16; 160] = core::array::from_fn(|n| (n as i16).wrapping_mul(12_345));
        let mut expected = [0; 5 * filter::BLOCK];
        Portable.correlate(&taps, &padded, &mut expected);
        for first in [0, 1, 7] {
            for samples in 0..=3 * filter::BLOCK + 1 {
                let mut y = [7; 5 * filter::BLOCK];
                let outputs = first..first + samples;
                Portable.correlate_all(&taps, &padded[first..], &mut y[outputs.clone()]);
                for (n, (&y, &expected)) in y.iter().zip(&expected).enumerate() {
                    let expected = if outputs.contains(&n) { expected } else { 7 };
                    assert_eq!(y, expected, "output {n} of {outputs:?}");
                }
            }
        }
    }
}
