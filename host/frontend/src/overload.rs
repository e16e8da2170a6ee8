//! An amplifier that takes time to recover from what it could not follow.

use crate::Analog;

use super::receiver::Receiver;
use super::synthesis::ROUND;

/// Noise, gain, clip, recovery and quantisation: `convert` of [`super::synthesis`] with a tail.
///
/// ```text
/// e[n] = 2^b·G·i[n]/i_fs − limit               what the amplifier cannot follow, codes
/// T[n] = max(T[n−1], a·e[n])                   while e > 0: held, the output is at its limit
/// T[n] = T[n−1] · e^(−Δ/τ)                     else: it recovers, the output is clip(2^b·G·i/i_fs + T)
/// ```
///
/// a is `overload_tail`, τ is `overload_tail_ns`. So n samples after the last one that clips the
/// tail is a·e_max·e^(−nΔ/τ). The tail is the amplifier's: it brings no shot noise.
#[inline(always)]
pub(super) fn convert(
    receiver: &Receiver,
    analog: &Analog,
    signal_ua: &[f32],
    normal: &[f32],
    codes: &mut [u16],
) {
    let gain = libm::pow(10.0, analog.gain_db / 20.0);
    let full_scale = f64::from(1u32 << receiver.adc_bits);
    let codes_per_ua = (full_scale * gain / receiver.full_scale_ua) as f32;
    let limit = ((full_scale * receiver.analog_limit).min(full_scale - 1.0)) as f32;
    let quiet_ua = receiver.quiescent_current_ua() as f32;
    let quiet_variance = receiver.quiescent_variance_ua2() as f32;
    let shot_variance = receiver.shot_variance_ua() as f32;
    let mut tail = Tail::new(receiver, analog);
    for ((code, &signal), &z) in codes.iter_mut().zip(signal_ua).zip(normal) {
        let sigma_ua = (quiet_variance + shot_variance * signal).sqrt();
        let level = codes_per_ua * (quiet_ua + signal + sigma_ua * z);
        let level = (level + tail.after(level - limit)).max(0.0).min(limit);
        *code = (level + ROUND).to_bits() as u16;
    }
}

/// T of [`convert`].
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

    /// Of a sample that exceeds the limit by this.
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

    use crate::Return;
    use crate::Trigger;

    use super::super::noise::NoiseKey;
    use super::super::synthesis::{Shot, synthesise, synthesise_baseline};
    use super::*;

    const ANALOG: Analog = Analog {
        power_w: 75.0,
        pulse_width_ns: 5.0,
        gain_db: 0.0,
        sample_period_ns: 1.0,
        delay_ns: 11.0,
        pre_trigger: 0,
    };
    const NEAR: Return = Return { range_m: 15.0, strength_per_m2: 0.1 / (PI * 225.0) as f32 };

    fn slow() -> Receiver {
        Receiver { overload_tail: 0.02, overload_tail_ns: 25.0, ..Receiver::default() }
    }

    fn shot(receiver: &Receiver, beam: u32) -> Vec<u16> {
        let mut codes = vec![0; 400];
        let key = NoiseKey::new(3, Trigger { frame: 0, beam, shot: 0 });
        synthesise(receiver, &ANALOG, &[NEAR], key, &mut Shot::default(), &mut codes);
        codes
    }

    #[test]
    fn the_tail_begins_where_clipping_ends_and_decays_with_its_constant() {
        let receiver = slow();
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
            "nothing before {first}, nor while it clips"
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
    fn without_an_overload_the_codes_are_those_of_a_sound_amplifier() {
        let weak = Return { strength_per_m2: NEAR.strength_per_m2 / 20.0, ..NEAR };
        for (receiver, returns) in
            [(slow(), [weak]), (Receiver { overload_tail_ns: 7.0, ..Receiver::default() }, [NEAR])]
        {
            for beam in 0..20 {
                let run = |receiver: &Receiver| {
                    let mut codes = vec![0; 400];
                    let key = NoiseKey::new(3, Trigger { frame: 0, beam, shot: 0 });
                    synthesise(receiver, &ANALOG, &returns, key, &mut Shot::default(), &mut codes);
                    codes
                };
                assert_eq!(run(&receiver), run(&Receiver::default()));
            }
        }
    }

    #[test]
    fn both_builds_give_the_same_codes() {
        for beam in 0..32 {
            let key = NoiseKey::new(3, Trigger { frame: 0, beam, shot: 0 });
            let (mut plain, mut fast) = (vec![0; 401], vec![0; 401]);
            synthesise_baseline(&slow(), &ANALOG, &[NEAR], key, &mut Shot::default(), &mut plain);
            synthesise(&slow(), &ANALOG, &[NEAR], key, &mut Shot::default(), &mut fast);
            assert_eq!(plain, fast);
        }
    }
}
