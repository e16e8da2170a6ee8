//! A gain that rises with range.

use echoloop_dsp::Settings;

use super::numbers::{floor_of, product, saturated, two_to};

const SAMPLE: f64 = 65_536.0;

/// Where the gain is full, and how it rises until then.
#[derive(Clone, Copy, Debug)]
pub struct Ramp {
    /// Octaves a sample, Q0.32.
    slope: f64,
    /// Q16.16 samples.
    end: f64,
}

impl Ramp {
    /// None where it is full everywhere; `step` is 2⁻²⁴ mm a sample.
    pub fn new(settings: &Settings, range_min_mm: u32, step: f64) -> Option<Self> {
        let slope = floor_of(f64::from(settings.gain_slope_mdb_m) * step, 45_656.0, two_to(30));
        let rising_mm = f64::from(settings.gain_range_mm) - f64::from(range_min_mm);
        let end = floor_of(rising_mm.max(0.0), two_to(40), step.max(1.0)).min(two_to(28));
        (slope > 0.0 && end > 0.0).then_some(Self { slope, end })
    }

    /// Samples that begin before its end.
    pub fn samples(&self) -> usize {
        (self.end / SAMPLE).ceil() as usize
    }

    /// Octaves below full gain at a time in Q16.16 samples, Q6.16.
    pub fn octaves(&self, time: f64) -> f64 {
        let before = (self.end - time).max(0.0);
        ((product(self.slope, before) >> 32) as f64).min(63.0 * SAMPLE)
    }

    /// Octaves below full gain at a sample.
    pub fn below(&self, n: usize) -> f64 {
        self.octaves(n as f64 * SAMPLE)
    }

    /// A height at full gain, from one of so many octaves below; Q1.15.
    pub fn at_full_gain(&self, height: f64, n: usize) -> f64 {
        let rise = power(self.below(n));
        floor_of(height, rise, two_to(24)).min(two_to(32) - 1.0)
    }
}

/// 2^x of x in Q16: Q.24.
pub(super) fn power(x: f64) -> f64 {
    let whole = (x / SAMPLE).floor();
    let f = x - whole * SAMPLE;
    let by = |value: f64| (value * f / SAMPLE).floor();
    let mantissa = two_to(24) + by(11_674_149.0 + by(3_792_776.0 + by(1_310_291.0)));
    (mantissa * two_to(whole.min(7.0) as i32)).floor()
}

/// Q1.15, rounded down.
pub(super) fn levelled(x: f64, octaves: f64) -> f64 {
    // Of negative ones, too: -⌈|x| 2^octaves⌉.
    let exact = x as i128 * power(octaves) as i128;
    saturated((exact >> 24) as f64)
}
