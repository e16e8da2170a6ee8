//! Constants of the detector.

use echoloop_dsp::choice::{AmbientEstimator, EchoChoice, TimingMethod};
use echoloop_dsp::template::Template;
use echoloop_dsp::{DetectorConfig, Hardware, Settings};

use super::dithered_edges::Dithered;
use super::numbers::{floor_of, nearest, two_to};
use super::pulse::Pulse;
use super::ramp::Ramp;
use super::split::Sharpener;

/// Speed of light, m/s.
pub const LIGHT: f64 = 299_792_458.0;

/// Bit-true model of the detector.
#[derive(Clone, Debug)]
pub struct BitTrue {
    /// m, number of shots.
    pub shots: f64,
    /// 2^d, divisor of the sum of the shots.
    pub sum_divisor: f64,
    /// Samples before the trigger.
    pub pre_trigger: usize,
    /// Ambient estimator.
    pub ambient: AmbientEstimator,
    /// Black level, Q1.15.
    pub black: f64,
    /// Q1.15 LSB of one code, after the shots are added up.
    pub code: f64,
    /// Q1.15 LSB of one code of one shot.
    pub shot_code: f64,
    /// Lowest saturated code.
    pub clip_code: f64,
    /// Taps of the filter, Q1.15.
    pub taps: Vec<f64>,
    /// r, gain of noise, Q1.15.
    pub noise_gain: f64,
    /// 1/g, inverse of the filter's peak gain, Q2.14.
    pub inverse_gain: f64,
    /// g·N, noise floor behind the filter, Q1.15.
    pub floor: f64,
    /// k, SNR threshold, Q8.8.
    pub snr_threshold: f64,
    /// o, upsampling.
    pub upsampling: f64,
    /// Timing method.
    pub timing: TimingMethod,
    /// Gain of the time's σ, Q16.16.
    pub timing_gain: f64,
    /// q, share of the top's shot noise that counts, Q1.15.
    pub shot_share: f64,
    /// β, bias of the parabola, Q1.15.
    pub timing_bias: f64,
    /// z, time from the method's edge to the middle, Q16.16.
    pub timing_offset: f64,
    /// The emitted pulse.
    pub pulse: Pulse,
    /// w, width above which a peak may hide others, Q16.16 samples.
    pub broad: f64,
    /// K, number of samples strictly inside the pulse on either side of its middle.
    pub reach: usize,
    /// κ, shot noise, Q0.32.
    pub shot_noise: f64,
    /// Reflectivity per Q1.15 and mm², in 2⁻⁷⁴; an integer that `f64` does not hold.
    pub reflectivity_scale: u64,
    /// ΔR, minimum separation, samples.
    pub min_separation: f64,
    /// E, largest number of echoes.
    pub echoes: usize,
    /// Choice of echoes.
    pub choice: EchoChoice,
    /// Sample period, fs.
    pub period_fs: f64,
    /// Range of sample 0, 1/256 mm.
    pub range_origin: f64,
    /// Range per sample, 2⁻²⁴ mm.
    pub range_step: f64,
    /// Range of sample 0, Q16.16 samples, at most 4096 of them.
    pub origin_samples: f64,
    /// Distance from sample 0 to where the receiver begins to see the beam, Q16.16 samples.
    pub blind: f64,
    /// Range from which it sees the whole beam, mm.
    pub overlap_mm: f64,
    /// Rise of the gain.
    pub ramp: Option<Ramp>,
    /// Reader of dithered shots.
    pub(super) dithered: Option<Dithered>,
    /// Filter that finds hidden peaks.
    pub sharpener: Option<Sharpener>,
}

/// Sample period, fs: 2 (R_max − R_min) / (c·N).
pub fn period_fs(bins: i32, hardware: &Hardware) -> f64 {
    let round_trip_mm = 2.0 * (f64::from(hardware.range_max_mm) - f64::from(hardware.range_min_mm));
    nearest(round_trip_mm * 1e12 / (f64::from(bins) * LIGHT))
}

impl BitTrue {
    /// The model for accepted settings; `config`, of the same settings, gives the constants in
    /// `f32`.
    pub fn new(settings: &Settings, hardware: &Hardware, config: &DetectorConfig) -> Self {
        let period_fs = period_fs(settings.bins, hardware);
        let width_ps = settings.pulse_width_ps as u32;
        let choices = settings.choices().expect("accepted settings have valid choices");
        let template = Template::new(choices.denoise, width_ps, period_fs as u32);
        let taps: Vec<f64> = template.taps().iter().map(|&h| f64::from(h)).collect();
        let peak_gain = f64::from(template.peak_gain);
        let shots = f64::from(settings.shots);
        // A sum has b + log₂ m bits, of which at most 14 stay.
        let bits = hardware.adc_bits as i32 + shots.log2() as i32;
        let sum_divisor = two_to((bits - 14).max(0));
        let full_scale = nearest(shots * (two_to(hardware.adc_bits as i32) - 1.0) / sum_divisor);
        let range_step = nearest(period_fs * LIGHT * two_to(23) / 1e12);
        let separation_um = match settings.min_separation_mm {
            Some(mm) => f64::from(mm) * 1e3,
            None => (f64::from(settings.pulse_width_ps) * 17_088.0 / 100.0).floor(),
        };
        Self {
            shots,
            sum_divisor,
            pre_trigger: settings.pre_trigger_samples() as usize,
            ambient: choices.ambient,
            black: nearest(f64::from(settings.black_level_ppm) * two_to(15) / 1e6),
            code: two_to(15 - bits.min(14)),
            shot_code: two_to(15 - hardware.adc_bits as i32),
            clip_code: nearest(f64::from(settings.saturation_ppm) * full_scale / 1e6),
            noise_gain: taps.iter().map(|h| h * h).sum::<f64>().sqrt().floor(),
            inverse_gain: (two_to(29) / peak_gain).floor().min(65_535.0),
            floor: nearest(f64::from(settings.noise_floor_ppm) * peak_gain / 1e6),
            taps,
            snr_threshold: nearest(f64::from(settings.snr_threshold_milli) * 256.0 / 1e3),
            upsampling: settings.upsampling.into(),
            timing: choices.timing,
            timing_gain: config.timing.gain.into(),
            shot_share: config.timing.shot_share.into(),
            timing_bias: config.timing.bias.into(),
            timing_offset: config.timing.offset as f64,
            broad: config.timing.broad as f64,
            pulse: Pulse::new(width_ps.into(), period_fs),
            reach: Template::sin_squared(width_ps, period_fs as u32).half(),
            shot_noise: config.shot_noise.into(),
            reflectivity_scale: config.reflectivity_scale,
            min_separation: (separation_um * two_to(24) / (range_step * 1e3)).floor().max(1.0),
            echoes: settings.echoes as usize,
            choice: choices.echoes,
            period_fs,
            range_origin: f64::from(hardware.range_min_mm) * 256.0,
            range_step,
            origin_samples: floor_of(
                f64::from(hardware.range_min_mm),
                two_to(40),
                range_step.max(1.0),
            )
            .min(two_to(28)),
            blind: floor_of(
                ((f64::from(settings.overlap_mm) * 9.0 / 10.0).floor()
                    - f64::from(hardware.range_min_mm))
                .max(0.0),
                two_to(40),
                range_step.max(1.0),
            ),
            overlap_mm: settings.overlap_mm.into(),
            ramp: Ramp::new(settings, hardware.range_min_mm, range_step),
            dithered: Dithered::new(settings, hardware, period_fs),
            sharpener: (settings.echoes > 1).then(|| Sharpener::for_pulse(width_ps, period_fs)),
        }
    }
}
