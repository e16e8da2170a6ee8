//! Constants of the timing methods: effect of the noise on the time of an echo, and bias of each
//! method.

use crate::limits::MAX_TAPS;
use crate::settings::choice::TimingMethod;
use crate::stages::lagrange::interpolation;
use crate::stages::template::Template;

/// Constants of the timing stage, derived once with the settings.
///
/// ```text
/// r(t) = Σ h[k] p(t − k)                   an echo of height 1 after the filter, t from its middle
/// top:  d[k] = Σ_t ℓ[t] (h[k+t] − h[k−t])·o/2          effect of noise on the slope there
///       slope = (2 r(0) − r(1/o) − r(−1/o)) o² / (1 − β)
/// CFD:  d[k] = h(k − z) − h(k)/2           effect of noise on the crossing and the fraction
///       slope = r(z − ½) − r(z + ½)
/// gain = √Σ d² / slope                     σ of the time over σ/A of a sample, in samples
/// q    = Σ d² p / Σ d²                     share of the top's shot noise that shifts the time
/// β    = 16/3 (δ̂ − δ) at δ = ¼             bias of a parabola: δ̂ − δ ≈ β δ̂ (1 − 4δ̂²)
/// w    = 1.2 · the width of r at half its height
/// z    = half of that width (CFD), or W f_s + K (rising edge: where the filtered pulse begins)
/// ```
///
/// ℓ interpolates at 1/o; h is linear between taps.
///
/// | name | format |
/// |---|---|
/// | `gain` | Q16.16 samples, nearest, saturating |
/// | `q`, `β` | Q1.15, nearest |
/// | `w`, `z` | Q16.16 samples, nearest |
///
/// Computed in `f32`: `q` and `z` are within 10⁻⁴; a top's slope and `β` within 10⁻⁶ (o W f_s)².
/// Derived in `benches/record/detector.md`, What noise does to the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Timing {
    /// Gain: σ of the time of an unclipped echo over σ/A of a sample, Q16.16 samples.
    pub gain: u32,
    /// q, share of the top's shot noise that shifts the time, Q1.15.
    pub shot_share: u32,
    /// β, Q1.15.
    pub bias: i32,
    /// z, from an edge's crossing to the middle of the echo, Q16.16 samples.
    pub offset: i64,
    /// w, width at half height from which an echo may hide others, Q16.16 samples.
    pub broad: i64,
}

impl Timing {
    /// Constants for a filter, a pulse width in samples, an upsampling ratio and a method.
    pub fn new(
        template: &Template,
        samples_per_width: f32,
        upsampling_log2: u32,
        method: TimingMethod,
    ) -> Self {
        let filtered = Filtered { template, width: samples_per_width };
        let log2 = upsampling_log2.min(3);
        let ratio = (1u32 << log2) as f32;
        let step = 1.0 / ratio;
        let (fall, bend) = filtered.differences(-0.25 * step, step);
        let bias = 16.0 / 3.0 * (0.5 * fall / bend - 0.25);
        let offset = filtered.offset(method);
        let slope = match method {
            TimingMethod::ConstantFraction => filtered.at(offset - 0.5) - filtered.at(offset + 0.5),
            _ => -filtered.differences(0.0, step).1 * ratio * ratio / (1.0 - bias),
        };
        let (noise, shot) = match method {
            TimingMethod::ConstantFraction => {
                filtered.share(|k| filtered.tap(k - offset) - 0.5 * filtered.tap(k))
            }
            _ => filtered.share(|k| filtered.slope_between(k, log2) * ratio),
        };
        let gain = libm::sqrtf(noise) / slope.max(1e-6);
        Self {
            gain: nearest(gain * 65536.0),
            shot_share: nearest(shot / noise.max(1e-12) * 32768.0),
            bias: libm::roundf(bias * 32768.0) as i32,
            offset: i64::from(nearest(65536.0 * offset)),
            broad: i64::from(nearest(65536.0 * 2.4 * filtered.half_width())),
        }
    }
}

/// Nearest integer: `as` saturates, and NaN is 0.
fn nearest(value: f32) -> u32 {
    libm::roundf(value) as u32
}

/// Echo after the filter.
struct Filtered<'a> {
    template: &'a Template,
    /// W f_s.
    width: f32,
}

impl Filtered<'_> {
    /// Pulse at `u` samples from its middle.
    fn pulse(&self, u: f32) -> f32 {
        let inside = libm::fabsf(u) < self.width;
        if inside { 0.5 + 0.5 * libm::cosf(core::f32::consts::PI * u / self.width) } else { 0.0 }
    }

    /// Distances of the taps from the middle, and the taps.
    fn taps(&self) -> impl Iterator<Item = (f32, f32)> {
        let half = self.template.half() as f32;
        let tap = |h: i16| f32::from(h) / 32768.0;
        self.template.taps().iter().enumerate().map(move |(i, &h)| (i as f32 - half, tap(h)))
    }

    /// r(t).
    fn at(&self, t: f32) -> f32 {
        self.taps().map(|(k, h)| h * self.pulse(t - k)).sum()
    }

    /// `r(t − s) − r(t + s)` and `r(t − s) − 2 r(t) + r(t + s)`, by products of sines: near the top
    /// the values of r differ in the last digits of `f32` only.
    fn differences(&self, t: f32, s: f32) -> (f32, f32) {
        let turn = core::f32::consts::PI / self.width;
        let (sine, half) = (libm::sinf(turn * s), libm::sinf(0.5 * turn * s));
        self.taps().fold((0.0, 0.0), |(first, second), (k, h)| {
            let u = t - k;
            let (fall, bend) = if libm::fabsf(u) + s < self.width {
                (libm::sinf(turn * u) * sine, -2.0 * libm::cosf(turn * u) * half * half)
            } else {
                let (before, here, after) = (self.pulse(u - s), self.pulse(u), self.pulse(u + s));
                (before - after, before - 2.0 * here + after)
            };
            (first + h * fall, second + h * bend)
        })
    }

    /// h at any place, linear between taps, 0 beyond them.
    fn tap(&self, k: f32) -> f32 {
        let place = k + self.template.half() as f32;
        let whole = libm::floorf(place);
        let tap = |place: f32| {
            let index = if place >= 0.0 { place as usize } else { usize::MAX };
            f32::from(self.template.taps().get(index).copied().unwrap_or(0)) / 32768.0
        };
        tap(whole) + (place - whole) * (tap(whole + 1.0) - tap(whole))
    }

    /// Half of the rise of `h` from k − 1/o to k + 1/o, interpolated as in the stage.
    fn slope_between(&self, k: f32, log2: u32) -> f32 {
        let rise = |t: f32| 0.5 * (self.tap(k + t) - self.tap(k - t));
        match interpolation(1, log2) {
            Some(weights) => (-3i8..)
                .zip(weights)
                .map(|(t, &w)| rise(f32::from(t)) * f32::from(w) / 32768.0)
                .sum(),
            None => rise(1.0),
        }
    }

    /// Σ d² and Σ d² p.
    fn share(&self, d: impl Fn(f32) -> f32) -> (f32, f32) {
        const REACH: i32 = 2 * MAX_TAPS as i32;
        (-REACH..=REACH).map(|k| k as f32).fold((0.0, 0.0), |(noise, shot), k| {
            let square = d(k) * d(k);
            (noise + square, shot + square * self.pulse(k))
        })
    }

    /// z.
    fn offset(&self, method: TimingMethod) -> f32 {
        match method {
            TimingMethod::RisingEdge => self.width + self.template.half() as f32,
            TimingMethod::ConstantFraction => self.half_width(),
            TimingMethod::Parabola | TimingMethod::WalkCorrected => 0.0,
        }
    }

    /// Half the width of r at half its height, by bisection.
    fn half_width(&self) -> f32 {
        let half = 0.5 * self.at(0.0);
        let (mut inside, mut outside) = (0.0, 2.0 * self.width);
        for _ in 0..24 {
            let middle = 0.5 * (inside + outside);
            if self.at(middle) > half { inside = middle } else { outside = middle }
        }
        outside
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::choice::DenoiseFilter;

    const PERIODS_FS: [u32; 4] = [2_000_000, 992_354, 500_000, 330_780];

    fn timing(
        filter: DenoiseFilter,
        period_fs: u32,
        upsampling_log2: u32,
        method: TimingMethod,
    ) -> Timing {
        let template = Template::new(filter, 5_000, period_fs);
        Timing::new(&template, 5e6 / period_fs as f32, upsampling_log2, method)
    }

    #[test]
    fn the_matched_filter_s_time_is_as_sharp_as_the_bound_allows() {
        for period_fs in PERIODS_FS {
            let width = 5e6 / f64::from(period_fs);
            let bound = core::f64::consts::FRAC_2_PI * width.sqrt();
            let gain = f64::from(
                timing(DenoiseFilter::Matched, period_fs, 0, TimingMethod::Parabola).gain,
            ) / 65536.0;
            assert!((gain / bound - 1.0).abs() < 0.02, "{period_fs} fs: {gain} against {bound}");
        }
    }

    #[test]
    fn every_other_filter_s_time_is_less_sharp() {
        for period_fs in PERIODS_FS {
            let gain = |filter| timing(filter, period_fs, 0, TimingMethod::Parabola).gain;
            assert!(
                gain(DenoiseFilter::Matched) < gain(DenoiseFilter::Gaussian)
                    && gain(DenoiseFilter::Gaussian) < gain(DenoiseFilter::None)
            );
        }
    }

    #[test]
    fn half_of_the_shot_noise_shifts_the_time() {
        // ∫ sin²2φ sin²φ over ∫ sin²2φ
        let share = timing(DenoiseFilter::Matched, 500_000, 0, TimingMethod::Parabola).shot_share;
        assert!((f64::from(share) / 32768.0 - 0.5).abs() < 0.01, "{share}");
    }

    #[test]
    fn a_constant_fraction_of_the_bare_pulse_lies_half_a_width_from_its_middle() {
        for period_fs in PERIODS_FS {
            let offset = timing(DenoiseFilter::None, period_fs, 0, TimingMethod::ConstantFraction)
                .offset as f64
                / 65536.0;
            assert!(
                (offset - 2.5e6 / f64::from(period_fs)).abs() < 1e-3,
                "{period_fs} fs: {offset}"
            );
        }
    }
}
