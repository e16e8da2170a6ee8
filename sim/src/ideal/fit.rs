//! Amplitudes and times of pulses by Gauss-Newton, damped after Levenberg and Marquardt.

use core::cmp::Ordering;
use core::f64::consts::SQRT_2;
use core::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::samples::{MeanSample, Phase, Samples};

/// Amplitude and time of a pulse in a waveform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FittedPulse {
    /// Fraction of full scale at full gain.
    pub(super) amplitude: f64,
    /// Time of its middle, samples.
    pub(super) time: f64,
    /// σ of the time where clipping hides it, samples.
    pub(super) spread: Option<f64>,
}

impl FittedPulse {
    pub(super) fn new(amplitude: f64, time: f64) -> Self {
        Self { amplitude, time, spread: None }
    }
}

/// Value and slope of a cos² pulse of FWHM `width`, `u` from its middle.
pub(super) fn shape(u: f64, width: f64) -> [f64; 2] {
    if u.abs() >= width {
        return [0.0; 2];
    }
    let turn = core::f64::consts::PI / width;
    [0.5 + 0.5 * libm::cos(turn * u), -0.5 * turn * libm::sin(turn * u)]
}

/// Largest number of fits of all pulses: they are fitted again when a fit changes which of them
/// overlap.
const MAX_FITS: usize = 3;
/// Largest number of steps of one fit.
const MAX_STEPS: usize = 40;
/// Smallest step in time that continues a fit, in pulse widths.
const MIN_STEP: f64 = 1e-7;

/// Order by falling amplitude, then by rising time.
pub(super) fn strongest_first(a: &FittedPulse, b: &FittedPulse) -> Ordering {
    b.amplitude.total_cmp(&a.amplitude).then(a.time.total_cmp(&b.time))
}

/// Fits all pulses, overlapping ones jointly, and repeats when the groups of overlapping pulses
/// change.
pub(super) fn refine(samples: &Samples, width: f64, pulses: &mut [FittedPulse]) {
    let fit = Fit { samples, width };
    let overlap = |a: &FittedPulse, b: &FittedPulse| b.time - a.time < 2.0 * width;
    pulses.sort_by(|a, b| a.time.total_cmp(&b.time));
    for _ in 0..MAX_FITS {
        let sizes = |pulses: &[FittedPulse]| pulses.chunk_by(overlap).map(<[_]>::len).collect();
        let before: Vec<usize> = sizes(pulses);
        for together in pulses.chunk_by_mut(overlap) {
            fit.refine(together);
            if let [single] = together {
                fit.weigh_amplitudes(single);
            }
        }
        pulses.sort_by(|a, b| a.time.total_cmp(&b.time));
        if sizes(pulses) == before {
            return;
        }
    }
}

/// χ² of pulses over a span of time; `weight_pulses` give the noise of each sample.
pub(super) fn misfit(
    samples: &Samples,
    width: f64,
    span: &Range<f64>,
    pulses: &[FittedPulse],
    weight_pulses: &[FittedPulse],
) -> f64 {
    let of_phase = |phase: &Phase| -> f64 {
        let of = |(time, sample): (f64, &MeanSample)| {
            let residual = sample.x - model(pulses, sample, time, width);
            let residual = if sample.clipped { residual.max(0.0) } else { residual };
            let light = model(weight_pulses, sample, time, width);
            residual * residual / samples.variance(sample, light)
        };
        phase.within(span.clone()).map(of).sum()
    };
    samples.phases.iter().map(of_phase).sum()
}

/// Steps of amplitude over which a clipped pulse is averaged.
const AMPLITUDES: usize = 40;
/// Smallest ratio of the greatest of these amplitudes to the clipping level.
const MIN_TIMES: f64 = 4.0;
/// Newton steps for the time of one amplitude.
const TIME_STEPS: usize = 8;
/// σ of a time that is uniform between two samples: 1 / √12.
const MAX_SPREAD: f64 = 0.288_675;

/// Best time of a pulse whose amplitude is given.
struct TimeFit {
    pulse: FittedPulse,
    /// σ of its time, samples.
    sigma: f64,
    misfit: f64,
}

struct Fit<'a> {
    samples: &'a Samples,
    width: f64,
}

/// Normal equations of a step, and the cost that the step must reduce.
struct Equations {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    cost: f64,
}

impl Fit<'_> {
    /// Fits pulses jointly. Damped after Levenberg and Marquardt, because the set of clipped
    /// samples that count changes from step to step.
    fn refine(&self, pulses: &mut [FittedPulse]) {
        let mut damping = 1e-3;
        for _ in 0..MAX_STEPS {
            let weight_pulses = pulses.to_vec();
            let Some(now) = self.equations(pulses, &weight_pulses) else { return };
            let mut damped = now.normal.clone();
            (0..damped.nrows()).for_each(|i| damped[(i, i)] *= 1.0 + damping);
            let Some(factor) = damped.cholesky() else { return };
            let step = factor.solve(&now.right);
            let stepped = self.stepped(pulses, &step);
            match self.equations(&stepped, &weight_pulses) {
                Some(then) if then.cost <= now.cost => {
                    let farthest =
                        pulses.iter().zip(&stepped).map(|(a, b)| (a.time - b.time).abs());
                    let farthest = farthest.fold(0.0, f64::max);
                    pulses.copy_from_slice(&stepped);
                    damping = (damping / 10.0).max(1e-9);
                    if farthest < MIN_STEP * self.width {
                        return;
                    }
                }
                _ if damping > 1e6 => return,
                _ => damping *= 10.0,
            }
        }
    }

    /// Replaces a clipped pulse by its posterior mean over all amplitudes up to that of a white
    /// wall.
    ///
    /// The likeliest amplitude and time of a clipped pulse may be far off: with little of its edges
    /// visible, a strong pulse and a stronger, later one look alike. Each amplitude is weighted by
    /// its likelihood; the prior is uniform in the logarithm of the amplitude.
    fn weigh_amplitudes(&self, pulse: &mut FittedPulse) {
        let Some((middle, level)) = self.clipped_run(pulse) else { return };
        let times = (self.samples.white(middle) / level).max(MIN_TIMES);
        let ratio = libm::pow(times, 1.0 / AMPLITUDES as f64);
        if self.amplitude_sigma(pulse) < ratio - 1.0 {
            return; // its edges determine the amplitude
        }
        let far = 2.5 * self.width + 1.0;
        let span = middle - far..middle + far;
        let amplitudes = (0..=AMPLITUDES).map(|step| level * libm::pow(ratio, step as f64));
        let fits: Vec<TimeFit> = amplitudes
            .map(|amplitude| self.fit_time(FittedPulse::new(amplitude, middle), &span))
            .collect();
        let least = fits.iter().map(|of| of.misfit).fold(f64::INFINITY, f64::min);
        let weight = |of: &TimeFit| of.sigma * libm::exp(0.5 * (least - of.misfit));
        let weights: Vec<f64> = fits.iter().map(weight).collect();
        let all: f64 = weights.iter().sum();
        let mean = |value: &dyn Fn(&TimeFit) -> f64| {
            fits.iter().zip(&weights).map(|(of, weight)| weight * value(of)).sum::<f64>() / all
        };
        let time = mean(&|of| of.pulse.time);
        let variance = mean(&|of| of.sigma.powi(2) + (of.pulse.time - time).powi(2));
        let amplitude = libm::exp(mean(&|of| libm::log(of.pulse.amplitude)));
        *pulse = FittedPulse { amplitude, time, spread: Some(variance.sqrt()) };
    }

    /// Relative σ of the amplitude, from the unclipped samples.
    fn amplitude_sigma(&self, pulse: &FittedPulse) -> f64 {
        let inverse = self
            .equations(&[*pulse], &[*pulse])
            .and_then(|equations| equations.normal.cholesky())
            .map(|factor| factor.inverse());
        inverse.map_or(f64::INFINITY, |inverse| inverse[(0, 0)].sqrt() / pulse.amplitude)
    }

    /// Middle of the clipped samples around a pulse, and the clipping level at full gain.
    fn clipped_run(&self, pulse: &FittedPulse) -> Option<(f64, f64)> {
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

    /// Best time of a pulse of given amplitude.
    fn fit_time(&self, mut pulse: FittedPulse, span: &Range<f64>) -> TimeFit {
        let mut sigma = MAX_SPREAD;
        for _ in 0..TIME_STEPS {
            let Some(Equations { normal, right, .. }) = self.equations(&[pulse], &[pulse]) else {
                break;
            };
            if normal[(1, 1)] <= 0.0 {
                break;
            }
            let most = self.width / 4.0;
            let step = (right[1] / normal[(1, 1)]).clamp(-most, most);
            sigma = normal[(1, 1)].powf(-0.5).min(MAX_SPREAD);
            pulse.time += step;
            if step.abs() < 1e-3 * sigma {
                break;
            }
        }
        TimeFit { pulse, sigma, misfit: self.deviance(&pulse, span) }
    }

    /// −2 ln L of the samples around a pulse, up to a constant.
    fn deviance(&self, pulse: &FittedPulse, span: &Range<f64>) -> f64 {
        let of = |(time, sample): (f64, &MeanSample)| {
            let model = model(&[*pulse], sample, time, self.width);
            let variance = self.samples.variance(sample, model);
            let over = (model - sample.x) / variance.sqrt();
            match sample.clipped {
                // Φ, at least 1e-300 so that its logarithm is finite.
                true => -2.0 * libm::log((0.5 * libm::erfc(-over / SQRT_2)).max(1e-300)),
                false => over * over + libm::log(variance / sample.dark),
            }
        };
        self.samples.phases.iter().flat_map(|phase| phase.within(span.clone()).map(of)).sum()
    }

    /// Pulses after a step: no time moves by more than half a width, no amplitude falls to 0.
    fn stepped(&self, pulses: &[FittedPulse], step: &DVector<f64>) -> Vec<FittedPulse> {
        let most = 0.5 * self.width;
        let stepped = |(i, pulse): (usize, &FittedPulse)| FittedPulse {
            amplitude: (pulse.amplitude + step[2 * i]).max(1e-6 * pulse.amplitude),
            time: pulse.time + step[2 * i + 1].clamp(-most, most),
            spread: None,
        };
        pulses.iter().enumerate().map(stepped).collect()
    }

    /// Normal equations at `pulses`; `weight_pulses` give the noise of each sample. `None` without
    /// a pulse.
    fn equations(
        &self,
        pulses: &[FittedPulse],
        weight_pulses: &[FittedPulse],
    ) -> Option<Equations> {
        let unknowns = 2 * pulses.len();
        let (mut normal, mut right) =
            (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
        let (mut cost, mut slopes) = (0.0, vec![0.0; unknowns]);
        let span = span(weight_pulses, self.width)?;
        for phase in &self.samples.phases {
            for (time, sample) in phase.within(span.clone()) {
                let model = model(pulses, sample, time, self.width);
                if sample.clipped && model >= sample.x {
                    continue; // clipped as the model predicts
                }
                let light = self::model(weight_pulses, sample, time, self.width);
                let weight = 1.0 / self.samples.variance(sample, light);
                for (i, pulse) in pulses.iter().enumerate() {
                    let [value, slope] = shape(time - pulse.time, self.width);
                    slopes[2 * i] = sample.gain * value;
                    slopes[2 * i + 1] = -sample.gain * pulse.amplitude * slope;
                }
                let residual = sample.x - model;
                cost += weight * residual * residual;
                for i in 0..unknowns {
                    right[i] += weight * slopes[i] * residual;
                    for j in 0..unknowns {
                        normal[(i, j)] += weight * slopes[i] * slopes[j];
                    }
                }
            }
        }
        Some(Equations { normal, right, cost })
    }
}

/// Span of time from before the first pulse to after the last.
pub(super) fn span(pulses: &[FittedPulse], width: f64) -> Option<Range<f64>> {
    let times = pulses.iter().map(|pulse| pulse.time);
    let (from, to) = (times.clone().reduce(f64::min)?, times.reduce(f64::max)?);
    Some(from - 1.25 * width - 1.0..to + 1.25 * width + 1.0)
}

/// Model of a sample: the sum of the pulses times its gain.
pub(super) fn model(pulses: &[FittedPulse], sample: &MeanSample, time: f64, width: f64) -> f64 {
    let light = pulses.iter().map(|pulse| pulse.amplitude * shape(time - pulse.time, width)[0]);
    sample.gain * light.sum::<f64>()
}

/// SNR, timing and clipping of a pulse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Detection {
    /// Amplitude over the least σ of any unbiased estimate of it, in the dark.
    pub(super) snr: f64,
    /// Cramér-Rao bound of its time, samples.
    pub(super) deviation: f64,
    /// True when one of its samples was clipped.
    pub(super) clipped: bool,
    /// Clipping level, where a sample was clipped; infinite otherwise.
    pub(super) level: f64,
}

pub(super) fn detection(samples: &Samples, width: f64, pulse: &FittedPulse) -> Detection {
    let (mut dark, mut clipped, mut level) = (0.0, false, f64::INFINITY);
    let (mut square, mut product, mut slope_square) = (0.0, 0.0, 0.0);
    for phase in &samples.phases {
        for (time, sample) in phase.within(pulse.time - width..pulse.time + width) {
            let [value, slope] = shape(time - pulse.time, width).map(|of| sample.gain * of);
            dark += value * value / sample.dark;
            clipped |= sample.clipped;
            if sample.clipped {
                level = sample.x;
                continue; // carries no information on the amplitude
            }
            let light = pulse.amplitude * value;
            let weight = 1.0 / samples.variance(sample, light);
            square += weight * value * value;
            product -= weight * value * pulse.amplitude * slope;
            slope_square += weight * (pulse.amplitude * slope).powi(2);
        }
    }
    let information = slope_square - product * product / square.max(f64::MIN_POSITIVE);
    let bound = if information > 0.0 { information.powf(-0.5) } else { width };
    let deviation = pulse.spread.unwrap_or(bound);
    Detection { snr: pulse.amplitude * dark.sqrt(), deviation, clipped, level }
}
