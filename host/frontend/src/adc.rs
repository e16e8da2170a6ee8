//! Noise, gain, clip and quantisation, by an amplifier that may take time to recover.

use crate::board::Analog;
use crate::receiver::Receiver;

/// 1.5 · 2²³: adding it to 0 ≤ x < 2²² leaves `round(x)`, ties to even, in the low bits.
pub(crate) const ROUND: f32 = 12_582_912.0;

/// From a signal current to codes.
///
/// ```text
/// L[n] = 2^b·(G·(i_quiet + i[n] + σ(i[n])·z[n]) / i_fs + black)        codes
/// x[n] = round( clip( L[n] + T[n], 0, limit ) )
/// e[n] = L[n] − limit                          what the amplifier cannot follow
/// T[n] = max(T[n−1], a·e[n])                   while e > 0: held, the output is at its limit
/// T[n] = T[n−1] · e^(−Δ/τ)                     else: it recovers
/// ```
///
/// a is `overload_tail`, τ is `overload_tail_ns`. So n samples after the last one that clips the
/// tail is a·e_max·e^(−nΔ/τ). The tail is the amplifier's: it brings no shot noise.
#[inline(always)]
pub(crate) fn convert(
    receiver: &Receiver,
    analog: &Analog,
    signal_ua: &[f32],
    normal: &[f32],
    codes: &mut [u16],
) {
    let amplifier = Amplifier::new(receiver, analog);
    // Without a tail no sample hangs on the one before it, and the loop runs in vectors.
    if receiver.overload_tail > 0.0 {
        let mut tail = Tail::new(receiver, analog);
        amplifier
            .convert(signal_ua, normal, codes, |level, limit| level + tail.after(level - limit));
    } else {
        amplifier.convert(signal_ua, normal, codes, |level, _| level);
    }
}

/// The constants of a conversion.
struct Amplifier {
    codes_per_ua: f32,
    /// Largest code.
    limit: f32,
    /// Codes of no current.
    black: f32,
    quiet_ua: f32,
    quiet_variance_ua2: f32,
    shot_variance_ua: f32,
}

impl Amplifier {
    #[inline(always)]
    fn new(receiver: &Receiver, analog: &Analog) -> Self {
        let gain = libm::pow(10.0, analog.gain_db / 20.0);
        let full_scale = f64::from(1u32 << receiver.adc_bits);
        Self {
            codes_per_ua: (full_scale * gain / receiver.full_scale_ua) as f32,
            limit: (full_scale * receiver.analog_limit).min(full_scale - 1.0) as f32,
            black: (full_scale * analog.black_level) as f32,
            quiet_ua: receiver.quiescent_current_ua() as f32,
            quiet_variance_ua2: receiver.quiescent_variance_ua2() as f32,
            shot_variance_ua: receiver.shot_variance_ua() as f32,
        }
    }

    /// `recover` says what becomes of a level, given the limit.
    #[inline(always)]
    fn convert(
        &self,
        signal_ua: &[f32],
        normal: &[f32],
        codes: &mut [u16],
        mut recover: impl FnMut(f32, f32) -> f32,
    ) {
        for ((code, &signal), &z) in codes.iter_mut().zip(signal_ua).zip(normal) {
            let sigma_ua = (self.quiet_variance_ua2 + self.shot_variance_ua * signal).sqrt();
            let current_ua = self.quiet_ua + signal + sigma_ua * z;
            let level = self.codes_per_ua * current_ua + self.black;
            let level = recover(level, self.limit).max(0.0).min(self.limit);
            *code = (level + ROUND).to_bits() as u16;
        }
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

    fn shot(receiver: &Receiver, beam: u32) -> Vec<u16> {
        let mut codes = vec![0; 400];
        let exposure = exposure(receiver, &[NEAR], beam);
        synthesise(&exposure, &mut ShotBuffers::default(), &mut codes);
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
                    let exposure = exposure(receiver, &returns, beam);
                    synthesise(&exposure, &mut ShotBuffers::default(), &mut codes);
                    codes
                };
                assert_eq!(run(&receiver), run(&Receiver::default()));
            }
        }
    }

    #[test]
    fn both_builds_give_the_same_codes() {
        for beam in 0..32 {
            let (slow, mut buffers) = (slow(), ShotBuffers::default());
            let exposure = exposure(&slow, &[NEAR], beam);
            let (mut plain, mut fast) = (vec![0; 401], vec![0; 401]);
            synthesise_baseline(&exposure, &mut buffers, &mut plain);
            synthesise(&exposure, &mut buffers, &mut fast);
            assert_eq!(plain, fast);
        }
    }
}
