//! The bit-true model: it rounds where the DSP's tables say.
//!
//! Written from those tables, not from the code: in `f64`, by sorting instead of counting, with
//! sums in no particular order. `f64` holds nearly every integer here exactly, and [`numbers`] the
//! products it does not, so the comparison is `==`. Values are in LSB of the DSP's formats. Of the
//! DSP it takes only what is computed in `f32`: the filter's taps and their gain, the timing
//! stage's constants, κ and the scale of reflectivity, each of which has a test of its own; and
//! where more than one echo is asked for, which peaks hide under others, whose model is [`split`].
//!
//! | module | model of |
//! |---|---|
//! | [`BitTrue`] | `config`, `accumulate`, `pipeline` |
//! | [`statistics`] | `statistics` |
//! | [`filter`] | `baseline`, `filter`, the threshold of `detect` |
//! | [`mod@peaks`] | `detect` |
//! | [`refine`] | `refine` |
//! | [`noise`], [`pulse`], [`edges`] | those |
//! | [`echo`] | `echo` |

use echoloop_dsp::choice::{AmbientEstimator, EchoChoice, TimingMethod};
use echoloop_dsp::statistics::Statistics as DspStatistics;
use echoloop_dsp::template::Template;
use echoloop_dsp::{DetectorConfig, Hardware, MAX_SAMPLES, Settings};

pub use filter::saturated;
pub use noise::Noise;
pub use numbers::nearest;
use numbers::two_to;

pub use peaks::{choose, climbs, hysteresis, peaks, separate};
pub use pulse::Pulse;
pub use refine::{Waveform, lagrange, rounded_lagrange};
use split::Sharpener;
pub use statistics::Order;

pub mod echo;
pub mod edges;
pub mod filter;
pub mod finder;
pub mod noise;
pub mod numbers;
pub mod peaks;
pub mod pulse;
pub mod refine;
pub mod split;
pub mod statistics;

/// Speed of light, m/s.
pub const LIGHT: f64 = 299_792_458.0;

/// Median, deviation (codes), ambient (Q1.15), σ̂ (Q13.19).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// m.
    pub median: f64,
    /// d.
    pub deviation: f64,
    /// a.
    pub ambient: f64,
    /// σ̂.
    pub sigma: f64,
}

/// σ_y (Q13.19), T (Q1.15) and what the baseline removed (Q1.15).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold {
    /// σ_y.
    pub sigma: f64,
    /// T.
    pub level: f64,
    /// a, saturated.
    pub ambient: f64,
}

/// A sample of the filter's output that tops its surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Which sample.
    pub index: usize,
    /// Its value.
    pub height: f64,
}

/// A peak between samples: time, its σ and width in Q16.16 samples, height and amplitude in Q1.15.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// Since sample 0.
    pub time: f64,
    /// At the vertex.
    pub height: f64,
    /// At half height.
    pub width: f64,
    /// As if nothing had clipped it.
    pub amplitude: f64,
    /// Of the time.
    pub sigma: f64,
    /// As on the wire.
    pub flags: u8,
}

/// An echo in wire units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Echo {
    /// U24.8 mm.
    pub range: f64,
    /// U1.15.
    pub amplitude: f64,
    /// U12.4 ns.
    pub width: f64,
    /// U8.8.
    pub snr: f64,
    /// U8.8 mm.
    pub deviation: f64,
    /// U6.10.
    pub reflectivity: f64,
    /// As on the wire.
    pub flags: u8,
}

impl From<DspStatistics> for Statistics {
    fn from(s: DspStatistics) -> Self {
        Self {
            median: s.median.into(),
            deviation: s.deviation.into(),
            ambient: s.ambient.into(),
            sigma: s.sigma.into(),
        }
    }
}

impl From<echoloop_dsp::detect::Threshold> for Threshold {
    fn from(t: echoloop_dsp::detect::Threshold) -> Self {
        Self { sigma: t.sigma.into(), level: t.level.into(), ambient: t.ambient.into() }
    }
}

impl From<echoloop_dsp::peak::Peak> for Peak {
    fn from(p: echoloop_dsp::peak::Peak) -> Self {
        Self { index: p.index.into(), height: p.height.into() }
    }
}

impl From<echoloop_dsp::refine::Refined> for Refined {
    fn from(r: echoloop_dsp::refine::Refined) -> Self {
        Self {
            time: r.time as f64,
            height: r.height.into(),
            width: r.width as f64,
            amplitude: r.amplitude as f64,
            sigma: r.sigma.into(),
            flags: r.flags.0,
        }
    }
}

impl From<echoloop_dsp::noise::Noise> for Noise {
    fn from(n: echoloop_dsp::noise::Noise) -> Self {
        Self { sigma: n.sigma.into(), shot: n.shot.into() }
    }
}

impl From<echoloop_dsp::edges::Edges> for edges::Edges {
    fn from(e: echoloop_dsp::edges::Edges) -> Self {
        Self { time: e.time as f64, amplitude: e.amplitude as f64, sigma: e.sigma.into() }
    }
}

impl From<echoloop_dsp::Echo> for Echo {
    fn from(e: echoloop_dsp::Echo) -> Self {
        Self {
            range: e.range.into(),
            amplitude: e.amplitude.into(),
            width: e.width.into(),
            snr: e.snr.into(),
            deviation: e.deviation.into(),
            reflectivity: e.reflectivity.into(),
            flags: e.flags.0,
        }
    }
}

/// The whole detector, constants first.
#[derive(Clone, Debug)]
pub struct BitTrue {
    /// m.
    pub shots: f64,
    /// 2^d, which the sum of the shots is divided by.
    pub sum_divisor: f64,
    /// Samples before the trigger.
    pub pre_trigger: usize,
    /// Which ambient estimator.
    pub ambient: AmbientEstimator,
    /// Q1.15 LSB of one code, after the shots are added up.
    pub code: f64,
    /// The lowest saturated code.
    pub clip_code: f64,
    /// The filter, Q1.15.
    pub taps: Vec<f64>,
    /// r, Q1.15.
    pub noise_gain: f64,
    /// 1/g, Q2.14.
    pub inverse_gain: f64,
    /// g·N, Q1.15.
    pub floor: f64,
    /// k, Q8.8.
    pub snr_threshold: f64,
    /// o.
    pub upsampling: f64,
    /// Which timing method.
    pub timing: TimingMethod,
    /// gain, Q16.16.
    pub timing_gain: f64,
    /// q, Q1.15.
    pub shot_share: f64,
    /// β, Q1.15.
    pub timing_bias: f64,
    /// z, Q16.16.
    pub timing_offset: f64,
    /// The pulse as it was emitted.
    pub pulse: Pulse,
    /// w, Q16.16 samples: broader peaks may hide others.
    pub broad: f64,
    /// K of the pulse: samples on either side of its middle, strictly inside.
    pub reach: usize,
    /// κ, Q0.32.
    pub shot_noise: f64,
    /// 2⁻⁷⁴ of ρ per Q1.15 and mm²: an integer that `f64` does not hold.
    pub reflectivity_scale: u64,
    /// ΔR, samples.
    pub min_separation: f64,
    /// E.
    pub echoes: usize,
    /// Which of them.
    pub choice: EchoChoice,
    /// Sample period, fs.
    pub period_fs: f64,
    /// Range of sample 0, 1/256 mm.
    pub range_origin: f64,
    /// Range per sample, 2⁻²⁴ mm.
    pub range_step: f64,
    /// Finds the peaks that others hide.
    pub sharpener: Option<Sharpener>,
}

/// Sample period, fs: 2 (R_max − R_min) / (c·N).
pub fn period_fs(bins: i32, hardware: &Hardware) -> f64 {
    let round_trip_mm = 2.0 * (f64::from(hardware.range_max_mm) - f64::from(hardware.range_min_mm));
    nearest(round_trip_mm * 1e12 / (f64::from(bins) * LIGHT))
}

impl BitTrue {
    /// Everything the stages read. `config`, of the same settings, gives what is computed in `f32`.
    pub fn new(settings: &Settings, hardware: &Hardware, config: &DetectorConfig) -> Self {
        let period_fs = period_fs(settings.bins, hardware);
        let width_ps = settings.pulse_width_ps as u32;
        let choices = settings.choices().expect("settings that are taken name choices");
        let template = Template::new(choices.denoise, width_ps, period_fs as u32);
        let taps: Vec<f64> = template.taps().iter().map(|&h| f64::from(h)).collect();
        let peak_gain = f64::from(template.peak_gain());
        let shots = f64::from(settings.shots);
        // Of b + log₂ m bits, 14 at most stay.
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
            code: two_to(15 - bits.min(14)),
            clip_code: nearest(f64::from(settings.saturation_ppm) * full_scale / 1e6),
            noise_gain: taps.iter().map(|h| h * h).sum::<f64>().sqrt().floor(),
            inverse_gain: (two_to(29) / peak_gain).floor().min(65_535.0),
            floor: nearest(f64::from(settings.noise_floor_ppm) * peak_gain / 1e6),
            taps,
            snr_threshold: nearest(f64::from(settings.snr_threshold_milli) * 256.0 / 1e3),
            upsampling: settings.upsampling.into(),
            timing: choices.timing,
            timing_gain: config.timing().gain().into(),
            shot_share: config.timing().shot_share().into(),
            timing_bias: config.timing().bias().into(),
            timing_offset: config.timing().offset() as f64,
            broad: config.timing().broad() as f64,
            pulse: Pulse::new(width_ps.into(), period_fs),
            reach: Template::sin_squared(width_ps, period_fs as u32).half(),
            shot_noise: config.shot_noise().into(),
            reflectivity_scale: config.reflectivity_scale(),
            min_separation: (separation_um * two_to(24) / (range_step * 1e3)).floor().max(1.0),
            echoes: settings.echoes as usize,
            choice: choices.echoes,
            period_fs,
            range_origin: f64::from(hardware.range_min_mm) * 256.0,
            range_step,
            sharpener: (settings.echoes > 1).then(|| Sharpener::for_pulse(width_ps, period_fs)),
        }
    }

    /// The codes of several shots as those of one.
    pub fn accumulate(&self, shots: &[Vec<u16>]) -> Vec<u16> {
        let length = shots.first().map_or(0, Vec::len);
        let sum = |n: usize| shots.iter().map(|codes| f64::from(codes[n])).sum::<f64>();
        (0..length).map(|n| nearest(sum(n) / self.sum_divisor).min(65_535.0) as u16).collect()
    }

    /// All stages: the codes before the trigger, if any are taken, then the waveform's.
    pub fn process(&self, codes: &[u16]) -> Vec<Echo> {
        let (before, codes) = codes.split_at(self.pre_trigger.min(codes.len()));
        let codes = &codes[..codes.len().min(MAX_SAMPLES)];
        let statistics = self.with_ambient(self.statistics(codes), before);
        let noise = Noise { sigma: statistics.sigma, shot: self.shot_noise };
        let x = self.baseline(codes, statistics.ambient);
        let (y, f) = (self.filter(&x), self.exact(&x));
        let wave = Waveform { codes, x: &x, y: &y, f: &f };
        let threshold = self.threshold(&statistics);
        let (found, hidden) = self.split(&wave, peaks(&y, threshold.level), &threshold, &noise);
        let separate = separate(&found, self.min_separation);
        let echo = |peak: Peak| {
            let refined = self.refine(&wave, peak, &threshold, &noise);
            let sharp = hidden.contains(&peak.index);
            self.echo(&if sharp { self.sharpen(&x, peak, refined) } else { refined }, &threshold)
        };
        choose(&separate, self.echoes, self.choice).into_iter().filter_map(echo).collect()
    }

    /// The peaks and those that stand under them; indices of the latter.
    fn split(
        &self,
        wave: &Waveform<'_>,
        found: Vec<Peak>,
        threshold: &Threshold,
        noise: &Noise,
    ) -> (Vec<Peak>, Vec<usize>) {
        let Some(sharpener) = self.sharpener.as_ref().filter(|_| !found.is_empty()) else {
            return (found, Vec::new());
        };
        let may_hide = |peak: Peak| {
            self.is_broad(wave.y, peak, threshold.level)
                && self.clipped_run(wave.codes, peak.index).is_none()
        };
        split::split(sharpener, wave.x, wave.y, noise.sigma, threshold.level, &found, may_hide)
    }
}
