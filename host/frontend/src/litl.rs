//! Compatibility mode: a front end in arbitrary units with photon noise, to compare with the
//! simulator of the paper.
//!
//! Written from the paper and from equations alone. It keeps that simulator's pulse, arbitrary
//! power, Poisson counts and saturation. It departs from it on purpose: ambient light does not grow
//! with range, counts are quantised at the converter, and every count has a seed.

use echoloop_random::{Stream, normals};

use crate::digitiser::ROUND;
use crate::exposure::{Exposure, ShotBuffers};
use crate::pulse::Pulse;

pub use crate::litl_units::*;

/// Mean from which counts are drawn from a corrected normal distribution; below, they are exact.
const MANY: f64 = 64.0;

/// Fills `codes` with the waveform of one shot in the compatibility mode; the background is in
/// units.
///
/// ```text
/// λ[n] = ambient + Σ P · K · (Σ_k w_k ρ_k cosθ_k ξ / R_k²) · e^(−2αR) · sin²(π(t − 2R/c) / 2W)
/// x[n] = clip( round( 2^b (min(G[n] Poisson(λ[n]), saturation)/saturation + black) ), 0, 2^b − 1 )
/// ```
pub(crate) fn synthesise(
    exposure: &Exposure<'_>,
    photons: Stream,
    buffers: &mut ShotBuffers,
    codes: &mut [u16],
) {
    let Exposure { receiver, analog, returns, background, key } = *exposure;
    let shot = buffers.begin(codes.len(), background);
    let (unit, pulse) = (units(analog.power_w), Pulse::new(analog));
    for echo in returns {
        let range_m = f64::from(echo.range_m);
        let peak = unit * f64::from(echo.strength_per_m2) * receiver.through_air(range_m);
        shot.lit.push(pulse.add(range_m, peak * analog.overlap(range_m), shot.signal_ua));
    }
    normals(key, shot.normal);
    let full_scale = f64::from(1u32 << receiver.adc_bits);
    let (full, near) = (libm::pow(10.0, analog.gain_db / 20.0), analog.near_samples());
    let samples = codes.iter_mut().zip(&*shot.signal_ua).zip(&*shot.normal);
    for (n, ((code, &signal), &z)) in samples.enumerate() {
        let count = poisson(NOISE_FLOOR + f64::from(signal), z.into(), photons.uniform(n as u64));
        let gain = if n < near { analog.gain_at(n) } else { full };
        let signal = (gain * count).min(SATURATION) / SATURATION;
        let level = full_scale * (signal + analog.black_level);
        *code = (level.min(full_scale - 1.0) as f32 + ROUND).to_bits() as u16;
    }
    shot.end();
}

/// Poisson count of this mean: by inverting the distribution function at a uniform number, or for
/// large means from a normal number, `λ + √λ z + (z² − 1)/6` (Cornish and Fisher), which has the
/// right mean and skewness, and the right variance to 0.06.
fn poisson(mean: f64, normal: f64, uniform: f64) -> f64 {
    if mean >= MANY {
        return (mean + mean.sqrt() * normal + (normal * normal - 1.0) / 6.0).round().max(0.0);
    }
    let (mut count, mut mass) = (0.0, libm::exp(-mean));
    let mut below = mass;
    // At 2.5 MANY, more than ten σ beyond the mean, the sum is 1 to the last bit.
    while uniform > below && count < 2.5 * MANY {
        count += 1.0;
        mass *= mean / count;
        below += mass;
    }
    count
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::board::{Analog, Trigger};
    use crate::light::Return;
    use crate::mode::Mode;
    use crate::noise::{Purpose, noise_key};
    use crate::receiver::Receiver;

    const ANALOG: Analog = Analog { sample_period_ns: 0.331, delay_ns: 5.0, ..Analog::USUAL };
    const SHOTS: u32 = 4_000;

    /// Mean and variance of every sample, in units.
    fn statistics(analog: &Analog, returns: &[Return]) -> Vec<(f64, f64)> {
        let receiver = Receiver { mode: Mode::LitlCompat, adc_bits: 14, ..Receiver::default() };
        let mut sums = vec![(0.0, 0.0); 300];
        let (mut buffers, mut codes) = (ShotBuffers::default(), vec![0; 300]);
        for beam in 0..SHOTS {
            let trigger = Trigger { frame: 0, beam, shot: 0 };
            let photons = Purpose::Photons.for_shot(3, trigger);
            let key = noise_key(3, trigger);
            let exposure = Exposure { receiver: &receiver, analog, returns, background: &[], key };
            synthesise(&exposure, photons, &mut buffers, &mut codes);
            for (sum, &code) in sums.iter_mut().zip(&codes) {
                let units = f64::from(code) * SATURATION / 16_384.0;
                *sum = (sum.0 + units, sum.1 + units * units);
            }
        }
        let n = f64::from(SHOTS);
        sums.into_iter()
            .map(|(sum, squares)| (sum / n, (squares - sum * sum / n) / (n - 1.0)))
            .collect()
    }

    fn wall(range_m: f64, rho: f64) -> Return {
        Return { range_m: range_m as f32, strength_per_m2: (rho / PI / range_m / range_m) as f32 }
    }

    #[test]
    fn an_echo_is_the_squared_sine_of_the_preset_s_height() {
        for (range_m, rho) in [(8.0, 0.2), (10.0, 0.02)] {
            let peak = POWER * SCALE_M2 * rho / (range_m * range_m);
            let begin = 2.0 * range_m / 0.299_792_458 - 5.0;
            for (n, (mean, _)) in statistics(&ANALOG, &[wall(range_m, rho)]).into_iter().enumerate()
            {
                let t = n as f64 * 0.331 - begin;
                let pulse =
                    if (0.0..10.0).contains(&t) { (PI * t / 10.0).sin().powi(2) } else { 0.0 };
                let expected = NOISE_FLOOR + peak * pulse;
                let confidence = 4.5 * (expected / f64::from(SHOTS)).sqrt();
                assert!(
                    (mean - expected).abs() < confidence + 0.01,
                    "sample {n}: {mean} against {expected}"
                );
            }
        }
    }

    #[test]
    fn the_variance_of_a_count_is_its_mean() {
        for rho in [0.0, 0.01, 0.1, 0.2] {
            for (n, (mean, variance)) in
                statistics(&ANALOG, &[wall(8.0, rho)]).into_iter().enumerate()
            {
                // The sample variance of N counts errs by √(2/N + 1/(λN)).
                let n_shots = f64::from(SHOTS);
                let confidence = 4.5 * (2.0 / n_shots + 1.0 / (mean * n_shots)).sqrt();
                let rounding = 0.15 / mean; // 1/12 for whole counts, 2/36 for the correction
                let ratio = variance / mean;
                assert!(
                    (ratio - 1.0).abs() < confidence + rounding,
                    "ρ {rho}, sample {n}: {ratio} at {mean}"
                );
            }
        }
    }

    #[test]
    fn every_value_of_a_small_count_has_its_poisson_probability() {
        for mean in [0.3, 1.0, 7.5, 63.9] {
            let stream = Purpose::Photons.for_number(1, 0);
            let mut seen = vec![0_u32; 200];
            for i in 0..100_000 {
                seen[poisson(mean, 0.0, stream.uniform(i)) as usize] += 1;
            }
            let mut probability = libm::exp(-mean);
            for (count, &seen) in seen.iter().enumerate() {
                let expected = 1e5 * probability;
                assert!(
                    (f64::from(seen) - expected).abs() < 5.0 * expected.sqrt() + 5.0,
                    "{count} at {mean}: {seen}"
                );
                probability *= mean / (count as f64 + 1.0);
            }
        }
    }

    #[test]
    fn strong_echoes_saturate_at_the_preset() {
        for rho in [0.5, 5.0, 50.0] {
            let statistics = statistics(&ANALOG, &[wall(5.0, rho)]);
            let highest = statistics.iter().map(|s| s.0).fold(0.0, f64::max);
            assert!((highest - SATURATION).abs() < 0.1, "ρ {rho}: {highest}");
        }
    }

    #[test]
    fn power_and_gain_scale_the_light_and_the_counts() {
        let at = |analog: Analog| {
            let all = statistics(&analog, &[wall(10.0, 0.05)]);
            all.iter().map(|s| s.0).fold(0.0, f64::max)
        };
        let base = at(ANALOG) - 1.0;
        let half = at(Analog { power_w: 37.5, ..ANALOG }) - 1.0;
        let twice = at(Analog { gain_db: 6.0206, ..ANALOG }) - 2.0;
        assert!(
            (half / base - 0.5).abs() < 0.01 && (twice / base - 2.0).abs() < 0.02,
            "{base} {half} {twice}"
        );
    }
}
