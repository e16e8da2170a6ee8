//! Counter-based random numbers for what is not a sample's noise.
//!
//! A number is a pure function of (seed, purpose, scan, beam, shot, index): the same on any number
//! of threads, in any order. The noise of samples has its own, wider generator in [`super::noise`].

use std::f64::consts::PI;

use crate::Trigger;

use super::noise::splitmix64;

/// What a stream is for. Values are part of every published result: never renumber.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// When the pulse leaves.
    Timing = 1,
    /// Which channels are dead or weak.
    Channels = 2,
    /// Where drops and flakes hang.
    Hydrometeors = 3,
    /// Photon counts of the compatibility mode, in the window.
    Photons = 4,
    /// The same before the trigger.
    PhotonsBefore = 5,
    /// How the sensor shakes.
    Shaking = 6,
}

/// A stream of random numbers that is read by index.
#[derive(Clone, Copy, Debug)]
pub struct Stream(u64);

impl Stream {
    /// Of one shot.
    pub(super) fn of_shot(seed: u64, purpose: Purpose, trigger: Trigger) -> Self {
        let Trigger { frame, beam, shot } = trigger;
        let Self(key) = Self::of(seed, purpose, u64::from(frame) << 32 | u64::from(beam));
        Self(splitmix64(key ^ u64::from(shot)))
    }

    /// Of anything that has a number.
    pub(super) fn of(seed: u64, purpose: Purpose, number: u64) -> Self {
        Self(splitmix64(splitmix64(splitmix64(seed) ^ purpose as u64) ^ number))
    }

    /// Of what shakes as one in a scan.
    pub fn of_motion(seed: u64, number: u64) -> Self {
        Self::of(seed, Purpose::Shaking, number)
    }

    /// Uniform in (0, 1), 53 bits, never an end.
    pub(super) fn uniform(self, index: u64) -> f64 {
        let bits = splitmix64(self.0.wrapping_add(index.wrapping_mul(0x9e37_79b9_7f4a_7c15))) >> 11;
        (bits as f64 + 0.5) / 9_007_199_254_740_992.0
    }

    /// Exponential of mean 1.
    pub(super) fn exponential(self, index: u64) -> f64 {
        -libm::log(self.uniform(index))
    }

    /// Standard normal (Box–Muller, its cosine); `index` and the next are used up.
    pub fn normal(self, index: u64) -> f64 {
        (2.0 * self.exponential(index)).sqrt() * libm::cos(2.0 * PI * self.uniform(index + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: u64 = 100_000;

    fn moments(draw: impl Fn(u64) -> f64) -> (f64, f64) {
        let mean = (0..N).map(&draw).sum::<f64>() / N as f64;
        let variance = (0..N).map(|i| (draw(i) - mean).powi(2)).sum::<f64>() / N as f64;
        (mean, variance)
    }

    #[test]
    fn streams_have_the_moments_of_their_distributions() {
        let stream = Stream::of(7, Purpose::Timing, 0);
        // (draw, mean, variance); standard errors of the mean below 0.0032, of the variance below
        // 0.009.
        let close = |(mean, variance): (f64, f64), expected: (f64, f64)| {
            assert!(
                (mean - expected.0).abs() < 0.013 && (variance - expected.1).abs() < 0.04,
                "{mean} {variance}"
            );
        };
        close(moments(|i| stream.uniform(i)), (0.5, 1.0 / 12.0));
        close(moments(|i| stream.exponential(i)), (1.0, 1.0));
        close(moments(|i| stream.normal(2 * i)), (0.0, 1.0));
        close(moments(|i| Stream::of(7, Purpose::Timing, i).normal(0)), (0.0, 1.0));
    }

    #[test]
    fn every_shot_and_every_purpose_has_a_stream_of_its_own() {
        let at = |purpose, frame, beam, shot| {
            Stream::of_shot(1, purpose, Trigger { frame, beam, shot }).uniform(0)
        };
        let streams = [
            at(Purpose::Timing, 0, 0, 0),
            at(Purpose::Photons, 0, 0, 0),
            at(Purpose::Timing, 1, 0, 0),
            at(Purpose::Timing, 0, 1, 0),
            at(Purpose::Timing, 0, 0, 1),
        ];
        for (i, a) in streams.iter().enumerate() {
            assert!(streams[i + 1..].iter().all(|b| a != b));
        }
    }
}
