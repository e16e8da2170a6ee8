//! Order statistics by searches with four probes, for processors that count below four bounds in
//! one pass.

use echoloop_dsp::statistics::{OrderStatistic, OrderStatistics, Statistics};

/// Order statistics of n ≥ 1 codes, equal to [`echoloop_dsp::statistics::by_counting`] bit for bit.
///
/// `at_most` counts the codes up to each of four rising bounds, `within` those up to each of four
/// distances from a median: none below 0, all n at 0xffff. With a good guess one pass finds the
/// median and one the deviation.
#[inline(always)]
pub(crate) fn order_statistics(
    n: u32,
    guess: &Statistics,
    at_most: impl Fn([i32; 4]) -> [u32; 4],
    within: impl Fn(u16, [i32; 4]) -> [u32; 4],
) -> OrderStatistics {
    // From one waveform to the next the median moves by 1.9 deviations/√N, the deviation by 1.2:
    // from 1,024 samples up, an eighth encloses most of them.
    let stride = 1 + i32::from(guess.deviation) / 8;
    let median = search(at_most, n, guess.median, stride);
    let near = |bounds| within(median.value, bounds);
    let deviation = search(near, n, guess.deviation, stride);
    OrderStatistics { median, deviation }
}

/// Smallest value whose cumulative count reaches ⌈n/2⌉, with the counts below it and at it.
///
/// Probes four values at a time: around the guess, then outwards in growing strides until the value
/// is enclosed, then at fifths.
#[inline(always)]
fn search(
    cumulative: impl Fn([i32; 4]) -> [u32; 4],
    n: u32,
    guess: u16,
    stride: i32,
) -> OrderStatistic {
    // Invariant: cumulative(low) < ⌈n/2⌉ ≤ cumulative(high).
    let (mut low, mut below) = (-1, 0);
    let (mut high, mut up_to) = (0xffff, n);
    let guess = i32::from(guess);
    let mut probes = [guess - 1 - stride, guess - 1, guess, guess + stride];
    let mut stride = stride;
    while high - low > 1 {
        for (probe, count) in probes.into_iter().zip(cumulative(probes)) {
            if count < n.div_ceil(2) {
                (low, below) = if probe > low { (probe, count) } else { (low, below) };
            } else {
                (high, up_to) = if probe < high { (probe, count) } else { (high, up_to) };
            }
        }
        stride = (4 * stride).min(0x10000); // no code lies further
        probes = if low < 0 && high > 5 * stride {
            [8, 4, 2, 1].map(|i| high - i * stride)
        } else if high == 0xffff && low < 0xffff - 5 * stride {
            [1, 2, 4, 8].map(|i| low + i * stride)
        } else {
            [1, 2, 3, 4].map(|i| low + ((high - low) * i + 4) / 5)
        };
    }
    OrderStatistic { value: high as u16, below, at: up_to - below }
}
