//! Echoes in the near field, where the gain still rises.

use super::config::BitTrue;
use super::noise::Noise;
use super::numbers::{floor_of, nearest, saturated, two_to};
use super::ramp::{levelled, power};
use super::refine::Waveform;
use super::values::{Peak, Threshold};

/// A waveform rescaled as if all samples around an echo had the echo's gain.
pub(super) struct Level {
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
    /// The echo's peak: the first sample of its plateau.
    pub(super) summit: Peak,
}

impl BitTrue {
    /// Samples from which ambient and noise are measured: those of full gain, or all without any.
    pub fn of_full_gain<'a>(&self, codes: &'a [u16]) -> &'a [u16] {
        let near = self.ramp.map_or(0, |ramp| ramp.samples());
        if near < codes.len() { &codes[near..] } else { codes }
    }

    /// Baseline of a sample, Q1.15.
    pub(super) fn rest(&self, n: usize, ambient: f64) -> f64 {
        let Some(ramp) = &self.ramp else { return ambient };
        let above = (ambient - self.black) * power(-ramp.below(n)) / two_to(24);
        saturated(self.black + above.floor())
    }

    /// True when the gain may still rise under an echo at sample `n`.
    pub(super) fn is_near(&self, n: usize) -> bool {
        self.ramp.is_some_and(|ramp| n < ramp.samples() + 2 * self.reach)
    }

    /// A finer sample `value` (Q1.15) of sample n at a time in Q16.16, without baseline, rescaled
    /// to the echo's gain.
    pub(super) fn level(
        &self,
        wave: &Waveform<'_>,
        ambient: f64,
        (n, time): (usize, f64),
        value: f64,
    ) -> f64 {
        match (self.ramp, wave.level) {
            (Some(ramp), Some((at, full))) => {
                levelled(value - self.rest(n, saturated(full)), ramp.octaves(time) - ramp.below(at))
            }
            _ => saturated(value - ambient),
        }
    }

    /// Waveform rescaled to the gain of a near echo, with its threshold and noise. `None` for an
    /// echo at full gain.
    pub(super) fn near(
        &self,
        wave: &Waveform<'_>,
        peak: Peak,
        (threshold, noise): (&Threshold, &Noise),
    ) -> Option<(Level, Threshold, Noise)> {
        let ramp = self.ramp.as_ref().filter(|_| self.is_near(peak.index))?;
        let here = ramp.below(peak.index);
        let gain = power(-here);
        let rounding = (74.0 * self.shot_code * two_to(4) / two_to(8)).floor();
        let part = |value: f64| floor_of(value, gain, two_to(24));
        let noise = Noise {
            sigma: part(noise.sigma).max(rounding).min(noise.sigma),
            shot: part(noise.shot),
        };
        let threshold = Threshold {
            sigma: nearest(noise.sigma * self.noise_gain / two_to(15)),
            ambient: self.rest(peak.index, threshold.ambient),
            ..*threshold
        };
        let (first, last) =
            self.clipped_run(wave.codes, peak.index).unwrap_or((peak.index, peak.index));
        let beside = (self.taps.len() - 1) / 2 + 2 * self.reach + 16;
        let around = first.saturating_sub(beside)..=last + beside;
        let level = |(n, &x): (usize, &f64)| match around.contains(&n) {
            true => levelled(x, ramp.below(n) - here),
            false => x,
        };
        let x: Vec<f64> = wave.x.iter().enumerate().map(level).collect();
        let half = (self.taps.len() - 1) / 2;
        let from = if *around.start() == 0 { 0 } else { around.start() + half };
        let to = if around.end() + 1 < x.len() { around.end() + 1 - half } else { x.len() };
        let mut y = wave.y.to_vec();
        let again = self.filter(&x);
        if from < to {
            y[from..to].copy_from_slice(&again[from..to]);
        }
        let earlier = (1..=self.reach)
            .take_while(|k| peak.index >= *k && y[peak.index - k] >= y[peak.index + 1 - k])
            .count();
        let index = peak.index - earlier;
        let summit = Peak { index, height: y[index] };
        Some((Level { x, y, summit }, threshold, noise))
    }
}
