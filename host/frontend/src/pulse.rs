//! The emitted pulse as the receiver sees it.

use std::f64::consts::PI;

use crate::board::Analog;
use crate::receiver::SPEED_OF_LIGHT_M_NS;

/// Adds `current · sin²(π(t − 2R/c) / 2W)`; the cosine by Chebyshev's recurrence, two evaluations a
/// pulse.
pub(crate) fn add_pulse(analog: &Analog, range_m: f64, current_ua: f64, signal_ua: &mut [f32]) {
    let begin = (2.0 * range_m / SPEED_OF_LIGHT_M_NS - analog.delay_ns) / analog.sample_period_ns;
    let length = 2.0 * analog.pulse_width_ns / analog.sample_period_ns;
    let first = (begin.ceil().max(0.0)) as usize;
    let last = (begin + length).ceil().clamp(0.0, signal_ua.len() as f64) as usize;
    let Some(span) = signal_ua.get_mut(first..last) else { return };
    // sin²(πu/L) = (1 − cos(2πu/L)) / 2, u samples after the begin.
    let step = 2.0 * PI / length;
    let phase = step * (first as f64 - begin);
    let twice_cos_step = 2.0 * libm::cos(step);
    let (mut cosine, mut previous) = (libm::cos(phase), libm::cos(phase - step));
    for sample in span {
        *sample += (current_ua * 0.5 * (1.0 - cosine)) as f32;
        (cosine, previous) = (twice_cos_step * cosine - previous, cosine);
    }
}
