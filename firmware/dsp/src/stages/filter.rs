//! The matched filter.

use fixed::types::I1F15;

use crate::q::shift_round;

/// Number of outputs computed at a time.
pub const BLOCK: usize = 16;

/// Number of zeros that the last block may read beyond the waveform and its template.
pub const PADDING: usize = 2 * BLOCK;

/// Correlates a waveform with a symmetric template of the emitted pulse.
///
/// ```text
/// y[n] = round( Σ h[k] · x[n + k − K] )      k = 0..2K,  n = 0..N−1,  x = 0 outside
/// ```
///
/// | name | meaning, unit | format | shape |
/// |---|---|---|---|
/// | `padded` | K zeros, x, at least K + [`PADDING`] zeros | Q1.15 | `[≥ N + 2K + PADDING]` |
/// | `h` | pulse, Σ abs(h) ≤ 1, and a last zero | Q1.15 | `[2K + 2]` |
/// | sum | exact | Q2.30 in `i32` | scalar |
/// | `y` | as `x` | Q1.15, nearest, ties up, saturating | `[N]`, capacity to a multiple of 16 |
///
/// `y` peaks at the centre of an echo. It stays within ±1 because the taps add up to at most one.
/// The paper leaves the denoiser open (Sec. 3.2); this is the correlation receiver, which for white
/// noise has the best SNR of all linear filters.
///
/// `taps` come with their last zero: an even number. The portable form of
/// [`SampleLoops::correlate`](crate::SampleLoops::correlate).
#[inline(always)]
pub fn correlate(taps: &[i16], padded: &[i16], y: &mut [i16]) {
    let windows = padded.windows(taps.len().saturating_add(BLOCK)).step_by(BLOCK);
    for (y, window) in y.as_chunks_mut::<BLOCK>().0.iter_mut().zip(windows) {
        for (y, sum) in y.iter_mut().zip(dot_block(taps, window)) {
            *y = round(sum);
        }
    }
}

/// `Σ h[k] · window[n + k]` for outputs n = 0..16, Q2.30.
#[inline(always)]
#[expect(
    clippy::arithmetic_side_effects,
    reason = "Σ abs(h) ≤ 1 in Q1.15, abs(x) ≤ 1: sums stay within 2³⁰"
)]
fn dot_block(taps: &[i16], window: &[i16]) -> [i32; BLOCK] {
    let mut sums = [0i32; BLOCK];
    for (&tap, window) in taps.iter().zip(window.windows(BLOCK)) {
        for (sum, &x) in sums.iter_mut().zip(window) {
            *sum += i32::from(x) * i32::from(tap);
        }
    }
    sums
}

/// Output `n` of [`correlate`] before it is rounded to Q1.15: Q9.23, nearest; 0 outside `samples`.
#[expect(
    clippy::arithmetic_side_effects,
    reason = "Σ abs(h) ≤ 1 in Q1.15, abs(x) ≤ 1: the sum stays within 2³⁰; lengths are of memory"
)]
#[inline(never)]
pub fn exact(taps: &[i16], padded: &[i16], samples: usize, n: i64) -> i64 {
    let start = usize::try_from(n).ok().filter(|&n| n < samples);
    let Some(window) = start.and_then(|n| padded.get(n..n + taps.len())) else { return 0 };
    let sum: i32 = taps.iter().zip(window).map(|(&h, &x)| i32::from(h) * i32::from(x)).sum();
    shift_round(sum.into(), 7)
}

/// Q2.30 to Q1.15: nearest, ties up, saturating.
#[inline(always)]
#[expect(clippy::arithmetic_side_effects, reason = "a sum stays within 2³⁰")]
pub fn round(sum: i32) -> i16 {
    ((sum + (1 << 14)) >> 15)
        .clamp(i32::from(I1F15::MIN.to_bits()), i32::from(I1F15::MAX.to_bits())) as i16
}
