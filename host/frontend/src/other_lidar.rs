//! Pulses of another LiDAR, at moments that have nothing to do with the sensor's own.

use std::ops::Range;

use crate::board::{Analog, Trigger};
use crate::light::OtherLight;
use crate::noise::Purpose;
use crate::pulse::Pulse;
use crate::receiver::Receiver;

/// Time between the other's pulses, ns: 100 kHz.
const PERIOD_NS: f64 = 10_000.0;

/// Full width at half maximum of its pulses, ns.
const WIDTH_NS: f64 = 5.0;

/// Pulse of another LiDAR that a shot may see.
pub(crate) struct OtherPulse {
    /// Beginning after the trigger, ns: anywhere below [`PERIOD_NS`], since neither waits for the
    /// other.
    begin_ns: f64,
    peak_ua: f64,
}

/// Pulse of another LiDAR within one piece of a waveform.
#[derive(Clone, Copy)]
pub(crate) struct PulseWithin {
    pulse: Pulse,
    /// Beginning, samples of the piece.
    begin: f64,
    peak_ua: f64,
}

impl OtherPulse {
    /// Pulse that meets a shot, the same for all beams fired with `trigger.beam`; the channel lets
    /// `share` of the light pass.
    ///
    /// ```text
    /// i = M·R0·η·A_r · E · e^(−α·path)
    /// ```
    pub(crate) fn at(
        receiver: &Receiver,
        light: OtherLight,
        share: f64,
        (seed, trigger): (u64, Trigger),
    ) -> Self {
        let irradiance = f64::from(light.irradiance_w_m2) * share;
        let through_air = libm::exp(-receiver.extinction_per_m * f64::from(light.path_m));
        Self {
            begin_ns: PERIOD_NS * Purpose::OtherLidar.for_shot(seed, trigger).uniform(0),
            peak_ua: receiver.peak_current_ua(irradiance, 0.0, 1.0) * through_air,
        }
    }

    /// The pulse in the window.
    pub(crate) fn in_window(&self, analog: &Analog) -> PulseWithin {
        self.within(analog, self.begin_ns - analog.delay_ns)
    }

    /// The pulse before it, in the samples before the trigger.
    pub(crate) fn before_trigger(&self, analog: &Analog) -> PulseWithin {
        let early_ns = analog.pre_trigger as f64 * analog.sample_period_ns;
        self.within(analog, self.begin_ns - PERIOD_NS + early_ns)
    }

    fn within(&self, analog: &Analog, begin_ns: f64) -> PulseWithin {
        PulseWithin {
            pulse: Pulse::new(&Analog { pulse_width_ns: WIDTH_NS, ..*analog }),
            begin: begin_ns / analog.sample_period_ns,
            peak_ua: self.peak_ua,
        }
    }
}

impl PulseWithin {
    /// Adds it to the signal and returns the span of samples that it reaches.
    pub(crate) fn add(&self, signal_ua: &mut [f32]) -> Range<usize> {
        self.pulse.add_from(self.begin, self.peak_ua, signal_ua)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::board::FrontEnd;
    use crate::light::SceneResponse;
    use crate::waveform_front_end::WaveformFrontEnd;

    const SHOTS: u32 = 4000;

    /// Sample of the highest code of each shot, and its height above the median, in codes.
    fn peaks(receiver: Receiver, analog: &Analog, light: OtherLight) -> Vec<(usize, f64)> {
        let beams = vec![0; SHOTS as usize + 1];
        let other = vec![light; SHOTS as usize];
        peaks_of(receiver, analog, SceneResponse { beams, other, ..SceneResponse::default() })
    }

    /// As [`peaks`], of the beams of a scene.
    fn peaks_of(receiver: Receiver, analog: &Analog, scene: SceneResponse) -> Vec<(usize, f64)> {
        let shots = scene.len() as u32;
        let mut front_end = WaveformFrontEnd::new(receiver, Arc::new(scene), 5);
        let mut codes = vec![0; analog.pre_trigger + 800];
        let peak = |beam| {
            front_end.capture(analog, Trigger { frame: 1, beam, shot: 0 }, &mut codes);
            let at = (0..codes.len()).max_by_key(|&n| codes[n]).unwrap_or(0);
            let mut sorted = codes.clone();
            sorted.sort_unstable();
            (at, f64::from(codes[at]) - f64::from(sorted[codes.len() / 2]))
        };
        (0..shots).map(peak).collect()
    }

    const LIGHT: OtherLight = OtherLight { irradiance_w_m2: 1e-3, path_m: 40.0 };

    fn mean_height(found: &[(usize, f64)]) -> f64 {
        let high: Vec<f64> = found.iter().map(|peak| peak.1).filter(|h| *h > 200.0).collect();
        high.iter().sum::<f64>() / high.len() as f64
    }

    #[test]
    fn a_pulse_of_another_meets_a_shot_in_twelve_anywhere_whatever_the_sensor_s_power() {
        let analog = Analog { pre_trigger: 40, ..Analog::USUAL };
        let weak = Analog { power_w: 1.0, ..analog };
        let found = peaks(Receiver::default(), &analog, LIGHT);
        assert_eq!(found, peaks(Receiver::default(), &weak, LIGHT));
        let met: Vec<usize> = found.iter().filter(|p| p.1 > 200.0).map(|p| p.0).collect();
        // 840 samples of 1 ns in 10 µs; five standard deviations.
        let expected = f64::from(SHOTS) * 0.084;
        assert!((met.len() as f64 - expected).abs() < 5.0 * expected.sqrt(), "{}", met.len());
        for quarter in 0..4 {
            let within = met.iter().filter(|&&n| n / 210 == quarter).count() as f64;
            let expected = 0.25 * expected;
            assert!((within - expected).abs() < 5.0 * expected.sqrt(), "{within} in {quarter}");
        }
        let own_ua = Receiver::default().peak_current_ua(1e-3, 0.0, 1.0);
        let height = mean_height(&found);
        // The highest code of a pulse has its noise on top.
        let expected = own_ua * Receiver::default().codes_per_ua();
        assert!((height / expected - 1.0).abs() < 0.05, "{height} for {expected}");
    }

    #[test]
    fn the_air_and_a_weak_channel_take_their_share_of_it() {
        let analog = Analog::USUAL;
        let all = mean_height(&peaks(Receiver::default(), &analog, LIGHT));
        let air = Receiver { extinction_per_m: 0.01, ..Receiver::default() };
        let through_air = mean_height(&peaks(air, &analog, LIGHT)) / all;
        assert!((through_air / libm::exp(-0.4) - 1.0).abs() < 0.05, "{through_air}");
        let weak = Receiver { weak_channels: 1.0, weak_channel_db: 3.0, ..Receiver::default() };
        let of_half = mean_height(&peaks(weak, &analog, LIGHT)) / all;
        assert!((of_half / 0.501 - 1.0).abs() < 0.05, "{of_half}");
    }

    #[test]
    fn beams_that_are_fired_at_once_meet_it_at_the_same_moment_whatever_their_jitter() {
        let shaken = Receiver { timing_jitter_ns: 10.0, ..Receiver::default() };
        let analog = Analog { pre_trigger: 40, ..Analog::USUAL };
        let met = |fired_with: Vec<u32>| {
            let (beams, other) = (vec![0; 401], vec![LIGHT; 400]);
            let fired_with = fired_with.into();
            let scene = SceneResponse { beams, other, fired_with, ..SceneResponse::default() };
            let found = peaks_of(shaken.clone(), &analog, scene);
            found.into_iter().map(|(at, height)| (height > 200.0).then_some(at)).collect()
        };
        // Four by four.
        let together: Vec<Option<usize>> = met((0..400).map(|beam| beam & !3).collect());
        let is_near = |four: &[Option<usize>]| match four {
            [Some(first), rest @ ..] => {
                rest.iter().all(|at| at.is_some_and(|at| at.abs_diff(*first) < 4))
            }
            _ => four.iter().all(Option::is_none),
        };
        assert!(together.as_chunks::<4>().0.iter().all(|four| is_near(four)), "{together:?}");
        let met_at_all = together.iter().flatten().count();
        assert!(met_at_all > 12, "{met_at_all} beams");
        let alone: Vec<Option<usize>> = met(Vec::new());
        assert!(!alone.as_chunks::<4>().0.iter().all(|four| is_near(four)), "{alone:?}");
    }

    #[test]
    fn a_beam_without_its_light_has_the_codes_of_a_scene_without_it() {
        let shot = |other: Vec<OtherLight>| {
            let scene = SceneResponse { beams: vec![0, 0], other, ..SceneResponse::default() };
            let mut front_end = WaveformFrontEnd::new(Receiver::default(), Arc::new(scene), 5);
            let mut codes = vec![0; 800];
            front_end.capture(&Analog::USUAL, Trigger { frame: 0, beam: 0, shot: 0 }, &mut codes);
            codes
        };
        assert_eq!(shot(vec![OtherLight::default()]), shot(Vec::new()));
    }
}
