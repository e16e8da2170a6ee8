//! Baseline, filter and threshold.

use super::config::BitTrue;
use super::numbers::{nearest, saturated, two_to};
use super::values::{Statistics, Threshold};

/// `Σ h[k] x[n + k − K]`, with x = 0 outside.
pub fn correlate(taps: &[f64], x: &[f64]) -> Vec<f64> {
    let half = taps.len() / 2;
    let mut padded = vec![0.0; half];
    padded.extend(x);
    padded.extend(vec![0.0; half]);
    let sum = |window: &[f64]| window.iter().zip(taps).map(|(x, h)| x * h).sum::<f64>();
    padded.windows(taps.len()).map(sum).collect()
}

impl BitTrue {
    /// Waveform without baseline, x, Q1.15.
    pub fn baseline(&self, codes: &[u16], ambient: f64) -> Vec<f64> {
        let ambient = saturated(ambient);
        let fraction = |&code: &u16| f64::from(code).min(self.clip_code) * self.code;
        let above = |(n, code)| saturated(fraction(code) - self.rest(n, ambient));
        codes.iter().enumerate().map(above).collect()
    }

    /// Filter's output y, Q1.15, as long as x.
    pub fn filter(&self, x: &[f64]) -> Vec<f64> {
        let round = |sum: &f64| saturated(nearest(sum / two_to(15)));
        self.sums(x).iter().map(round).collect()
    }

    /// Filter's output f with eight more bits, Q9.23, as long as x.
    pub fn exact(&self, x: &[f64]) -> Vec<f64> {
        self.sums(x).iter().map(|sum| nearest(sum / two_to(7))).collect()
    }

    /// Sums of the filter, Q2.30.
    fn sums(&self, x: &[f64]) -> Vec<f64> {
        correlate(&self.taps, x)
    }

    /// Threshold T and σ_y of a waveform.
    pub fn threshold(&self, statistics: &Statistics) -> Threshold {
        let sigma = nearest(statistics.sigma * self.noise_gain / two_to(15));
        let snr = self.snr_threshold + self.excess(statistics);
        let by_noise = sigma * snr / two_to(12) + 0.5;
        let by_noise = if by_noise < 16.0 { by_noise.ceil() } else { nearest(by_noise) };
        let level = by_noise.max(self.floor).clamp(1.0, 32_767.0);
        Threshold { sigma, level, ambient: saturated(statistics.ambient) }
    }

    /// What clipped noise needs above k, Q8.8.
    fn excess(&self, statistics: &Statistics) -> f64 {
        let root = (self.shots * two_to(16)).sqrt().floor();
        let median = statistics.median * self.code * two_to(4);
        let ratio = (median * two_to(16) / (statistics.sigma.max(1.0) * root)).floor();
        let left = |edge: f64| (edge * 256.0 - ratio).round().max(0.0);
        if self.shots == 1.0 {
            let long = ((two_to(23) / self.noise_gain).floor() - 410.0).max(0.0);
            let slope = (59.0 * long / two_to(8)).floor();
            (slope * left(1.3) / two_to(8)).floor()
        } else {
            let factor = if self.shots == 2.0 { 256.0 } else { 410.0 };
            let slope = (factor * two_to(8) / root).floor();
            (slope * left(1.95).powi(2) / two_to(16)).floor()
        }
    }
}
