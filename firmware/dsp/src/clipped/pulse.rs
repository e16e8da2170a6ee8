//! Emitted pulse as a function of time, which the edges of a clipped echo are compared with.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "times within the pulse are below 2²³, a pulse is at least 2³, a phase at most 2²⁴, \
              the table's values at most 2³⁰"
)]

use crate::q::divide_round;

/// Emitted sin² pulse, for a width and a sample period.
///
/// ```text
/// p(u) = sin²(π u / L),  0 ≤ u ≤ L = 2 W f_s       u in samples since the pulse began; 0 outside
/// ```
///
/// | name | format |
/// |---|---|
/// | `u`, `L`, `W f_s` | Q16.16; `W f_s` nearest, 1/16 to 127 samples; L twice that |
/// | phase φ = u / L | Q0.24: (u · ⌊2⁴⁰ / L⌋) / 2¹⁶, rounded down; beyond ½ mirrored: 1 − φ |
/// | `p` | Q2.30: linear between 257 nearest values of phases 0, 1/512, … ½, rounded down |
/// | `p′` | Q2.30 per sample, absolute; 0 outside |
/// | π/L | Q1.16, nearest of π in Q2.30 |
///
/// `p′ = π/L · sin(2πu/L) = π/L · (1 − 2 p(|u − L/4|))`, L/4 and the product rounded down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulse {
    /// W f_s, Q16.16.
    width: i64,
    /// ⌊2⁴⁰ / L⌋.
    per_length: u64,
    /// π / L, Q1.16.
    turn: i64,
}

/// 1 in Q2.30.
pub const ONE: i64 = 1 << 30;

/// π in Q2.30, nearest.
const PI: i64 = 3_373_259_426;

impl Pulse {
    /// Pulse of this full width at half maximum, held to 1/16 to 127 samples.
    pub fn new(width_ps: u32, sample_period_fs: u32) -> Self {
        let samples =
            divide_round((i64::from(width_ps) * 1000) << 16, i64::from(sample_period_fs.max(1)));
        let width = samples.clamp(1 << 12, 127 << 16);
        let length = 2 * width as u64;
        Self { width, per_length: (1 << 40) / length, turn: divide_round(PI << 2, 2 * width) }
    }

    /// W f_s, the full width at half maximum, which is half the length: Q16.16 samples.
    pub fn width(&self) -> i64 {
        self.width
    }

    /// p(u), Q2.30.
    pub fn at(&self, u: i64) -> i64 {
        if u <= 0 || u >= 2 * self.width {
            return 0;
        }
        let phase = (u as u64 * self.per_length) >> 16;
        let folded = phase.min((1 << 24) - phase);
        let (index, fraction) = ((folded >> 15) as usize, (folded & 0x7fff) as i64);
        let low = i64::from(SIN_SQUARED.get(index).copied().unwrap_or(1 << 30));
        let high = i64::from(SIN_SQUARED.get(index + 1).copied().unwrap_or(1 << 30));
        low + (((high - low) * fraction) >> 15)
    }

    /// |p′(u)|, Q2.30 per sample; 0 outside the pulse.
    pub fn slope(&self, u: i64) -> i64 {
        if u <= 0 || u >= 2 * self.width {
            return 0;
        }
        let sine = ONE - 2 * self.at((u - (self.width >> 1)).abs());
        (sine.abs() * self.turn) >> 16
    }
}

/// sin²(π/2 · i/256), Q2.30, nearest.
#[expect(clippy::indexing_slicing, reason = "the compiler evaluates it")]
pub const SIN_SQUARED: [u32; 257] = {
    let mut table = [0; 257];
    let mut i = 0;
    while i < table.len() {
        // sin² x = (1 − cos 2x) / 2, and 2x = π i/256
        table[i] =
            ((1.0 - cosine(core::f64::consts::PI * i as f64 / 256.0)) * 536_870_912.0 + 0.5) as u32;
        i += 1;
    }
    table
};

/// cos x for 0 ≤ x ≤ π, by its series.
const fn cosine(x: f64) -> f64 {
    let (mut sum, mut term, mut n) = (1.0, 1.0, 0.0);
    while n < 40.0 {
        n += 2.0;
        term *= -x * x / (n * (n - 1.0));
        sum += term;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    #[test]
    fn the_table_is_sin_squared() {
        for (i, &value) in SIN_SQUARED.iter().enumerate() {
            let expected = libm::sin(PI / 2.0 * i as f64 / 256.0).powi(2) * f64::from(1 << 30);
            assert!((f64::from(value) - expected).abs() <= 0.5 + 1e-3, "{i}");
        }
    }

    #[test]
    fn the_pulse_and_its_slope_follow_the_formula() {
        for (width_ps, period_fs) in [(5_000, 2_000_000), (5_000, 992_354), (20_000, 330_780)] {
            let pulse = Pulse::new(width_ps, period_fs);
            let length = 2.0 * f64::from(width_ps) * 1e3 / f64::from(period_fs);
            for step in -10..=1010 {
                let u = length * f64::from(step) / 1000.0;
                let inside = (0.0..=length).contains(&u);
                let expected = if inside { libm::sin(PI * u / length).powi(2) } else { 0.0 };
                let value = pulse.at((u * 65536.0) as i64);
                let got = value as f64 / ONE as f64;
                assert!((got - expected).abs() < 3e-5, "{u} of {length}: {got} against {expected}");
                let slope = if inside {
                    (PI / length * libm::sin(2.0 * PI * u / length)).abs()
                } else {
                    0.0
                };
                let got = pulse.slope((u * 65536.0) as i64) as f64 / ONE as f64;
                assert!(
                    (got - slope).abs() < 1e-3 * PI / length,
                    "{u} of {length}: {got} against {slope}"
                );
            }
        }
    }
}
