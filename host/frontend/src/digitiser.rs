//! Amplifier and converter: noise, gain, clipping, recovery from overload, quantisation.

use std::ops::Range;

use crate::board::Analog;
use crate::receiver::Receiver;

/// 1.5 · 2²³: adding it to 0 ≤ x < 2²² leaves `round(x)`, ties to even, in the low bits.
pub(crate) const ROUND: f32 = 12_582_912.0;

/// Converts a signal current to ADC codes; holds the constants of one set of settings.
///
/// ```text
/// L[n] = 2^b·(G[n]·(i_quiet + i[n]) / i_fs + black) + 2^b·G[n]·σ(i[n]) / i_fs · z[n]      codes
/// x[n] = round( clip( L[n] + T[n], 0, limit ) )
/// e[n] = L[n] − limit                          excess over the amplifier's limit
/// T[n] = max(T[n−1], a·e[n])                   while e > 0: held, the output is at its limit
/// T[n] = T[n−1] · e^(−Δ/τ)                     else: it recovers
/// ```
///
/// G[n] is [`Analog::gain_at`], a `overload_tail`, τ `overload_tail_ns`. The tail is therefore
/// a·e_max·e^(−nΔ/τ) n samples after the last clipped one. It arises in the amplifier, so it adds
/// no shot noise.
#[derive(Clone, Debug)]
pub(crate) struct Digitiser {
    /// Codes per µA at full gain.
    codes_per_ua: f32,
    /// Codes per µA of each sample before the gain is full.
    near_codes_per_ua: Vec<f32>,
    /// Largest code.
    limit: f32,
    /// Black level, codes.
    black: f32,
    quiet_ua: f32,
    quiet_variance_ua2: f32,
    shot_variance_ua: f32,
    /// Present when an overload leaves a tail.
    tail: Option<Tail>,
}

impl Digitiser {
    /// Prepares the constants for a window of `samples`.
    pub(crate) fn new(receiver: &Receiver, analog: &Analog, samples: usize) -> Self {
        let full_scale = f64::from(1u32 << receiver.adc_bits);
        let codes_per_ua = |gain: f64| (gain * receiver.codes_per_ua()) as f32;
        let near = 0..analog.near_samples().min(samples);
        Self {
            codes_per_ua: codes_per_ua(libm::pow(10.0, analog.gain_db / 20.0)),
            near_codes_per_ua: near.map(|n| codes_per_ua(analog.gain_at(n))).collect(),
            limit: (full_scale * receiver.analog_limit).min(full_scale - 1.0) as f32,
            black: (full_scale * analog.black_level) as f32,
            quiet_ua: receiver.quiescent_current_ua() as f32,
            quiet_variance_ua2: receiver.quiescent_variance_ua2() as f32,
            shot_variance_ua: receiver.shot_variance_ua() as f32,
            tail: (receiver.overload_tail > 0.0).then(|| Tail::new(receiver, analog)),
        }
    }

    /// Converts a signal that is zero outside the spans `lit`.
    #[inline(always)]
    pub(crate) fn convert(
        &self,
        lit: &[Range<usize>],
        signal_ua: &[f32],
        normal: &[f32],
        codes: &mut [u16],
    ) {
        let near = self.near_codes_per_ua.iter().copied();
        let full = std::iter::repeat(self.codes_per_ua);
        if let Some(mut tail) = self.tail.clone() {
            let recover = |level, limit| level + tail.after(level - limit);
            return self.convert_each(near.chain(full), signal_ua, normal, codes, recover);
        }
        // Without a tail no sample depends on the one before it, so the loops vectorise.
        let begin = near.len().min(codes.len());
        self.convert_quiet(&normal[begin..], &mut codes[begin..]);
        let (signal, z, out) = (&signal_ua[..begin], &normal[..begin], &mut codes[..begin]);
        self.convert_each(near, signal, z, out, |level, _| level);
        for span in lit {
            let span = span.start.max(begin)..span.end.max(begin);
            let (signal, z) = (&signal_ua[span.clone()], &normal[span.clone()]);
            self.convert_each(full.clone(), signal, z, &mut codes[span], |level, _| level);
        }
    }

    /// Converts samples without a signal, at full gain; same codes as [`Self::convert_each`].
    #[inline(always)]
    fn convert_quiet(&self, normal: &[f32], codes: &mut [u16]) {
        let (level, spread) = self.level_and_spread(self.codes_per_ua, 0.0);
        for (code, &z) in codes.iter_mut().zip(normal) {
            *code = self.code(level + spread * z);
        }
    }

    /// Converts sample by sample; `recover` maps a level and the limit to the level with its tail.
    #[inline(always)]
    fn convert_each(
        &self,
        codes_per_ua: impl Iterator<Item = f32>,
        signal_ua: &[f32],
        normal: &[f32],
        codes: &mut [u16],
        mut recover: impl FnMut(f32, f32) -> f32,
    ) {
        let samples = codes.iter_mut().zip(signal_ua).zip(normal);
        for (((code, &signal), &z), codes_per_ua) in samples.zip(codes_per_ua) {
            let (level, spread) = self.level_and_spread(codes_per_ua, signal);
            *code = self.code(recover(level + spread * z, self.limit));
        }
    }

    /// Mean and standard deviation of a sample, codes.
    #[inline(always)]
    fn level_and_spread(&self, codes_per_ua: f32, signal_ua: f32) -> (f32, f32) {
        let sigma_ua = (self.quiet_variance_ua2 + self.shot_variance_ua * signal_ua).sqrt();
        (codes_per_ua * (self.quiet_ua + signal_ua) + self.black, codes_per_ua * sigma_ua)
    }

    #[inline(always)]
    fn code(&self, level: f32) -> u16 {
        (level.max(0.0).min(self.limit) + ROUND).to_bits() as u16
    }
}

/// Tail T of an overload, see [`Digitiser`].
#[derive(Clone, Debug)]
struct Tail {
    fraction: f32,
    decay: f32,
    value: f32,
}

impl Tail {
    fn new(receiver: &Receiver, analog: &Analog) -> Self {
        let decay = libm::exp(-analog.sample_period_ns / receiver.overload_tail_ns) as f32;
        Self { fraction: receiver.overload_tail as f32, decay, value: 0.0 }
    }

    /// Tail after a sample that exceeds the limit by `excess`.
    #[inline(always)]
    fn after(&mut self, excess: f32) -> f32 {
        self.value = if excess > 0.0 {
            self.value.max(self.fraction * excess)
        } else {
            self.value * self.decay
        };
        self.value
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::board::Trigger;
    use crate::exposure::{Exposure, ShotBuffers};
    use crate::light::Return;
    use crate::noise::noise_key;
    use crate::synthesis::{synthesise, synthesise_baseline};

    const ANALOG: Analog = Analog::USUAL;
    const NEAR: Return = Return { range_m: 15.0, strength_per_m2: 0.1 / (PI * 225.0) as f32 };

    fn slow() -> Receiver {
        Receiver { overload_tail: 0.02, overload_tail_ns: 25.0, ..Receiver::default() }
    }

    fn exposure<'a>(receiver: &'a Receiver, returns: &'a [Return], beam: u32) -> Exposure<'a> {
        let key = noise_key(3, Trigger { frame: 0, beam, shot: 0 });
        Exposure { receiver, analog: &ANALOG, returns, background: &[], key }
    }

    fn codes(exposure: &Exposure<'_>) -> Vec<u16> {
        let mut codes = vec![0; 400];
        synthesise(exposure, &mut ShotBuffers::default(), &mut codes);
        codes
    }

    #[test]
    fn the_tail_begins_where_clipping_ends_and_decays_with_its_constant() {
        let receiver = slow();
        let shot = |receiver: &Receiver, beam| codes(&exposure(receiver, &[NEAR], beam));
        let mut difference = vec![0.0; 400];
        const SHOTS: u32 = 200;
        for beam in 0..SHOTS {
            for ((sum, slow), sound) in difference
                .iter_mut()
                .zip(shot(&receiver, beam))
                .zip(shot(&Receiver::default(), beam))
            {
                *sum += (f64::from(slow) - f64::from(sound)) / f64::from(SHOTS);
            }
        }
        let sound = shot(&Receiver::default(), 0);
        let first = sound.iter().position(|&code| code == 4095).unwrap();
        let last = sound.iter().rposition(|&code| code == 4095).unwrap();
        assert!(
            difference[..=last].iter().all(|&d| d == 0.0),
            "the codes are the same before {first} and while it clips"
        );
        // 199 µA over 30 µA of full scale: the overload is 5.64 full scales; 2 % of it is 462
        // codes.
        let peak = receiver.peak_current_ua(75.0, 15.0, NEAR.strength_per_m2.into())
            + receiver.quiescent_current_ua();
        let begin = 0.02 * (peak / 30.0 * 4096.0 - 4095.0);
        for after in [4, 10, 25, 50, 75] {
            let expected = begin * (-f64::from(after) / 25.0).exp();
            let got = difference[last + after as usize];
            assert!(
                (got / expected - 1.0).abs() < 0.03,
                "{after} ns after: {got} instead of {expected} codes"
            );
        }
    }

    #[test]
    fn without_an_overload_a_slow_amplifier_gives_the_codes_of_an_ideal_one() {
        let weak = Return { strength_per_m2: NEAR.strength_per_m2 / 20.0, ..NEAR };
        for (receiver, returns) in
            [(slow(), [weak]), (Receiver { overload_tail_ns: 7.0, ..Receiver::default() }, [NEAR])]
        {
            for beam in 0..20 {
                let shot = |receiver: &Receiver| codes(&exposure(receiver, &returns, beam));
                assert_eq!(shot(&receiver), shot(&Receiver::default()));
            }
        }
    }

    /// 1 dB/m up to 40 m.
    const RISING: Analog = Analog { gain_slope_db_ns: 0.15, gain_full_ns: 271.85, ..ANALOG };

    /// Mean waveform of 400 shots.
    fn means(analog: &Analog, returns: &[Return]) -> Vec<f64> {
        let (receiver, mut sum) = (Receiver::default(), vec![0.0; 400]);
        for beam in 0..400 {
            let exposure = Exposure { analog, ..exposure(&receiver, returns, beam) };
            for (sum, code) in sum.iter_mut().zip(codes(&exposure)) {
                *sum += f64::from(code) / 400.0;
            }
        }
        sum
    }

    #[test]
    fn a_gain_that_rises_scales_light_and_noise_but_not_the_black_level() {
        let weak = Return { strength_per_m2: NEAR.strength_per_m2 / 20.0, ..NEAR };
        let lifted = |analog: Analog| Analog { black_level: 0.01, ..analog };
        let (full, rising) = (means(&lifted(ANALOG), &[weak]), means(&lifted(RISING), &[weak]));
        let black = 0.01 * 4096.0;
        for (n, (full, rising)) in full.iter().zip(&rising).enumerate() {
            let below_db = 0.15 * (271.85 - (11.0 + n as f64)).max(0.0);
            let expected = black + (full - black) * 10f64.powf(-below_db / 20.0);
            assert!((rising - expected).abs() < 1.0, "sample {n}: {rising} against {expected}");
        }
        // 37 dB down the noise is below a code.
        let (receiver, analog) = (slow(), lifted(RISING));
        let codes = codes(&Exposure { analog: &analog, ..exposure(&receiver, &[], 0) });
        let spread = |codes: &[u16]| codes.iter().max().unwrap() - codes.iter().min().unwrap();
        assert!(spread(&codes[..40]) <= 2 && spread(&codes[300..]) > 30, "{codes:?}");
    }

    #[test]
    fn the_overlap_rises_from_none_at_nine_tenths_of_its_range_to_all() {
        let top = |overlap_m, range_m: f32| {
            let wall = Return { range_m, strength_per_m2: 1e-5 };
            let seen = means(&Analog { overlap_m, ..ANALOG }, &[wall]);
            seen.iter().copied().fold(0.0, f64::max) - seen[380]
        };
        let all = top(1.0, 19.0);
        for (range_m, part) in [(17.9, 0.0), (19.0, 0.5), (20.5, 1.0)] {
            let got = top(20.0, range_m) / all;
            assert!((got - part).abs() < 0.02, "{range_m} m: {got}");
        }
    }

    #[test]
    fn both_builds_give_the_same_codes() {
        let far = [
            Return { range_m: 40.0, strength_per_m2: 4e-5 },
            Return { range_m: 90.0, strength_per_m2: 1e-5 },
        ];
        let mut buffers = ShotBuffers::default();
        for beam in 0..64 {
            for (receiver, analog, returns) in [
                (slow(), ANALOG, &[NEAR][..]),
                (slow(), RISING, &[NEAR]),
                (Receiver::default(), ANALOG, &far),
            ] {
                let exposure = Exposure { analog: &analog, ..exposure(&receiver, returns, beam) };
                let (mut plain, mut fast) = (vec![0; 801], vec![0; 801]);
                synthesise_baseline(&exposure, &mut buffers, &mut plain);
                synthesise(&exposure, &mut buffers, &mut fast);
                assert_eq!(plain, fast);
            }
        }
    }
}
