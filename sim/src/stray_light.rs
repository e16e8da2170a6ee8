//! Light of retro-reflectors that strays within the sensor's own optics: glare in the channels that
//! listen at the same time, and ghosts at multiples of the range.

use std::collections::{BTreeMap, HashMap};

use echoloop_frontend::{Glare, Return, SceneResponse};

use crate::scanner::cluster;
use crate::scene::{Material, Surface};

/// Retro-reflection of white prismatic sheeting, cd/lx/m², at 0.2° from the light: type IV of
/// ASTM D4956.
const SHEETING_CD_LX_M2: f32 = 360.0;

/// Makes signs and plates as bright as sheeting is: ρ = π R_A, since R_A of a matt white surface is
/// 1/π.
pub fn brighten_signs(materials: &mut [Material]) {
    if let Some(sign) = materials.get_mut(usize::from(Surface::RetroSign.index())) {
        sign.reflectance_905nm = std::f32::consts::PI * SHEETING_CD_LX_M2;
    }
}

/// Strength below which stray light is left out, 1/m²: a hundredth of a wall of 10 % at 200 m.
pub(crate) const FAINTEST_PER_M2: f64 = 1e-8;

/// Light that the receiving optics scatter, at 1° from its way, 1/sr: a lens behind a window with
/// the dust of a drive (ours).
const SCATTERED_PER_SR: f64 = 0.3;

/// Share of the light on the detector that its surface reflects, silicon with a coating (ours).
const DETECTOR_REFLECTS: f64 = 0.05;

/// Area of the receiver as a retro-reflector, m²: its lens focuses light on the detector, and sends
/// what the detector reflects back to where it came from, a cat's eye.
///
/// ```text
/// C = A_r · η² · ρ_d
/// ```
///
/// The cat's-eye effect of cameras, measured in Crystals 11 (2021) 1366.
#[must_use]
pub fn cats_eye_m2(aperture_m2: f64, transmission: f64) -> f64 {
    aperture_m2 * transmission * transmission * DETECTOR_REFLECTS
}

/// Ranges and strengths of the ghosts of a sub-ray: light that goes to and fro between surface and
/// receiver once more for each.
///
/// ```text
/// R_n = n R        s_n = s (s C)^(n−1)        n = 2, 3, …
/// ```
pub(crate) fn ghosts(
    range_m: f64,
    strength_per_m2: f64,
    cats_eye_m2: f64,
) -> impl Iterator<Item = (f64, f64)> {
    let again = (strength_per_m2 * cats_eye_m2).min(1.0); // a lens returns no more than it gets
    let ghost =
        move |n: u8| (f64::from(n) * range_m, strength_per_m2 * again.powi(i32::from(n) - 1));
    (2..=MOST_TIMES).map(ghost)
}

/// Most ways to the surface and back.
const MOST_TIMES: u8 = 4;

/// Share of the light from a direction that the receiving optics scatter into a pixel `angle_rad`
/// beside it: Ω_b · b(θ), b(θ) = b₁ (1° / θ)², the steepest slope of polished surfaces (Harvey,
/// Understanding Surface Scatter Phenomena, 2019).
///
/// Within the pixel itself it stays that at the edge.
#[must_use]
pub fn scattered(angle_rad: f64, divergence_mrad: [f64; 2]) -> f64 {
    let degrees = angle_rad.max(edge_rad(divergence_mrad)).to_degrees();
    let solid_angle_sr = divergence_mrad[0] * divergence_mrad[1] * 1e-6;
    (solid_angle_sr * SCATTERED_PER_SR / (degrees * degrees)).min(1.0)
}

/// Half of the wider side of a pixel, radians.
pub(crate) fn edge_rad(divergence_mrad: [f64; 2]) -> f64 {
    0.5e-3 * divergence_mrad[0].max(divergence_mrad[1])
}

/// Adds to each beam what the optics scatter of the light of the beams fired at the same moment: a
/// linear operator, the same for every scene (Gump et al., CVPR 2026).
///
/// `directions` are unit vectors in the sensor's frame.
pub fn add_glare(response: &mut SceneResponse, directions: &[[f32; 3]], divergence_mrad: [f64; 2]) {
    let strongest = scattered(0.0, divergence_mrad);
    let mut fired: HashMap<u32, Vec<usize>> = HashMap::new();
    for (beam, first) in response.fired_with.iter().enumerate() {
        fired.entry(*first).or_default().push(beam);
    }
    let mut added: BTreeMap<usize, Vec<(f64, f64)>> = BTreeMap::new();
    for (beam, first) in response.fired_with.iter().enumerate() {
        let bright = |of: &&Return| f64::from(of.strength_per_m2) * strongest > FAINTEST_PER_M2;
        for of in response.of(beam).iter().filter(bright) {
            for &other in fired[first].iter().filter(|other| **other != beam) {
                let [a, b] = [beam, other].map(|beam| directions[beam].map(f64::from));
                let share = scattered(angle(a, b), divergence_mrad);
                let strength = share * f64::from(of.strength_per_m2);
                if strength > FAINTEST_PER_M2 {
                    added.entry(other).or_default().push((of.range_m.into(), strength));
                }
            }
        }
    }
    let of_beam = |(beam, mut lights): (usize, Vec<_>)| {
        let beam = beam as u32;
        cluster(&mut lights).into_iter().map(move |light| Glare { beam, light })
    };
    response.glare = added.into_iter().flat_map(of_beam).collect();
}

/// Angle between two unit vectors, radians.
pub(crate) fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let chord: f64 = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum();
    2.0 * libm::asin((0.5 * chord.sqrt()).min(1.0))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Isometry3;

    use super::*;
    use crate::raycast::Raycaster;
    use crate::scanner::{BeamOptics, scan};
    use crate::scene::{MATERIALS, Mesh};

    /// Returns of beams at these elevations, degrees, to a sign of 60 cm ahead of the first.
    fn look(range_m: f32, elevations: &[f64]) -> (SceneResponse, Vec<[f32; 3]>) {
        let corners = [(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)];
        let sign = Mesh {
            vertices: corners.map(|(y, z)| [range_m, y, z]).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            materials: vec![Surface::RetroSign.index(); 2],
        };
        let mut materials = MATERIALS.to_vec();
        brighten_signs(&mut materials);
        let unit = |degrees: &f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            [cos as f32, 0.0, sin as f32]
        };
        let directions: Vec<[f32; 3]> = elevations.iter().map(unit).collect();
        let caster = Raycaster::from_mesh(&sign);
        let optics = BeamOptics { cats_eye_m2: cats_eye_m2(4.909e-4, 0.7), ..Default::default() };
        (scan(&caster, &materials, &Isometry3::identity(), &directions, &optics), directions)
    }

    fn returns(response: &SceneResponse, beam: usize) -> Vec<(f64, f64)> {
        let pair = |of: &Return| (of.range_m.into(), of.strength_per_m2.into());
        response.of(beam).iter().map(pair).collect()
    }

    fn near(got: f64, expected: f64) -> bool {
        (got / expected - 1.0).abs() < 0.01
    }

    #[test]
    fn a_sign_is_seen_again_at_twice_its_range_over_the_receiver_s_own_eye() {
        let (response, _) = look(10.0, &[0.0]);
        let [(_, sign), (range_m, ghost)] = returns(&response, 0)[..] else {
            panic!("a sign and a ghost: {:?}", response.returns)
        };
        // R_A of 360 cd/lx/m² is the radiance of one lux, whatever the range.
        assert!(near(sign, 360.0 / 100.0), "{sign}");
        // Area of 4.9 cm², seen twice through optics that pass 0.7, before silicon of 5 %.
        assert!(near(ghost, sign * sign * 4.909e-4 * 0.49 * 0.05), "{ghost}");
        assert!((range_m - 20.0).abs() < 0.01, "{range_m} m");
        // Far signs have a ghost too weak for any receiver, and near ones a third.
        assert_eq!(look(150.0, &[0.0]).0.returns.len(), 1);
        assert!(returns(&look(2.0, &[0.0]).0, 0).iter().any(|(range_m, _)| *range_m > 5.9));
    }

    #[test]
    fn a_sign_glares_into_channels_fired_with_it_as_the_square_of_the_angle() {
        let (plain, directions) = look(20.0, &[0.0, 1.5, 3.0, 6.0]);
        assert!((1..4).all(|beam| plain.of(beam).is_empty()), "beside the sign");
        let glared = |fired_with: &[u32]| {
            let mut response = SceneResponse { fired_with: fired_with.into(), ..plain.clone() };
            add_glare(&mut response, &directions, [3.0, 1.5]);
            assert_eq!((&response.beams, &response.returns), (&plain.beams, &plain.returns));
            response
        };
        assert!(glared(&[]).glare.is_empty() && glared(&[0, 1, 2, 3]).glare.is_empty());
        let response = glared(&[0; 4]);
        let sign = returns(&plain, 0)[0].1;
        for (beam, degrees) in [(1, 1.5), (2, 3.0), (3, 6.0)] {
            let [Glare { light, .. }] = response.glare_in(beam) else { panic!("one glare") };
            let (range_m, glare) = (f64::from(light.range_m), f64::from(light.strength_per_m2));
            let expected = sign * 4.5e-6 * 0.3 / (degrees * degrees);
            assert!(near(glare, expected), "{glare} for {expected} at {degrees} degrees");
            assert!((range_m - 20.0).abs() < 0.01, "{range_m} m");
        }
        assert!(response.glare_in(0).is_empty(), "the sign's own beam");
    }

    /// ∫ b dΩ between the edge of the pixel and 90°.
    #[test]
    fn the_optics_scatter_less_than_a_hundredth_in_all() {
        let step = 1e-4_f64;
        let rings = (0..).map(|k| 0.0015 + f64::from(k) * step).take_while(|at| *at < 0.5 * PI);
        let ring = |at: f64| scattered(at, [3.0, 1.5]) / 4.5e-6 * 2.0 * PI * libm::sin(at) * step;
        let all: f64 = rings.map(ring).sum();
        assert!((0.001..0.01).contains(&all), "{all}");
    }
}
