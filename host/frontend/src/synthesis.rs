//! Synthesis of a waveform: from returns to ADC codes.

use echoloop_dispatch::dispatch;
use echoloop_random::{Key, normals, normals_baseline};

use crate::aerosol::Light;
use crate::board::Analog;
use crate::digitiser::Digitiser;
use crate::exposure::{Exposure, ShotBuffers};
use crate::pulse::Pulse;
use crate::receiver::Receiver;

/// Fills `codes` with the waveform of one shot.
///
/// ```text
/// i    = i_quiet + Σ i_k ξ(R_k) p(t − 2R_k/c) + σ(t) · z
/// x[n] = clip( round( 2^b · G·i / i_fs ), 0, 2^b − 1 ),   after clip( G·i, 0, limit )
/// ```
///
/// Compiled for the baseline and for x86-64-v3; both give the same bytes.
pub fn synthesise(exposure: &Exposure<'_>, buffers: &mut ShotBuffers, codes: &mut [u16]) {
    let Exposure { receiver, analog, returns, background, key } = *exposure;
    let prepared = Prepared::new(receiver, analog, codes.len());
    render(&prepared, Light { returns, background, other: None }, key, buffers, codes);
}

/// [`synthesise`] as compiled for the target's baseline.
pub fn synthesise_baseline(exposure: &Exposure<'_>, buffers: &mut ShotBuffers, codes: &mut [u16]) {
    let Exposure { receiver, analog, returns, background, key } = *exposure;
    let prepared = Prepared::new(receiver, analog, codes.len());
    render_with(
        &prepared,
        Light { returns, background, other: None },
        key,
        buffers,
        codes,
        normals_baseline,
    );
}

/// Constants shared by all shots with the same settings.
#[derive(Clone, Debug)]
pub(crate) struct Prepared {
    analog: Analog,
    samples: usize,
    digitiser: Digitiser,
    pulse: Pulse,
    /// Peak current of a return of 1/m² in clear air, µA.
    unit_ua: f64,
    extinction_per_m: f64,
}

impl Prepared {
    pub(crate) fn new(receiver: &Receiver, analog: &Analog, samples: usize) -> Self {
        Self {
            analog: *analog,
            samples,
            digitiser: Digitiser::new(receiver, analog, samples),
            pulse: Pulse::new(analog),
            unit_ua: receiver.peak_current_ua(analog.power_w, 0.0, 1.0),
            extinction_per_m: receiver.extinction_per_m(),
        }
    }

    /// True when it was prepared for these settings and this many samples.
    pub(crate) fn is_for(&self, analog: &Analog, samples: usize) -> bool {
        (&self.analog, self.samples) == (analog, samples)
    }

    /// Peak current of a return, µA.
    fn peak_ua(&self, range_m: f64, strength_per_m2: f64) -> f64 {
        let through_air = libm::exp(-2.0 * self.extinction_per_m * range_m);
        self.unit_ua * strength_per_m2 * through_air * self.analog.overlap(range_m)
    }
}

dispatch! {
    /// Fills `codes`, one for each sample prepared for, with the waveform of one shot.
    pub(crate) fn render(
        prepared: &Prepared,
        light: Light<'_>,
        key: Key,
        buffers: &mut ShotBuffers,
        codes: &mut [u16],
    ) = render_with, with: normals_baseline, v3_with: normals;
}

#[inline(always)]
fn render_with(
    prepared: &Prepared,
    Light { returns, background, other }: Light<'_>,
    key: Key,
    buffers: &mut ShotBuffers,
    codes: &mut [u16],
    normals: impl Fn(Key, &mut [f32]),
) {
    let shot = buffers.begin(codes.len(), background);
    for echo in returns {
        let (range_m, strength_per_m2) = (f64::from(echo.range_m), f64::from(echo.strength_per_m2));
        let current_ua = prepared.peak_ua(range_m, strength_per_m2);
        shot.lit.push(prepared.pulse.add(range_m, current_ua, shot.signal_ua));
    }
    if let Some(other) = other {
        shot.lit.push(other.add(shot.signal_ua));
    }
    normals(key, shot.normal);
    prepared.digitiser.convert(shot.lit, shot.signal_ua, shot.normal, codes);
    shot.end();
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::board::{Analog, Trigger};
    use crate::light::Return;
    use crate::noise::noise_key;
    use crate::receiver::Receiver;

    const ANALOG: Analog = Analog::USUAL;

    fn shot(analog: &Analog, returns: &[Return], beam: u32) -> Vec<u16> {
        let mut codes = vec![0; 800];
        let (receiver, key) =
            (Receiver::default(), noise_key(3, Trigger { frame: 0, beam, shot: 0 }));
        let exposure = Exposure { receiver: &receiver, analog, returns, background: &[], key };
        synthesise(&exposure, &mut ShotBuffers::default(), &mut codes);
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
    fn an_echo_peaks_at_its_range_with_the_height_of_the_link_budget() {
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
    fn the_area_of_an_echo_scales_with_power_width_gain_and_sample_rate() {
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
