//! Sub-sample time, height and width of a peak.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "times are Q16.16 within 2400 samples, 2²⁸; outputs Q9.23 within ±2²⁴, times a fraction or a tap 2⁴¹; divisors are at least 1"
)]

use crate::config::Config;
use crate::detect::{Peak, hysteresis};
use crate::echo::Flags;
use crate::q::{divide_round, shift_round};

/// A peak between samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refined {
    /// Time since sample 0, Q16.16 samples.
    pub time: i64,
    /// Height of the filter's output at the vertex, Q1.15.
    pub height: i32,
    /// Width at half height, Q16.16 samples.
    pub width: i64,
    /// [`Flags::SATURATED`], [`Flags::MERGED`], [`Flags::TRUNCATED`], [`Flags::WALK_CORRECTED`].
    pub flags: Flags,
}

/// Refines one peak of `y`; `codes` are the waveform's raw codes, to see whether it was clipped.
///
/// ```text
/// f[n]  = the filter's output before it was rounded to y         Q9.23; f = 0 outside
/// s     = index, moved later one sample at a time while f rises, at most K times
/// z[j]  = f interpolated at s + j/o, j = −o−1..o+1               Q9.23, nearest
/// δ     = (z₋ − z₊) / (2 (z₋ − 2 z₀ + z₊))   around the highest z[j], j = −o..o     Q16.16, nearest, within ±½
/// height = z₀ − (z₋ − z₊)·δ/4                                    Q9.23, nearest; then Q1.15, nearest
/// time  = s + (j + δ)/o                                          Q16.16, nearest; unless clipped and walk-corrected:
/// time  = (left + right) / 2                                     crossings of half the height; Q16.16, rounded down
/// width = right − left                                           Q16.16
/// ```
///
/// Of equally high `z[j]` the sample itself (j = 0) counts, else the first. A denominator of 0 makes δ 0. With o = 1, j is 0.
/// Clipped is an echo of which a code, no further from the index than ⌈K/2⌉, reached the saturation level.
///
/// The steps of `y`, 2⁻¹⁵, would flatten the top of a weak echo in little noise; `f` has 256 times finer ones, for the few
/// samples that need them. The filter's output of a clipped echo is as symmetric as that of a whole one, so the middle of its
/// half-height crossings does not walk with the amplitude, and its flat top does not matter. The width is the filtered one:
/// 1.44 W for a whole echo.
///
/// Accuracy, against the same method in real numbers, 12 bits, noise of 4 codes or more: 75, 20 and 5 mm at SNR 5, 20 and 100
/// (`tolerance.rs` of the tests has the whole table).
pub fn refine(
    config: &Config,
    codes: &[u16],
    y: &[i16],
    f: impl Fn(i64) -> i64,
    peak: Peak,
    threshold: i16,
) -> Refined {
    let vertex = vertex(f, peak, config.template.half(), config.upsampling_log2);
    let left = crossing(y, peak, threshold, -1);
    let right = crossing(y, peak, threshold, 1);
    let mut flags = left.flags | right.flags;
    let saturated = is_clipped(config, codes, peak);
    let mut time = vertex.time;
    if saturated {
        flags |= Flags::SATURATED;
        if config.walk_corrected {
            flags |= Flags::WALK_CORRECTED;
            time = (left.time + right.time) >> 1;
        }
    }
    Refined { time, height: vertex.height, width: right.time - left.time, flags }
}

/// Whether a code within the template's half width at half maximum of the peak reached the saturation level.
fn is_clipped(config: &Config, codes: &[u16], peak: Peak) -> bool {
    let reach = config.template.half().div_ceil(2);
    let index = usize::from(peak.index);
    let end = (index + reach + 1).min(codes.len());
    let around = codes.get(index.saturating_sub(reach)..end).unwrap_or_default();
    around.iter().any(|&code| code >= config.clip_code)
}

struct Vertex {
    time: i64,
    height: i32,
}

/// Samples of `f` on each side of the summit that interpolation reads; without upsampling, one.
const MARGIN: i64 = 5;

/// `f` around the summit, the summit in the middle.
type Around = [i64; 2 * MARGIN as usize + 1];

/// Parabola through the highest interpolated value and its neighbours.
fn vertex(f: impl Fn(i64) -> i64, peak: Peak, reach: usize, upsampling_log2: u32) -> Vertex {
    let ratio = 1i64 << upsampling_log2;
    let summit = climb(&f, i64::from(peak.index), reach);
    let margin = if ratio > 1 { MARGIN } else { 1 };
    let around: Around = core::array::from_fn(|i| {
        let offset = i as i64 - MARGIN;
        if offset.abs() <= margin { f(summit + offset) } else { 0 }
    });
    let at = |j: i64| interpolate(&around, j, upsampling_log2);
    let mut best = (at(0), 0);
    let others = if ratio > 1 { -ratio..ratio + 1 } else { 0..0 };
    for j in others {
        let z = at(j);
        if z > best.0 {
            best = (z, j);
        }
    }
    let (z0, j) = best;
    let (before, after) = (at(j - 1), at(j + 1));
    let slope = before - after;
    let delta = divide_round(slope << 15, before - 2 * z0 + after).clamp(-0x8000, 0x8000);
    let fine = (j << 16) + delta;
    let time = (summit << 16) + if ratio > 1 { shift_round(fine, upsampling_log2) } else { fine };
    // The parabola's height is z₀ − (z₋ − z₊)·δ/4, in Q9.23.
    let height = z0 - shift_round(slope * delta, 18);
    Vertex { time, height: shift_round(height, 8) as i32 }
}

/// Up `f` from `start`, at most `reach` samples. Only later: a peak is the first sample of its plateau of `y`, so `f` is lower
/// before it.
fn climb(f: impl Fn(i64) -> i64, start: i64, reach: usize) -> i64 {
    let rises = |n: &i64| f(n + 1) > f(*n);
    let steps = (start..).take(reach).take_while(rises).count();
    start + steps as i64
}

/// `f` at `j / 2^log2` from the summit, Q9.23: a polynomial through the eight samples around.
fn interpolate(around: &Around, j: i64, log2: u32) -> i64 {
    let sample = |offset: i64| usize::try_from(MARGIN + offset).ok().and_then(|i| around.get(i)).map_or(0, |&v| v);
    let whole = j >> log2;
    let phase = (j & ((1 << log2) - 1)) << (3 - log2);
    let Some(taps) = (phase as usize).checked_sub(1).and_then(|row| LAGRANGE.get(row)) else {
        return sample(whole);
    };
    let sum: i64 = taps.iter().zip(-3..).map(|(&tap, t)| i64::from(tap) * sample(whole + t)).sum();
    shift_round(sum, 15)
}

/// Row p − 1 interpolates at p/8 after a sample, taps at −3..=4: the Lagrange polynomial of degree 7 in Q1.15, nearest, the
/// tap nearest to the point adjusted so that a row adds up to 2¹⁵ exactly.
///
/// Maximally flat at low frequencies, where the output of a matched filter lies: a windowed sinc of this length was 30 times
/// worse there.
pub const LAGRANGE: [[i16; 8]; 7] = [
    [-36, 366, -2071, 31072, 4439, -1243, 270, -29],
    [-62, 626, -3378, 28153, 9384, -2413, 512, -54],
    [-77, 765, -3966, 24238, 14543, -3356, 693, -72],
    [-80, 784, -3920, 19600, 19600, -3920, 784, -80],
    [-72, 693, -3356, 14543, 24238, -3966, 765, -77],
    [-54, 512, -2413, 9384, 28153, -3378, 626, -62],
    [-29, 270, -1243, 4439, 31072, -2071, 366, -36],
];

struct Crossing {
    time: i64,
    flags: Flags,
}

/// Where `y` falls below half the peak's height (rounded down), going `direction` from it: linear between samples, Q16.16,
/// the fraction of a sample rounded down, towards the peak.
///
/// Ends early in the valley (of equals the one nearest to the peak) before a neighbour that rises by more than the peak's
/// [`hysteresis`] ([`Flags::MERGED`]) or at the last sample ([`Flags::TRUNCATED`]).
fn crossing(y: &[i16], peak: Peak, threshold: i16, direction: i64) -> Crossing {
    let half = i32::from(peak.height) >> 1;
    let rise = i32::from(hysteresis(peak.height, threshold));
    let mut inner = (i64::from(peak.index), i32::from(peak.height));
    let mut valley = inner;
    loop {
        let index = inner.0 + direction;
        let Some(&value) = usize::try_from(index).ok().and_then(|i| y.get(i)) else {
            return Crossing { time: inner.0 << 16, flags: Flags::TRUNCATED };
        };
        let value = i32::from(value);
        if value < half {
            let fraction = (((inner.1 - half) as u32) << 16) / (inner.1 - value).max(1) as u32;
            return Crossing { time: (inner.0 << 16) + direction * i64::from(fraction), flags: Flags::NONE };
        }
        if value > valley.1 + rise {
            return Crossing { time: valley.0 << 16, flags: Flags::MERGED };
        }
        inner = (index, value);
        if value < valley.1 {
            valley = inner;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_interpolation_row_adds_up_to_one_and_mirrors_its_partner() {
        for (row, taps) in LAGRANGE.iter().enumerate() {
            assert_eq!(taps.iter().map(|&t| i32::from(t)).sum::<i32>(), 1 << 15);
            let partner = &LAGRANGE[6 - row];
            assert!(taps.iter().zip(partner.iter().rev()).all(|(a, b)| a.abs_diff(*b) <= 2), "row {row}");
        }
    }

    #[test]
    fn interpolation_reproduces_a_slow_sine_within_two_lsb() {
        let wave = |t: f64| 20_000.0 * (0.3 * t).sin();
        let around: Around = core::array::from_fn(|i| (256.0 * wave(25.0 + i as f64)).round() as i64);
        for j in 0..8 {
            let expected = wave(30.0 + j as f64 / 8.0);
            let got = interpolate(&around, j, 3) as f64 / 256.0;
            assert!((got - expected).abs() < 2.0, "phase {j}: {got} against {expected}");
        }
    }

    #[test]
    fn a_plateau_is_climbed_to_its_summit_and_no_further_than_the_reach() {
        let hill = |n: i64| 100 - (n - 7).abs();
        assert_eq!(climb(hill, 4, 10), 7);
        assert_eq!(climb(hill, 0, 3), 3);
        assert_eq!(climb(|_| 5, 4, 10), 4, "a flat top stays where it was found");
    }
}
