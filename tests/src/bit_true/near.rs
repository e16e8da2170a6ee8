//! Echoes where the gain still rises.

use super::config::BitTrue;
use super::noise::Noise;
use super::numbers::{floor_of, nearest, saturated, two_to};
use super::ramp::{levelled, power};
use super::refine::Waveform;
use super::values::{Peak, Threshold};

impl BitTrue {
    /// The samples that ambient and noise are measured from; all where none has full gain.
    pub fn of_full_gain<'a>(&self, codes: &'a [u16]) -> &'a [u16] {
        let near = self.ramp.map_or(0, |ramp| ramp.samples());
        if near < codes.len() { &codes[near..] } else { codes }
    }

    /// What a sample rests on, Q1.15.
    pub(super) fn rest(&self, n: usize, ambient: f64) -> f64 {
        let Some(ramp) = &self.ramp else { return ambient };
        let above = (ambient - self.black) * power(-ramp.below(n)) / two_to(24);
        saturated(self.black + above.floor())
    }

    /// Whether the gain may still rise under an echo at a sample.
    pub(super) fn is_near(&self, n: usize) -> bool {
        self.ramp.is_some_and(|ramp| n < ramp.samples() + 2 * self.reach)
    }

    /// What an echo is seen under that stands where the gain still rises: noise, threshold, and a
    /// waveform as if all around it had its gain. None where the gain is full.
    pub(super) fn near(
        &self,
        wave: &Waveform<'_>,
        peak: Peak,
        (threshold, noise): (&Threshold, &Noise),
    ) -> Option<(Vec<f64>, Threshold, Noise)> {
        let ramp = self.ramp.as_ref().filter(|_| self.is_near(peak.index))?;
        let here = ramp.below(peak.index);
        let gain = power(-here);
        let rounding = (74.0 * self.code * two_to(4) / two_to(8)).floor();
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
        Some((wave.x.iter().enumerate().map(level).collect(), threshold, noise))
    }
}
