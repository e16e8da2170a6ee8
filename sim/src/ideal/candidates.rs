//! Where pulses may be.

use echoloop_dsp::Settings;

use super::fit::{Pulse, model, shape};
use super::samples::{Phase, Sample, Samples};

/// The most that are looked at: as many as the program keeps.
pub(super) const MOST: usize = 32;

/// Finds pulses, as settings ask for them.
pub(super) struct Finder<'a> {
    /// FWHM of the pulse, samples.
    pub(super) width: f64,
    pub(super) settings: &'a Settings,
    /// Range of a sample, mm.
    pub(super) step_mm: f64,
}

/// The best amplitude of a pulse in the middle of a sample.
#[derive(Clone, Copy, Debug)]
struct Place {
    time: f64,
    amplitude: f64,
    snr: f64,
    /// Least SNR that is believed here.
    least: f64,
}

impl Finder<'_> {
    /// What an amplitude over its σ must reach.
    fn least_snr(&self) -> f64 {
        f64::from(self.settings.snr_threshold_milli) / 1e3
    }

    fn floor(&self) -> f64 {
        f64::from(self.settings.noise_floor_ppm) / 1e6
    }

    /// Whether a pulse is believed: its amplitude as it is converted, and its SNR.
    pub(super) fn passes(&self, amplitude: f64, snr: f64) -> bool {
        snr >= self.least_snr() && amplitude >= self.floor()
    }

    /// The peaks that known pulses leave over, strongest first.
    pub(super) fn find(&self, samples: &Samples, known: &[Pulse]) -> Vec<Pulse> {
        let phases: Vec<Left> =
            samples.phases.iter().map(|phase| self.left(phase, known)).collect();
        let places: Vec<Place> =
            (0..samples.len()).map(|n| self.place(samples, &phases, n)).collect();
        let mut peaks = climbs(&places);
        peaks.sort_by(|a, b| b.snr.total_cmp(&a.snr).then(a.time.total_cmp(&b.time)));
        let pulse = |place: &Place| Pulse::new(place.amplitude, place.time);
        let mut kept = self.separate(peaks.iter().map(pulse));
        kept.truncate(MOST);
        kept
    }

    /// Of pulses, strongest first, those that are far enough from each stronger one.
    pub(super) fn separate(&self, pulses: impl IntoIterator<Item = Pulse>) -> Vec<Pulse> {
        let apart = self.apart();
        let mut kept: Vec<Pulse> = Vec::new();
        for pulse in pulses {
            if kept.iter().all(|k| (k.time - pulse.time).abs() >= apart) {
                kept.push(pulse);
            }
        }
        kept
    }

    /// What known pulses leave of a phase.
    fn left(&self, phase: &Phase, known: &[Pulse]) -> Left {
        let half = self.width.ceil() as i32;
        let template = (-half..=half).map(|k| shape(f64::from(k) + phase.offset, self.width)[0]);
        let weighed = |(n, sample): (usize, &Sample)| {
            let time = n as f64 + phase.offset;
            let left = match known {
                [] => sample.x,
                _ => sample.x - model(known, sample, time, self.width),
            };
            let left = if sample.clipped { left.max(0.0) } else { left };
            let weight = sample.gain / sample.dark;
            [weight * left, weight * sample.gain]
        };
        let weighed = phase.samples.iter().enumerate().map(weighed).collect();
        Left { half: half as usize, template: template.collect(), weighed }
    }

    /// How far peaks must be apart, samples: 1.14 widths unless settings say it.
    fn apart(&self) -> f64 {
        self.settings.min_separation_mm.map_or(1.14 * self.width, |mm| f64::from(mm) / self.step_mm)
    }

    fn place(&self, samples: &Samples, phases: &[Left], n: usize) -> Place {
        let (mut along, mut square) = (0.0, 0.0);
        for Left { half, template, weighed } in phases {
            let cut = half.saturating_sub(n); // samples before the first
            let around = weighed.iter().skip(n.saturating_sub(*half));
            for (value, [light, weight]) in template.iter().skip(cut).zip(around) {
                along += value * light;
                square += value * value * weight;
            }
        }
        let (time, root) = (n as f64, square.sqrt());
        let floor = self.floor() / samples.gain(time);
        Place {
            time,
            amplitude: along / square,
            snr: along / root,
            least: self.least_snr().max(floor * root),
        }
    }
}

/// What is left of a phase.
struct Left {
    /// Samples of the template on either side of its middle.
    half: usize,
    /// The pulse in the middle of a sample, as this phase samples it.
    template: Vec<f64>,
    /// Of each sample what is left times its gain over its variance, and its gain squared over its
    /// variance.
    weighed: Vec<[f64; 2]>,
}

/// The tops between valleys: a top is left by a fall of half the threshold, or of a sixteenth of
/// its height where that is more; a valley by as much of a rise.
fn climbs(places: &[Place]) -> Vec<Place> {
    let mut tops: Vec<Place> = Vec::new();
    let (mut top, mut valley): (Option<Place>, f64) = (None, 0.0);
    for place in places {
        let step = |snr: f64| (place.least / 2.0).max(snr / 16.0);
        match &mut top {
            Some(highest) if place.snr > highest.snr => *highest = *place,
            Some(highest) => {
                if place.snr < highest.snr - step(highest.snr) {
                    tops.push(*highest);
                    (top, valley) = (None, place.snr);
                }
            }
            None => {
                valley = valley.min(place.snr);
                let risen = valley < place.least / 2.0 || place.snr > valley + step(place.snr);
                if place.snr >= place.least && risen {
                    top = Some(*place);
                }
            }
        }
    }
    tops.extend(top);
    tops
}
