//! Waveforms whose gain rises with range: baseline of each sample, and echoes corrected to
//! constant gain.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "differences and samples of Q1.15, gains at most 2²⁴, σ and κ below 2³²: products \
              below 2⁶³; indices and reach lie in memory"
)]

use core::ops::Range;

use crate::config::DetectorConfig;
use crate::q::shift_round;
use crate::rising_gain::ramp::{Ramp, levelled};
use crate::stages::baseline;
use crate::stages::detect::Threshold;
use crate::stages::noise::Noise;

/// Waveform whose gain rises, with its ambient light.
#[derive(Clone, Copy, Debug)]
pub struct Near<'a> {
    /// Gain over range.
    pub ramp: &'a Ramp,
    /// Constants of the stages.
    pub config: &'a DetectorConfig,
    /// Ambient light at full gain, Q1.15.
    pub ambient: i16,
}

impl Near<'_> {
    /// True when part of the pulse of an echo at sample `n` may lie before the ramp's end: `n` is
    /// less than 2K samples beyond it, K samples being on either side of a pulse's middle.
    pub fn holds(&self, n: usize) -> bool {
        n < self.ramp.samples().saturating_add(2 * self.config.reach)
    }

    /// Baseline b at a sample, Q1.15.
    #[inline(always)]
    pub fn rest(&self, n: usize) -> i16 {
        self.rest_of(self.ramp.gain(n))
    }

    /// Baseline b at gain g, Q1.15.
    #[inline(always)]
    fn rest_of(&self, gain: u32) -> i16 {
        let black = self.config.black;
        let above = (i64::from(i32::from(self.ambient) - black) * i64::from(gain)) >> 24;
        (black + above as i32).clamp(-0x8000, 0x7fff) as i16
    }

    /// Writes x of a range of samples. The portable form of
    /// [`SampleLoops::remove_near_baseline`](crate::SampleLoops::remove_near_baseline).
    #[inline(always)]
    pub fn remove_baseline(&self, codes: &[u16], samples: Range<usize>, x: &mut [i16]) {
        let DetectorConfig { clip_code, code_shift, .. } = *self.config;
        let end = samples.end.min(codes.len()).min(x.len());
        let samples = samples.start.min(end)..end;
        let codes = codes.get(samples.clone()).unwrap_or_default();
        let x = x.get_mut(samples.clone()).unwrap_or_default();
        let of = |code, gain| baseline::of(code, clip_code, code_shift, self.rest_of(gain));
        let gains = self.ramp.kept(samples.clone());
        for (&gain, (&code, x)) in gains.iter().zip(codes.iter().zip(&mut *x)) {
            *x = of(code, gain);
        }
        let beyond = samples.start + gains.len()..samples.end;
        let codes = codes.get(gains.len()..).unwrap_or_default();
        let x = x.get_mut(gains.len()..).unwrap_or_default();
        for (n, (&code, x)) in beyond.zip(codes.iter().zip(x)) {
            *x = of(code, self.ramp.gain(n));
        }
    }

    /// Turns x into z for a range of samples around an echo at `at`. The portable form of
    /// [`SampleLoops::level`](crate::SampleLoops::level).
    #[inline(always)]
    pub fn level(&self, at: usize, samples: Range<usize>, x: &mut [i16]) {
        let here = self.ramp.below(at);
        let samples = samples.start..samples.end.min(x.len());
        let x = x.get_mut(samples.clone()).unwrap_or_default();
        for (n, x) in samples.zip(x) {
            *x = levelled((*x).into(), self.ramp.below(n) - here);
        }
    }

    /// Noise of an echo at a sample: σ̂ and κ times g, rounded down. σ̂ is at least the noise of
    /// rounding one shot to codes, 74/2⁸ of a code: where noise is below a code all shots are
    /// rounded alike, and averaging does not help.
    pub fn noise(&self, at: usize, noise: &Noise) -> Noise {
        let gain = u64::from(self.ramp.gain(at));
        let rounding = (74 << (self.config.shot_code_shift + 4)) >> 8;
        let part = |value: u32| ((u64::from(value) * gain) >> 24) as u32; // the gain is at most 1
        Noise { sigma: part(noise.sigma).max(rounding).min(noise.sigma), shot: part(noise.shot) }
    }

    /// Threshold of an echo at a sample; its level stays that of full gain.
    pub fn threshold(&self, at: usize, noise: &Noise, threshold: &Threshold) -> Threshold {
        let noise_gain = i64::from(self.config.template.noise_gain);
        let sigma = shift_round(i64::from(noise.sigma) * noise_gain, 15) as u32;
        Threshold { sigma, ambient: self.rest(at), ..*threshold }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::MAX_GAINS;
    use crate::settings::Settings;
    use crate::settings::hardware::Hardware;

    const LEN: usize = MAX_GAINS + 100;

    #[test]
    fn each_sample_rests_on_its_own_gain_wherever_some_begin_and_end() {
        let settings =
            Settings { gain_slope_mdb_m: 900, gain_range_mm: 65_000, ..Settings::default() };
        let config = DetectorConfig::new(&Settings::default(), &Hardware::REFERENCE).unwrap();
        let ramp = Ramp::new(&settings, 1_000, 1 << 28).unwrap();
        let near = Near { ramp: &ramp, config: &config, ambient: 3_000 };
        assert!(ramp.samples() > LEN, "it rises beyond what is kept");
        let codes: [u16; LEN] = core::array::from_fn(|n| (n * 37 % 4096) as u16);
        let last = MAX_GAINS.saturating_sub(1);
        let backwards = Range { start: 9, end: 7 };
        let cut = [0..LEN, last..LEN, LEN - 9..LEN, LEN - 3..LEN + 9, LEN..LEN + 1];
        for samples in cut.into_iter().chain([5..5, backwards]) {
            for short in [0, 4] {
                let mut x = [i16::MAX; LEN];
                let x = &mut x[short..];
                near.remove_baseline(&codes, samples.clone(), x);
                for (n, &x) in x.iter().enumerate() {
                    let (clip, shift) = (config.clip_code, config.code_shift);
                    let alone = baseline::of(codes[n], clip, shift, near.rest(n));
                    let expected = if samples.contains(&n) { alone } else { i16::MAX };
                    assert_eq!(x, expected, "{n} of {samples:?}, {short} short");
                }
            }
        }
    }
}
