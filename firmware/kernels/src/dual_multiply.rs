//! Loops for Armv7E-M and for Armv8-M with the DSP extension: two samples at a time.

use echoloop_dsp::loops::Portable;
use echoloop_dsp::statistics::{self, BINS, OrderStatistics, Statistics, by_histogram_of};
use echoloop_dsp::{SampleLoops, filter};

core::arch::global_asm!(include_str!("dual_multiply.s"), options(raw));

// dual_multiply.s states the memory that each reads and writes, and its conditions.
unsafe extern "C" {
    fn echoloop_correlate(
        taps: *const i16,
        pairs: usize,
        x: *const i16,
        y: *mut i16,
        sixteens: usize,
    );
    fn echoloop_remove_baseline(
        codes: *const u16,
        x: *mut i16,
        eights: usize,
        clips: u32,
        ambients: u32,
        shift: u32,
    );
    fn echoloop_reaches(values: *const i16, count: usize, thresholds: u32) -> u32;
    fn echoloop_count(codes: *const u16, eights: usize, firsts: u32, counts: *mut u16) -> u32;
}

/// Loops in dual multiplications and packed halfwords. Equal to [`Portable`] bit for bit.
///
/// The assembly takes whole blocks. The rest, and arguments that it does not allow, go to the
/// portable form.
#[derive(Clone, Copy, Debug, Default)]
pub struct DualMultiply;

impl SampleLoops for DualMultiply {
    #[inline(always)]
    fn order_statistics(self, codes: &[u16], top: u16, guess: &Statistics) -> OrderStatistics {
        by_histogram_of(codes, top, guess, count)
    }

    #[inline(always)]
    fn remove_baseline(
        self,
        codes: &[u16],
        clip_code: u16,
        shift: u32,
        ambient: i16,
        x: &mut [i16],
    ) {
        if shift > 15 || u32::from(clip_code) << shift > 0xffff {
            return Portable.remove_baseline(codes, clip_code, shift, ambient, x);
        }
        let n = codes.len().min(x.len());
        let (Some(codes), Some(x)) = (codes.get(..n), x.get_mut(..n)) else { return };
        let (eights, codes) = codes.as_chunks::<8>();
        let (x_eights, x) = x.as_chunks_mut::<8>();
        if !eights.is_empty() {
            let (from, to) = (eights.as_ptr().cast(), x_eights.as_mut_ptr().cast());
            let (clips, ambients) = (twice(clip_code), twice(ambient as u16));
            // SAFETY: both hold this many eights, at least one.
            unsafe { echoloop_remove_baseline(from, to, eights.len(), clips, ambients, shift) };
        }
        Portable.remove_baseline(codes, clip_code, shift, ambient, x);
    }

    #[inline(always)]
    fn correlate(self, taps: &[i16], padded: &[i16], y: &mut [i16]) {
        let (pairs, odd) = taps.as_chunks::<2>();
        if pairs.is_empty() || !odd.is_empty() {
            return Portable.correlate(taps, padded, y);
        }
        let sixteens =
            (padded.len().saturating_sub(taps.len()) / filter::BLOCK).min(y.len() / filter::BLOCK);
        if sixteens > 0 {
            // SAFETY: `y` holds 16·sixteens samples, `padded` 16·sixteens + 2·pairs, `taps`
            // 2·pairs; pairs, sixteens ≥ 1.
            unsafe {
                echoloop_correlate(
                    taps.as_ptr(),
                    pairs.len(),
                    padded.as_ptr(),
                    y.as_mut_ptr(),
                    sixteens,
                )
            };
        }
    }

    #[inline(always)]
    fn reaches(self, values: &[i16], threshold: i16) -> bool {
        // SAFETY: the length is that of `values`.
        unsafe { echoloop_reaches(values.as_ptr(), values.len(), twice(threshold as u16)) != 0 }
    }
}

/// [`statistics::count`]: sorts codes from `first` up into bins and returns the number below.
/// `first` is at most 2^16 − 128; beyond that low codes are counted as high ones, but no other
/// memory is touched.
#[inline(always)]
pub fn count(codes: &[u16], first: u16, counts: &mut [u16; BINS]) -> u32 {
    const { assert!(BINS == 128) };
    let (eights, codes) = codes.as_chunks::<8>();
    let mut below = 0;
    if !eights.is_empty() {
        // SAFETY: `eights` holds 8 of each, at least one; `counts` holds 128.
        below = unsafe {
            echoloop_count(eights.as_ptr().cast(), eights.len(), twice(first), counts.as_mut_ptr())
        };
    }
    below.wrapping_add(statistics::count(codes, first, counts))
}

/// Word with a halfword in both halves.
#[inline(always)]
fn twice(halfword: u16) -> u32 {
    u32::from(halfword) << 16 | u32::from(halfword)
}
