//! Constants of the stages, derived from the settings once, when new settings are committed.

use crate::clipped::dithered_config::DitheredConfig;
use crate::clipped::pulse::Pulse;
use crate::rising_gain::ramp::Ramp;
use crate::settings::Settings;
use crate::settings::choice::{AmbientEstimator, EchoChoice, TimingMethod};
use crate::settings::hardware::{Hardware, SPEED_OF_LIGHT_M_S, sample_period_fs};
use crate::settings::refusal::Refusal;
use crate::stages::dark::Dark;
use crate::stages::split::Sharpener;
use crate::stages::template::{Template, half_length, samples_per_width};
use crate::stages::timing::Timing;

/// Constants of all stages, derived from [`Settings`] and [`Hardware`].
///
/// | constant | value | format |
/// |---|---|---|
/// | sample period | 2 (R_max − R_min) / (c·N_w) | fs, nearest |
/// | clip code | S · full-scale code of the shots' sum | code, nearest |
/// | black | black level | Q1.15, nearest |
/// | floor | g·N | Q1.15, nearest |
/// | k | SNR threshold | Q8.8, nearest |
/// | κ, shot noise | shot noise at 0 dB · 10^(G/20) / m | Q0.32, in `f32`, saturating |
/// | reflectivity scale | 1 / (U · P · 10^(G/20)), U ≥ 1/1000 | 2⁻⁷⁴, in `f32`, saturating |
/// | range origin | R_min | 1/256 mm |
/// | range step | c/2 · sample period | 2⁻²⁴ mm, nearest |
/// | range origin in samples | R_min over the range step, at most 4096 | Q16.16, rounded down |
/// | blind | max(⌊0.9 · overlap⌋ in mm − R_min, 0) / range step | Q16.16, down |
/// | ΔR, where it follows the pulse | W · 170.88 µm/ps | µm, rounded down |
/// | minimum separation | ΔR over the range step | samples, rounded down, at least 1 |
///
/// U is the unit echo. Values computed in `f32` are within 3 × 10⁻⁶. The reflectivity scale is ρ in
/// Q6.10 per Q1.15 of amplitude and mm² of range, with 64 more fraction bits.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DetectorConfig {
    /// Number of samples of a waveform.
    pub samples: usize,
    /// Number of samples before the trigger.
    pub pre_trigger: usize,
    /// Number of shots that are added up for one waveform.
    pub shots: u32,
    /// Right shift of the sum of shots.
    pub sum_shift: u32,
    /// Left shift that brings a code to Q1.15 after the shots are added up.
    pub code_shift: u32,
    /// Left shift that brings a code of a single shot to Q1.15.
    pub shot_code_shift: u32,
    /// Lowest saturated code.
    pub clip_code: u16,
    /// Taps and gains of the denoise filter.
    pub template: Template,
    /// Level without light, Q1.15.
    pub black: i32,
    /// Constants for reading dithered shots; `None` where shots are not dithered.
    pub dithered: Option<DitheredConfig>,
    /// The emitted pulse.
    pub pulse: Pulse,
    /// K, the number of samples on either side of a pulse's middle that lie strictly inside it.
    pub reach: usize,
    /// Chosen ambient estimator.
    pub ambient: AmbientEstimator,
    /// Chosen timing method.
    pub method: TimingMethod,
    /// Constants of the timing stage.
    pub timing: Timing,
    /// Filter that finds echoes hidden in others; `None` where a single echo is asked for.
    pub sharpener: Option<Sharpener>,
    /// κ, Q0.32.
    pub shot_noise: u32,
    /// Reflectivity per Q1.15 of amplitude and mm² of range: Q6.10, 64 more fraction bits.
    pub reflectivity_scale: u64,
    /// N on the filter's output, Q1.15.
    pub floor: i32,
    /// k, Q8.8.
    pub snr_threshold: u32,
    /// What k needs more where noise is clipped at 0.
    pub dark: Dark,
    /// log₂ of the upsampling ratio.
    pub upsampling_log2: u32,
    /// Smallest distance between two candidates, samples.
    pub min_separation: u32,
    /// Most echoes that are reported.
    pub echoes: usize,
    /// Rule for which echoes are kept.
    pub echo_choice: EchoChoice,
    /// Sample period.
    pub sample_period_fs: u32,
    /// Range of sample 0, 1/256 mm.
    pub range_origin: i64,
    /// Range per sample, 1/256 mm with 16 more fraction bits.
    pub range_step: i64,
    /// Range of sample 0 in samples, Q16.16.
    pub origin_samples: i64,
    /// Near gain; `None` where the gain is full everywhere.
    pub ramp: Option<Ramp>,
    /// Range from which the receiver sees the whole beam, mm.
    pub overlap_mm: u32,
    /// Distance from sample 0 to where the receiver begins to see the beam, Q16.16 samples.
    pub blind: i64,
}

impl DetectorConfig {
    /// Derives the stages' constants.
    ///
    /// # Errors
    ///
    /// [`Refusal`] of the first field that [`Settings::check`] does not accept.
    #[expect(
        clippy::arithmetic_side_effects,
        reason = "k is checked: below 2¹³; 2³² mm are below 2⁴⁰ / 256"
    )]
    pub fn new(settings: &Settings, hardware: &Hardware) -> Result<Self, Refusal> {
        settings.check(hardware)?;
        let choices = settings.choices()?;
        let period_fs = sample_period_fs(settings.bins as u32, hardware);
        let width_ps = settings.pulse_width_ps as u32;
        let template = Template::new(choices.denoise, width_ps, period_fs);
        let samples_per_width = samples_per_width(width_ps, period_fs);
        let upsampling_log2 = settings.upsampling.trailing_zeros(); // a power of two
        let range_step = range_step(period_fs);
        let sum = Sum::new(settings, hardware);
        Ok(Self {
            samples: settings.bins as usize,
            pre_trigger: settings.pre_trigger_samples() as usize,
            shots: sum.shots,
            sum_shift: sum.shift,
            code_shift: sum.code_shift,
            shot_code_shift: hardware.code_shift(),
            clip_code: clip_code(settings, sum.full_scale),
            black: black(settings),
            dithered: DitheredConfig::new(
                settings,
                period_fs,
                hardware.full_scale_code(),
                hardware.code_shift(),
            ),
            floor: scaled_floor(settings, &template),
            timing: Timing::new(&template, samples_per_width, upsampling_log2, choices.timing),
            sharpener: (settings.echoes > 1).then(|| Sharpener::for_pulse(width_ps, period_fs)),
            dark: Dark::new(sum.shots, template.noise_gain),
            template,
            pulse: Pulse::new(width_ps, period_fs),
            reach: half_length(samples_per_width),
            ambient: choices.ambient,
            method: choices.timing,
            shot_noise: shot_noise(settings, hardware),
            reflectivity_scale: reflectivity_scale(settings, hardware),
            snr_threshold: (settings.snr_threshold_milli as u32 * 256 + 500) / 1000,
            upsampling_log2,
            min_separation: min_separation(settings, range_step),
            echoes: settings.echoes as usize,
            echo_choice: choices.echoes,
            sample_period_fs: period_fs,
            range_origin: i64::from(hardware.range_min_mm) * 256,
            range_step,
            origin_samples: origin_samples(hardware, range_step),
            ramp: Ramp::new(settings, hardware.range_min_mm, range_step),
            overlap_mm: settings.overlap_mm as u32,
            blind: blind(settings, hardware, range_step),
        })
    }

    /// Number of samples of a shot: those before the trigger and the waveform's.
    pub fn codes(&self) -> usize {
        self.pre_trigger.saturating_add(self.samples)
    }

    /// Height at full gain of a height seen at sample `n`: divided by the near gain there, Q1.15,
    /// rounded down, saturating.
    pub(crate) fn at_full_gain(&self, height: u32, n: usize) -> u32 {
        self.ramp.as_ref().map_or(height, |ramp| ramp.at_full_gain(height, n))
    }
}

/// Constants for adding the shots of a waveform up: [`crate::stages::accumulate`].
struct Sum {
    shots: u32,
    shift: u32,
    code_shift: u32,
    /// Code of the sum when all shots are at full scale.
    full_scale: u32,
}

impl Sum {
    #[expect(
        clippy::arithmetic_side_effects,
        reason = "16 shots of 14 bits at most: all below 2¹⁸, shifts at most 4"
    )]
    fn new(settings: &Settings, hardware: &Hardware) -> Self {
        let shots = settings.shots as u32; // a power of two, at most 16
        let bits = 15 - hardware.code_shift() + shots.trailing_zeros();
        let shift = bits.saturating_sub(14);
        let full_scale =
            (shots * u32::from(hardware.full_scale_code()) + ((1 << shift) >> 1)) >> shift;
        Self { shots, shift, code_shift: 15 - (bits - shift), full_scale }
    }
}

/// S as a code, nearest, at most full scale.
#[expect(clippy::arithmetic_side_effects, reason = "S is checked: 10⁶ ppm of a code below 2¹⁵")]
fn clip_code(settings: &Settings, full_scale: u32) -> u16 {
    ((settings.saturation_ppm as u64 * u64::from(full_scale) + 500_000) / 1_000_000) as u16
}

/// Black level in Q1.15, the same for any number of shots.
#[expect(clippy::arithmetic_side_effects, reason = "checked: below 10⁶ ppm of 2¹⁵")]
fn black(settings: &Settings) -> i32 {
    ((i64::from(settings.black_level_ppm) * 32_768 + 500_000) / 1_000_000) as i32
}

/// 10^(G/20), in `f32`.
fn gain(settings: &Settings) -> f32 {
    libm::exp2f(settings.gain_cdb as f32 * (core::f32::consts::LOG2_10 / 2_000.0))
}

/// κ. Gain scales the variance by its square and full scale, as a current, by its inverse: κ is in
/// proportion to the gain. Averaging m shots divides it by m.
fn shot_noise(settings: &Settings, hardware: &Hardware) -> u32 {
    let kappa = hardware.shot_noise_ppm as f32 * 1e-6 * gain(settings) / settings.shots as f32;
    libm::roundf(kappa * 4_294_967_296.0) as u32 // `as` saturates
}

/// ρ = A R² / (U P G): 2¹⁰ of ρ per 2⁻¹⁵ of full scale and 10⁻⁶ m², 10⁻⁶ W, 1/1000 of the unit
/// echo; times 2⁶⁴.
fn reflectivity_scale(settings: &Settings, hardware: &Hardware) -> u64 {
    let unit = hardware.unit_echo_milli.max(1) as f32 * 1e-3;
    let per_square_m = 1.0 / (unit * settings.power_uw as f32 * 1e-6 * gain(settings));
    const TWO_TO_64: f32 = 18_446_744_073_709_551_616.0;
    libm::roundf(per_square_m * (1e-6 / 32.0) * TWO_TO_64) as u64 // `as` saturates
}

/// Noise floor on the filter's output. N is an amplitude; the filter scales amplitudes by its peak
/// gain.
#[expect(
    clippy::arithmetic_side_effects,
    reason = "N is checked: below 10⁶ ppm of a gain below 2¹⁵"
)]
fn scaled_floor(settings: &Settings, template: &Template) -> i32 {
    ((settings.noise_floor_ppm as u64 * u64::from(template.peak_gain) + 500_000) / 1_000_000) as i32
}

/// Range per sample, c/2 times the period: fs × m/s = 10⁻¹² mm, times 256 × 2¹⁶ / 2.
#[expect(clippy::arithmetic_side_effects, reason = "2³² · 2²⁹ · 2²³ is below 2¹²⁸")]
fn range_step(period_fs: u32) -> i64 {
    let scaled = (u128::from(period_fs) * u128::from(SPEED_OF_LIGHT_M_S)) << 23;
    ((scaled + 500_000_000_000) / 1_000_000_000_000) as i64
}

/// Farthest beginning of a window, 4096 samples, Q16.16: beyond it the air before the window does
/// not matter.
const FARTHEST: i64 = 1 << 28;

/// R_min in samples: both ranges are in 2⁻²⁴ mm.
#[expect(clippy::arithmetic_side_effects, reason = "2³² mm · 2⁴⁰ is below 2⁷³")]
fn origin_samples(hardware: &Hardware, range_step: i64) -> i64 {
    let origin = u128::from(hardware.range_min_mm) << 40;
    (origin / range_step.max(1) as u128).min(FARTHEST as u128) as i64
}

/// Samples before the receiver sees the beam: 0.9 of the overlap's range less R_min, at least 0.
#[expect(clippy::arithmetic_side_effects, reason = "checked: below 2¹⁵ mm, times 2⁴⁰")]
fn blind(settings: &Settings, hardware: &Hardware, range_step: i64) -> i64 {
    let begins_mm = i64::from(settings.overlap_mm) * 9 / 10;
    ((begins_mm - i64::from(hardware.range_min_mm)).max(0) << 40) / range_step.max(1)
}

/// ΔR in samples, at least 1; 1.14·cW/2 when it follows the pulse. Rounded down, so that echoes ΔR
/// apart stay two.
#[expect(
    clippy::arithmetic_side_effects,
    reason = "ΔR and W are checked: below 4 m; so is a step, 1.2 m at most: W spans 2.5 samples"
)]
fn min_separation(settings: &Settings, range_step: i64) -> u32 {
    let separation_um = match settings.min_separation_mm {
        Some(mm) => i64::from(mm) * 1000,
        // 1.14 × c/2 = 170.88 µm per ps
        None => i64::from(settings.pulse_width_ps) * 17_088 / 100,
    };
    (((separation_um * 256) << 16) / (range_step * 1000).max(1)).max(1) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_bin_lies_one_step_before_the_far_end() {
        for bins in [200, 800, 2400] {
            let settings = Settings {
                bins,
                pulse_width_ps: 10_000,
                power_uw: 30_000_000,
                ..Settings::default()
            };
            let config = DetectorConfig::new(&settings, &Hardware::REFERENCE).unwrap();
            let span_mm = (config.range_step * i64::from(bins)) as f64 / 256.0 / 65536.0;
            assert!((span_mm - 119_000.0).abs() < 1.0, "{bins} bins span {span_mm} mm");
        }
    }

    #[test]
    fn the_default_separation_is_what_a_matched_filter_can_split() {
        let config = DetectorConfig::new(&Settings::default(), &Hardware::REFERENCE).unwrap();
        let expected: f64 = 1.14 * 0.299_792_458 * 5.0 / 2.0 / 0.14875;
        assert_eq!(f64::from(config.min_separation), expected.floor());
    }
}
