//! The emitted pulse.

use std::f64::consts::PI;
use std::sync::LazyLock;

use super::numbers::{floor_of, nearest, nearest_ratio, two_to};

/// sin² at phases i/512, Q2.30.
pub static TABLE: LazyLock<[f64; 257]> = LazyLock::new(|| {
    std::array::from_fn(|i| nearest((PI * i as f64 / 512.0).sin().powi(2) * two_to(30)))
});

/// The sin² pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// Width W f_s, Q16.16 samples.
    pub width: f64,
}

impl Pulse {
    /// Pulse of a width, sampled with a period.
    pub fn new(width_ps: f64, period_fs: f64) -> Self {
        Self {
            width: nearest_ratio(width_ps * 1e3 * two_to(16), period_fs)
                .clamp(two_to(12), 127.0 * two_to(16)),
        }
    }

    /// Length L, Q16.16 samples.
    pub fn length(&self) -> f64 {
        2.0 * self.width
    }

    /// Pulse p(u), Q2.30.
    pub fn at(&self, u: f64) -> f64 {
        if u <= 0.0 || u >= self.length() {
            return 0.0;
        }
        let phase = floor_of(u, (two_to(40) / self.length()).floor(), two_to(16));
        let steps = phase.min(two_to(24) - phase) / two_to(15);
        let (low, high) = (TABLE[steps.floor() as usize], TABLE[steps.ceil() as usize]);
        low + ((high - low) * steps.fract()).floor()
    }

    /// Slope |p′(u)|, Q2.30 a sample.
    pub fn slope(&self, u: f64) -> f64 {
        if u <= 0.0 || u >= self.length() {
            return 0.0;
        }
        let turn = nearest_ratio(nearest(PI * two_to(30)) * two_to(2), self.length());
        let sine = two_to(30) - 2.0 * self.at((u - (self.length() / 4.0).floor()).abs());
        floor_of(sine.abs(), turn, two_to(16))
    }
}
