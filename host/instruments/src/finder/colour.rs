//! Noise whose neighbouring samples are correlated.

// No overflow: |ρ| is Q1.15 and taps add up to 1 in Q1.15, so sums stay below 2⁵² and gains below
// 2¹⁶; σ below 2³² times a ratio below 2¹².

use echoloop_dsp::q::shift_round;

/// Number of lags from 0 on; samples farther apart count as uncorrelated.
pub const LAGS: usize = 32;

/// Correlation of a recording's noise.
///
/// ```text
/// c     = σ/σ̂                     σ̂: that of white noise with the same second differences
/// ρ_k   correlation of samples k apart; ρ_0 = 1
/// r     = √(Σ h² + 2·Σ_k ρ_k·Σ h[n]·h[n + k])       σ of filtered noise over σ; at least √Σh² / 2
/// ```
///
/// | name | format |
/// |---|---|
/// | `c` | Q.8 |
/// | `ρ` | Q1.15 |
/// | `r` | Q1.15 of taps in Q1.15, the sum rounded to nearest, its root down |
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour {
    /// c, Q.8.
    pub ratio: u32,
    /// ρ, Q1.15. The first, ρ_0, is not read.
    pub correlation: [i16; LAGS],
}

impl Colour {
    /// From c and ρ_0, ρ_1…; those that are left out are 0.
    pub fn new(ratio: f64, correlation: &[f64]) -> Self {
        let mut all = [0; LAGS];
        for (all, rho) in all.iter_mut().zip(correlation) {
            *all = (32_768.0 * rho).round().clamp(-32_767.0, 32_767.0) as i16;
        }
        Self { ratio: (256.0 * ratio).round().clamp(16.0, 4_095.0) as u32, correlation: all }
    }

    /// σ of a sample of σ̂, both Q13.19; nearest.
    pub fn sigma(&self, white: u32) -> u32 {
        shift_round(i64::from(white) * i64::from(self.ratio), 8).min(u32::MAX.into()) as u32
    }

    /// r of taps, Q1.15.
    pub fn noise_gain(&self, taps: &[i16]) -> u16 {
        let product = |k: usize| {
            let later = taps.get(k..).unwrap_or_default();
            taps.iter().zip(later).map(|(&a, &b)| i64::from(a) * i64::from(b)).sum::<i64>()
        };
        let white = product(0);
        let lags = self.correlation.iter().enumerate().skip(1);
        let more: i64 = lags.map(|(k, &rho)| 2 * i64::from(rho) * product(k)).sum();
        let sum = white + shift_round(more, 15);
        sum.max(white >> 2).max(0).isqrt().min(0xffff) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_white_noise_the_gain_is_the_root_of_the_squares() {
        let white = Colour::new(1.0, &[1.0]);
        assert_eq!(white.noise_gain(&[3000, 4000, 0]), 5000);
        assert_eq!(white.sigma(77), 77);
    }

    #[test]
    fn a_mean_of_samples_that_are_alike_has_their_noise() {
        let alike = Colour::new(2.5, &[1.0; LAGS]);
        let gain = alike.noise_gain(&[8192; 4]);
        assert!((32_760..=32_768).contains(&gain), "{gain}");
        assert_eq!(alike.sigma(10), 25);
        // Neighbours that cancel out, but for what the estimate may be off.
        assert_eq!(Colour::new(1.0, &[1.0, -1.0]).noise_gain(&[4096, 4096]), 2896);
    }
}
