//! Noise model of a sample.

use super::numbers::{floor_root, product, two_to};

/// Noise of a waveform: σ̂ (Q13.19) and κ (Q0.32).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// σ̂, noise without signal.
    pub sigma: f64,
    /// κ, variance per signal.
    pub shot: f64,
}

impl Noise {
    /// Noise σ(v) of a value, Q13.19.
    pub fn of(&self, value: f64) -> f64 {
        self.with(value, two_to(15))
    }

    /// Noise σ(v) with a share (Q1.15) of the shot noise.
    pub fn with(&self, value: f64, share: f64) -> f64 {
        floor_root(self.variance(value, share))
    }

    /// Variance σ(v)² with a share (Q1.15) of the shot noise, Q13.38, at most 2⁶⁴ − 1: an integer
    /// that `f64` does not hold.
    pub fn variance(&self, value: f64, share: f64) -> u128 {
        let signal = value.clamp(0.0, 65_535.0);
        // Q0.32 · Q1.15 · Q1.15 → Q13.38
        let shot = product(self.shot, signal * share.min(two_to(15))) >> 24;
        (product(self.sigma, self.sigma) + shot).min(u64::MAX.into())
    }

    /// True when a value (Q1.15) is more than three σ of itself.
    pub fn shows(&self, value: f64) -> bool {
        let height = value.clamp(0.0, 65_535.0) * two_to(4);
        product(height, height) > 9 * self.variance(value, two_to(15))
    }

    /// Highest value that is at most three σ of itself, Q1.15.
    pub fn hidden(&self) -> f64 {
        let shot = (self.shot / two_to(13)).floor();
        let root = floor_root(
            (36 * product(self.sigma, self.sigma))
                .min(u64::MAX.into())
                .saturating_add(81 * product(shot, shot))
                .min(u64::MAX.into()),
        );
        ((9.0 * shot + root) / two_to(5)).floor()
    }
}
