//! Ambient light and noise, from the order statistics of the codes.

use crate::MAX_SAMPLES;
use crate::q::shift_round;

/// Where a waveform rests and how much it trembles.
///
/// ```text
/// m   = median code: the smallest with  #{x ≤ m} ≥ ⌈N/2⌉
/// a   = m − ½ + (N/2 − #{x < m}) / #{x = m}                     grouped median: resolves below one code
/// d   = median of |x − m|: the smallest with  #{|x − m| ≤ d} ≥ ⌈N/2⌉
/// mad = d − ½ + (N/2 − #{|x − m| < d}) / #{|x − m| = d}         d = 0:  (N/2) / #{x = m} / 2
/// σ̂   = 1.4826 · mad
/// ```
///
/// | name | meaning | format |
/// |---|---|---|
/// | `x` | ADC codes, b bits | integers, `[N]` |
/// | `a` | ambient | Q1.15: codes · 2^(15−b), the quotient rounded down |
/// | `mad` | median absolute deviation | Q13.19: codes · 2^(19−b), the quotient rounded down |
/// | 1.4826 | σ of a normal distribution over its mad | Q2.14, nearest: 24 291 |
/// | `σ̂` | noise of one sample | Q13.19, nearest |
///
/// Half of the samples may be echoes before either gives way. A constant waveform still has σ̂ = 0.37 codes: the ADC's own
/// quantisation is noise too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// m, the median code.
    pub median: u16,
    /// d, the median absolute deviation in codes.
    pub deviation: u16,
    /// a, Q1.15.
    pub ambient: i32,
    /// σ̂, Q13.19.
    pub sigma: u32,
}

/// 1.4826 in Q2.14.
const MAD_TO_SIGMA: u64 = 24_291;

/// Bits of the deviation below Q1.15. Without them a quiet 14-bit waveform would have no noise at all.
const MAD_EXTRA_BITS: u32 = 4;

impl Statistics {
    /// Measures a waveform of codes, of which an ADC gives `15 − shift` bits. `guess` only saves time: where the last
    /// waveform's statistics lay, these lie nearby.
    #[inline(always)]
    pub fn of(codes: &[u16], shift: u32, guess: &Self) -> Self {
        let codes = &codes[..codes.len().min(MAX_SAMPLES)];
        if codes.is_empty() {
            return Self::default();
        }
        let top = (1 << (15 - shift)) - 1;
        let half = codes.len().div_ceil(2) as u32;
        let at_most = |bound: i32| count_within(codes, 0, bound);
        let (median, below, at) = order_statistic(at_most, half, i32::from(guess.median), top);
        let near = |d: i32| count_within(codes, (median - d).max(0), median + d);
        let (deviation, inside, on) = order_statistic(near, half, i32::from(guess.deviation), top);
        let n = codes.len() as u32;
        let ambient = grouped(median, below, at, n, shift);
        let fine = shift + MAD_EXTRA_BITS;
        let mad = if deviation == 0 { (n << fine) / (4 * on) } else { grouped(deviation, inside, on, n, fine) as u32 };
        Self {
            median: median as u16,
            deviation: deviation as u16,
            ambient,
            sigma: shift_round((u64::from(mad) * MAD_TO_SIGMA) as i64, 14) as u32,
        }
    }
}

/// `(v − ½ + (N/2 − below) / at) · 2^shift`, the quotient rounded down.
#[inline(always)]
fn grouped(value: i32, below: u32, at: u32, n: u32, shift: u32) -> i32 {
    let offset = ((n - 2 * below) << (shift - 1)) / at;
    (value << shift) - (1 << (shift - 1)) + offset as i32
}

/// Samples whose code lies in `low..=high`, at most [`MAX_SAMPLES`] of them.
///
/// A plain sum in 16 bits, which vectorises.
#[inline(always)]
fn count_within(codes: &[u16], low: i32, high: i32) -> u32 {
    const { assert!(MAX_SAMPLES <= u16::MAX as usize) };
    if high < low || low > 0xffff {
        return 0;
    }
    let (low, width) = (low as u16, (high.min(0xffff) - low) as u16);
    let mut count = 0u16;
    for &code in codes {
        count = count.wrapping_add(u16::from(code.wrapping_sub(low) <= width));
    }
    u32::from(count)
}

/// The smallest value whose cumulative count reaches `rank`, with the counts below it and at it.
///
/// Gallops out from the guess, then bisects: with a good guess two or three counts, with none twelve.
#[inline(always)]
fn order_statistic(cumulative: impl Fn(i32) -> u32, rank: u32, guess: i32, top: i32) -> (i32, u32, u32) {
    // Invariant: cumulative(low) < rank ≤ cumulative(high), low = −1 standing for "nothing".
    let (mut low, mut below) = (-1, 0);
    let (mut high, mut up_to) = (0x10000, u32::MAX);
    let mut probe = guess.clamp(0, top);
    let mut stride = 1;
    while high - low > 1 {
        let count = cumulative(probe);
        if count >= rank {
            (high, up_to) = (probe, count);
        } else {
            (low, below) = (probe, count);
        }
        probe = if low < 0 && high - stride > 0 {
            high - stride
        } else if low < 0 {
            high / 2
        } else if up_to == u32::MAX {
            low + stride
        } else {
            i32::midpoint(low, high)
        };
        stride = (2 * stride).min(0x10000); // no code lies further
    }
    (high, below, up_to - below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_beyond_the_adc_s_range_are_ranked_like_any_other() {
        for code in [0x8000, 40_000, u16::MAX] {
            let statistics = Statistics::of(&[code; 9], 3, &Statistics::default());
            assert_eq!((statistics.median, statistics.deviation), (code, 0));
        }
    }

    #[test]
    fn a_constant_waveform_has_the_noise_of_quantisation_at_every_resolution() {
        for shift in 1..=7 {
            let statistics = Statistics::of(&[100; 800], shift, &Statistics::default());
            let sigma_codes = f64::from(statistics.sigma) / f64::from(1 << (shift + 4));
            assert!((sigma_codes - 0.3706).abs() < 0.02, "shift {shift}: {sigma_codes} codes");
        }
    }
}
