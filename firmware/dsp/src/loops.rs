//! The loops over every sample, which processors do in their own ways.

use crate::peak::Peaks;
use crate::statistics::{OrderStatistics, Statistics};
use crate::{baseline, detect, filter, statistics};

/// The four loops that take nearly all of the time. Every method is plain Rust unless a processor
/// knows better.
///
/// Every implementation must equal [`Portable`] bit for bit, whatever the input: sums are exact, so
/// only speed can differ.
pub trait SampleLoops: Copy {
    /// Median and median absolute deviation: [`statistics::by_counting`] or anything that gives the
    /// same.
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

    /// [`filter::correlate`].
    #[inline(always)]
    fn correlate(self, taps: &[i16], padded: &[i16], y: &mut [i16]) {
        filter::correlate(taps, padded, y);
    }

    /// [`detect::reaches`].
    #[inline(always)]
    fn reaches(self, values: &[i16], threshold: i16) -> bool {
        detect::reaches(values, threshold)
    }

    /// [`detect::peaks`], for processors that know more than [`Self::reaches`].
    #[inline(always)]
    fn peaks(self, y: &[i16], threshold: i16, found: &mut Peaks) {
        detect::peaks(move |values| self.reaches(values, threshold), y, threshold, found);
    }
}

/// Plain Rust, for every processor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Portable;

impl SampleLoops for Portable {}

/// Plain Rust for processors that take one sample at a time: one pass for both order statistics
/// instead of several.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scalar;

impl SampleLoops for Scalar {
    #[inline(always)]
    fn order_statistics(self, codes: &[u16], top: u16, guess: &Statistics) -> OrderStatistics {
        statistics::by_histogram(codes, top, guess)
    }
}
