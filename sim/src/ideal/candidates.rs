//! Candidate pulses: peaks of the amplitude over its σ that known pulses do not explain.

use echoloop_dsp::Settings;

use super::fit::{FittedPulse, model, shape};
use super::samples::{MeanSample, Phase, Samples};

/// Most candidates that are kept: the firmware's number.
pub(super) const MAX_PULSES: usize = 32;

/// Search for candidates with the threshold, floor and separation of the settings.
pub(super) struct Finder<'a> {
    /// FWHM of the pulse, samples.
    pub(super) width: f64,
    pub(super) settings: &'a Settings,
    /// Range of a sample, mm.
    pub(super) step_mm: f64,
}

/// Best-fitting amplitude of a pulse centred on a sample, and its SNR.
#[derive(Clone, Copy, Debug)]
struct MatchScore {
    time: f64,
    amplitude: f64,
    snr: f64,
    /// Detection threshold here: the larger of the SNR threshold and the noise floor over σ.
    min_snr: f64,
}

impl Finder<'_> {
    /// SNR threshold: least amplitude over its σ.
    fn snr_threshold(&self) -> f64 {
        f64::from(self.settings.snr_threshold_milli) / 1e3
    }

    fn floor(&self) -> f64 {
        f64::from(self.settings.noise_floor_ppm) / 1e6
    }

    /// True when a pulse is above both thresholds: its amplitude as converted, and its SNR.
    pub(super) fn passes(&self, amplitude: f64, snr: f64) -> bool {
        snr >= self.snr_threshold() && amplitude >= self.floor()
    }

    /// Peaks of the residual of the known pulses, strongest first.
    pub(super) fn find(&self, samples: &Samples, known: &[FittedPulse]) -> Vec<FittedPulse> {
        let phases: Vec<Residual> =
            samples.phases.iter().map(|phase| self.residual(phase, known)).collect();
        let scores: Vec<MatchScore> =
            (0..samples.len()).map(|n| self.score(samples, &phases, n)).collect();
        let mut peaks = hysteresis_peaks(&scores);
        peaks.sort_by(|a, b| b.snr.total_cmp(&a.snr).then(a.time.total_cmp(&b.time)));
        let pulse = |score: &MatchScore| FittedPulse::new(score.amplitude, score.time);
        let mut kept = self.separate(peaks.iter().map(pulse));
        kept.truncate(MAX_PULSES);
        kept
    }

    /// Drops each pulse that is nearer than the separation to a stronger one; takes them strongest
    /// first.
    pub(super) fn separate(
        &self,
        pulses: impl IntoIterator<Item = FittedPulse>,
    ) -> Vec<FittedPulse> {
        let min_separation = self.min_separation();
        let mut kept: Vec<FittedPulse> = Vec::new();
        for pulse in pulses {
            if kept.iter().all(|k| (k.time - pulse.time).abs() >= min_separation) {
                kept.push(pulse);
            }
        }
        kept
    }

    /// Residual of a phase: its samples less the known pulses.
    fn residual(&self, phase: &Phase, known: &[FittedPulse]) -> Residual {
        let half = self.width.ceil() as i32;
        let template = (-half..=half).map(|k| shape(f64::from(k) + phase.offset, self.width)[0]);
        let weighed = |(n, sample): (usize, &MeanSample)| {
            let time = n as f64 + phase.offset;
            let residual = match known {
                [] => sample.x,
                _ => sample.x - model(known, sample, time, self.width),
            };
            let residual = if sample.clipped { residual.max(0.0) } else { residual };
            let weight = sample.gain / sample.dark;
            [weight * residual, weight * sample.gain]
        };
        let weighed = phase.samples.iter().enumerate().map(weighed).collect();
        Residual { half: half as usize, template: template.collect(), weighed }
    }

    /// Least distance between peaks, samples: 1.14 pulse widths unless the settings give one.
    fn min_separation(&self) -> f64 {
        self.settings.min_separation_mm.map_or(1.14 * self.width, |mm| f64::from(mm) / self.step_mm)
    }

    fn score(&self, samples: &Samples, phases: &[Residual], n: usize) -> MatchScore {
        let (mut along, mut square) = (0.0, 0.0);
        for Residual { half, template, weighed } in phases {
            let cut = half.saturating_sub(n); // samples before the first
            let around = weighed.iter().skip(n.saturating_sub(*half));
            for (value, [light, weight]) in template.iter().skip(cut).zip(around) {
                along += value * light;
                square += value * value * weight;
            }
        }
        let (time, root) = (n as f64, square.sqrt());
        let floor = self.floor() / samples.gain(time);
        MatchScore {
            time,
            amplitude: along / square,
            snr: along / root,
            min_snr: self.snr_threshold().max(floor * root),
        }
    }
}

/// Residual of a phase, with its template.
struct Residual {
    /// Samples of the template on each side of its middle.
    half: usize,
    /// Pulse centred on a sample, as this phase samples it.
    template: Vec<f64>,
    /// For each sample: residual times gain over variance, and gain squared over variance.
    weighed: Vec<[f64; 2]>,
}

/// Peaks with hysteresis: a fall ends a peak, a rise ends a valley, each of half the threshold or a
/// sixteenth of the height, whichever is more.
fn hysteresis_peaks(scores: &[MatchScore]) -> Vec<MatchScore> {
    let mut tops: Vec<MatchScore> = Vec::new();
    let (mut top, mut valley): (Option<MatchScore>, f64) = (None, 0.0);
    for score in scores {
        let step = |snr: f64| (score.min_snr / 2.0).max(snr / 16.0);
        match &mut top {
            Some(highest) if score.snr > highest.snr => *highest = *score,
            Some(highest) => {
                if score.snr < highest.snr - step(highest.snr) {
                    tops.push(*highest);
                    (top, valley) = (None, score.snr);
                }
            }
            None => {
                valley = valley.min(score.snr);
                let risen = valley < score.min_snr / 2.0 || score.snr > valley + step(score.snr);
                if score.snr >= score.min_snr && risen {
                    top = Some(*score);
                }
            }
        }
    }
    tops.extend(top);
    tops
}
