//! Maximum-likelihood detector in floating point: the reference for the firmware.
//!
//! The firmware approximates it in integers with a matched filter, a parabola and two edges;
//! `detector.kind = "ideal"` replaces it, in process. There is no limit of memory or time, and the
//! choices of filter and timing have no effect.
//!
//! 1. Ambient and σ of the samples at full gain, estimated as in the firmware (`samples`).
//! 2. Candidates: peaks of the best amplitude at each sample over its σ, with the firmware's
//!    threshold, hysteresis and separation (`candidates`).
//! 3. Joint fit of all amplitudes and times by Gauss-Newton; a clipped sample is a lower bound
//!    (`fit`).
//! 4. When more than one echo is kept, the residual is searched in the same way and all is fitted
//!    again from several starts.
//!
//! Dithered shots are fitted phase by phase, each at its own sampling times.

mod candidates;
mod fit;
mod samples;

use echoloop_dsp::choice::EchoChoice;
use echoloop_dsp::hardware::{SPEED_OF_LIGHT_M_S, sample_period_fs};
use echoloop_dsp::{Echo, Echoes, Flags, Hardware, Settings};

pub use samples::Shots;

use candidates::{Finder, MAX_PULSES};
use fit::{FittedPulse, strongest_first};
use samples::Samples;

/// Largest number of searches of the residual.
const SEARCHES: usize = 4;

/// Least amplitude of an echo relative to one that it overlaps: a smaller one may be the tail of a
/// pulse from a slanted surface.
const MIN_OVERLAPPED_RATIO: f64 = 1.0 / 16.0;

/// Detector for one set of settings.
#[derive(Clone, Debug)]
pub struct IdealDetector {
    settings: Settings,
    hardware: Hardware,
    /// FWHM of the pulse, samples.
    width: f64,
    /// Range of a sample, mm.
    step_mm: f64,
    choice: EchoChoice,
}

impl IdealDetector {
    /// `None` for settings that the sensor refuses.
    pub fn new(settings: &Settings, hardware: &Hardware) -> Option<Self> {
        settings.check(hardware).ok()?;
        let period_ns = f64::from(sample_period_fs(settings.bins as u32, hardware)) / 1e6;
        Some(Self {
            settings: *settings,
            hardware: *hardware,
            width: f64::from(settings.pulse_width_ps) / 1e3 / period_ns,
            step_mm: period_ns * SPEED_OF_LIGHT_M_S as f64 / 2e6,
            choice: settings.choices().ok()?.echoes,
        })
    }

    /// Settings it was made for.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Echoes of a beam.
    pub fn process(&self, shots: &Shots) -> Echoes {
        let samples = Samples::new(shots, &self.settings, &self.hardware, self.step_mm);
        let finder = Finder { width: self.width, settings: &self.settings, step_mm: self.step_mm };
        let mut pulses = finder.find(&samples, &[]);
        fit::refine(&samples, self.width, &mut pulses);
        if self.settings.echoes > 1 {
            self.find_hidden(&samples, &finder, &mut pulses);
        }
        pulses.sort_by(strongest_first);
        if self.settings.min_separation_mm.is_some() {
            pulses = finder.separate(pulses);
        }
        match self.choice {
            EchoChoice::First => pulses.sort_by(|a, b| a.time.total_cmp(&b.time)),
            EchoChoice::Last => pulses.sort_by(|a, b| b.time.total_cmp(&a.time)),
            EchoChoice::Strongest => {}
        }
        let found = pulses.iter().filter_map(|pulse| self.echo(&samples, &finder, pulse));
        found.take(self.settings.echoes as usize).collect()
    }

    /// Adds pulses that stand out of the residual of the fit.
    fn find_hidden(&self, samples: &Samples, finder: &Finder<'_>, pulses: &mut Vec<FittedPulse>) {
        for _ in 0..SEARCHES {
            let Some(more) = finder.find(samples, pulses).first().copied() else { return };
            // Two merged pulses leave a residual near neither of them: so try other starts, too.
            let mut best = self.fitted(samples, pulses, &[more]);
            let nearest = (0..pulses.len()).min_by(|&a, &b| {
                let apart = |i: usize| (pulses[i].time - more.time).abs();
                apart(a).total_cmp(&apart(b))
            });
            if let Some(nearest) = nearest.filter(|&i| self.overlap(&pulses[i], &more)) {
                let mut others = pulses.clone();
                let one = others.swap_remove(nearest);
                for widths in [0.25, 0.5] {
                    let moved =
                        |by: f64| FittedPulse::new(0.6 * one.amplitude, one.time + by * self.width);
                    let two = [moved(-widths), moved(widths)];
                    let other = self.fitted(samples, &others, &two);
                    let all = [&best, &other, &*pulses].map(Vec::as_slice).concat();
                    let Some(span) = fit::span(&all, self.width) else { return };
                    let misfit =
                        |of: &[FittedPulse]| fit::misfit(samples, self.width, &span, of, pulses);
                    if misfit(&other) < misfit(&best) {
                        best = other;
                    }
                }
            }
            if best.len() > MAX_PULSES || self.has_tail(&best) {
                return;
            }
            *pulses = best;
        }
    }

    fn fitted(
        &self,
        samples: &Samples,
        pulses: &[FittedPulse],
        more: &[FittedPulse],
    ) -> Vec<FittedPulse> {
        let mut all = [pulses, more].concat();
        fit::refine(samples, self.width, &mut all);
        all
    }

    fn overlap(&self, one: &FittedPulse, other: &FittedPulse) -> bool {
        (one.time - other.time).abs() < 2.0 * self.width
    }

    /// True when a pulse is so small beside one it overlaps that it may be its tail.
    fn has_tail(&self, pulses: &[FittedPulse]) -> bool {
        let is_tail = |small: &FittedPulse, of: &FittedPulse| {
            self.overlap(small, of) && small.amplitude < MIN_OVERLAPPED_RATIO * of.amplitude
        };
        pulses.iter().any(|small| pulses.iter().any(|of| is_tail(small, of)))
    }

    /// Echo that the sensor would report; `None` below its thresholds.
    fn echo(&self, samples: &Samples, finder: &Finder<'_>, pulse: &FittedPulse) -> Option<Echo> {
        let seen = fit::detection(samples, self.width, pulse);
        let range_mm = f64::from(self.hardware.range_min_mm) + pulse.time * self.step_mm;
        let here = samples.gain(pulse.time);
        if range_mm < 0.0 || !finder.passes(pulse.amplitude * here, seen.snr) {
            return None;
        }
        let mut flags = Flags::NONE;
        if seen.clipped {
            flags |= Flags::SATURATED;
        }
        if !finder.passes(pulse.amplitude * here / 1.25, seen.snr / 1.25) {
            flags |= Flags::LOW_CONFIDENCE;
        }
        let ends = [pulse.time - self.width, pulse.time + self.width];
        let truncated = ends[0] < 0.0 || ends[1] > samples.len() as f64 - 1.0;
        if truncated {
            flags |= Flags::TRUNCATED;
        }
        let converted = (pulse.amplitude * here).min(seen.level); // a lower bound where clipped
        let deviation = if truncated { f64::INFINITY } else { seen.deviation };
        let width_ns = f64::from(self.settings.pulse_width_ps) / 1e3;
        Some(Echo {
            range: (range_mm * 256.0).round() as u32, // `as` saturates, here and below
            amplitude: (converted * 32_768.0).round() as u16,
            width: (width_ns * 16.0).round() as u16,
            snr: (seen.snr * 256.0) as u16,
            deviation: (deviation * self.step_mm * 256.0) as u16,
            reflectivity: (self.reflectivity(pulse.amplitude, range_mm) * 1_024.0).round() as u16,
            flags,
        })
    }

    /// A R² / (U P G ξ), as [`Echo`] has it.
    fn reflectivity(&self, amplitude: f64, range_mm: f64) -> f64 {
        let overlap_mm = f64::from(self.settings.overlap_mm);
        let begin_mm = 0.9 * overlap_mm;
        let overlap = ((range_mm - begin_mm) / (overlap_mm - begin_mm)).clamp(1.0 / 16.0, 1.0);
        let white = samples::white(&self.settings, &self.hardware);
        amplitude * (range_mm / 1e3).powi(2) / (white * overlap)
    }
}
