//! From returns to ADC codes.

use std::f64::consts::PI;

use echoloop_dispatch::dispatch;

use super::board::Analog;
use super::light::Return;
use super::noise::{NoiseKey, normals};
use super::overload;
use super::receiver::{Receiver, SPEED_OF_LIGHT_M_NS};

/// Working memory of one shot.
#[derive(Clone, Debug, Default)]
pub struct Shot {
    /// Signal current, µA.
    signal_ua: Vec<f32>,
    /// Standard normals.
    normal: Vec<f32>,
}

impl Shot {
    /// Memory for this many samples: signal, which is `background` to begin with, and normals of an
    /// earlier shot.
    #[inline(always)]
    pub(super) fn begin(&mut self, samples: usize, background: &[f32]) -> (&mut [f32], &mut [f32]) {
        if self.normal.len() < samples {
            self.signal_ua.resize(samples, 0.0);
            self.normal.resize(samples, 0.0);
        }
        let signal_ua = &mut self.signal_ua[..samples];
        let (lit, dark) = signal_ua.split_at_mut(background.len().min(samples));
        lit.copy_from_slice(&background[..lit.len()]);
        dark.fill(0.0);
        (signal_ua, &mut self.normal[..samples])
    }
}

/// Fills `codes` with the waveform of one shot.
///
/// ```text
/// i    = i_quiet + Σ i_k p(t − 2R_k/c) + σ(t) · z
/// x[n] = clip( round( 2^b · G·i / i_fs ), 0, 2^b − 1 ),   after clip( G·i, 0, limit )
/// ```
///
/// Compiled twice, as the DSP is: for the baseline and for x86-64-v3. Same bytes.
pub fn synthesise(
    receiver: &Receiver,
    analog: &Analog,
    returns: &[Return],
    key: NoiseKey,
    shot: &mut Shot,
    codes: &mut [u16],
) {
    synthesise_over(receiver, analog, returns, &[], key, shot, codes);
}

dispatch! {
    /// [`synthesise`] where `background` flows besides, µA of signal current a sample; beyond its
    /// end, none.
    pub(super) fn synthesise_over(
        receiver: &Receiver,
        analog: &Analog,
        returns: &[Return],
        background: &[f32],
        key: NoiseKey,
        shot: &mut Shot,
        codes: &mut [u16],
    ) = synthesise_inline;
}

/// [`synthesise`] as compiled for the target's baseline.
pub fn synthesise_baseline(
    receiver: &Receiver,
    analog: &Analog,
    returns: &[Return],
    key: NoiseKey,
    shot: &mut Shot,
    codes: &mut [u16],
) {
    synthesise_inline(receiver, analog, returns, &[], key, shot, codes);
}

#[inline(always)]
fn synthesise_inline(
    receiver: &Receiver,
    analog: &Analog,
    returns: &[Return],
    background: &[f32],
    key: NoiseKey,
    shot: &mut Shot,
    codes: &mut [u16],
) {
    let (signal_ua, normal) = shot.begin(codes.len(), background);
    for echo in returns {
        let current_ua = receiver.peak_current_ua(
            analog.power_w,
            f64::from(echo.range_m),
            f64::from(echo.strength_per_m2),
        );
        add_pulse(analog, f64::from(echo.range_m), current_ua, signal_ua);
    }
    normals(key, normal);
    match receiver.overload_tail > 0.0 {
        true => overload::convert(receiver, analog, signal_ua, normal, codes),
        false => convert(receiver, analog, signal_ua, normal, codes),
    }
}

/// Adds `current · sin²(π(t − 2R/c) / 2W)`; the cosine by Chebyshev's recurrence, two evaluations a
/// pulse.
pub(super) fn add_pulse(analog: &Analog, range_m: f64, current_ua: f64, signal_ua: &mut [f32]) {
    let begin = (2.0 * range_m / SPEED_OF_LIGHT_M_NS - analog.delay_ns) / analog.sample_period_ns;
    let length = 2.0 * analog.pulse_width_ns / analog.sample_period_ns;
    let first = (begin.ceil().max(0.0)) as usize;
    let last = (begin + length).ceil().clamp(0.0, signal_ua.len() as f64) as usize;
    let Some(span) = signal_ua.get_mut(first..last) else { return };
    // sin²(πu/L) = (1 − cos(2πu/L)) / 2, u samples after the begin.
    let step = 2.0 * PI / length;
    let phase = step * (first as f64 - begin);
    let twice_cos_step = 2.0 * libm::cos(step);
    let (mut cosine, mut previous) = (libm::cos(phase), libm::cos(phase - step));
    for sample in span {
        *sample += (current_ua * 0.5 * (1.0 - cosine)) as f32;
        (cosine, previous) = (twice_cos_step * cosine - previous, cosine);
    }
}

/// 1.5 · 2²³: adding it to 0 ≤ x < 2²² leaves `round(x)`, ties to even, in the low bits.
pub(super) const ROUND: f32 = 12_582_912.0;

/// Noise, gain, clip and quantisation.
#[inline(always)]
fn convert(
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
    for ((code, &signal), &z) in codes.iter_mut().zip(signal_ua).zip(normal) {
        let sigma_ua = (quiet_variance + shot_variance * signal).sqrt();
        let level = (codes_per_ua * (quiet_ua + signal + sigma_ua * z)).max(0.0).min(limit);
        *code = (level + ROUND).to_bits() as u16;
    }
}

#[cfg(test)]
mod tests {
    use crate::Trigger;

    use super::*;

    const ANALOG: Analog = Analog {
        power_w: 75.0,
        pulse_width_ns: 5.0,
        gain_db: 0.0,
        sample_period_ns: 1.0,
        delay_ns: 11.0,
        pre_trigger: 0,
    };

    fn shot(analog: &Analog, returns: &[Return], beam: u32) -> Vec<u16> {
        let mut codes = vec![0; 800];
        let key = NoiseKey::new(3, Trigger { frame: 0, beam, shot: 0 });
        synthesise(&Receiver::default(), analog, returns, key, &mut Shot::default(), &mut codes);
        codes
    }

    fn average(analog: &Analog, returns: &[Return]) -> Vec<f64> {
        let mut sum = vec![0.0; 800];
        for beam in 0..400 {
            for (sum, code) in sum.iter_mut().zip(shot(analog, returns, beam)) {
                *sum += f64::from(code) / 400.0;
            }
        }
        sum
    }

    #[test]
    fn both_builds_give_the_same_codes() {
        let returns = [
            Return { range_m: 40.0, strength_per_m2: 4e-5 },
            Return { range_m: 90.0, strength_per_m2: 1e-5 },
        ];
        for beam in 0..64 {
            let mut plain = vec![0; 801];
            let mut fast = vec![0; 801];
            let key = NoiseKey::new(3, Trigger { frame: 0, beam, shot: 0 });
            synthesise_baseline(
                &Receiver::default(),
                &ANALOG,
                &returns,
                key,
                &mut Shot::default(),
                &mut plain,
            );
            synthesise(
                &Receiver::default(),
                &ANALOG,
                &returns,
                key,
                &mut Shot::default(),
                &mut fast,
            );
            assert_eq!(plain, fast);
        }
    }

    #[test]
    fn an_echo_peaks_where_its_range_says_and_as_high_as_the_link_budget_says() {
        let range_m = 299_792_458e-9 / 2.0 * 306.0; // pulse middle at 306 + 5 ns, sample 300
        let echo =
            Return { range_m: range_m as f32, strength_per_m2: (0.1 / PI / 50.0 / 50.0) as f32 };
        let mean = average(&ANALOG, &[echo]);
        let quiet = mean[..250].iter().sum::<f64>() / 250.0;
        let expected = 4096.0
            * Receiver::default().peak_current_ua(75.0, 50.0, f64::from(echo.strength_per_m2))
            / 30.0;
        assert!(
            (mean[300] - quiet - expected).abs() < 0.01 * expected,
            "{} against {expected}",
            mean[300] - quiet
        );
        assert!(
            (mean[297] - mean[303]).abs() < 0.03 * expected,
            "the pulse is symmetric about sample 300"
        );
    }

    #[test]
    fn power_width_and_gain_act_as_the_physics_says() {
        let echo = [Return { range_m: 60.0, strength_per_m2: 1e-5 }];
        let area = |analog: &Analog| {
            let mean = average(analog, &echo);
            let quiet = mean[..200].iter().sum::<f64>() / 200.0;
            mean.iter().map(|v| v - quiet).sum::<f64>()
        };
        let base = area(&ANALOG);
        for (name, analog, factor) in [
            ("power", Analog { power_w: 37.5, ..ANALOG }, 0.5),
            ("width", Analog { pulse_width_ns: 10.0, ..ANALOG }, 2.0),
            ("gain", Analog { gain_db: 6.0206, ..ANALOG }, 2.0),
            ("clock", Analog { sample_period_ns: 0.5, delay_ns: 300.0, ..ANALOG }, 2.0),
        ] {
            let ratio = area(&analog) / base;
            assert!((ratio / factor - 1.0).abs() < 0.05, "{name}: {ratio} instead of {factor}");
        }
    }

    #[test]
    fn a_near_wall_fills_the_converter_and_stays_in_range() {
        let codes = shot(&ANALOG, &[Return { range_m: 10.0, strength_per_m2: 1e-2 }], 0);
        assert_eq!(codes.iter().copied().max(), Some(4095));
    }
}
