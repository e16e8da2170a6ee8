//! Another vehicle's flash LiDAR, which lights the scene that the sensor looks at.
//!
//! A scanning one meets a beam of ours about once in a million shots: it would have to light
//! the same spot within the same microsecond (Popko, Gaylord and Valenta, Optical Engineering 59
//! (2020) 033104, have the geometry). A flash lights all spots with each pulse.

use std::f32::consts::PI;
use std::f64::consts::TAU;

use echoloop_frontend::{OtherLight, SceneResponse};
use echoloop_random::Generator;
use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;

use crate::raycast::{Met, Raycaster};
use crate::scanner::{BeamOptics, footprint, spread};
use crate::scene::Material;
use crate::stray_light::{angle, edge_rad, scattered};
use crate::vector::{dot, sub};

/// Peak power of its pulses, W. With 5 ns and 100 kHz it sends out 10 W in the mean (ours).
const POWER_W: f32 = 20_000.0;

/// Half of its field of view, across and up, radians: 120° × 30°.
const HALF_FIELD_RAD: [f32; 2] = [PI / 3.0, PI / 12.0];

/// Distance from the sensor, m.
const AWAY_M: [f64; 2] = [5.0, 25.0];

/// Places that are tried.
const TRIES: usize = 64;

/// Another LiDAR.
#[derive(Clone, Debug)]
pub struct OtherLidar {
    at: [f32; 3],
    /// Direction that it faces, radians from x towards y.
    heading_rad: f32,
}

impl OtherLidar {
    /// One as high above the ground as a sensor, which it faces within 60°, so that the sensor is
    /// in its field of view; in sight of it, if one of 64 places is.
    #[must_use]
    pub fn near(caster: &Raycaster, sensor: [f32; 3], seed: u64) -> Self {
        let mut rng = Generator::new(seed, 0);
        let mut place = || {
            let (away_m, turn) = (rng.range(AWAY_M[0], AWAY_M[1]), rng.range(0.0, TAU));
            let (sin, cos) = libm::sincos(turn);
            let [x, y] = [sensor[0] + (away_m * cos) as f32, sensor[1] + (away_m * sin) as f32];
            let facing_rad = turn + 0.5 * TAU + rng.spread(HALF_FIELD_RAD[0].into());
            Self { at: [x, y, sensor[2]], heading_rad: facing_rad as f32 }
        };
        let mut other = place();
        for _ in 0..TRIES {
            if caster.sees(sensor, other.at) {
                break;
            }
            other = place();
        }
        other
    }

    /// Adds its light to a response: what the surfaces in each beam scatter of it, and of the light
    /// that comes straight, all in the beam that points to it, and in others what the sensor's
    /// optics scatter.
    ///
    /// ```text
    /// E(x) = P / (Ω_o d²)                      in its field of view Ω_o, where it is seen from x
    /// E_b  = Σ_k w_k · ρ cosθ' / π · E · Ω_b  +  E(sensor) · Ω_b b(angle between the beam and it)
    /// ```
    ///
    /// θ' is the angle of incidence of its light. A retro-reflector sends it back.
    pub fn light(
        &self,
        response: &mut SceneResponse,
        (caster, materials): (&Raycaster, &[Material]),
        world_from_sensor: impl Fn(usize) -> Isometry3<f64> + Sync,
        directions: &[[f32; 3]],
        optics: &BeamOptics,
    ) {
        let solid_angle_sr = (1e-6 * optics.divergence_mrad[0] * optics.divergence_mrad[1]) as f32;
        let grid = footprint(optics);
        let beam = |(index, direction): (usize, &[f32; 3])| {
            let pose = world_from_sensor(index);
            let origin: [f32; 3] = pose.translation.vector.cast::<f32>().into();
            let mut parts: Vec<[f32; 2]> = Vec::new();
            for (ray, (_, weight)) in spread(direction, &grid, &pose).into_iter().zip(&grid) {
                let Some(met) = caster.meet(origin, ray) else { continue };
                let Some(material) = materials.get(usize::from(met.material)) else { continue };
                if let Some((lit, path_m)) = self.scattered_at(caster, &met, material) {
                    parts.push([*weight as f32 * lit * solid_angle_sr, met.range_m + path_m]);
                }
            }
            if let Some((irradiance, from, away_m)) = self.irradiance(caster, origin) {
                let axis = pose.rotation * Vector3::from(direction.map(f64::from));
                let angle_rad = angle(axis.into(), from.map(f64::from));
                let share = match angle_rad < edge_rad(optics.divergence_mrad) {
                    true => 1.0,
                    false => scattered(angle_rad, optics.divergence_mrad) as f32,
                };
                parts.push([irradiance * share, away_m]);
            }
            total(&parts)
        };
        response.other = directions.par_iter().enumerate().map(beam).collect();
    }

    /// Radiance of a surface in its light, W/m²/sr, and the way from it to the surface, m.
    fn scattered_at(
        &self,
        caster: &Raycaster,
        met: &Met,
        material: &Material,
    ) -> Option<(f32, f32)> {
        let (irradiance, from, away_m) = self.irradiance(caster, met.before)?;
        let cos = dot(from, met.normal);
        let scatters = cos > 0.0 && material.reflectance_905nm <= 1.0;
        scatters.then_some((material.reflectance_905nm * cos / PI * irradiance, away_m))
    }

    /// Irradiance of a place across the light, W/m², the direction that it comes from and the
    /// distance, m.
    fn irradiance(&self, caster: &Raycaster, at: [f32; 3]) -> Option<(f32, [f32; 3], f32)> {
        let to_it = sub(self.at, at);
        let away_m = dot(to_it, to_it).sqrt();
        let from = to_it.map(|part| part / away_m);
        let (sin, cos) = libm::sincosf(self.heading_rad);
        let (ahead, left) = (-from[0] * cos - from[1] * sin, from[0] * sin - from[1] * cos);
        let is_in_field = libm::atan2f(left, ahead).abs() <= HALF_FIELD_RAD[0]
            && libm::asinf(from[2].clamp(-1.0, 1.0)).abs() <= HALF_FIELD_RAD[1];
        let field_sr = 4.0 * HALF_FIELD_RAD[0] * libm::sinf(HALF_FIELD_RAD[1]);
        let lit = away_m > 0.0 && is_in_field && caster.sees(at, self.at);
        lit.then_some((POWER_W / (field_sr * away_m * away_m), from, away_m))
    }
}

/// Sum of irradiances, with the mean way weighted by them.
fn total(parts: &[[f32; 2]]) -> OtherLight {
    let irradiance_w_m2: f32 = parts.iter().map(|[irradiance, _]| irradiance).sum();
    let way: f32 = parts.iter().map(|[irradiance, path_m]| irradiance * path_m).sum();
    match irradiance_w_m2 > 0.0 {
        true => OtherLight { irradiance_w_m2, path_m: way / irradiance_w_m2 },
        false => OtherLight::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::scan;
    use crate::scene::{MATERIALS, Mesh, SceneKind, Surface, generate};

    const OPTICS: BeamOptics =
        BeamOptics { divergence_mrad: [0.3; 2], subrays: 5, mirrors: false, cats_eye_m2: 0.0 };

    /// A wall of ± 20 m across the way at `range_m`.
    fn wall(range_m: f32, surface: Surface) -> Raycaster {
        let corners = [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)];
        Raycaster::from_mesh(&Mesh {
            vertices: corners.map(|(y, z)| [range_m, y, z]).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            materials: vec![surface.index(); 2],
        })
    }

    /// Light of one at a place that faces `heading_deg`, in beams of a sensor in the origin.
    fn light(
        caster: &Raycaster,
        at: [f32; 3],
        heading_deg: f32,
        beams: &[[f32; 3]],
    ) -> Vec<OtherLight> {
        let other = OtherLidar { at, heading_rad: heading_deg.to_radians() };
        let pose = Isometry3::identity();
        let mut response = scan(caster, MATERIALS, &pose, beams, &OPTICS);
        other.light(&mut response, (caster, MATERIALS), |_| pose, beams, &OPTICS);
        response.other
    }

    const AHEAD: [f32; 3] = [1.0, 0.0, 0.0];

    fn near(got: f32, expected: f32) -> bool {
        (got / expected - 1.0).abs() < 0.01
    }

    #[test]
    fn a_wall_scatters_its_light_as_the_inverse_square_of_its_own_distance() {
        // It stands 10 m beside the way to the wall and faces away from the sensor, 60° to the left
        // of where the beam meets the wall.
        let distance = 200.0_f32.sqrt();
        let [seen] = light(&wall(10.0, Surface::Plaster), [0.0, -10.0, 0.0], 45.0, &[AHEAD])[..]
        else {
            panic!("one beam")
        };
        // 120° × 30°: 2π/3 · 2 sin 15°.
        let irradiance = 20_000.0 / (2.0944 * 0.51764) / 200.0;
        let expected = 0.643 * (10.0 / distance) / PI * irradiance * 0.09e-6;
        assert!(near(seen.irradiance_w_m2, expected), "{seen:?}, {expected} W/m²");
        assert!(near(seen.path_m, 10.0 + distance), "{seen:?}");
    }

    #[test]
    fn what_it_does_not_light_is_dark() {
        let dark = |caster: &Raycaster, at, heading_deg| {
            light(caster, at, heading_deg, &[AHEAD])[0] == OtherLight::default()
        };
        let plaster = wall(10.0, Surface::Plaster);
        assert!(dark(&plaster, [0.0, -10.0, 0.0], -20.0), "65° beside where it faces");
        assert!(dark(&plaster, [9.0, 0.0, 5.0], 0.0), "15° above");
        assert!(dark(&plaster, [20.0, -10.0, 0.0], 135.0), "behind the wall");
        // What is left is its straight light, 90° beside the beam.
        let beside = |surface| light(&wall(10.0, surface), [0.0, -10.0, 0.0], 45.0, &[AHEAD])[0];
        let [sign, lit] = [Surface::RetroSign, Surface::Plaster].map(beside);
        assert!(sign.irradiance_w_m2 < 1e-2 * lit.irradiance_w_m2, "{sign:?} of {lit:?}");
        assert_eq!(sign.path_m, 10.0);
    }

    #[test]
    fn its_straight_light_is_scattered_into_beams_beside_it() {
        let beams: Vec<[f32; 3]> = [0.0, 2.0, 4.0_f32]
            .map(|degrees| {
                let (sin, cos) = degrees.to_radians().sin_cos();
                [cos, sin, 0.0]
            })
            .to_vec();
        let nothing = wall(-10.0, Surface::Plaster);
        let seen = light(&nothing, [10.0, 0.0, 0.0], 180.0, &beams);
        let straight = 20_000.0 / (2.0944 * 0.51764) / 100.0;
        for (seen, degrees) in seen[1..].iter().zip([2.0_f32, 4.0]) {
            let expected = straight * 0.09e-6 * 0.3 / (degrees * degrees);
            assert!(near(seen.irradiance_w_m2, expected), "{seen:?}, {expected} at {degrees}°");
            assert!(near(seen.path_m, 10.0), "{seen:?}");
        }
        assert!(near(seen[0].irradiance_w_m2, straight), "{:?}, {straight}", seen[0]);
    }

    #[test]
    fn it_stands_in_sight_of_the_sensor_and_faces_it() {
        let caster = Raycaster::new(&generate(SceneKind::Structured, 1));
        let mut places = Vec::new();
        for seed in 0..20 {
            let other = OtherLidar::near(&caster, [0.0, 0.0, 2.0], seed);
            let (_, _, away_m) = other.irradiance(&caster, [0.0, 0.0, 2.0]).expect("lights it");
            assert!((5.0..=25.0).contains(&away_m), "{away_m} m");
            places.push(other.at);
        }
        places.sort_by(|a, b| a[0].total_cmp(&b[0]));
        places.dedup();
        assert_eq!(places.len(), 20);
    }
}
