//! Noise of a sample, which grows with the signal.

use crate::stages::statistics::Statistics;

/// Noise of amplifier and ambient light, and shot noise of the signal.
///
/// ```text
/// σ(v)² = σ̂² + κ v          κ = shot noise at 0 dB · 10^(G/20) / m
/// ```
///
/// | name | meaning | format |
/// |---|---|---|
/// | `v` | signal, clamped to 0 to 2 − 2⁻¹⁵ | Q1.15 |
/// | `σ̂` | from the waveform | Q13.19 |
/// | `κ` | full scale² per full scale | Q0.32 |
/// | `κ v` | rounded down, once with its share where only a share counts | Q13.38 |
/// | `σ(v)²` | their sum, saturating in `u64` | Q13.38 |
/// | `σ(v)` | root rounded down | Q13.19 |
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Noise {
    /// σ̂, Q13.19.
    pub sigma: u32,
    /// κ, Q0.32.
    pub shot: u32,
}

impl Noise {
    /// Noise of a waveform with these statistics.
    pub fn new(statistics: &Statistics, shot: u32) -> Self {
        Self { sigma: statistics.sigma, shot }
    }

    /// σ(v) of a sample, Q13.19.
    pub fn of(&self, value: i64) -> u32 {
        self.with(value, 1 << 15)
    }

    /// Highest value that noise hides, which is 3 σ of itself: v = (9κ + √(81κ² + 36σ̂²)) / 2.
    /// Q1.15, rounded down from Q13.19; κ in Q0.19, rounded down, the root rounded down, its square
    /// saturating.
    #[expect(clippy::arithmetic_side_effects, reason = "κ in Q0.19 is below 2¹⁹, a root below 2³²")]
    pub fn hidden(&self) -> i64 {
        let shot = u64::from(self.shot >> 13);
        let sigma = u64::from(self.sigma);
        let square = (36 * sigma).saturating_mul(sigma).saturating_add(81 * shot * shot);
        ((9 * shot + square.isqrt()) >> 5) as i64
    }

    /// True when noise hides a value, v ≤ 3 σ(v): (16 v)² ≤ 9 σ(v)², both Q13.38 and exact (a σ² of
    /// 2⁶⁴/9 or more hides every value).
    pub fn hides(&self, value: i64) -> bool {
        let height = (value.clamp(0, 0xffff) as u64) << 4;
        height.saturating_mul(height) <= self.variance(value, 1 << 15).saturating_mul(9)
    }

    /// σ(v) when only a share (Q1.15, at most 1) of the shot noise counts, Q13.19.
    pub fn with(&self, value: i64, share: u32) -> u32 {
        self.variance(value, share).isqrt() as u32
    }

    /// σ(v)² when only a share (Q1.15) of the shot noise counts: Q13.38, saturating.
    #[expect(
        clippy::arithmetic_side_effects,
        reason = "κ 2³², v at most 2¹⁶, a share at most 2¹⁵: 2⁶³; σ̂² below 2⁶⁴"
    )]
    pub fn variance(&self, value: i64, share: u32) -> u64 {
        let signal = value.clamp(0, 0xffff) as u64;
        let shot = (u64::from(self.shot) * signal * u64::from(share.min(1 << 15))) >> 24;
        let quiet = u64::from(self.sigma) * u64::from(self.sigma);
        quiet.saturating_add(shot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shot_noise_adds_to_the_square_and_grows_with_the_signal() {
        let noise = Noise { sigma: 1_000, shot: 1 << 22 }; // κ ≈ 10⁻³
        let variance = |value| f64::from(noise.of(value)).powi(2);
        assert_eq!(noise.of(0), 1_000);
        assert_eq!(noise.of(-50), 1_000);
        let (half, full) = (variance(0x4000) - 1e6, variance(0x8000) - 1e6);
        assert!((full / half - 2.0).abs() < 1e-3);
        let expected = f64::from(1u32 << 22) / 2f64.powi(32) * 2f64.powi(38);
        assert!((full / expected - 1.0).abs() < 1e-3);
    }
}
