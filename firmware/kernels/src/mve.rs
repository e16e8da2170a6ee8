//! Loops for Armv8.1-M with the vector extension (MVE, "Helium"): eight samples at a time.

use echoloop_dsp::loops::Portable;
use echoloop_dsp::peak::Peaks;
use echoloop_dsp::statistics::{OrderStatistics, Statistics};
use echoloop_dsp::{MAX_TAPS, SampleLoops, detect, filter};

use crate::four_probes;

core::arch::global_asm!(include_str!("mve.s"), options(raw));

// mve.s states the memory that each reads and writes, and its conditions.
unsafe extern "C" {
    fn echoloop_correlate_short(
        taps: *const i16,
        count: usize,
        x: *const i16,
        y: *mut i16,
        eights: usize,
    );
    fn echoloop_correlate_long(
        taps: *const i16,
        x: *const i16,
        y: *mut i16,
        eights: usize,
        vectors: usize,
    );
    fn echoloop_count_above(codes: *const u16, count: usize, centre: u32, bounds: *mut u32);
    fn echoloop_first_reaching(values: *const i16, count: usize, threshold: i32) -> usize;
}

/// Loops in vectors of eight samples. Equal to [`Portable`] bit for bit.
///
/// The compiler vectorises the other loops as they are.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mve;

/// Number of samples of a vector.
const LANES: usize = 8;

// A block is two vectors: the promises of `correlate` to the assembly depend on it.
const _: () = assert!(filter::BLOCK == 2 * LANES);

/// Number of vectors that the longest template and one more lane fill.
const MAX_VECTORS: usize = MAX_TAPS / LANES + 1;

impl SampleLoops for Mve {
    #[inline(always)]
    fn order_statistics(self, codes: &[u16], _top: u16, guess: &Statistics) -> OrderStatistics {
        let at_most = |bounds| count_within(codes, 0, bounds);
        let within = |median, bounds| count_within(codes, median, bounds);
        four_probes::order_statistics(codes.len() as u32, guess, at_most, within)
    }

    #[inline(always)]
    fn correlate(self, taps: &[i16], padded: &[i16], y: &mut [i16]) {
        // A last tap of zero needs no lane.
        let used = taps.strip_suffix(&[0]).unwrap_or(taps);
        let vectors = used.len() / LANES + 1; // one lane more than there are taps
        let blocks =
            (padded.len().saturating_sub(taps.len()) / filter::BLOCK).min(y.len() / filter::BLOCK);
        // Vectors of samples reach further than the taps.
        let whole = blocks.min((padded.len() / LANES).saturating_sub(vectors.max(2)) / 2);
        if whole == 0 || vectors > MAX_VECTORS {
            return Portable.correlate(taps, padded, y);
        }
        let (x, to, eights) = (padded.as_ptr(), y.as_mut_ptr(), 2 * whole);
        if vectors <= 2 {
            // SAFETY: `y` holds 16·whole ≥ 16 samples, `padded` 16 more; there are at most 15 taps.
            unsafe { echoloop_correlate_short(used.as_ptr(), used.len(), x, to, eights) };
        } else {
            let mut later = [0; LANES * MAX_VECTORS + 1];
            if let Some(places) = later.get_mut(1..=used.len()) {
                places.copy_from_slice(used);
            }
            // SAFETY: as above, with 8·vectors more in `padded`; before the taps there is a zero,
            // and after them zeros to the end of their vectors and one beyond.
            unsafe { echoloop_correlate_long(later.as_ptr(), x, to, eights, vectors) };
        }
        if whole < blocks {
            let done = filter::BLOCK * whole;
            let (Some(x), Some(y)) = (padded.get(done..), y.get_mut(done..)) else { return };
            Portable.correlate(taps, x, y);
        }
    }

    #[inline(always)]
    fn reaches(self, values: &[i16], threshold: i16) -> bool {
        first_reaching(values, threshold).is_some()
    }

    #[inline(always)]
    fn peaks(self, y: &[i16], threshold: i16, found: &mut Peaks) {
        detect::peaks_of_hills(|values| first_reaching(values, threshold), y, threshold, found);
    }
}

/// Number of codes within each of four distances from a centre; none within a negative one.
#[inline(always)]
fn count_within(codes: &[u16], centre: u16, bounds: [i32; 4]) -> [u32; 4] {
    let mut above = bounds.map(|bound| bound.clamp(0, 0xffff) as u32);
    // SAFETY: the length is that of `codes`; `above` holds four numbers below 2^16.
    unsafe { echoloop_count_above(codes.as_ptr(), codes.len(), centre.into(), above.as_mut_ptr()) };
    let mut within = [0; 4];
    for ((within, above), bound) in within.iter_mut().zip(above).zip(bounds) {
        *within = if bound < 0 { 0 } else { codes.len() as u32 - above };
    }
    within
}

/// Index of the first value that is not below `threshold`.
#[inline(always)]
fn first_reaching(values: &[i16], threshold: i16) -> Option<usize> {
    // SAFETY: the length is that of `values`.
    let first = unsafe { echoloop_first_reaching(values.as_ptr(), values.len(), threshold.into()) };
    (first < values.len()).then_some(first)
}
