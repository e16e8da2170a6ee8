//! Single drops and flakes near the sensor.

use echoloop_random::Stream;

use crate::light::Return;
use crate::shares::Shares;
use crate::weather::Air;

/// Mean number of particles in [`CELL_M`] of beam above which the air is a continuous medium.
const CROWD: f64 = 4.0;
/// Length of that cell, m: the default pulse's, c·5 ns/2. With the length of the pulse that is set,
/// every candidate of an optimiser would meet other drops.
const CELL_M: f64 = 0.75;
/// Range beyond which the air is a continuous medium in any case, m.
const FARTHEST_M: f64 = 60.0;

/// The near part of a beam, in which particles are met one by one.
///
/// ```text
/// number   Poisson of n·θ_az·θ_el·R³/3 within range R, up to where n·θ_az·θ_el·R²·0.75 m = 4
/// strength σ_b / (θ_az·θ_el·R²) / R²,   σ_b = (β/n)·x²/2,  x exponential (diameters are)
/// ```
///
/// σ_b is the backscatter of a particle, m²/sr; its mean is β/n, so that particles return as much
/// as the medium would. No particle returns more than one that fills the beam. Particles behind a
/// surface return nothing; all shots of a beam in a scan meet the same particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hydrometeors {
    air: Air,
    /// θ_az·θ_el.
    solid_angle_sr: f64,
    /// Range at which the continuous medium begins, m.
    pub(crate) reach_m: f64,
}

impl Hydrometeors {
    /// Particles of this air in a beam of this divergence.
    pub(crate) fn new(air: Air, divergence_mrad: [f64; 2]) -> Self {
        let solid_angle_sr = divergence_mrad[0] * divergence_mrad[1] * 1e-6;
        let per_m3 = air.particles_per_m3 * solid_angle_sr;
        let reach_m =
            if per_m3 > 0.0 { (CROWD / (CELL_M * per_m3)).sqrt().min(FARTHEST_M) } else { 0.0 };
        Self { air, solid_angle_sr, reach_m }
    }

    /// Appends the particles of one beam that no surface hides, nearest first.
    pub(crate) fn add(&self, stream: Stream, returns: &mut Vec<Return>) {
        let per_m3 = self.air.particles_per_m3 * self.solid_angle_sr / 3.0;
        if self.reach_m == 0.0 {
            return;
        }
        let surfaces = returns.len();
        let mut volume = 0.0; // times n: a Poisson process of rate 1
        for index in (0..).step_by(4) {
            volume += stream.exponential(index);
            let range_m = libm::cbrt(volume / per_m3);
            if range_m >= self.reach_m {
                return;
            }
            let open = Shares::new(&returns[..surfaces]).open_at(range_m);
            if stream.uniform(index + 1) < open {
                let strength_per_m2 =
                    self.strength_per_m2(range_m, stream.exponential(index + 2)) as f32;
                returns.push(Return { range_m: range_m as f32, strength_per_m2 });
            }
        }
    }

    fn strength_per_m2(&self, range_m: f64, diameter: f64) -> f64 {
        let mean_m2_sr = self.air.backscatter_per_m_sr / self.air.particles_per_m3;
        let footprint_m2 = self.solid_angle_sr * range_m * range_m;
        // Extinction is twice the shadow, and the shadow is at most the footprint.
        let most_per_sr = 2.0 / self.air.lidar_ratio_sr();
        let per_sr = (mean_m2_sr * diameter * diameter / 2.0 / footprint_m2).min(most_per_sr);
        per_sr / (range_m * range_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Purpose;
    use crate::weather::{Precipitation, Weather};

    const BEAMS: u64 = 20_000;

    fn rain(rate_mm_h: f64) -> Hydrometeors {
        let weather = Weather { kind: Precipitation::Rain, rate_mm_h, ..Weather::default() };
        Hydrometeors::new(weather.air(905.0), [3.0, 1.5])
    }

    fn drops(rain: &Hydrometeors, beam: u64, surfaces: &[Return]) -> Vec<Return> {
        let mut returns = surfaces.to_vec();
        rain.add(Purpose::Hydrometeors.for_number(5, beam), &mut returns);
        returns.split_off(surfaces.len())
    }

    #[test]
    fn the_number_of_particles_follows_from_their_density() {
        for rate_mm_h in [2.0, 10.0, 50.0] {
            let rain = rain(rate_mm_h);
            let expected =
                rain.air.particles_per_m3 * rain.solid_angle_sr * rain.reach_m.powi(3) / 3.0;
            let counts: usize = (0..2_000).map(|beam| drops(&rain, beam, &[]).len()).sum();
            let mean = counts as f64 / 2_000.0;
            let confidence = 4.0 * (expected / 2_000.0).sqrt();
            assert!(
                (mean - expected).abs() < confidence,
                "{rate_mm_h} mm/h: {mean} against {expected}"
            );
        }
    }

    #[test]
    fn particles_together_return_as_much_as_the_medium() {
        // Between 8 and 12 m, where no drop fills the beam: Σ strength·R² over beams is ∫ β dR.
        let rain = rain(10.0);
        let sum = |beam| -> f64 {
            let near = |r: &&Return| (8.0..12.0).contains(&r.range_m);
            let list = drops(&rain, beam, &[]);
            list.iter()
                .filter(near)
                .map(|r| f64::from(r.strength_per_m2) * f64::from(r.range_m).powi(2))
                .sum()
        };
        let mean = (0..BEAMS).map(sum).sum::<f64>() / BEAMS as f64;
        let expected = 4.0 * rain.air.backscatter_per_m_sr;
        // Per beam about 6.4 drops of relative variance 5: a standard error of 0.7 %.
        assert!((mean / expected - 1.0).abs() < 0.03, "{mean} against {expected}");
    }

    #[test]
    fn drops_behind_a_wall_return_nothing() {
        let wall = [Return { range_m: 7.0, strength_per_m2: 1e-3 }];
        let rain = rain(20.0);
        for beam in 0..200 {
            let (open, ended) = (drops(&rain, beam, &[]), drops(&rain, beam, &wall));
            let before: Vec<Return> = open.into_iter().filter(|r| r.range_m < 7.0).collect();
            assert_eq!(before, ended, "beam {beam}");
        }
    }

    #[test]
    fn no_drop_returns_more_than_a_beam_that_it_fills() {
        let rain = rain(100.0);
        for r in (0..2_000).flat_map(|beam| drops(&rain, beam, &[])) {
            let limit = 2.0 / 18.8 / (r.range_m * r.range_m);
            assert!(r.strength_per_m2 <= limit * 1.0001, "{r:?}");
        }
    }
}
