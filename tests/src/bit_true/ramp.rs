//! A gain that rises with range.

use echoloop_dsp::Settings;

use super::numbers::{floor_of, product, saturated, two_to};

const SAMPLE: f64 = 65_536.0;

/// Rise of the gain up to full gain.
#[derive(Clone, Copy, Debug)]
pub struct Ramp {
    /// Slope, octaves a sample, Q0.32.
    slope: f64,
    /// Time of full gain, Q16.16 samples.
    end: f64,
}

impl Ramp {
    /// `None` when the gain is full everywhere; `step` is in 2⁻²⁴ mm a sample.
    pub fn new(settings: &Settings, range_min_mm: u32, step: f64) -> Option<Self> {
        let slope = floor_of(f64::from(settings.gain_slope_mdb_m) * step, 45_656.0, two_to(30));
        let rising_mm = f64::from(settings.gain_range_mm) - f64::from(range_min_mm);
        let end = floor_of(rising_mm.max(0.0), two_to(40), step.max(1.0)).min(two_to(28));
        (slope > 0.0 && end > 0.0).then_some(Self { slope, end })
    }

    /// Number of samples before the ramp's end.
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

    /// Height at full gain of a height seen at sample `n`, Q1.15.
    pub fn at_full_gain(&self, height: f64, n: usize) -> f64 {
        let rise = power(self.below(n));
        floor_of(height, rise, two_to(24)).min(two_to(32) - 1.0)
    }
}

/// 2^x, for x in Q16, as Q.24.
pub(super) fn power(x: f64) -> f64 {
    let whole = (x / SAMPLE).floor();
    let f = x - whole * SAMPLE;
    let by = |value: f64| (value * f / SAMPLE).floor();
    let mantissa = two_to(24) + by(11_674_149.0 + by(3_792_776.0 + by(1_310_291.0)));
    (mantissa * two_to(whole.min(7.0) as i32)).floor()
}

/// `x` raised by some octaves, Q1.15, rounded down.
pub(super) fn levelled(x: f64, octaves: f64) -> f64 {
    // The shift rounds negative values down, too: -⌈|x| 2^octaves⌉.
    let exact = x as i128 * power(octaves) as i128;
    saturated((exact >> 24) as f64)
}
