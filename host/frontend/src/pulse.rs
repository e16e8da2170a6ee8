//! Shape of the emitted pulse.

use std::f64::consts::PI;
use std::ops::Range;

use crate::board::Analog;
use crate::receiver::SPEED_OF_LIGHT_M_NS;

/// The pulse of one set of settings, on the grid of its samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pulse {
    delay_ns: f64,
    sample_period_ns: f64,
    /// Duration, samples.
    length: f64,
    /// Phase step of the cosine per sample, and its sine and cosine.
    step: f64,
    step_sine: f64,
    step_cosine: f64,
}

impl Pulse {
    pub(crate) fn new(analog: &Analog) -> Self {
        let Analog { delay_ns, sample_period_ns, pulse_width_ns, .. } = *analog;
        let length = 2.0 * pulse_width_ns / sample_period_ns;
        let step = 2.0 * PI / length;
        let (step_sine, step_cosine) = libm::sincos(step);
        Self { delay_ns, sample_period_ns, length, step, step_sine, step_cosine }
    }

    /// Adds `current · sin²(π(t − 2R/c) / 2W)`, with the cosine by Chebyshev's recurrence, and
    /// returns the span of samples that it reaches.
    pub(crate) fn add(&self, range_m: f64, current: f64, signal: &mut [f32]) -> Range<usize> {
        let begin = (2.0 * range_m / SPEED_OF_LIGHT_M_NS - self.delay_ns) / self.sample_period_ns;
        self.add_from(begin, current, signal)
    }

    /// As [`Pulse::add`], from a moment in samples on.
    pub(crate) fn add_from(&self, begin: f64, current: f64, signal: &mut [f32]) -> Range<usize> {
        let first = (begin.ceil().max(0.0)) as usize;
        let last = (begin + self.length).ceil().clamp(0.0, signal.len() as f64) as usize;
        let Some(samples) = signal.get_mut(first..last) else { return 0..0 };
        // sin²(πu/L) = (1 − cos(2πu/L)) / 2, u samples after the begin.
        let (sine, mut cosine) = libm::sincos(self.step * (first as f64 - begin));
        let mut previous = cosine * self.step_cosine + sine * self.step_sine;
        for sample in samples {
            *sample += (current * 0.5 * (1.0 - cosine)) as f32;
            (cosine, previous) = (2.0 * self.step_cosine * cosine - previous, cosine);
        }
        first..last
    }
}
