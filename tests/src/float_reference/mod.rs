//! Reference model of the detector that never rounds: the same algorithm in real numbers, with the
//! true sin² template. It has the parabola with and without walk correction, and the edge fit of
//! clipped echoes.
//!
//! [`crate::tolerance`] bounds the error of the integer code against it.

use std::f64::consts::PI;

use echoloop_dsp::choice::{EchoChoice, TimingMethod};
use echoloop_dsp::{Hardware, Settings};

use edges::Clipped;
pub use filtered::Filtered;

use crate::bit_true::filter::correlate;
use crate::bit_true::{LIGHT, Order, Peak, choose, climbs, lagrange, separate};
use crate::vectors::pulse;

mod edges;
mod filtered;

/// An echo in physical units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Echo {
    /// Slant range, mm.
    pub range_mm: f64,
    /// Fraction of full scale.
    pub amplitude: f64,
    /// Filtered width, ns.
    pub width_ns: f64,
    /// Height over σ after the filter.
    pub snr: f64,
    /// σ of the range, mm.
    pub deviation_mm: f64,
    /// True when one of its codes reached the saturation level.
    pub saturated: bool,
}

/// The whole detector. Amplitudes are fractions of full scale, times are in samples.
#[derive(Clone, Debug)]
pub struct FloatReference {
    code: f64,
    /// Pulse width.
    width: f64,
    clip: f64,
    taps: Vec<f64>,
    noise_gain: f64,
    peak_gain: f64,
    floor: f64,
    snr_threshold: f64,
    upsampling: i32,
    walk_corrected: bool,
    /// β.
    bias: f64,
    /// [`Filtered::gain_and_share`] of the parabola.
    gain_and_share: (f64, f64),
    /// κ.
    shot: f64,
    min_separation: f64,
    echoes: usize,
    choice: EchoChoice,
    period_ns: f64,
    range_min_mm: f64,
}

impl FloatReference {
    /// The detector for accepted settings.
    pub fn new(settings: &Settings, hardware: &Hardware) -> Self {
        let choices = settings.choices().expect("accepted settings have valid choices");
        let window_mm = f64::from(hardware.range_max_mm - hardware.range_min_mm);
        let period_ns = 2.0 * window_mm * 1e6 / (f64::from(settings.bins) * LIGHT);
        let width = f64::from(settings.pulse_width_ps) / 1e3 / period_ns;
        let half = width.ceil() as i32 - 1;
        let shape: Vec<f64> = (-half..=half).map(|k| pulse(k.into(), width)).collect();
        let sum: f64 = shape.iter().sum();
        let energy: f64 = shape.iter().map(|p| p * p).sum();
        let peak_gain = energy / sum;
        let follows_mm = 1.14 * LIGHT * f64::from(settings.pulse_width_ps) * 1e-9 / 2.0;
        let taps: Vec<f64> = shape.iter().map(|p| p / sum).collect();
        let filtered = Filtered::new(taps.clone(), width, settings.upsampling);
        let gain = f64::powf(10.0, f64::from(settings.gain_cdb) / 2_000.0);
        let separation_mm = settings.min_separation_mm.map_or(follows_mm, f64::from);
        Self {
            width,
            code: 1.0 / f64::from(1 << hardware.adc_bits),
            clip: f64::from(settings.saturation_ppm) / 1e6 * f64::from(hardware.full_scale_code()),
            taps,
            noise_gain: energy.sqrt() / sum,
            peak_gain,
            floor: f64::from(settings.noise_floor_ppm) / 1e6 * peak_gain,
            snr_threshold: f64::from(settings.snr_threshold_milli) / 1e3,
            upsampling: settings.upsampling,
            walk_corrected: choices.timing == TimingMethod::WalkCorrected,
            bias: filtered.bias(),
            gain_and_share: filtered.gain_and_share(TimingMethod::Parabola),
            shot: f64::from(hardware.shot_noise_ppm) / 1e6 * gain,
            min_separation: separation_mm * f64::from(settings.bins) / window_mm,
            echoes: settings.echoes as usize,
            choice: choices.echoes,
            period_ns,
            range_min_mm: hardware.range_min_mm.into(),
        }
    }

    /// Cramér–Rao bound of the range in white noise, mm: `(cτ/π) / (S·√(f_s·τ))`, with S the ratio
    /// of the amplitude to σ of one sample.
    pub fn range_crlb_mm(&self, snr: f64) -> f64 {
        LIGHT * 1e-6 * self.width * self.period_ns / PI / (snr * self.width.sqrt())
    }

    /// Pulse width, samples.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// True range of an echo centred at a sample, mm.
    pub fn range_mm(&self, sample: f64) -> f64 {
        self.range_min_mm + sample * self.period_ns * LIGHT * 1e-6 / 2.0
    }

    /// Ambient and σ, fractions of full scale.
    pub fn statistics(&self, codes: &[u16]) -> (f64, f64) {
        let values: Vec<f64> = codes.iter().map(|&c| f64::from(c)).collect();
        let half = values.len() as f64 / 2.0;
        let median = Order::from_values(values.clone());
        let deviation =
            Order::from_values(values.iter().map(|v| (v - median.middle).abs()).collect());
        let grouped = |order: &Order| order.middle - 0.5 + (half - order.below) / order.at;
        let mad =
            if deviation.middle == 0.0 { half / deviation.at / 2.0 } else { grouped(&deviation) };
        (grouped(&median) * self.code, mad * self.code * MAD_TO_SIGMA)
    }

    /// Echoes of a waveform.
    pub fn process(&self, codes: &[u16]) -> Vec<Echo> {
        let (ambient, sigma) = self.statistics(codes);
        let x: Vec<f64> =
            codes.iter().map(|&c| f64::from(c).min(self.clip) * self.code - ambient).collect();
        let y = correlate(&self.taps, &x);
        let filtered_sigma = sigma * self.noise_gain;
        let threshold = self.floor.max(self.snr_threshold * filtered_sigma);
        let hysteresis = |height: f64| (threshold / 2.0).max(height / 16.0);
        let found = climbs(&y, threshold, threshold / 2.0, hysteresis);
        let peaks = separate(&found, self.min_separation, |p| p.height);
        let wave = Waveform { codes, x: &x, y: &y, ambient, sigma };
        let echo = |peak: Peak| self.refine(&wave, peak, hysteresis(peak.height));
        choose(&peaks, self.echoes, self.choice, |p| p.height).into_iter().map(echo).collect()
    }

    fn refine(&self, wave: &Waveform<'_>, peak: Peak, rise: f64) -> Echo {
        let run = self.clipped_run(wave.codes, peak.index);
        let (mut time, height) =
            self.vertex(wave.y, peak.index, self.walk_corrected && run.is_none());
        let left = edge(wave.y[..peak.index].iter().rev(), peak.height, rise);
        let right = edge(wave.y[peak.index + 1..].iter(), peak.height, rise);
        let amplitude = height / self.peak_gain;
        let (gain, share) = self.gain_and_share;
        let mut sigma =
            gain * (wave.sigma.powi(2) + share * self.shot * amplitude).sqrt() / amplitude;
        if let Some((first, last)) = run.filter(|_| self.walk_corrected) {
            let (width, x, level) = (self.width, wave.x, self.clip * self.code - wave.ambient);
            let clipped =
                Clipped { width, x, level, first, last, sigma: wave.sigma, shot: self.shot };
            (time, sigma) =
                clipped.fit().unwrap_or((peak.index as f64 + (right - left) / 2.0, sigma));
        }
        Echo {
            range_mm: self.range_mm(time),
            amplitude,
            width_ns: (left + right) * self.period_ns,
            snr: height / (wave.sigma * self.noise_gain),
            deviation_mm: sigma * self.period_ns * LIGHT * 1e-6 / 2.0,
            saturated: run.is_some(),
        }
    }

    /// First and last sample of the clipped run nearest to an index.
    fn clipped_run(&self, codes: &[u16], index: usize) -> Option<(usize, usize)> {
        let clipped = |n: &usize| f64::from(codes[*n]) >= self.clip.round();
        let reach = (self.taps.len() / 2).div_ceil(2);
        let near = (0..codes.len()).filter(|n| n.abs_diff(index) <= reach && clipped(n));
        let nearest = near.min_by_key(|n| n.abs_diff(index))?;
        let first = (0..nearest).rev().take_while(clipped).last().unwrap_or(nearest);
        Some((first, (nearest..codes.len()).take_while(clipped).last().unwrap_or(nearest)))
    }

    /// Time and height of the parabola through the highest interpolated value and its neighbours.
    fn vertex(&self, y: &[f64], index: usize, corrected: bool) -> (f64, f64) {
        let o = self.upsampling;
        let z = |j: i32| {
            interpolate(
                y,
                index as i64 + i64::from(j.div_euclid(o)),
                f64::from(j.rem_euclid(o)) / f64::from(o),
            )
        };
        let reach = if o > 1 { o } else { 0 };
        let top = (-reach..=reach).max_by(|&a, &b| z(a).total_cmp(&z(b))).unwrap_or(0);
        let (before, at, after) = (z(top - 1), z(top), z(top + 1));
        let delta = ((before - after) / (2.0 * (before - 2.0 * at + after))).clamp(-0.5, 0.5);
        let bias = if corrected { self.bias * delta * (1.0 - 4.0 * delta * delta) } else { 0.0 };
        (
            index as f64 + (f64::from(top) + delta - bias) / f64::from(o),
            at - (before - after) * delta / 4.0,
        )
    }
}

/// A waveform, its ambient and the σ of its samples, fractions of full scale.
struct Waveform<'a> {
    codes: &'a [u16],
    x: &'a [f64],
    y: &'a [f64],
    ambient: f64,
    sigma: f64,
}

/// Ratio of a normal distribution's σ to its median absolute deviation: 1 / Φ⁻¹(¾).
const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;

fn interpolate(y: &[f64], whole: i64, phase: f64) -> f64 {
    let at = |n: i64| if (0..y.len() as i64).contains(&n) { y[n as usize] } else { 0.0 };
    if phase == 0.0 {
        return at(whole);
    }
    lagrange(phase).iter().zip(-3..).map(|(weight, k)| weight * at(whole + k)).sum()
}

/// Distance from a peak to half its height, or to the valley before a rise, or to the end of the
/// waveform.
fn edge<'a>(outwards: impl Iterator<Item = &'a f64>, height: f64, rise: f64) -> f64 {
    let (mut inner, mut valley) = (height, (height, 0.0));
    let mut distance = 0.0;
    for &value in outwards {
        if value < height / 2.0 {
            return distance + (inner - height / 2.0) / (inner - value);
        }
        if value > valley.0 + rise {
            return valley.1;
        }
        distance += 1.0;
        inner = value;
        if value < valley.0 {
            valley = (value, distance);
        }
    }
    distance
}
