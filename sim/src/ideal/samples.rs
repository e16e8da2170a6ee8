//! Samples of a beam with the baseline removed, and the noise of each.

use core::ops::Range;

use echoloop_dsp::{AmbientEstimator, Hardware, Settings};

/// ADC codes of a beam.
#[derive(Clone, Debug, Default)]
pub struct Shots {
    /// Sums of codes over the shots of a phase, from before the trigger on: `[phase][N]`.
    pub sums: Vec<Vec<u32>>,
}

impl Shots {
    /// A single shot.
    pub fn one(codes: &[u16]) -> Self {
        Self { sums: vec![codes.iter().map(|&code| code.into()).collect()] }
    }
}

/// Gain of the amplifier as a factor.
fn gain_factor(settings: &Settings) -> f64 {
    libm::pow(10.0, f64::from(settings.gain_cdb) / 2_000.0)
}

/// Amplitude of a white Lambertian surface square to the beam at 1 m, fraction of full scale.
pub(super) fn white(settings: &Settings, hardware: &Hardware) -> f64 {
    let power_w = f64::from(settings.power_uw) / 1e6;
    f64::from(hardware.unit_echo_milli) / 1e3 * power_w * gain_factor(settings)
}

/// A waveform: amplitudes in fractions of full scale, times in samples.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    /// Shots grouped by their sampling times.
    pub(super) phases: Vec<Phase>,
    /// Variance that a signal of 1 adds to a sample of a phase: shot noise.
    shot: f64,
    ramp: GainRamp,
    /// Amplitude of a white wall at 1 m.
    white: f64,
    /// Range of sample 0 and of a sample, m.
    origin_m: f64,
    step_m: f64,
}

/// The samples of one phase.
#[derive(Clone, Debug)]
pub(super) struct Phase {
    /// Offset of the sampling times from whole sample numbers, samples.
    pub(super) offset: f64,
    pub(super) samples: Vec<MeanSample>,
}

/// Mean of the shots at one sampling time.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeanSample {
    /// Amplitude above the baseline.
    pub(super) x: f64,
    /// True when the converter clipped it: `x` is a lower bound.
    pub(super) clipped: bool,
    /// Relative gain of the amplifier, 1 at full gain.
    pub(super) gain: f64,
    /// Variance in the dark.
    pub(super) dark: f64,
}

impl Samples {
    pub(super) fn new(
        shots: &Shots,
        settings: &Settings,
        hardware: &Hardware,
        step_mm: f64,
    ) -> Self {
        let phases = shots.sums.len().max(1);
        let code = 1.0 / f64::from(1u32 << (15 - hardware.code_shift()));
        let of_phase = f64::from(settings.shots) / phases as f64;
        let before = settings.pre_trigger_samples() as usize;
        let clip_code = f64::from(settings.saturation_ppm) / 1e6;
        let clip = (clip_code * f64::from(hardware.full_scale_code())).round() * code;
        let ramp = GainRamp::new(settings, hardware, step_mm);

        let mean = MeanWaveform::of(shots, f64::from(settings.shots));
        let (early, waveform) = mean.codes.split_at(before.min(mean.codes.len()));
        let full = waveform.get(ramp.samples()..).filter(|full| !full.is_empty());
        let (median, sigma) = mean.centre_and_spread(full.unwrap_or(waveform));
        let (median, sigma) = (median * code, sigma * code);
        let black = f64::from(settings.black_level_ppm) / 1e6;
        let ambient = match AmbientEstimator::from_code(settings.ambient) {
            Some(AmbientEstimator::PreTrigger) if !early.is_empty() => {
                code * early.iter().sum::<f64>() / early.len() as f64
            }
            Some(AmbientEstimator::None) => black,
            _ => median,
        };

        // Some of several shots may be clipped while their mean is still below the level.
        let all_clear = match settings.shots {
            1 => clip,
            shots => clip - sigma * f64::from(shots).sqrt(),
        };
        let rounding = code / 12f64.sqrt();
        let phase = |(number, sums): (usize, &Vec<u32>)| {
            let offset = (2.0 * number as f64 + 1.0 - phases as f64) / (2.0 * phases as f64);
            let sample = |(n, &sum): (usize, &u32)| {
                let value = f64::from(sum) / of_phase * code;
                let gain = ramp.gain(n as f64 + offset);
                let dark = (gain * sigma).max(rounding).min(sigma);
                MeanSample {
                    x: value.min(clip) - black - gain * (ambient - black),
                    clipped: value >= all_clear,
                    gain,
                    dark: dark * dark * phases as f64,
                }
            };
            let after = sums.get(before..).unwrap_or_default();
            Phase { offset, samples: after.iter().enumerate().map(sample).collect() }
        };
        Self {
            phases: shots.sums.iter().enumerate().map(phase).collect(),
            shot: f64::from(hardware.shot_noise_ppm) / 1e6 * gain_factor(settings) / of_phase,
            ramp,
            white: white(settings, hardware),
            origin_m: f64::from(hardware.range_min_mm) / 1e3,
            step_m: step_mm / 1e3,
        }
    }

    /// Amplitude of a white wall square to the beam at the range of a time.
    pub(super) fn white(&self, time: f64) -> f64 {
        let range_m = (self.origin_m + time * self.step_m).max(self.step_m);
        self.white / (range_m * range_m)
    }

    /// Variance of a sample with a signal of `light` in it.
    pub(super) fn variance(&self, sample: &MeanSample, light: f64) -> f64 {
        sample.dark + self.shot * sample.gain * light
    }

    /// Relative gain at a time.
    pub(super) fn gain(&self, time: f64) -> f64 {
        self.ramp.gain(time)
    }

    /// Number of samples of a phase.
    pub(super) fn len(&self) -> usize {
        self.phases.first().map_or(0, |phase| phase.samples.len())
    }
}

impl Phase {
    /// Samples within a span of time, with their times.
    pub(super) fn within(&self, span: Range<f64>) -> impl Iterator<Item = (f64, &MeanSample)> {
        let first = (span.start - self.offset).ceil().max(0.0) as usize;
        let end = (span.end - self.offset).floor().max(-1.0) + 1.0;
        let end = (end as usize).min(self.samples.len());
        let samples = self.samples.get(first.min(end)..end).unwrap_or_default();
        (first..).zip(samples).map(|(n, sample)| (n as f64 + self.offset, sample))
    }
}

/// Gain that rises linearly in dB over range and is full from its end on.
#[derive(Clone, Copy, Debug)]
struct GainRamp {
    /// Octaves a sample.
    slope: f64,
    /// Sample at which it ends.
    end: f64,
}

impl GainRamp {
    fn new(settings: &Settings, hardware: &Hardware, step_mm: f64) -> Self {
        let db_m = f64::from(settings.gain_slope_mdb_m) / 1e3;
        let rising_mm = f64::from(settings.gain_range_mm) - f64::from(hardware.range_min_mm);
        let slope = db_m * step_mm / 1e3 * core::f64::consts::LOG2_10 / 20.0;
        Self { slope, end: if slope > 0.0 { rising_mm.max(0.0) / step_mm } else { 0.0 } }
    }

    fn gain(&self, time: f64) -> f64 {
        libm::exp2(-self.slope * (self.end - time).max(0.0))
    }

    fn samples(&self) -> usize {
        self.end.ceil() as usize
    }
}

/// Mean of all shots, in ADC codes.
struct MeanWaveform {
    codes: Vec<f64>,
    /// Resolution: one code over the number of shots.
    step: f64,
}

impl MeanWaveform {
    fn of(shots: &Shots, count: f64) -> Self {
        let codes = shots.sums.first().map_or(0, Vec::len);
        let sum = |n: usize| {
            shots.sums.iter().map(|sums| f64::from(sums.get(n).copied().unwrap_or(0))).sum::<f64>()
        };
        Self { codes: (0..codes).map(|n| sum(n) / count).collect(), step: 1.0 / count }
    }

    /// Median, and σ from the median absolute deviation, both for values spread evenly over their
    /// step.
    fn centre_and_spread(&self, values: &[f64]) -> (f64, f64) {
        /// σ of a normal distribution over its median absolute deviation: 1 / Φ⁻¹(¾).
        const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;
        let mut values = values.to_vec();
        let Some(median) = self.grouped_median(&mut values) else { return (0.0, self.step) };
        let nearest = (median / self.step).round() * self.step;
        let mut deviations: Vec<f64> = values.iter().map(|v| (v - nearest).abs()).collect();
        // Deviations below half a step fold onto 0 from both sides: that bin is half as wide.
        let mad = self.grouped_median(&mut deviations).unwrap_or(0.0);
        let zeros = deviations.iter().filter(|&&d| d < 0.5 * self.step).count();
        let mad = match 2 * zeros > deviations.len() {
            true => self.step * deviations.len() as f64 / zeros as f64 / 4.0,
            false => mad,
        };
        (median, mad * MAD_TO_SIGMA)
    }

    fn grouped_median(&self, values: &mut [f64]) -> Option<f64> {
        let middle = values.len() / 2;
        let half = values.len() as f64 / 2.0;
        values.get(middle)?;
        let (_, &mut median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
        let edge = 0.5 * self.step;
        let below = values.iter().filter(|&&v| v < median - edge).count() as f64;
        let at = values.iter().filter(|&&v| (v - median).abs() <= edge).count() as f64;
        Some(median - edge + self.step * (half - below) / at)
    }
}
