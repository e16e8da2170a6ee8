//! Ray casting: the first surface along a ray, by a bounding volume hierarchy eight boxes wide.
//!
//! The crate `obvhs` builds the hierarchy. It is traversed here, because rays from one place are
//! cast as a packet and each must hit what it would hit alone, without a gap at shared edges and
//! with ties decided by the order of the mesh.

mod frustum;
mod packet;
mod triangle;
mod wide_bvh;

use std::time::Duration;

use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};

use crate::scene::{Mesh, Scene};
use crate::vector::{cross, dot, sub};
use frustum::DEPTH;
use packet::{LANES, LeafHit, nearest, nearest_single};
use triangle::{Triangle, cos_incidence};
use wide_bvh::{WideNode, widen};

/// One triangle a leaf: a ray tests eight boxes at once. Larger leaves make a scan 5 % faster, and
/// the build slower by the time of a whole scan. The `medium_build` of `obvhs` takes 1.5 times as
/// long and gains nothing.
const BUILD: BvhBuildParams =
    BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::fast_build() };

/// Least number of rays that are faster as a packet than one by one.
const MIN_PACKET: usize = 4;

/// Nearest surface along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin, metres.
    pub range_m: f32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// |cos| of the angle between the ray and the surface's normal, 0–1.
    pub cos_incidence: f32,
    /// Index into the scene's materials.
    pub material: u8,
}

/// Surface that a ray meets.
pub(crate) struct Met {
    pub(crate) range_m: f32,
    /// Place a millimetre before the surface.
    pub(crate) before: [f32; 3],
    /// Unit normal of the side that faces the ray.
    pub(crate) normal: [f32; 3],
    pub(crate) material: u8,
}

/// A bounding volume hierarchy over a scene's triangles.
///
/// Triangles count from both sides. Neighbours that share an edge leave no gap: the test of Woop,
/// Benthin and Wald (JCGT 2013) evaluates an edge with the same numbers from either side, and the
/// boxes of the hierarchy are padded by more than their rounding. Of two triangles at exactly the
/// same distance, the later one of the mesh is hit.
#[derive(Clone)]
pub struct Raycaster {
    nodes: Vec<WideNode>,
    /// Triangles in the order of the leaves.
    triangles: Vec<Triangle>,
}

/// Corners of a triangle, whose box for the hierarchy is padded.
struct PaddedTriangle([[f32; 3]; 3]);

impl Boundable for PaddedTriangle {
    fn aabb(&self) -> Aabb {
        let low: [f32; 3] =
            std::array::from_fn(|i| self.0.iter().fold(f32::INFINITY, |m, p| m.min(p[i])));
        let high: [f32; 3] =
            std::array::from_fn(|i| self.0.iter().fold(f32::NEG_INFINITY, |m, p| m.max(p[i])));
        let pad = |x: f32| 1e-5 + 4e-7 * x.abs();
        Aabb::new(low.map(|x| x - pad(x)).into(), high.map(|x| x + pad(x)).into())
    }
}

impl Raycaster {
    /// Builds the hierarchy. The mesh must have passed [`Mesh::check`], as generated and imported
    /// ones have.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        Self::from_mesh(&scene.mesh)
    }

    /// As [`Raycaster::new`], for a mesh that is not yet a scene.
    #[must_use]
    pub fn from_mesh(mesh: &Mesh) -> Self {
        let boxes: Vec<PaddedTriangle> =
            (0..mesh.triangles.len()).map(|t| PaddedTriangle(mesh.corners(t))).collect();
        let bvh = build_bvh2(&boxes, BUILD, &mut Duration::default());
        let triangle = |&index: &u32| Triangle {
            corners: mesh.corners(index as usize),
            index,
            material: mesh.materials[index as usize],
        };
        let triangles = bvh.primitive_indices.iter().map(triangle).collect();
        Self { nodes: widen(&bvh), triangles }
    }

    /// First surface from `origin` (metres) along `direction` (unit).
    #[must_use]
    pub fn cast(&self, origin: [f32; 3], direction: [f32; 3]) -> Option<Hit> {
        self.cast_within(origin, direction, f32::INFINITY)
    }

    /// As [`Raycaster::cast`], within `max_m`.
    #[must_use]
    pub fn cast_within(&self, origin: [f32; 3], direction: [f32; 3], max_m: f32) -> Option<Hit> {
        let met = nearest_single(&self.nodes, &self.triangles, origin, direction, max_m);
        self.hit(met, direction)
    }

    /// [`Raycaster::cast`] for many directions from one place; the closer they are, the faster.
    #[must_use]
    pub fn cast_beam(&self, origin: [f32; 3], directions: &[[f32; 3]]) -> Vec<Option<Hit>> {
        if directions.len() < MIN_PACKET {
            return directions.iter().map(|&direction| self.cast(origin, direction)).collect();
        }
        let mut hits = Vec::with_capacity(directions.len());
        let mut stack = Vec::with_capacity(DEPTH);
        for directions in directions.chunks(LANES) {
            let met = nearest(&self.nodes, &self.triangles, origin, directions, &mut stack);
            hits.extend(met.iter().zip(directions).map(|(&met, &ray)| self.hit(met, ray)));
        }
        hits
    }

    fn hit(&self, LeafHit { slot, range_m, .. }: LeafHit, direction: [f32; 3]) -> Option<Hit> {
        let triangle = self.triangles.get(slot as usize)?;
        Some(Hit {
            range_m,
            triangle: triangle.index,
            cos_incidence: cos_incidence(&triangle.corners, direction),
            material: triangle.material,
        })
    }

    /// Ray that the first surface mirrors: its origin, a millimetre before the surface, and its
    /// direction.
    pub(crate) fn mirrored(
        &self,
        origin: [f32; 3],
        direction: [f32; 3],
    ) -> Option<([f32; 3], [f32; 3])> {
        let Met { before, normal, .. } = self.meet(origin, direction)?;
        let along = dot(direction, normal);
        Some((before, [0, 1, 2].map(|i| direction[i] - 2.0 * along * normal[i])))
    }

    /// First surface that a ray meets, with the side that faces it.
    pub(crate) fn meet(&self, origin: [f32; 3], direction: [f32; 3]) -> Option<Met> {
        let met = nearest_single(&self.nodes, &self.triangles, origin, direction, f32::INFINITY);
        let triangle = self.triangles.get(met.slot as usize)?;
        let [a, b, c] = triangle.corners;
        let across = cross(sub(b, a), sub(c, a));
        let towards = -dot(direction, across).signum();
        let normal = across.map(|x| towards * x / dot(across, across).sqrt());
        let at = [0, 1, 2].map(|i| origin[i] + met.range_m * direction[i]);
        let before = [0, 1, 2].map(|i| at[i] + 1e-3 * normal[i]);
        Some(Met { range_m: met.range_m, before, normal, material: triangle.material })
    }

    /// True when no surface lies between two points, metres.
    #[must_use]
    pub fn sees(&self, from: [f32; 3], to: [f32; 3]) -> bool {
        let way = sub(to, from);
        let distance = dot(way, way).sqrt();
        distance == 0.0 || self.cast_within(from, way.map(|x| x / distance), distance).is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raycast::triangle::ShearedRay;
    use crate::scene::{SceneKind, generate};
    use echoloop_random::Generator;

    fn mesh(triangles: Vec<[[f32; 3]; 3]>) -> Mesh {
        Mesh {
            vertices: triangles.concat(),
            triangles: (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            materials: vec![0; triangles.len()],
        }
    }

    fn point(rng: &mut Generator, half: f64) -> [f32; 3] {
        std::array::from_fn(|_| rng.spread(half) as f32)
    }

    fn unit(way: [f32; 3]) -> [f32; 3] {
        way.map(|x| x / dot(way, way).sqrt())
    }

    /// Direction near `aim`: each component differs by `width` at most before it is scaled.
    fn near(rng: &mut Generator, aim: [f64; 3], width: f64) -> [f32; 3] {
        unit(std::array::from_fn(|i| (aim[i] + rng.spread(width)) as f32))
    }

    /// A sphere of flat faces with shared corners, radius 10 m.
    fn closed(rng: &mut Generator) -> Mesh {
        let mut b = Mesh::default();
        let (columns, rows) = (24_u32, 12_u32);
        for j in 0..=rows {
            for i in 0..columns {
                let (turn, polar) = (
                    f64::from(i) / 24.0 * std::f64::consts::TAU,
                    f64::from(j) / 12.0 * std::f64::consts::PI,
                );
                let ring = if j == 0 || j == rows { 0.0 } else { libm::sin(polar) };
                let r = if ring == 0.0 { 10.0 } else { 10.0 + rng.spread(0.5) };
                b.vertices.push(
                    [ring * libm::cos(turn), ring * libm::sin(turn), libm::cos(polar)]
                        .map(|x| (r * x) as f32),
                );
            }
        }
        for j in 0..rows {
            for i in 0..columns {
                let (a, c) = (j * columns + i, j * columns + (i + 1) % columns);
                b.triangles.extend([[a, c, c + columns], [a, c + columns, a + columns]]);
            }
        }
        b.materials = vec![0; b.triangles.len()];
        b
    }

    /// Range and triangle of the nearest hit by brute force; the later triangle on a tie.
    fn brute_force(mesh: &Mesh, origin: [f32; 3], direction: [f32; 3]) -> Option<(f32, u32)> {
        let ray = ShearedRay::new(origin, direction);
        let hit = |t: usize| (ray.distance_m(&mesh.corners(t)), t as u32);
        let nearer = |a: (f32, u32), b: (f32, u32)| if b.0 <= a.0 { b } else { a };
        let met = (0..mesh.triangles.len()).map(hit).fold((f32::INFINITY, 0), nearer);
        (met.0 < f32::INFINITY).then_some(met)
    }

    #[test]
    fn the_nearest_hit_is_the_one_brute_force_finds() {
        let mut rng = Generator::new(11, 0);
        let mesh = soup(&mut rng, 300);
        let caster = Raycaster::from_mesh(&mesh);
        let mut hits = 0;
        for _ in 0..5000 {
            let (origin, direction) = (point(&mut rng, 12.0), rng.direction().map(|x| x as f32));
            let found = caster.cast(origin, direction);
            assert_eq!(
                found.map(|hit| (hit.range_m, hit.triangle)),
                brute_force(&mesh, origin, direction)
            );
            hits += usize::from(found.is_some());
        }
        assert!(hits > 1000);
    }

    #[test]
    fn on_a_tie_in_distance_the_last_triangle_of_the_mesh_is_hit_in_any_hierarchy() {
        let mut rng = Generator::new(16, 0);
        let mut hits = 0;
        for round in 0..20 {
            // Coplanar triangles, some of them twice or three times.
            let mut corner = || [5.0, rng.spread(3.0) as f32, rng.spread(3.0) as f32];
            let wall: Vec<[[f32; 3]; 3]> = (0..60).map(|_| [0; 3].map(|_| corner())).collect();
            let mesh = mesh([&wall[..], &wall[..30], &wall[20..]].concat());
            let caster = Raycaster::from_mesh(&mesh);
            for _ in 0..100 {
                let origin = point(&mut rng, 2.0);
                let aim = [1.0, 0.3 * rng.spread(1.0), 0.3 * rng.spread(1.0)];
                let rays: [[f32; 3]; 25] = std::array::from_fn(|_| near(&mut rng, aim, 0.02));
                let found = caster.cast_beam(origin, &rays);
                for (hit, &ray) in found.iter().zip(&rays) {
                    let expected = brute_force(&mesh, origin, ray);
                    assert_eq!(hit.map(|h| (h.range_m, h.triangle)), expected, "round {round}");
                    assert_eq!(*hit, caster.cast(origin, ray));
                    hits += usize::from(hit.is_some());
                }
            }
        }
        assert!(hits > 10_000, "{hits}");
    }

    #[test]
    fn a_generated_scene_is_hit_where_brute_force_says() {
        let mut rng = Generator::new(17, 0);
        for kind in [SceneKind::Structured, SceneKind::SemiStructured, SceneKind::Unstructured] {
            let mesh = generate(kind, 3).mesh;
            let caster = Raycaster::from_mesh(&mesh);
            let origin = [rng.spread(20.0) as f32, rng.spread(20.0) as f32, 12.0];
            let aim = [rng.spread(1.0), rng.spread(1.0), -0.2];
            let rays: [[f32; 3]; 25] = std::array::from_fn(|_| near(&mut rng, aim, 0.002));
            let found = caster.cast_beam(origin, &rays);
            assert!(found.iter().any(Option::is_some));
            for (hit, ray) in found.iter().zip(rays) {
                assert_eq!(hit.map(|h| (h.range_m, h.triangle)), brute_force(&mesh, origin, ray));
            }
        }
    }

    #[test]
    fn a_surface_at_the_target_point_does_not_hide_it() {
        let caster = Raycaster::from_mesh(&mesh(vec![
            [[5.0, -9.0, -9.0], [5.0, 9.0, -9.0], [5.0, 0.0, 9.0]],
            [[5.0, -9.0, -9.0], [5.0, 9.0, -9.0], [5.0, 0.0, 9.0]],
        ]));
        assert!(caster.sees([0.0; 3], [5.0, 0.0, 0.0]));
        assert!(!caster.sees([0.0; 3], [5.001, 0.0, 0.0]));
    }

    /// Triangles of many sizes, many of them overlapping.
    fn soup(rng: &mut Generator, count: usize) -> Mesh {
        let triangle = |_| {
            let (centre, size) = (point(rng, 10.0), rng.range(0.05, 4.0));
            [0; 3].map(|_| {
                let p = point(rng, size);
                std::array::from_fn(|i| centre[i] + p[i])
            })
        };
        mesh((0..count).map(triangle).collect())
    }

    #[test]
    fn each_ray_of_a_beam_hits_what_it_hits_alone() {
        let mut rng = Generator::new(13, 0);
        let caster = Raycaster::from_mesh(&soup(&mut rng, 2000));
        let mut hits = 0;
        for k in 0..2000 {
            // From nearly parallel rays to rays all round; full and partial packets.
            let (origin, axis) = (point(&mut rng, 12.0), rng.direction());
            let width = [1e-3, 1e-2, 0.3, 3.0][k % 4];
            let rays: Vec<[f32; 3]> = (0..k % 35).map(|_| near(&mut rng, axis, width)).collect();
            let alone: Vec<Option<Hit>> = rays.iter().map(|&r| caster.cast(origin, r)).collect();
            assert_eq!(caster.cast_beam(origin, &rays), alone);
            hits += alone.iter().flatten().count();
        }
        assert!(hits > 10_000, "{hits}");
    }

    #[test]
    fn rays_of_a_beam_at_edges_and_corners_do_not_leak() {
        let mut rng = Generator::new(14, 0);
        let mesh = closed(&mut rng);
        let caster = Raycaster::from_mesh(&mesh);
        for _ in 0..2000 {
            let origin = point(&mut rng, 3.0);
            let rays: [[f32; 3]; 25] = std::array::from_fn(|k| {
                let [a, b, _] = mesh.corners(rng.index(mesh.triangles.len()));
                let target =
                    if k % 2 == 0 { a } else { std::array::from_fn(|i| 0.5 * (a[i] + b[i])) };
                unit(sub(target, origin))
            });
            for (hit, ray) in caster.cast_beam(origin, &rays).iter().zip(rays) {
                assert_eq!(*hit, caster.cast(origin, ray));
                assert!(hit.is_some());
            }
        }
    }

    #[test]
    fn no_ray_leaks_out_of_a_closed_shape() {
        let mut rng = Generator::new(12, 0);
        let mesh = closed(&mut rng);
        let caster = Raycaster::from_mesh(&mesh);
        for k in 0..200_000 {
            let origin = point(&mut rng, 3.0);
            // Every other ray aims at a corner or the middle of an edge, where gaps would be.
            let direction = if k % 2 == 0 {
                rng.direction().map(|x| x as f32)
            } else {
                let [a, b, _] = mesh.corners(rng.index(mesh.triangles.len()));
                let target =
                    if k % 4 == 1 { a } else { std::array::from_fn(|i| 0.5 * (a[i] + b[i])) };
                unit(sub(target, origin))
            };
            assert!(
                caster.cast(origin, direction).is_some(),
                "ray {k} from {origin:?} along {direction:?}"
            );
        }
    }

    #[test]
    fn an_axis_parallel_box_is_closed_too() {
        let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -5.0 } else { 5.0 });
        let mut b = Mesh {
            vertices: (0..8).map(corner).collect(),
            materials: vec![0; 12],
            ..Mesh::default()
        };
        for [p, q, r, s] in
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
        {
            b.triangles.extend([[p, q, r], [p, r, s]]);
        }
        let caster = Raycaster::from_mesh(&b);
        for k in 0..=200 {
            let slope = k as f32 / 100.0 - 1.0;
            for direction in
                [[1.0, slope, slope], [slope, 1.0, 0.0], [0.0, slope, -1.0], [slope, -1.0, slope]]
            {
                let length = dot(direction, direction).sqrt();
                assert!(
                    caster.cast([0.0; 3], direction.map(|x| x / length)).is_some(),
                    "{direction:?}"
                );
            }
        }
    }

    #[test]
    fn both_sides_of_a_face_are_hit_at_the_same_angle() {
        let caster = Raycaster::from_mesh(&mesh(vec![[
            [5.0, -9.0, -9.0],
            [5.0, 9.0, -9.0],
            [5.0, 0.0, 9.0],
        ]]));
        for (origin, sign) in [(0.0, 1.0), (10.0, -1.0)] {
            let hit = caster.cast([origin, 0.0, 0.0], [sign * 0.8, 0.6, 0.0]).expect("a hit");
            assert!((hit.range_m - 6.25).abs() < 1e-5);
            assert!((hit.cos_incidence - 0.8).abs() < 1e-6);
        }
        assert!(caster.cast([0.0; 3], [-1.0, 0.0, 0.0]).is_none());
    }

    #[test]
    fn an_empty_mesh_is_never_hit() {
        let nothing = Raycaster::from_mesh(&Mesh::default());
        assert_eq!(nothing.cast_beam([0.0; 3], &[[1.0, 0.0, 0.0]]), [None]);
        assert_eq!(Raycaster::from_mesh(&Mesh::default()).cast([0.0; 3], [1.0, 0.0, 0.0]), None);
    }
}
