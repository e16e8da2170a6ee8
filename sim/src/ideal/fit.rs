//! Amplitudes and times of pulses, by Gauss and Newton.

use core::cmp::Ordering;
use core::f64::consts::SQRT_2;
use core::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::samples::{Phase, Sample, Samples};

/// A pulse in a waveform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pulse {
    /// Fraction of full scale, as if the gain were full.
    pub(super) amplitude: f64,
    /// Of its middle, samples.
    pub(super) time: f64,
    /// σ of the time where clipping hides it, samples.
    pub(super) spread: Option<f64>,
}

impl Pulse {
    pub(super) fn new(amplitude: f64, time: f64) -> Self {
        Self { amplitude, time, spread: None }
    }
}

/// cos² of FWHM `width`, `u` from its middle: its value and its slope.
pub(super) fn shape(u: f64, width: f64) -> [f64; 2] {
    if u.abs() >= width {
        return [0.0; 2];
    }
    let turn = core::f64::consts::PI / width;
    [0.5 + 0.5 * libm::cos(turn * u), -0.5 * turn * libm::sin(turn * u)]
}

/// How often all are fitted, where some move to others.
const MOST_FITS: usize = 3;
/// Steps until a fit is given up as it is.
const MOST_STEPS: usize = 40;
/// A step that is smaller, in widths of a pulse, is the last.
const LEAST_STEP: f64 = 1e-7;

/// By amplitude, then by time.
pub(super) fn strongest_first(a: &Pulse, b: &Pulse) -> Ordering {
    b.amplitude.total_cmp(&a.amplitude).then(a.time.total_cmp(&b.time))
}

/// Fits all of them at once, those that overlap together; again where they have moved together.
pub(super) fn refine(samples: &Samples, width: f64, pulses: &mut [Pulse]) {
    let fit = Fit { samples, width };
    let overlap = |a: &Pulse, b: &Pulse| b.time - a.time < 2.0 * width;
    pulses.sort_by(|a, b| a.time.total_cmp(&b.time));
    for _ in 0..MOST_FITS {
        let sizes = |pulses: &[Pulse]| pulses.chunk_by(overlap).map(<[_]>::len).collect();
        let before: Vec<usize> = sizes(pulses);
        for together in pulses.chunk_by_mut(overlap) {
            fit.refine(together);
            if let [alone] = together {
                fit.weigh_amplitudes(alone);
            }
        }
        pulses.sort_by(|a, b| a.time.total_cmp(&b.time));
        if sizes(pulses) == before {
            return;
        }
    }
}

/// χ² of pulses over a span of time, each sample weighed by its noise under those of `weigher`.
pub(super) fn misfit(
    samples: &Samples,
    width: f64,
    span: &Range<f64>,
    pulses: &[Pulse],
    weigher: &[Pulse],
) -> f64 {
    let of_phase = |phase: &Phase| -> f64 {
        let of = |(time, sample): (f64, &Sample)| {
            let left = sample.x - model(pulses, sample, time, width);
            let left = if sample.clipped { left.max(0.0) } else { left };
            let light = model(weigher, sample, time, width);
            left * left / samples.variance(sample, light)
        };
        phase.within(span.clone()).map(of).sum()
    };
    samples.phases.iter().map(of_phase).sum()
}

/// Steps between amplitudes that a clipped pulse is tried with.
const AMPLITUDES: usize = 40;
/// The greatest is at least so many times what clips.
const LEAST_TIMES: f64 = 4.0;
/// Steps to the best time of one of them.
const TIME_STEPS: usize = 8;
/// σ of a time that is known to lie between two samples.
const MOST_SPREAD: f64 = 0.288_675;

/// What is known of a pulse of one amplitude.
struct Told {
    pulse: Pulse,
    /// Of its time.
    sigma: f64,
    misfit: f64,
}

struct Fit<'a> {
    samples: &'a Samples,
    width: f64,
}

/// The equations of a step, and what is to become less.
struct Equations {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    cost: f64,
}

impl Fit<'_> {
    /// Damped as Levenberg and Marquardt do, because clipped samples come and go.
    fn refine(&self, pulses: &mut [Pulse]) {
        let mut damping = 1e-3;
        for _ in 0..MOST_STEPS {
            let weigher = pulses.to_vec();
            let Some(now) = self.equations(pulses, &weigher) else { return };
            let mut damped = now.normal.clone();
            (0..damped.nrows()).for_each(|i| damped[(i, i)] *= 1.0 + damping);
            let Some(factor) = damped.cholesky() else { return };
            let step = factor.solve(&now.right);
            let moved = self.moved(pulses, &step);
            match self.equations(&moved, &weigher) {
                Some(then) if then.cost <= now.cost => {
                    let farthest = pulses.iter().zip(&moved).map(|(a, b)| (a.time - b.time).abs());
                    let farthest = farthest.fold(0.0, f64::max);
                    pulses.copy_from_slice(&moved);
                    damping = (damping / 10.0).max(1e-9);
                    if farthest < LEAST_STEP * self.width {
                        return;
                    }
                }
                _ if damping > 1e6 => return,
                _ => damping *= 10.0,
            }
        }
    }

    /// Of a pulse whose top is clipped the likeliest amplitude and time may be far from both: where
    /// little of its edges shows, a strong pulse and a stronger one a little later look alike. So
    /// its time is the mean over all amplitudes up to a white wall's, each as likely as what it
    /// leaves over says; a priori one is as likely as its double.
    fn weigh_amplitudes(&self, pulse: &mut Pulse) {
        let Some((middle, level)) = self.clipped_run(pulse) else { return };
        let times = (self.samples.white(middle) / level).max(LEAST_TIMES);
        let ratio = libm::pow(times, 1.0 / AMPLITUDES as f64);
        if self.amplitude_sigma(pulse) < ratio - 1.0 {
            return; // its edges tell the amplitude
        }
        let far = 2.5 * self.width + 1.0;
        let span = middle - far..middle + far;
        let amplitudes = (0..=AMPLITUDES).map(|step| level * libm::pow(ratio, step as f64));
        let told: Vec<Told> =
            amplitudes.map(|amplitude| self.told(Pulse::new(amplitude, middle), &span)).collect();
        let least = told.iter().map(|of| of.misfit).fold(f64::INFINITY, f64::min);
        let weight = |of: &Told| of.sigma * libm::exp(0.5 * (least - of.misfit));
        let weights: Vec<f64> = told.iter().map(weight).collect();
        let all: f64 = weights.iter().sum();
        let mean = |value: &dyn Fn(&Told) -> f64| {
            told.iter().zip(&weights).map(|(of, weight)| weight * value(of)).sum::<f64>() / all
        };
        let time = mean(&|of| of.pulse.time);
        let variance = mean(&|of| of.sigma.powi(2) + (of.pulse.time - time).powi(2));
        let amplitude = libm::exp(mean(&|of| libm::log(of.pulse.amplitude)));
        *pulse = Pulse { amplitude, time, spread: Some(variance.sqrt()) };
    }

    /// σ of the amplitude over it, as the edges tell it.
    fn amplitude_sigma(&self, pulse: &Pulse) -> f64 {
        let inverse = self
            .equations(&[*pulse], &[*pulse])
            .and_then(|equations| equations.normal.cholesky())
            .map(|factor| factor.inverse());
        inverse.map_or(f64::INFINITY, |inverse| inverse[(0, 0)].sqrt() / pulse.amplitude)
    }

    /// The middle of the clipped samples around a pulse, and what they are clipped at, as if the
    /// gain were full.
    fn clipped_run(&self, pulse: &Pulse) -> Option<(f64, f64)> {
        let (mut times, mut level) = ([f64::INFINITY, f64::NEG_INFINITY], 0.0_f64);
        for phase in &self.samples.phases {
            for (time, sample) in phase.within(pulse.time - self.width..pulse.time + self.width) {
                if sample.clipped {
                    times = [times[0].min(time), times[1].max(time)];
                    level = level.max(sample.x / sample.gain);
                }
            }
        }
        (level > 0.0).then_some(((times[0] + times[1]) / 2.0, level))
    }

    /// The best time of a pulse of one amplitude.
    fn told(&self, mut pulse: Pulse, span: &Range<f64>) -> Told {
        let mut sigma = MOST_SPREAD;
        for _ in 0..TIME_STEPS {
            let Some(Equations { normal, right, .. }) = self.equations(&[pulse], &[pulse]) else {
                break;
            };
            if normal[(1, 1)] <= 0.0 {
                break;
            }
            let most = self.width / 4.0;
            let step = (right[1] / normal[(1, 1)]).clamp(-most, most);
            sigma = normal[(1, 1)].powf(-0.5).min(MOST_SPREAD);
            pulse.time += step;
            if step.abs() < 1e-3 * sigma {
                break;
            }
        }
        Told { pulse, sigma, misfit: self.unlikelihood(&pulse, span) }
    }

    /// −2 ln of how likely the samples around a pulse are, but for a constant.
    fn unlikelihood(&self, pulse: &Pulse, span: &Range<f64>) -> f64 {
        let of = |(time, sample): (f64, &Sample)| {
            let model = model(&[*pulse], sample, time, self.width);
            let variance = self.samples.variance(sample, model);
            let over = (model - sample.x) / variance.sqrt();
            match sample.clipped {
                // Φ; what no float holds is as good as nothing.
                true => -2.0 * libm::log((0.5 * libm::erfc(-over / SQRT_2)).max(1e-300)),
                false => over * over + libm::log(variance / sample.dark),
            }
        };
        self.samples.phases.iter().flat_map(|phase| phase.within(span.clone()).map(of)).sum()
    }

    /// No pulse farther than half its width at a time, none that takes light away.
    fn moved(&self, pulses: &[Pulse], step: &DVector<f64>) -> Vec<Pulse> {
        let most = 0.5 * self.width;
        let moved = |(i, pulse): (usize, &Pulse)| Pulse {
            amplitude: (pulse.amplitude + step[2 * i]).max(1e-6 * pulse.amplitude),
            time: pulse.time + step[2 * i + 1].clamp(-most, most),
            spread: None,
        };
        pulses.iter().enumerate().map(moved).collect()
    }

    /// With each sample weighed by its noise under the pulses of `weigher`; `None` where there is
    /// nothing to fit to.
    fn equations(&self, pulses: &[Pulse], weigher: &[Pulse]) -> Option<Equations> {
        let unknowns = 2 * pulses.len();
        let (mut normal, mut right) =
            (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
        let (mut cost, mut slopes) = (0.0, vec![0.0; unknowns]);
        let span = span(weigher, self.width)?;
        for phase in &self.samples.phases {
            for (time, sample) in phase.within(span.clone()) {
                let model = model(pulses, sample, time, self.width);
                if sample.clipped && model >= sample.x {
                    continue; // as it should be
                }
                let light = self::model(weigher, sample, time, self.width);
                let weight = 1.0 / self.samples.variance(sample, light);
                for (i, pulse) in pulses.iter().enumerate() {
                    let [value, slope] = shape(time - pulse.time, self.width);
                    slopes[2 * i] = sample.gain * value;
                    slopes[2 * i + 1] = -sample.gain * pulse.amplitude * slope;
                }
                let left = sample.x - model;
                cost += weight * left * left;
                for i in 0..unknowns {
                    right[i] += weight * slopes[i] * left;
                    for j in 0..unknowns {
                        normal[(i, j)] += weight * slopes[i] * slopes[j];
                    }
                }
            }
        }
        Some(Equations { normal, right, cost })
    }
}

/// From the first pulse's beginning to the last one's end, and a little.
pub(super) fn span(pulses: &[Pulse], width: f64) -> Option<Range<f64>> {
    let times = pulses.iter().map(|pulse| pulse.time);
    let (from, to) = (times.clone().reduce(f64::min)?, times.reduce(f64::max)?);
    Some(from - 1.25 * width - 1.0..to + 1.25 * width + 1.0)
}

/// What pulses make of a sample.
pub(super) fn model(pulses: &[Pulse], sample: &Sample, time: f64, width: f64) -> f64 {
    let light = pulses.iter().map(|pulse| pulse.amplitude * shape(time - pulse.time, width)[0]);
    sample.gain * light.sum::<f64>()
}

/// How well a pulse is seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Its amplitude over the least σ of it, in the dark.
    pub(super) snr: f64,
    /// The least σ of its time (Cramér and Rao), samples.
    pub(super) deviation: f64,
    /// Whether a sample of it was clipped.
    pub(super) clipped: bool,
    /// The most that was converted of it, where it was.
    pub(super) level: f64,
}

pub(super) fn seen(samples: &Samples, width: f64, pulse: &Pulse) -> Seen {
    let (mut dark, mut clipped, mut level) = (0.0, false, f64::INFINITY);
    let (mut square, mut product, mut slope_square) = (0.0, 0.0, 0.0);
    for phase in &samples.phases {
        for (time, sample) in phase.within(pulse.time - width..pulse.time + width) {
            let [value, slope] = shape(time - pulse.time, width).map(|of| sample.gain * of);
            dark += value * value / sample.dark;
            clipped |= sample.clipped;
            if sample.clipped {
                level = sample.x;
                continue; // how much more there was nobody knows
            }
            let light = pulse.amplitude * value;
            let weight = 1.0 / samples.variance(sample, light);
            square += weight * value * value;
            product -= weight * value * pulse.amplitude * slope;
            slope_square += weight * (pulse.amplitude * slope).powi(2);
        }
    }
    let information = slope_square - product * product / square.max(f64::MIN_POSITIVE);
    let least = if information > 0.0 { information.powf(-0.5) } else { width };
    let deviation = pulse.spread.unwrap_or(least);
    Seen { snr: pulse.amplitude * dark.sqrt(), deviation, clipped, level }
}
