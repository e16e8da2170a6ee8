//! Gain that rises with range, and its removal from the samples around an echo.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "exponents are below 2²³, gains at most 2²⁴, ratios below 2³², samples and sums of \
              codes below 2²³: products below 2⁶³; shifts are bounded"
)]

use core::ops::Range;

use crate::limits::MAX_GAINS;
use crate::settings::Settings;

/// Near gain: linear in dB over range up to its end, full from there on.
///
/// ```text
/// e(n) = max(0, slope · (end − n))              octaves below full gain, n in samples
/// g(n) = 2^(−e(n))
/// b(n) = black + g(n) (ambient − black)         baseline of a sample
/// x[n] = min(code[n], S) − b(n)                 before the filter
/// z[n] = x[n] g(n₀)/g(n)                        around an echo at n₀: as if all had its gain
/// ```
///
/// | name | value | format |
/// |---|---|---|
/// | slope | dB/m · step · log₂10/20, 45 656/2³⁰ of mdB/m · 2⁻²⁴ mm, rounded down | Q0.32 |
/// | end | from sample 0 to where the gain is full, at most 4096 samples | Q16.16, rounded down |
/// | e | at most 63 | Q6.16, rounded down |
/// | 2^f | 1 + f (11 674 149 + f (3 792 776 + 1 310 291 f))/2²⁴, f from 0 to 1 | Q.24, each down |
/// | g; g(n₀)/g(n) | 2^f shifted; below 2⁸ | Q.24, down |
/// | b | the product rounded down | Q1.15, saturating |
/// | x, z | z rounded down | Q1.15, saturating |
///
/// 2^f is within 1.5 × 10⁻⁴. A gain that rises as R² would shift every echo by another distance,
/// 0.304 (cW/2)²/R behind a matched filter; this one shifts them alike, and `z` not at all.
/// Derived in `benches/record/detector.md`, A gain that rises with range.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ramp {
    /// Slope in octaves a sample, Q0.32.
    slope: u32,
    /// End of the ramp, Q16.16 samples.
    end: i32,
    /// g of the first samples, Q.24.
    gains: [u32; MAX_GAINS],
}

/// 1 in Q.24.
const ONE: u32 = 1 << 24;

/// Highest exponent, Q16.
const MOST: u32 = 63 << 16;

/// Farthest end of the ramp: 4096 samples, Q16.16.
const FARTHEST: i64 = 1 << 28;

/// Factor from mdB/m times 2⁻²⁴ mm to octaves in Q0.32: log₂10/20 octaves a dB, over 10⁶ · 2²⁴ /
/// 2³², times 2³⁰.
const OCTAVES: i64 = 45_656;

impl Ramp {
    /// Ramp of these settings; `None` where the gain is the same everywhere. `step` is the range
    /// per sample, 2⁻²⁴ mm.
    pub fn new(settings: &Settings, range_min_mm: u32, step: i64) -> Option<Self> {
        let slope = (i64::from(settings.gain_slope_mdb_m).clamp(0, 1 << 10)
            * step.clamp(0, 1 << 36)
            * OCTAVES)
            >> 30;
        let rising_mm =
            i64::from(settings.gain_range_mm).clamp(0, 1 << 16) - i64::from(range_min_mm);
        let end = ((rising_mm.max(0) << 40) / step.max(1)).min(FARTHEST) as i32;
        if slope <= 0 || end <= 0 {
            return None;
        }
        let slope = slope.min(u32::MAX.into()) as u32;
        let mut ramp = Self { slope, end, gains: [0; MAX_GAINS] };
        ramp.gains = core::array::from_fn(|n| ramp.worked_out(n));
        Some(ramp)
    }

    /// Number of samples before the ramp's end.
    pub fn samples(&self) -> usize {
        ((self.end + 0xffff) >> 16) as usize
    }

    /// e at a time in Q16.16 samples: octaves below full gain, Q6.16.
    #[inline(always)]
    pub fn octaves(&self, time: i32) -> i32 {
        let before = (self.end - time).max(0) as u32;
        high(self.slope, before).min(MOST) as i32
    }

    /// e at a sample: octaves below full gain, Q6.16.
    #[inline(always)]
    pub fn below(&self, n: usize) -> i32 {
        self.octaves((n as i32) << 16)
    }

    /// Height at full gain of a height seen at a sample: divided by g there, Q1.15, rounded down,
    /// saturating.
    pub fn at_full_gain(&self, height: u32, n: usize) -> u32 {
        let full = u64::from(height) * u64::from(power(self.below(n)));
        (full >> 24).min(u32::MAX.into()) as u32
    }

    /// g at a sample, Q.24.
    #[inline(always)]
    pub fn gain(&self, n: usize) -> u32 {
        self.gains.get(n).copied().unwrap_or_else(|| self.worked_out(n))
    }

    /// Stored gains g of a range of samples: of its first ones, of all, or of none.
    #[inline(always)]
    pub fn kept(&self, samples: Range<usize>) -> &[u32] {
        let end = samples.end.min(self.gains.len());
        self.gains.get(samples.start.min(end)..end).unwrap_or_default()
    }

    #[inline(always)]
    fn worked_out(&self, n: usize) -> u32 {
        power(-self.below(n))
    }
}

/// 2^x, x in Q16: Q.24, below 2⁸.
#[inline(always)]
pub fn power(x: i32) -> u32 {
    let f = (x as u32) << 16; // Q0.32
    let mantissa = ONE + high(11_674_149 + high(3_792_776 + high(1_310_291, f), f), f);
    match x >> 16 {
        up @ 0.. => mantissa << up.min(7),
        down => mantissa >> down.unsigned_abs().min(31),
    }
}

/// Upper word of a product: one instruction, where the whole product takes more.
#[inline(always)]
fn high(a: u32, b: u32) -> u32 {
    ((u64::from(a) * u64::from(b)) >> 32) as u32
}

/// Sample, below 2²³, times 2^octaves: Q1.15, rounded down, saturating.
#[inline(always)]
pub fn levelled(x: i32, octaves: i32) -> i16 {
    let level = (i64::from(x) * i64::from(power(octaves))) >> 24; // within 2³¹
    (level as i32).clamp(-0x8000, 0x7fff) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_is_the_same_whether_it_is_kept_or_worked_out() {
        let settings =
            Settings { gain_slope_mdb_m: 900, gain_range_mm: 65_000, ..Settings::default() };
        let ramp = Ramp::new(&settings, 1_000, 1 << 28).unwrap();
        let far = MAX_GAINS + 100;
        assert!(ramp.samples() > far, "it rises beyond what is kept: {}", ramp.samples());
        assert!((0..far).all(|n| ramp.gain(n) == power(-ramp.below(n))));
        let last = MAX_GAINS.saturating_sub(1);
        let backwards = Range { start: 9, end: 7 };
        for samples in [0..far, 7..9, backwards, last..far, far..far + 1] {
            let kept = samples.start..samples.end.min(MAX_GAINS);
            let expected = kept.map(|n| power(-ramp.below(n)));
            assert!(ramp.kept(samples.clone()).iter().copied().eq(expected), "{samples:?}");
        }
    }
}
