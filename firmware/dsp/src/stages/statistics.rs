//! Ambient light and noise, from the order statistics of the codes.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "counts are at most 2400, codes below 2¹⁷, shifts at most 11: below 2²⁹; eight counts \
              shifted by 11 below 2²⁶; divisors ≥ 1"
)]

use crate::limits::MAX_SAMPLES;
use crate::q::shift_round;
use crate::settings::choice::AmbientEstimator;
use crate::stages::dark;

/// Ambient light and noise of a waveform.
///
/// ```text
/// m   = median code: the smallest with  #{x ≤ m} ≥ ⌈N/2⌉
/// a   = m − ½ + (N/2 − #{x < m}) / #{x = m}                grouped median: resolves below one code
/// d   = median of |x − m|: the smallest with  #{|x − m| ≤ d} ≥ ⌈N/2⌉
/// mad = d − ½ + (N/2 − #{|x − m| < d}) / #{|x − m| = d}    d = 0:  (N/2) / #{x = m} / 2
/// σ̂   = 1.4826 · mad        at least that of the upper part, where noise is clipped at 0: `dark`
/// ```
///
/// | name | meaning | format |
/// |---|---|---|
/// | `x` | ADC codes, b bits | integers, `[N]` |
/// | `a` | ambient | Q1.15: codes · 2^(15−b), nearest, from Q13.19 |
/// | `mad` | median absolute deviation | Q13.19: codes · 2^(19−b), the quotient rounded down |
/// | 1.4826 | σ of a normal distribution over its mad | Q2.14, nearest: 24 291 |
/// | `σ̂` | noise of one sample | Q13.19, nearest |
///
/// Both hold while at most half of the samples are echoes. A constant waveform still has σ̂ =
/// 0.37 codes: the ADC's own quantisation is noise too.
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

/// Bits of the deviation below Q1.15. Without them a quiet 14-bit waveform would have no noise at
/// all.
const MAD_EXTRA_BITS: u32 = 4;

impl Statistics {
    /// Measures a waveform of codes of `15 − shift` bits. `order_statistics` finds median and
    /// deviation of at least one code; its second argument is the ADC's largest code. It is
    /// [`by_counting`] or anything that gives the same result.
    #[inline(always)]
    pub fn measure(
        codes: &[u16],
        shift: u32,
        order_statistics: impl FnOnce(&[u16], u16) -> OrderStatistics,
    ) -> Self {
        let codes = codes.get(..MAX_SAMPLES).unwrap_or(codes);
        if codes.is_empty() {
            return Self::default();
        }
        let top = 0x7fff >> shift;
        let ranks = order_statistics(codes, top);
        let all = Self::from_order_statistics(&ranks, codes.len() as u32, shift);
        if all.median > all.deviation {
            return all;
        }
        let sigma = all.sigma.max(dark::sigma(codes, &ranks, shift + MAD_EXTRA_BITS));
        Self { sigma, ..all }
    }

    /// The same noise with the ambient light of another estimator.
    ///
    /// ```text
    /// a = Σ x / n over the n samples before the trigger    Q1.15, rounded down; n = 0: median
    ///   = black                                            none
    /// ```
    ///
    /// σ̂ stays that of the waveform, around its median.
    #[must_use]
    pub fn with_ambient(
        self,
        estimator: AmbientEstimator,
        before: &[u16],
        shift: u32,
        black: i32,
    ) -> Self {
        let ambient = match (estimator, before.len() as u32) {
            (AmbientEstimator::PreTrigger, n @ 1..) => {
                let sum: u32 = before.iter().map(|&code| u32::from(code)).sum();
                ((u64::from(sum) << shift) / u64::from(n)) as i32
            }
            (AmbientEstimator::None, _) => black,
            (AmbientEstimator::Median | AmbientEstimator::PreTrigger, _) => self.ambient,
        };
        Self { ambient, ..self }
    }

    fn from_order_statistics(order_statistics: &OrderStatistics, n: u32, shift: u32) -> Self {
        let OrderStatistics { median, deviation } = order_statistics;
        let fine = shift + MAD_EXTRA_BITS;
        let ambient = shift_round(grouped(median, 4 * n, fine).into(), MAD_EXTRA_BITS) as i32;
        let mad = if deviation.value == 0 {
            (n << fine) / (4 * deviation.at).max(1)
        } else {
            grouped(deviation, 4 * n, fine) as u32
        };
        Self {
            median: median.value,
            deviation: deviation.value,
            ambient,
            sigma: shift_round((u64::from(mad) * MAD_TO_SIGMA) as i64, 14) as u32,
        }
    }

    /// Ambient light as the baseline removes it: Q1.15, saturating.
    pub fn ambient_q15(&self) -> i16 {
        self.ambient.clamp(-0x8000, 0x7fff) as i16
    }
}

/// Median and median absolute deviation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OrderStatistics {
    /// m among the codes.
    pub median: OrderStatistic,
    /// d among the distances |x − m|.
    pub deviation: OrderStatistic,
}

/// Smallest value v with `#{≤ v} ≥ ⌈N/2⌉`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OrderStatistic {
    /// v.
    pub value: u16,
    /// #{< v}.
    pub below: u32,
    /// #{= v}, at least 1.
    pub at: u32,
}

/// Median and deviation by repeated counts of the codes in an interval: counts vectorise.
///
/// `codes` hold 1 to [`MAX_SAMPLES`] samples. The search begins at `guess`, the statistics of the
/// last waveform, or at `top`, the largest code of the ADC, if that is lower: both only save time.
#[inline(always)]
pub fn by_counting(codes: &[u16], top: u16, guess: &Statistics) -> OrderStatistics {
    let half = codes.len().div_ceil(2) as u32;
    let at_most = |bound: i32| count_within(codes, 0, bound);
    let median = order_statistic(at_most, half, guess.median, top);
    let m = i32::from(median.value);
    let near = |d: i32| count_within(codes, (m - d).max(0), m + d);
    OrderStatistics { median, deviation: order_statistic(near, half, guess.deviation, top) }
}

/// Number of codes that the histogram spans, with the guess in its middle.
pub const BINS: usize = 128;

/// Median and deviation in one pass, if both lie within a histogram around the guess; else
/// [`by_counting`].
#[inline(always)]
pub fn by_histogram(codes: &[u16], top: u16, guess: &Statistics) -> OrderStatistics {
    by_histogram_of(codes, top, guess, count)
}

/// [`by_histogram`] with another way to [`count`].
#[inline(always)]
pub fn by_histogram_of(
    codes: &[u16],
    top: u16,
    guess: &Statistics,
    count: impl FnOnce(&[u16], u16, &mut [u16; BINS]) -> u32,
) -> OrderStatistics {
    let first = guess.median.saturating_sub(BINS as u16 / 2).min(u16::MAX - BINS as u16);
    let mut counts = [0u16; BINS];
    let below = count(codes, first, &mut counts);
    read_histogram(&counts, first, below, codes.len().div_ceil(2) as u32)
        .unwrap_or_else(|| by_counting(codes, top, guess))
}

/// Adds one to `counts[code − first]` for every code within; returns the number of codes below
/// `first`.
#[inline(always)]
pub fn count(codes: &[u16], first: u16, counts: &mut [u16; BINS]) -> u32 {
    let mut below = 0;
    for &code in codes {
        match counts.get_mut(usize::from(code.wrapping_sub(first))) {
            Some(count) => *count += 1,
            None => below += u32::from(code < first),
        }
    }
    below
}

/// Median and deviation, if both lie inside the histogram. `below` codes lie below `first`, the
/// code of bin 0.
fn read_histogram(
    counts: &[u16; BINS],
    first: u16,
    below: u32,
    half: u32,
) -> Option<OrderStatistics> {
    if below >= half {
        return None;
    }
    let (middle, up_to) = middle(counts, below, half)?;
    let at = u32::from(*counts.get(middle)?);
    let median = OrderStatistic { value: first + middle as u16, below: up_to - at, at };
    let mut inside = 0;
    let mut on = at;
    let mut distance = 0;
    while inside + on < half {
        distance += 1;
        inside += on;
        let (left, right) =
            (counts.get(middle.checked_sub(distance)?)?, counts.get(middle + distance)?);
        on = u32::from(*left) + u32::from(*right);
    }
    Some(OrderStatistics {
        median,
        deviation: OrderStatistic { value: distance as u16, below: inside, at: on },
    })
}

/// Bin in which the count reaches `half`, and the count up to its end. Eight bins at a time first,
/// which is faster.
fn middle(counts: &[u16; BINS], below: u32, half: u32) -> Option<(usize, u32)> {
    let (mut first, mut up_to) = (0, below);
    for eight in counts.chunks_exact(8) {
        let next = up_to + eight.iter().map(|&count| u32::from(count)).sum::<u32>();
        if next >= half {
            break;
        }
        (first, up_to) = (first + 8, next);
    }
    for (bin, &count) in counts.iter().enumerate().skip(first) {
        up_to += u32::from(count);
        if up_to >= half {
            return Some((bin, up_to));
        }
    }
    None
}

/// `(v − ½ + (count − below) / at) · 2^shift`, the quotient rounded down; the count in eighths.
#[inline(always)]
pub(crate) fn grouped(rank: &OrderStatistic, eighths: u32, shift: u32) -> i32 {
    let offset = ((eighths - 8 * rank.below) << shift) / (8 * rank.at).max(1);
    (i32::from(rank.value) << shift) - (1 << (shift - 1)) + offset as i32
}

/// Number of codes in `low..=high`, among at most [`MAX_SAMPLES`].
///
/// It is a plain sum in 16 bits, which vectorises.
#[inline(always)]
pub fn count_within(codes: &[u16], low: i32, high: i32) -> u32 {
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

/// Smallest value whose cumulative count reaches `rank`, with the counts below it and at it.
///
/// Gallops out from the guess, then bisects: two or three counts with a good guess, twelve without
/// one.
#[inline(always)]
pub(crate) fn order_statistic(
    cumulative: impl Fn(i32) -> u32,
    rank: u32,
    guess: u16,
    top: u16,
) -> OrderStatistic {
    // Invariant: cumulative(low) < rank ≤ cumulative(high), low = −1 standing for "nothing".
    let (mut low, mut below) = (-1, 0);
    let (mut high, mut up_to) = (0x10000, u32::MAX);
    let mut probe = i32::from(guess.min(top));
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
    OrderStatistic { value: high as u16, below, at: up_to - below }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure(codes: &[u16], shift: u32) -> Statistics {
        let guess = Statistics::default();
        Statistics::measure(codes, shift, |codes, top| by_counting(codes, top, &guess))
    }

    #[test]
    fn codes_beyond_the_adc_s_range_are_ranked_like_any_other() {
        for code in [0x8000, 40_000, u16::MAX] {
            let statistics = measure(&[code; 9], 3);
            assert_eq!((statistics.median, statistics.deviation), (code, 0));
        }
    }

    #[test]
    fn a_constant_waveform_has_the_noise_of_quantisation_at_every_resolution() {
        for shift in 1..=7 {
            let statistics = measure(&[100; 800], shift);
            let sigma_codes = f64::from(statistics.sigma) / f64::from(1 << (shift + 4));
            assert!((sigma_codes - 0.3706).abs() < 0.02, "shift {shift}: {sigma_codes} codes");
        }
    }
}
