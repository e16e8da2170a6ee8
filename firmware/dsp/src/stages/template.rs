//! Taps of the denoise filter.

use heapless::Vec;
use micromath::F32Ext;

use crate::limits::MAX_TAPS;
use crate::q::shift_round;
use crate::settings::choice::DenoiseFilter;

/// Symmetric filter, with its gains for amplitudes and noise.
///
/// ```text
/// p(t) = sin²(πt / 2τ) = (1 + cos(π u / τ)) / 2,   u = t − τ,  |u| < τ = W      the emitted pulse
/// s(t) = p(t)                matched: the pulse itself
///      = 2^(−16 (t/W)²)      Gaussian: half as wide as the pulse
///      = 1 at 0, else 0      none
/// h[k] = ⌊ 32767 · s(k/f_s) / Σ s ⌋               k = −K..K, so Σ|h| ≤ 1 in Q1.15; K = 0 for none
/// g    = Σ h p        height of a filtered echo over its amplitude
/// r    = √Σh²         σ of filtered white noise over σ
/// ```
///
/// | name | format | shape |
/// |---|---|---|
/// | `h` | Q1.15 | `[2K + 1]`, at most [`MAX_TAPS`], centre at K |
/// | `g` | Q1.15, rounded down, at least ¼ | scalar |
/// | `1/g` | Q2.14, rounded down, of the `g` in Q1.15 | scalar |
/// | `r` | Q1.15, rounded down, of the `h` in Q1.15 | scalar |
///
/// An amplitude is `height · 1/g`, nearest. The cosine is micromath's (error below 1.1 × 10⁻³), in
/// `f32` without fused multiply-add: the same taps on every machine. (It is called as
/// `F32Ext::cos`: where std is in the build, `x.cos()` would silently be std's.) One half is
/// computed and mirrored: the taps are symmetric to the bit, so a symmetric echo has no bias in
/// time.
#[derive(Clone, Debug)]
pub struct Template {
    /// Taps and one zero.
    taps: Vec<i16, { MAX_TAPS + 1 }>,
    /// g: height of a filtered echo over its amplitude, Q1.15.
    pub peak_gain: u16,
    inverse_gain: u16,
    /// r: σ of filtered white noise over σ, Q1.15.
    pub noise_gain: u16,
}

impl Template {
    /// Matched filter: the sin² pulse of a full width at half maximum, sampled with a period. A
    /// pulse that needs more than [`MAX_TAPS`] taps is cut; no accepted setting needs more.
    pub fn sin_squared(width_ps: u32, sample_period_fs: u32) -> Self {
        let width = samples_per_width(width_ps, sample_period_fs);
        Self::sampled(width, half_length(width), |k| pulse(k, width))
    }

    /// Chosen filter for the pulse.
    pub fn new(filter: DenoiseFilter, width_ps: u32, sample_period_fs: u32) -> Self {
        let width = samples_per_width(width_ps, sample_period_fs);
        match filter {
            DenoiseFilter::None => Self::sampled(width, 0, |_| 1.0),
            DenoiseFilter::Gaussian => Self::sampled(width, half_length(width), |k| {
                let t = k as f32 / width;
                libm::exp2f(-16.0 * t * t)
            }),
            DenoiseFilter::Matched => Self::sin_squared(width_ps, sample_period_fs),
        }
    }

    /// Taps from `shape` at −half..=half samples from its middle, scaled to add up to 1.
    #[expect(clippy::arithmetic_side_effects, reason = "half is at most half of MAX_TAPS")]
    fn sampled(width: f32, half: usize, shape: impl Fn(usize) -> f32) -> Self {
        let mut sum = shape(0);
        for k in 1..=half {
            sum += 2.0 * shape(k);
        }
        // Towards zero: the sum stays within 1.
        let tap = |k: usize| (32767.0 * shape(k) / sum) as i16;
        let distances = (0..2 * half + 1).map(|i| i.abs_diff(half));
        let mut taps = Vec::new();
        for k in distances.clone() {
            let _ = taps.push(tap(k)); // half is bounded by MAX_TAPS: never full
        }
        let _ = taps.push(0);
        let height: f32 = distances.map(|k| f32::from(tap(k)) * pulse(k, width)).sum();
        Self::from_taps(taps, height as u32)
    }

    /// Any symmetric taps; `height` is Σ h p in Q1.15.
    #[expect(clippy::arithmetic_side_effects, reason = "the divisor, g, is at least ¼")]
    fn from_taps(taps: Vec<i16, { MAX_TAPS + 1 }>, height: u32) -> Self {
        let peak_gain = height.clamp(1 << 13, 0x7fff) as u16;
        let energy: u64 = taps.iter().map(|&h| u64::from(h.unsigned_abs()).pow(2)).sum();
        Self {
            peak_gain,
            inverse_gain: ((1 << 29) / u32::from(peak_gain)).min(0xffff) as u16,
            noise_gain: energy.isqrt() as u16,
            taps,
        }
    }

    /// Taps, Q1.15, centre in the middle.
    pub fn taps(&self) -> &[i16] {
        self.taps.split_last().map_or(&[], |(_, taps)| taps)
    }

    /// Taps and one zero, so that they can be read in pairs.
    pub fn taps_in_pairs(&self) -> &[i16] {
        &self.taps
    }

    /// Number of taps on either side of the centre.
    pub fn half(&self) -> usize {
        self.taps().len() / 2
    }

    /// Amplitude whose filtered height is `height`, both Q1.15: `round(height / g)`.
    #[expect(clippy::arithmetic_side_effects, reason = "2³¹ · 2¹⁶ is below 2⁶²")]
    pub fn amplitude(&self, height: i32) -> i64 {
        shift_round(i64::from(height) * i64::from(self.inverse_gain), 14)
    }
}

/// Pulse width in samples, W f_s.
pub fn samples_per_width(width_ps: u32, sample_period_fs: u32) -> f32 {
    width_ps as f32 * 1000.0 / sample_period_fs as f32
}

/// Pulse at `k` samples from its middle, |k| ≤ [`half_length`].
fn pulse(k: usize, width: f32) -> f32 {
    0.5 + 0.5 * F32Ext::cos(core::f32::consts::PI * k as f32 / width)
}

/// K: last sample strictly inside the pulse, counted from its middle.
pub fn half_length(samples_per_width: f32) -> usize {
    let end = F32Ext::ceil(samples_per_width) as i32;
    end.saturating_sub(1).clamp(0, (MAX_TAPS / 2) as i32) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_are_symmetric_positive_and_add_up_to_at_most_one() {
        for width_ps in (2_000..=20_000).step_by(377) {
            for period_fs in [330_780, 500_000, 992_354, 800_000] {
                let template = Template::sin_squared(width_ps, period_fs);
                let taps = template.taps();
                assert!(taps.iter().eq(taps.iter().rev()));
                let sum: i32 = taps.iter().map(|&h| i32::from(h)).sum();
                assert!(sum <= 0x7fff && sum > 0x7fff - taps.len() as i32, "{width_ps} ps: {sum}");
            }
        }
    }

    #[test]
    fn a_well_sampled_pulse_keeps_three_quarters_of_its_height() {
        let template = Template::sin_squared(5_000, 330_780);
        assert!((f64::from(template.peak_gain) / 32768.0 - 0.75).abs() < 2e-3);
    }
}
