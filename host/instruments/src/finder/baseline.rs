//! Ambient and noise of a short record.

// No overflow: codes are below 2¹⁵, shifts at most 7, noise below 2³² times a constant below 2¹⁵;
// counts are those of samples, and at least 1 where they divide.

use echoloop_dsp::loops::{Portable, SampleLoops};
use echoloop_dsp::q::shift_round;
use echoloop_dsp::statistics::Statistics;

use super::colour::Colour;

/// Ambient and noise of a record that may consist mostly of echo.
///
/// ```text
/// l    = the code of rank ⌊(N − 1)/20⌋ among the N codes in order
/// m    = v − ½ + (N/2 − #{x < v}) / #{x = v}       v of rank ⌊(N − 1)/2⌋: the grouped median
/// d[n] = 2¹⁵ + code[n − 1] − 2·code[n] + code[n + 1]       n = 1..N−2
/// q    = the value of rank ⌊(n − 1)/4⌋ among the n = N − 2 values |d − median d|
/// σ    = max(σ̂(d) / √6, 1/√12)                     σ̂ of Statistics; at least quantisation's
///        of n < 48: max(min(σ̂(d) / √6, q / (0.3186·√6)), 1/√12)
/// c    = where codes are densest, see `densest`, if anywhere
/// b    = max(l + 1.645·σ, c − σ)
/// a    = m if m ≤ b + σ, else b
/// ```
///
/// | name | meaning | format |
/// |---|---|---|
/// | `σ` | noise of one sample | Q13.19, nearest |
/// | `m` | codes · 2^shift, the quotient rounded down | Q1.15 |
/// | `a` | ambient, at most the largest Q1.15 | Q1.15; 1.645·σ nearest |
///
/// Derived, with a figure, in benches/record/finder.md, Ambient and noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Baseline {
    /// a, Q1.15.
    pub ambient: i16,
    /// σ, Q13.19.
    pub sigma: u32,
}

/// What is known of a record's noise.
#[derive(Clone, Copy, Debug, Default)]
pub struct KnownNoise<'a> {
    /// Its colour; the σ of white noise is multiplied by its c.
    pub colour: Option<&'a Colour>,
    /// Its σ, Q13.19, which is not measured then.
    pub sigma: Option<u32>,
}

/// 1/√6, σ of one sample over that of a second difference: Q0.16, nearest.
const SECOND_DIFFERENCE_TO_SIGMA: i64 = 26_755;

/// 1.645 in Q.10, rounded down: a twentieth of normal noise is below its middle less 1.645 σ.
const TWENTIETH_TO_MIDDLE: i64 = 1_684;

/// 1/(0.3186·√6), σ of one sample over q: Q.16, nearest.
const QUARTER_TO_SIGMA: i64 = 83_977;

/// Number of differences from which on their median alone gives σ.
const SHORT: usize = 48;

/// 1/√12, the noise of rounding to a code: Q.15 of codes, nearest.
const QUANTISATION: i64 = 9_459;

impl Baseline {
    /// Measures σ alone, as [`Baseline::measure`] does.
    pub fn sigma(codes: &[u16], shift: u32, colour: Option<&Colour>, order: &mut [u16]) -> u32 {
        let white = noise_of(codes, shift, order);
        colour.map_or(white, |colour| colour.sigma(white))
    }

    /// Measures codes of at most 15 − `shift` bits. `order` is memory for at least as many codes.
    pub fn measure(codes: &[u16], shift: u32, noise: KnownNoise<'_>, order: &mut [u16]) -> Self {
        let sigma = noise.sigma.unwrap_or_else(|| Self::sigma(codes, shift, noise.colour, order));
        let order = order.get_mut(..codes.len()).unwrap_or_default();
        order.copy_from_slice(codes);
        order.sort_unstable();
        let low = order
            .get(order.len().saturating_sub(1) / 20)
            .map_or(0, |&code| i64::from(code) << shift);
        let one_sigma = shift_round(i64::from(sigma), 4);
        let low_end = (low + shift_round(i64::from(sigma) * TWENTIETH_TO_MIDDLE, 14))
            .max(densest(order, shift, one_sigma).map_or(0, |dense| dense - one_sigma));
        let median = grouped_median(order, shift);
        // In a record mostly at rest, the median is a better ambient than the lower end.
        let ambient = if median <= low_end + one_sigma { median } else { low_end };
        Self { ambient: ambient.clamp(-0x8000, 0x7fff) as i16, sigma }
    }
}

/// c of sorted codes, Q1.15: the middle of the narrowest range from one code to the ⌊N/6⌋-th after
/// it, ties to the lowest, among those that end in the lower half of the codes' span. `None` when
/// it is wider than max(2·σ, one code).
fn densest(order: &[u16], shift: u32, sigma: i64) -> Option<i64> {
    let (least, most) = (i64::from(*order.first()?), i64::from(*order.last()?));
    let ranges = order
        .iter()
        .zip(order.iter().skip(order.len() / 6))
        .map(|(&a, &b)| (i64::from(a), i64::from(b)));
    let (a, b) = ranges.filter(|(_, b)| 2 * b <= least + most).min_by_key(|(a, b)| b - a)?;
    ((b - a) << shift <= (2 * sigma).max(1 << shift)).then_some(((a + b) << shift) >> 1)
}

/// m of sorted codes, Q1.15.
pub(crate) fn grouped_median(order: &[u16], shift: u32) -> i64 {
    let Some(&code) = order.get(order.len().saturating_sub(1) / 2) else { return 0 };
    let below = order.partition_point(|&c| c < code);
    let at = order.partition_point(|&c| c <= code) - below;
    let offset = ((order.len() as i64 - 2 * below as i64) << shift) / (2 * at as i64).max(1);
    (i64::from(code) << shift) - (1 << (shift - 1)) + offset
}

/// σ of white noise, Q13.19.
fn noise_of(codes: &[u16], shift: u32, differences: &mut [u16]) -> u32 {
    let mut count = 0;
    for (d, around) in differences.iter_mut().zip(codes.windows(3)) {
        if let &[before, here, after] = around {
            *d = (0x8000 + i32::from(before) - 2 * i32::from(here) + i32::from(after)) as u16;
            count += 1;
        }
    }
    let differences = differences.get_mut(..count).unwrap_or_default();
    let of_differences = Portable.statistics(differences, shift, &Statistics::default());
    let by_median = shift_round(i64::from(of_differences.sigma) * SECOND_DIFFERENCE_TO_SIGMA, 16);
    let by_quarter = match differences.len() {
        SHORT.. => i64::MAX,
        // In few differences, an echo's flanks may be more than half: the quarter leaves them out.
        _ => shift_round(
            (quarter(differences, of_differences.median) << (shift + 4)) * QUARTER_TO_SIGMA,
            16,
        ),
    };
    let quantisation = shift_round(QUANTISATION << (shift + 4), 15);
    by_median.min(by_quarter).max(quantisation) as u32
}

/// q of the differences, which it overwrites.
fn quarter(differences: &mut [u16], median: u16) -> i64 {
    differences.iter_mut().for_each(|d| *d = d.abs_diff(median));
    differences.sort_unstable();
    differences.get(differences.len().saturating_sub(1) / 4).map_or(0, |&q| q.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn baseline(codes: &[u16]) -> Baseline {
        Baseline::measure(codes, 3, KnownNoise::default(), &mut [0; 100])
    }

    #[test]
    fn a_record_of_mostly_echo_rests_at_its_foot() {
        let codes: [u16; 40] =
            core::array::from_fn(|n| 200 + 2 * n.min(39 - n).saturating_sub(2).pow(2) as u16);
        let baseline = baseline(&codes);
        assert!((1600..1620).contains(&baseline.ambient), "{baseline:?}");
    }

    #[test]
    fn an_echo_that_fills_its_record_is_not_taken_for_noise() {
        let baseline = baseline(&[0, 0, 10, 20, 10, 0, 0]);
        assert_eq!(
            (baseline.ambient, baseline.sigma),
            (3, 37),
            "1.645 σ of quantisation: {baseline:?}"
        );
    }

    #[test]
    fn a_constant_record_has_no_noise_but_its_quantisation() {
        let baseline = baseline(&[77; 60]);
        assert_eq!(baseline.ambient, 77 << 3);
        assert_eq!(baseline.sigma, 37, "0.289 codes of 2³ in Q13.19");
    }
}
