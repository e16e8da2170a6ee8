//! Returns of a scene to the beams of a scanner, before any electronics
//! (benches/record/physics.md §1).
//!
//! They depend on the scene and the pose, and not on the settings of the sensor: a pose is traced
//! once and every candidate Θ_lidar renders its waveforms from it.

use std::f32::consts::PI;

use echoloop_dispatch::dispatch;
use echoloop_frontend::{Return, SceneResponse};
use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;

use crate::mirror::image;
use crate::raycast::{Hit, Raycaster};
use crate::scene::Material;
use crate::stray_light::{FAINTEST_PER_M2, ghosts};

/// Range span within which returns merge, metres.
///
/// 3 cm of range is 0.2 ns of round trip, 1/25 of the default pulse. Two equal sin² pulses that far
/// apart sum to a peak 0.1 % lower, while most beams shrink from 25 returns to one or two.
pub const CLUSTER_SPAN_M: f64 = 0.03;

/// Range below which the strength no longer grows, metres: half of the least range that a receiver
/// sees.
const NEAREST_M: f32 = 0.2;

/// Shape of a beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamOptics {
    /// Full widths along azimuth and along elevation, mrad. The outermost sub-rays lie at ± half.
    pub divergence_mrad: [f64; 2],
    /// Sub-rays along each width; an even count is rounded up to the next odd one.
    pub subrays: u8,
    /// True to see what smooth surfaces mirror.
    pub mirrors: bool,
    /// Area of the receiver as a retro-reflector, m² ([`crate::stray_light::cats_eye_m2`]); 0: no
    /// ghosts.
    pub cats_eye_m2: f64,
}

impl Default for BeamOptics {
    fn default() -> Self {
        Self { divergence_mrad: [3.0, 1.5], subrays: 5, mirrors: false, cats_eye_m2: 0.0 }
    }
}

/// Traces every beam of a scan from one pose.
///
/// `directions` are unit vectors in the sensor's frame (x forward, y left, z up). The result
/// depends on the arguments only, not on the number of threads.
#[must_use]
pub fn scan(
    caster: &Raycaster,
    materials: &[Material],
    world_from_sensor: &Isometry3<f64>,
    directions: &[[f32; 3]],
    optics: &BeamOptics,
) -> SceneResponse {
    scan_moving(caster, materials, |_| *world_from_sensor, directions, optics)
}

/// As [`scan`], from a pose for each beam by its index: a sensor that moves while it
/// scans.
#[must_use]
pub fn scan_moving(
    caster: &Raycaster,
    materials: &[Material],
    world_from_sensor: impl Fn(usize) -> Isometry3<f64> + Sync,
    directions: &[[f32; 3]],
    optics: &BeamOptics,
) -> SceneResponse {
    let grid = footprint(optics);
    let beam = |(index, direction): (usize, &[f32; 3])| {
        let world_from_sensor = world_from_sensor(index);
        let origin = world_from_sensor.translation.vector.cast::<f32>().into();
        let rays = spread(direction, &grid, &world_from_sensor);
        let hits = caster.cast_beam(origin, &rays);
        let mut echoes: Vec<(f64, f64)> = hits
            .iter()
            .zip(&grid)
            .filter_map(|(hit, (_, weight))| echo(hit.as_ref()?, materials, *weight))
            .collect();
        if optics.mirrors {
            for ((hit, ray), (_, weight)) in hits.iter().zip(&rays).zip(&grid) {
                let hit = hit.as_ref();
                let image = hit.and_then(|hit| image(caster, materials, (origin, *ray), hit));
                let weighted = |(range, strength): (f32, f32)| {
                    (f64::from(range), weight * f64::from(strength))
                };
                echoes.extend(image.map(weighted).filter(|(_, strength)| *strength > 0.0));
            }
        }
        if optics.cats_eye_m2 > 0.0 {
            for (hit, (_, weight)) in hits.iter().zip(&grid) {
                let direct = hit.as_ref().and_then(|hit| echo(hit, materials, 1.0));
                let again = direct
                    .into_iter()
                    .flat_map(|(range_m, strength)| ghosts(range_m, strength, optics.cats_eye_m2));
                let weighted = again.map(|(range_m, strength)| (range_m, weight * strength));
                echoes.extend(weighted.filter(|(_, strength)| *strength > FAINTEST_PER_M2));
            }
        }
        cluster(&mut echoes)
    };
    collect(directions.par_iter().enumerate().map(beam).collect())
}

/// Sub-ray: its offsets along azimuth and elevation, radians, and its share of the power.
pub(crate) type SubRay = ([f64; 2], f64);

/// Grid of sub-rays of a beam: `w ∝ 2^(−d²)`, d the distance from the middle in grid steps, Σw = 1.
pub(crate) fn footprint(optics: &BeamOptics) -> Vec<SubRay> {
    let half = i32::from(optics.subrays / 2);
    let offset = |k: i32, axis: usize| {
        f64::from(k) / f64::from(2 * half.max(1)) * 1e-3 * optics.divergence_mrad[axis]
    };
    let cell =
        |i: i32, j: i32| ([offset(i, 0), offset(j, 1)], libm::exp2(-f64::from(i * i + j * j)));
    let grid: Vec<SubRay> =
        (-half..=half).flat_map(|j| (-half..=half).map(move |i| cell(i, j))).collect();
    let total: f64 = grid.iter().map(|(_, weight)| weight).sum();
    grid.into_iter().map(|(at, weight)| (at, weight / total)).collect()
}

/// World directions of the sub-rays of a beam, unit vectors, row by row of increasing elevation.
#[must_use]
pub fn sub_rays(
    direction: &[f32; 3],
    optics: &BeamOptics,
    world_from_sensor: &Isometry3<f64>,
) -> Vec<[f32; 3]> {
    spread(direction, &footprint(optics), world_from_sensor)
}

/// World directions of the sub-rays of a [`footprint`].
pub(crate) fn spread(
    direction: &[f32; 3],
    grid: &[SubRay],
    world_from_sensor: &Isometry3<f64>,
) -> Vec<[f32; 3]> {
    let axis = Vector3::from(direction.map(f64::from));
    // Straight up or down has no azimuth: any two directions square to the beam serve.
    let azimuth = Vector3::z().cross(&axis).try_normalize(1e-6).unwrap_or_else(Vector3::y);
    let elevation = axis.cross(&azimuth);
    let frame = [axis, azimuth, elevation].map(|v| (world_from_sensor.rotation * v).into());
    let mut rays = Vec::with_capacity(grid.len());
    grid.chunks(FAN).for_each(|chunk| fan(&frame, chunk, &mut rays));
    rays
}

/// Sub-rays computed at a time.
const FAN: usize = 32;

dispatch! {
    /// Adds unit vectors along `axis + u · azimuth + v · elevation` for up to [`FAN`] offsets.
    fn fan(frame: &[[f64; 3]; 3], grid: &[SubRay], rays: &mut Vec<[f32; 3]>) = fan_inline;
}

#[inline(always)]
fn fan_inline(
    [axis, azimuth, elevation]: &[[f64; 3]; 3],
    grid: &[SubRay],
    rays: &mut Vec<[f32; 3]>,
) {
    let mut offsets = [[0.0; FAN]; 2];
    for (k, ([u, v], _)) in grid.iter().enumerate().take(FAN) {
        (offsets[0][k], offsets[1][k]) = (*u, *v);
    }
    let (mut way, mut unit) = ([[0.0; FAN]; 3], [[0.0; FAN]; 3]);
    for i in 0..3 {
        for k in 0..FAN {
            way[i][k] = axis[i] + offsets[0][k] * azimuth[i] + offsets[1][k] * elevation[i];
        }
    }
    for k in 0..FAN {
        let [x, y, z] = [way[0][k], way[1][k], way[2][k]];
        let length = (x * x + y * y + z * z).sqrt();
        (unit[0][k], unit[1][k], unit[2][k]) = (x / length, y / length, z / length);
    }
    rays.extend((0..grid.len().min(FAN)).map(|k| [0, 1, 2].map(|i| unit[i][k] as f32)));
}

/// Range and strength of one sub-ray; `None` when nothing comes back.
fn echo(hit: &Hit, materials: &[Material], weight: f64) -> Option<(f64, f64)> {
    let material = &materials[usize::from(hit.material)];
    let strength = weight * f64::from(backscattered(material, hit.cos_incidence, hit.range_m));
    (strength > 0.0).then_some((f64::from(hit.range_m), strength))
}

/// `ρ cosθ / (π R²)`: share of the light on a surface that it returns to each m² at the sensor.
pub(crate) fn backscattered(material: &Material, cos_incidence: f32, range_m: f32) -> f32 {
    let albedo = material.backscatter(cos_incidence);
    albedo * cos_incidence / PI / range_m.max(NEAREST_M).powi(2)
}

/// Merges echoes within [`CLUSTER_SPAN_M`] of the nearest of their group; the range is the mean
/// weighted by strength.
pub(crate) fn cluster(echoes: &mut [(f64, f64)]) -> Vec<Return> {
    echoes.sort_by(|a, b| a.0.total_cmp(&b.0));
    groups(echoes, CLUSTER_SPAN_M).map(merge).filter(|r| r.strength_per_m2 > 0.0).collect()
}

fn merge(group: &[(f64, f64)]) -> Return {
    let strength: f64 = group.iter().map(|(_, s)| s).sum();
    let moment: f64 = group.iter().map(|(r, s)| r * s).sum();
    Return { range_m: (moment / strength) as f32, strength_per_m2: strength as f32 }
}

/// Splits sorted echoes into groups within `span_m` of their first member.
fn groups(echoes: &[(f64, f64)], span_m: f64) -> impl Iterator<Item = &[(f64, f64)]> {
    let mut rest = echoes;
    std::iter::from_fn(move || {
        let (start, _) = rest.first()?;
        let (group, after) =
            rest.split_at(rest.partition_point(|(range, _)| range - start <= span_m));
        rest = after;
        Some(group)
    })
}

fn collect(beams: Vec<Vec<Return>>) -> SceneResponse {
    let mut offsets = Vec::with_capacity(beams.len() + 1);
    offsets.push(0);
    let mut end = 0;
    for beam in &beams {
        end += beam.len() as u32;
        offsets.push(end);
    }
    SceneResponse { beams: offsets, returns: beams.concat(), ..SceneResponse::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Mesh, SceneKind, generate};
    use nalgebra::{Translation3, UnitQuaternion};

    const WALL: Material =
        Material { name: "wall", reflectance_905nm: 0.1, specular_f0: 0.0, roughness: 1.0 };

    /// Squares of ± `half` at x = `range`, turned by `turn` about z through their middle; the left
    /// edge at `left`.
    fn walls(list: &[(f32, f32, f32)]) -> Raycaster {
        let mut mesh = Mesh::default();
        for &(range, left, turn) in list {
            let n = mesh.vertices.len() as u32;
            let (sin, cos) = (libm::sinf(turn), libm::cosf(turn));
            for (y, z) in [(left, -40.0), (-40.0, -40.0), (-40.0, 40.0), (left, 40.0)] {
                mesh.vertices.push([range - sin * y, cos * y, z]);
            }
            mesh.triangles.extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
            mesh.materials.extend([0, 0]);
        }
        Raycaster::from_mesh(&mesh)
    }

    fn look(caster: &Raycaster, optics: &BeamOptics) -> SceneResponse {
        scan(caster, &[WALL], &Isometry3::identity(), &[[1.0, 0.0, 0.0]], optics)
    }

    #[test]
    fn a_wall_at_normal_incidence_gives_rho_over_pi_r_squared() {
        for range in [2.0_f32, 10.0, 50.0, 100.0, 200.0] {
            let response = look(&walls(&[(range, 40.0, 0.0)]), &BeamOptics::default());
            let [echo] = response.of(0) else { panic!("one return at {range}") };
            let expected = 0.1 / PI / (range * range);
            assert!((echo.strength_per_m2 / expected - 1.0).abs() < 1e-4, "{range} m");
            assert!((echo.range_m - range).abs() < 1e-3, "{range} m");
        }
    }

    #[test]
    fn a_wall_at_oblique_incidence_gives_its_cosine() {
        for degrees in [20.0_f32, 45.0, 70.0, 80.0] {
            let response =
                look(&walls(&[(20.0, 40.0, degrees.to_radians())]), &BeamOptics::default());
            let strength: f32 = response.of(0).iter().map(|r| r.strength_per_m2).sum();
            let expected = 0.1 * libm::cosf(degrees.to_radians()) / PI / 400.0;
            assert!(
                (strength / expected - 1.0).abs() < 0.01,
                "{degrees} degrees: {strength} against {expected}"
            );
        }
    }

    #[test]
    fn an_edge_splits_a_beam_by_weight() {
        // The near wall covers y ≤ −1 mm: two of five columns, weights (1/16 + 1/2) of (1/8 + 1 +
        // 1).
        let response =
            look(&walls(&[(10.0, -0.001, 0.0), (14.0, 40.0, 0.0)]), &BeamOptics::default());
        let [near, far] = response.of(0) else { panic!("two returns") };
        let share = 0.5625 / 2.125;
        assert!((near.strength_per_m2 / (share * 0.1 / PI / 100.0) - 1.0).abs() < 0.01);
        assert!((far.strength_per_m2 / ((1.0 - share) * 0.1 / PI / 196.0) - 1.0).abs() < 0.01);
        assert!(near.range_m < far.range_m);
    }

    #[test]
    fn returns_within_three_centimetres_are_one() {
        for (gap, count) in [(0.02, 1), (0.04, 2)] {
            let response = look(
                &walls(&[(10.0, -0.001, 0.0), (10.0 + gap, 40.0, 0.0)]),
                &BeamOptics::default(),
            );
            assert_eq!(response.of(0).len(), count, "{gap} m");
        }
    }

    #[test]
    fn sub_rays_are_unit_vectors_at_their_offsets_from_the_beam() {
        let pose = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, -0.2, 2.0));
        for (direction, subrays) in
            [([0.6, 0.0, 0.8], 5), ([0.0, -1.0, 0.0], 7), ([0.0, 0.0, 1.0], 1)]
        {
            let optics = BeamOptics { subrays, ..BeamOptics::default() };
            let axis = Vector3::from(direction.map(f64::from));
            let azimuth = Vector3::z().cross(&axis).try_normalize(1e-6).unwrap_or_else(Vector3::y);
            let frame = [axis, azimuth, axis.cross(&azimuth)].map(|v| pose.rotation * v);
            let expected = footprint(&optics).into_iter().map(|([u, v], _)| {
                let way = frame[0] + u * frame[1] + v * frame[2];
                way.normalize().cast::<f32>().into()
            });
            let expected: Vec<[f32; 3]> = expected.collect();
            assert_eq!(sub_rays(&direction, &optics, &pose), expected);
        }
    }

    #[test]
    fn weights_add_up_to_one_and_span_the_divergence() {
        for subrays in [1, 3, 5, 7] {
            let grid = footprint(&BeamOptics { subrays, ..BeamOptics::default() });
            assert_eq!(grid.len(), usize::from(subrays) * usize::from(subrays));
            assert!((grid.iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-12);
            let reach = if subrays == 1 { [0.0; 2] } else { [1.5e-3, 0.75e-3] };
            assert_eq!(grid[grid.len() - 1].0, reach);
            assert_eq!(grid[0].0, reach.map(|v| -v));
        }
    }

    /// The outermost of five rows or columns has 1/16 of the weight of the middle one.
    #[test]
    fn a_beam_reaches_three_milliradians_across_and_half_of_that_upwards() {
        let share = 0.0625 / 2.125;
        // An edge at 10 m, between two sub-rays: ±0.75 and ±1.5 mrad across, ±0.375 and ±0.75 up.
        for (edge_m, axis) in [(0.011, 1), (0.0055, 2)] {
            let mut near = Mesh::default();
            for side in [[edge_m, -5.0], [edge_m, 5.0], [9.0, 5.0], [9.0, -5.0]] {
                let mut corner = [10.0; 3];
                (corner[axis], corner[3 - axis]) = (side[0], side[1]);
                near.vertices.push(corner);
            }
            near.triangles.extend([[0, 1, 2], [0, 2, 3]]);
            near.materials.extend([0, 0]);
            let response = look(&Raycaster::from_mesh(&near), &BeamOptics::default());
            let [echo] = response.of(0) else { panic!("axis {axis}: one return") };
            let expected = share * 0.1 / PI / 100.0;
            assert!((echo.strength_per_m2 / expected - 1.0).abs() < 0.01, "axis {axis}");
            // Beyond the outermost sub-rays the beam hits nothing.
            for corner in &mut near.vertices {
                corner[axis] += 0.5 * edge_m;
            }
            let missed = look(&Raycaster::from_mesh(&near), &BeamOptics::default());
            assert!(missed.of(0).is_empty(), "axis {axis}");
        }
    }

    #[test]
    fn a_sensor_that_moves_sees_each_beam_from_where_it_was() {
        let caster = walls(&[(20.0, 40.0, 0.0)]);
        let pose = |beam: usize| Isometry3::translation(0.5 * beam as f64, 0.0, 0.0);
        let optics = BeamOptics::default();
        let response = scan_moving(&caster, &[WALL], pose, &[[1.0, 0.0, 0.0]; 9], &optics);
        for beam in 0..9 {
            let alone = scan(&caster, &[WALL], &pose(beam), &[[1.0, 0.0, 0.0]], &optics);
            assert_eq!(response.of(beam), alone.of(0));
            assert!((response.of(beam)[0].range_m - (20.0 - 0.5 * beam as f32)).abs() < 1e-3);
        }
    }

    #[test]
    fn one_thread_and_many_give_the_same_response() {
        let scene = generate(SceneKind::SemiStructured, 4);
        let caster = Raycaster::new(&scene);
        let pose =
            Isometry3::from_parts(Translation3::new(0.0, 0.0, 6.0), UnitQuaternion::identity());
        let beam = |k: u32| {
            let turn = f64::from(k) * 0.01;
            [libm::cos(turn) as f32, libm::sin(turn) as f32, 0.0]
        };
        let directions: Vec<[f32; 3]> = (0..600).map(beam).collect();
        let traced = || scan(&caster, &scene.materials, &pose, &directions, &BeamOptics::default());
        let single =
            rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool").install(traced);
        assert_eq!(single, traced());
        assert_eq!(single.len(), 600);
        for beam in 0..600 {
            assert!(single.of(beam).is_sorted_by(|a, b| a.range_m < b.range_m));
        }
    }
}
