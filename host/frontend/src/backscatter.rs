//! Continuous backscatter from the air.

use std::f64::consts::PI;

use crate::board::Analog;
use crate::light::Return;
use crate::receiver::SPEED_OF_LIGHT_M_NS;
use crate::shares::Shares;

/// Table steps per pulse width: linear interpolation then errs by 1.5 × 10⁻⁴ of the pulse.
const STEPS: usize = 64;
/// Table steps per pulse, which lasts two widths.
const PULSE: usize = 2 * STEPS;

/// Homogeneous air, the same for every beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Medium {
    /// α, extinction of clear air and weather together, 1/m.
    pub(crate) extinction_per_m: f64,
    /// β, 1/(m·sr).
    pub(crate) backscatter_per_m_sr: f64,
    /// Range at which it begins, m; nearer, particles are met one by one.
    pub(crate) from_m: f64,
}

/// Response of a medium to a pulse, in the scanner's unit: received power over `P0 η A_r`, 1/m².
///
/// ```text
/// S(t) = ∫ β · ξ(R) · e^(−2αR) / R² · p(t − 2R/c) dR   over R up to the surface that ends it
///      = ½ (G0 − cos ωt · Gc − sin ωt · Gs),                   ω = π/W
/// G·   = ∫ g(u) · {1, cos ωu, sin ωu} du                 u from t − 2W to the surface's 2R/c or t
/// g    = (c/2) β ξ e^(−2αR) / R²
/// ```
///
/// For a hard target, ρ cosθ/π takes the place of β dR. The integrals are cumulative sums, so a
/// surface in the beam costs one more pulse length of samples. One table serves all beams of a
/// setting.
#[derive(Clone, Debug, Default)]
pub(crate) struct BackscatterResponse {
    key: Option<(Medium, [f64; 2])>,
    /// Time between entries, ns; entry j is for j steps after the pulse begins.
    step_ns: f64,
    /// G0, Gc and Gs from 0 to each entry's time.
    integrals: Vec<[f64; 3]>,
    /// S of a beam that meets no surface.
    open: Vec<f32>,
}

impl BackscatterResponse {
    /// Extends the table to the end of the window, or rebuilds it for new settings.
    pub(crate) fn prepare(&mut self, medium: Medium, analog: &Analog, samples: usize) {
        let end_ns = analog.delay_ns + samples as f64 * analog.sample_period_ns;
        let key = Some((medium, [analog.pulse_width_ns, analog.overlap_m]));
        if self.key != key {
            self.key = key;
            self.step_ns = analog.pulse_width_ns / STEPS as f64;
            self.integrals.clear();
            self.open.clear();
        }
        let entries = (end_ns / self.step_ns).max(0.0) as usize + 3;
        if self.open.len() < entries {
            self.extend(medium, analog, entries + PULSE);
        }
    }

    /// Extends the table to `entries`, by the trapezoidal rule.
    fn extend(&mut self, medium: Medium, analog: &Analog, entries: usize) {
        let step = self.step_ns;
        let density = |j: usize| {
            let g = medium.density(j as f64 * step, analog);
            let (sin, cos) = sin_cos(j);
            [g, g * cos, g * sin]
        };
        self.integrals.reserve(entries);
        let mut sum = self.integrals.last().copied().unwrap_or([0.0; 3]);
        let mut previous = density(self.integrals.len().saturating_sub(1));
        for j in self.integrals.len()..entries {
            let next = density(j);
            if j > 0 {
                sum = std::array::from_fn(|i| sum[i] + 0.5 * step * (previous[i] + next[i]));
            }
            self.integrals.push(sum);
            previous = next;
        }
        for j in self.open.len()..entries {
            let from = j.saturating_sub(PULSE);
            self.open.push(
                combine(difference(self.integrals[j], self.integrals[from]), sin_cos(j)) as f32,
            );
        }
    }

    /// Adds `unit` times the response of a beam that its returns block.
    pub(crate) fn add(&self, analog: &Analog, returns: &[Return], unit: f32, signal: &mut [f32]) {
        let shares = Shares::new(returns);
        let first_ns = analog.delay_ns;
        let sample_at =
            |ns: f64| ((ns - first_ns) / analog.sample_period_ns).ceil().max(0.0) as usize;
        let mut begin = 0;
        for (range_m, open) in shares.steps() {
            let end = sample_at(2.0 * range_m / SPEED_OF_LIGHT_M_NS).clamp(begin, signal.len());
            self.add_open(analog, begin..end, unit * open as f32, signal);
            begin = end;
        }
        self.add_open(analog, begin..signal.len(), unit * shares.beyond() as f32, signal);
        for (range_m, share) in shares.taken() {
            self.add_last(analog, 2.0 * range_m / SPEED_OF_LIGHT_M_NS, unit * share as f32, signal);
        }
    }

    /// Adds the response of an unblocked beam to the samples of `span`.
    fn add_open(
        &self,
        analog: &Analog,
        span: std::ops::Range<usize>,
        unit: f32,
        signal: &mut [f32],
    ) {
        if unit == 0.0 {
            return;
        }
        let per_step = 1.0 / self.step_ns;
        let first = span.start;
        for (n, sample) in signal.get_mut(span).unwrap_or_default().iter_mut().enumerate() {
            let at = (analog.delay_ns + (first + n) as f64 * analog.sample_period_ns) * per_step;
            if at < 0.0 {
                continue;
            }
            let (j, part) = (at as usize, (at - at.floor()) as f32);
            let [Some(&a), Some(&b)] = [self.open.get(j), self.open.get(j + 1)] else { return };
            *sample += unit * (a + (b - a) * part);
        }
    }

    /// Adds the backscatter that still arrives after a surface's own echo has begun.
    fn add_last(&self, analog: &Analog, surface_ns: f64, unit: f32, signal: &mut [f32]) {
        let width = analog.pulse_width_ns;
        let upto = self.integral(surface_ns);
        let first = ((surface_ns - analog.delay_ns) / analog.sample_period_ns).ceil().max(0.0);
        for (n, sample) in signal.iter_mut().enumerate().skip(first as usize) {
            let t = analog.delay_ns + n as f64 * analog.sample_period_ns;
            if t >= surface_ns + 2.0 * width {
                return;
            }
            let (sin, cos) = (libm::sin(PI * t / width), libm::cos(PI * t / width));
            *sample +=
                unit * combine(difference(upto, self.integral(t - 2.0 * width)), (sin, cos)) as f32;
        }
    }

    /// Cumulative integrals up to a time, by linear interpolation.
    fn integral(&self, at_ns: f64) -> [f64; 3] {
        let at = (at_ns / self.step_ns).max(0.0);
        let (j, part) = (at as usize, at - at.floor());
        let entry =
            |j: usize| self.integrals.get(j).or(self.integrals.last()).copied().unwrap_or([0.0; 3]);
        let (a, b) = (entry(j), entry(j + 1));
        std::array::from_fn(|i| a[i] + (b[i] - a[i]) * part)
    }
}

impl Medium {
    /// g(u), 1/(m²·ns), at a round-trip time u.
    fn density(&self, round_trip_ns: f64, analog: &Analog) -> f64 {
        let range_m = 0.5 * SPEED_OF_LIGHT_M_NS * round_trip_ns;
        let overlap = analog.overlap(range_m);
        if overlap <= 0.0 || range_m < self.from_m {
            return 0.0;
        }
        let through_air = libm::exp(-2.0 * self.extinction_per_m * range_m);
        0.5 * SPEED_OF_LIGHT_M_NS * self.backscatter_per_m_sr * overlap * through_air
            / (range_m * range_m)
    }
}

/// Sine and cosine of ω·j·step.
fn sin_cos(j: usize) -> (f64, f64) {
    let phase = PI * (j % PULSE) as f64 / STEPS as f64;
    (libm::sin(phase), libm::cos(phase))
}

/// S from G0, Gc and Gs.
fn combine([plain, cosine, sine]: [f64; 3], (sin, cos): (f64, f64)) -> f64 {
    (0.5 * (plain - cos * cosine - sin * sine)).max(0.0)
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOG: Medium =
        Medium { extinction_per_m: 0.06, backscatter_per_m_sr: 9.2e-4, from_m: 0.0 };
    const ANALOG: Analog = Analog { delay_ns: 3.3, ..Analog::USUAL };

    /// S(t) by its definition, with the midpoint rule.
    fn by_definition(t_ns: f64, end_m: f64) -> f64 {
        const SLICES: usize = 200_000;
        let reach_ns = t_ns.min(2.0 * end_m / SPEED_OF_LIGHT_M_NS);
        let from_ns = (t_ns - 10.0).max(0.0);
        let step = (reach_ns - from_ns) / SLICES as f64;
        if step <= 0.0 {
            return 0.0;
        }
        let slice = |k: usize| {
            let u = from_ns + (k as f64 + 0.5) * step;
            FOG.density(u, &ANALOG) * libm::sin(PI * (t_ns - u) / 10.0).powi(2) * step
        };
        (0..SLICES).map(slice).sum()
    }

    fn response(returns: &[Return]) -> Vec<f32> {
        let mut backscatter = BackscatterResponse::default();
        backscatter.prepare(FOG, &ANALOG, 400);
        let mut signal = vec![0.0; 400];
        backscatter.add(&ANALOG, returns, 1.0, &mut signal);
        signal
    }

    #[test]
    fn the_table_is_the_integral() {
        let signal = response(&[]);
        let peak = signal.iter().copied().fold(0.0, f32::max);
        for n in [4, 6, 8, 10, 12, 20, 60, 200, 399] {
            let expected = by_definition(3.3 + n as f64, 1e9);
            let error = (f64::from(signal[n]) - expected).abs();
            assert!(error < 3e-4 * f64::from(peak), "sample {n}: {} against {expected}", signal[n]);
            assert!(
                n < 12 || error < 2e-3 * expected,
                "sample {n}: {} against {expected}",
                signal[n]
            );
        }
    }

    #[test]
    fn the_air_behind_a_surface_returns_nothing() {
        let wall = Return { range_m: 9.0, strength_per_m2: 1e-3 };
        let (open, ended) = (response(&[]), response(&[wall]));
        let wall_ns = 2.0 * 9.0 / SPEED_OF_LIGHT_M_NS;
        for (n, (&open, &ended)) in open.iter().zip(&ended).enumerate() {
            let t = 3.3 + n as f64;
            if t <= wall_ns {
                assert_eq!(open, ended, "sample {n}: the wall has no effect yet");
            } else if t > wall_ns + 10.0 {
                assert_eq!(ended, 0.0, "sample {n}");
            } else {
                let expected = by_definition(t, 9.0) as f32;
                assert!(
                    (ended - expected).abs() < 2e-3 * open,
                    "sample {n}: {ended} against {expected}"
                );
            }
        }
    }

    #[test]
    fn a_beam_split_in_halves_returns_the_mean_of_both() {
        let pair = [9.0_f32, 18.0]
            .map(|range_m| Return { range_m, strength_per_m2: 0.01 / (range_m * range_m) });
        let (both, near, far) = (response(&pair), response(&pair[..1]), response(&pair[1..]));
        for n in 0..400 {
            let expected = 0.5 * (near[n] + far[n]);
            assert!((both[n] - expected).abs() <= 1e-6 * expected.max(1e-9), "sample {n}");
        }
    }

    #[test]
    fn a_longer_window_extends_the_table_without_changing_it() {
        let mut backscatter = BackscatterResponse::default();
        backscatter.prepare(FOG, &ANALOG, 100);
        backscatter.prepare(FOG, &ANALOG, 400);
        let mut signal = vec![0.0; 400];
        backscatter.add(&ANALOG, &[], 1.0, &mut signal);
        assert_eq!(signal, response(&[]));
    }
}
