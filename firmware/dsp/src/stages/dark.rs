//! Noise that the converter clips at 0, as it does in the dark.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "counts are at most 2400, codes below 2¹⁵, shifts at most 11, divisors at least 1, \
              slopes below 2²³ at r = 1 LSB, of several shots below 2⁹, e's factors below 2⁹"
)]

use crate::q::shift_round;
use crate::stages::statistics::{OrderStatistics, count_within, grouped, order_statistic};

/// 1/1.1503 in Q2.14: σ of a normal distribution over its 7/8 quantile above the median.
const EIGHTH_TO_SIGMA: i64 = 14_243;

/// 1.1503 + √(2π)/2 and √(2π) in Q2.14.
const QUANTILES: u32 = 39_381;
const SLOPE: u32 = 41_069;

/// σ̂ from the upper part of the codes, Q13.19, where m ≤ d.
///
/// ```text
/// h  = 7/8 quantile of the codes, grouped as the median is
/// σ̂  = (h − a)/1.1503
///    = (h − ½)/(1.1503 − √(2π) (p − ½))     m = 0: p = #{x = 0}/N, Φ⁻¹(p) ≈ √(2π) (p − ½)
/// ```
///
/// Where half of the codes lie in m ± d and m ≤ d, a quarter of them is clipped, and the deviation
/// of the lower half is too small. A code of 0 may be any value below ½: where the median is 0, the
/// share of the zeros says how far below ½ it lies. The 7/8 quantile scatters by 1.4/√N, the MAD by
/// 1.17/√N. An echo may hold up to an eighth of the samples.
#[inline(never)]
pub(super) fn sigma(codes: &[u16], ranks: &OrderStatistics, shift: u32) -> u32 {
    let OrderStatistics { median, deviation } = ranks;
    let n = codes.len() as u32;
    let at_most = |bound: i32| count_within(codes, 0, bound);
    let guess = median.value.saturating_add(deviation.value).saturating_add(1);
    let high = order_statistic(at_most, (7 * n).div_ceil(8), guess, 0x7fff);
    let high_at = i64::from(grouped(&high, 7 * n, shift));
    if median.value == 0 {
        let above = (high_at - (1 << shift) / 2).max(0);
        let quantiles = i64::from(QUANTILES - (SLOPE * median.at / n.max(1)).min(QUANTILES));
        return ((above << 14) / quantiles.max(1)) as u32;
    }
    let above = high_at - i64::from(grouped(median, 4 * n, shift));
    shift_round(above.max(0) * EIGHTH_TO_SIGMA, 14) as u32
}

/// What the threshold needs above k so that clipped noise passes it as seldom as whole noise does.
///
/// ```text
/// ρ = m/(σ̂ √M)                       a shot's median over its σ; half of it is clipped at 0
/// e = 0.23·(1/r − 1.6)·(1.3 − ρ)     M = 1 shot
///   = c/√M·(1.95 − ρ)²               several: c = 1.6, of two shots 1
/// ```
///
/// A factor below 0 counts as 0. The filter adds up samples, and clipped ones have a mean above
/// their median: the more the longer it is. Of several shots the median is near the mean, but their
/// sum is skewed. Both are fits to simulated noise: benches/record/detector.md, "In the dark".
///
/// | name | meaning | format |
/// |---|---|---|
/// | `m` | median code | Q13.19 |
/// | `√M`, `1/r`, `ρ` | rounded down | Q.8 |
/// | `0.23·(1/r − 1.6)`, `c/√M` | rounded down | Q.8 |
/// | `e` | the product, rounded down | Q8.8 |
#[derive(Clone, Copy, Debug)]
pub struct Dark {
    /// √M.
    root: u32,
    /// Factor that does not depend on the noise.
    slope: u32,
}

/// ρ from which on nothing is added: 1.3 of one shot, 1.95 of several. Q.8.
const EDGE_OF_ONE: u32 = 333;
const EDGE_OF_SEVERAL: u32 = 499;

impl Dark {
    /// For a number of shots, 1 to 16, and r, Q1.15.
    pub fn new(shots: u32, noise_gain: u16) -> Self {
        let root = (shots.clamp(1, 16) << 16).isqrt();
        let inverse = (1 << 23) / u32::from(noise_gain).max(1);
        let slope = match shots {
            0 | 1 => (59 * inverse.saturating_sub(410)) >> 8,
            2 => (1 << 16) / root.max(1),
            _ => (410 << 8) / root.max(1),
        };
        Self { root, slope }
    }

    /// e for a median and σ̂, both Q13.19.
    pub fn excess(&self, median: u32, sigma: u32) -> u32 {
        let edge = if self.root == 256 { EDGE_OF_ONE } else { EDGE_OF_SEVERAL };
        let scale = (u64::from(sigma) * u64::from(self.root)).max(1);
        let scaled = u64::from(median) << 16;
        if scaled >= u64::from(edge) * scale {
            return 0;
        }
        let left = edge - (scaled / scale) as u32;
        match self.root {
            256 => (self.slope * left) >> 8,
            _ => (self.slope * left * left) >> 16,
        }
    }
}
