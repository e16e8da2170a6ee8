//! Where a ray first meets a scene.

use std::time::Duration;

use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::ray::{Ray, RayHit};
use obvhs::{Boundable, BvhBuildParams};

use crate::scene::{Mesh, Scene};

/// The nearest surface along a ray.
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

/// A bounding volume hierarchy over a scene's triangles.
///
/// Triangles count from both sides. Neighbours that share an edge leave no gap: the test is that of
/// Woop, Benthin and Wald (JCGT 2013), which decides an edge with the same numbers from either
/// side, and the boxes of the hierarchy are padded by more than their rounding.
#[derive(Clone)]
pub struct Raycaster {
    bvh: Bvh2,
    /// In the order of the hierarchy's leaves.
    triangles: Vec<Triangle>,
}

#[derive(Clone, Copy)]
struct Triangle {
    corners: [[f32; 3]; 3],
    index: u32,
    material: u8,
}

/// The box round a triangle, as the hierarchy wants it.
struct Padded([[f32; 3]; 3]);

impl Boundable for Padded {
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
        let boxes: Vec<Padded> =
            (0..mesh.triangles.len()).map(|t| Padded(mesh.corners(t))).collect();
        let bvh = build_bvh2(&boxes, BvhBuildParams::fast_build(), &mut Duration::default());
        let triangle = |&index: &u32| Triangle {
            corners: mesh.corners(index as usize),
            index,
            material: mesh.materials[index as usize],
        };
        let triangles = bvh.primitive_indices.iter().map(triangle).collect();
        Self { bvh, triangles }
    }

    /// The first surface from `origin` (metres) along `direction` (unit).
    #[must_use]
    pub fn cast(&self, origin: [f32; 3], direction: [f32; 3]) -> Option<Hit> {
        self.cast_within(origin, direction, f32::INFINITY)
    }

    /// As [`Raycaster::cast`], up to `max_m`.
    #[must_use]
    pub fn cast_within(&self, origin: [f32; 3], direction: [f32; 3], max_m: f32) -> Option<Hit> {
        let sheared = Sheared::new(origin, direction);
        let ray = Ray::new(origin.into(), direction.into(), 0.0, max_m);
        let mut nearest = RayHit::none();
        let meet = |_: &Ray, slot: usize| sheared.meets(&self.triangles[slot].corners);
        if !self.bvh.ray_traverse(ray, &mut nearest, meet) {
            return None;
        }
        let triangle = &self.triangles[nearest.primitive_id as usize];
        Some(Hit {
            range_m: nearest.t,
            triangle: triangle.index,
            cos_incidence: cos_incidence(&triangle.corners, direction),
            material: triangle.material,
        })
    }

    /// True when nothing lies between two points, metres.
    #[must_use]
    pub fn sees(&self, from: [f32; 3], to: [f32; 3]) -> bool {
        let way = difference(to, from);
        let distance = dot(way, way).sqrt();
        distance == 0.0 || self.cast_within(from, way.map(|x| x / distance), distance).is_none()
    }
}

/// A ray in coordinates in which it runs along +z from the origin with unit slope.
#[derive(Clone, Copy)]
struct Sheared {
    origin: [f32; 3],
    axes: [usize; 3],
    shear: [f32; 3],
}

impl Sheared {
    fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let magnitude = direction.map(f32::abs);
        let z = (0..3).fold(0, |best, i| if magnitude[i] > magnitude[best] { i } else { best });
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let shear = [
            direction[axes[0]] / direction[z],
            direction[axes[1]] / direction[z],
            1.0 / direction[z],
        ];
        Self { origin, axes, shear }
    }

    /// Distance to a triangle, infinite for a miss.
    fn meets(&self, corners: &[[f32; 3]; 3]) -> f32 {
        let [a, b, c] = corners.map(|p| self.shift(p));
        let mut edges =
            [c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]];
        if edges.contains(&0.0) {
            // On an edge, as far as f32 can tell: exact products decide for both neighbours alike.
            let exact = |p: [f32; 3], q: [f32; 3]| {
                (f64::from(p[0]) * f64::from(q[1]) - f64::from(p[1]) * f64::from(q[0])) as f32
            };
            edges = [exact(c, b), exact(a, c), exact(b, a)];
        }
        let outside = edges.iter().any(|&e| e < 0.0) && edges.iter().any(|&e| e > 0.0);
        let whole = edges[0] + edges[1] + edges[2];
        if outside || whole == 0.0 {
            return f32::INFINITY;
        }
        let depth = (edges[0] * a[2] + edges[1] * b[2] + edges[2] * c[2]) / whole;
        if depth > 0.0 { depth } else { f32::INFINITY }
    }

    fn shift(&self, p: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.axes.map(|axis| p[axis] - self.origin[axis]);
        [x - self.shear[0] * z, y - self.shear[1] * z, self.shear[2] * z]
    }
}

fn cos_incidence(&[a, b, c]: &[[f32; 3]; 3], direction: [f32; 3]) -> f32 {
    let (e, f) = (difference(b, a), difference(c, a));
    let normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    let length = (dot(normal, normal) * dot(direction, direction)).sqrt();
    if length > 0.0 { (dot(normal, direction) / length).abs().min(1.0) } else { 0.0 }
}

fn difference(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
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

    #[test]
    fn the_nearest_hit_is_the_one_brute_force_finds() {
        let mut rng = Generator::new(11, 0);
        let soup = (0..300).map(|_| {
            let centre = point(&mut rng, 10.0);
            [0; 3].map(|_| {
                let p = point(&mut rng, 4.0);
                std::array::from_fn(|i| centre[i] + p[i])
            })
        });
        let mesh = mesh(soup.collect());
        let caster = Raycaster::from_mesh(&mesh);
        let mut hits = 0;
        for _ in 0..5000 {
            let (origin, direction) = (point(&mut rng, 12.0), rng.direction().map(|x| x as f32));
            let sheared = Sheared::new(origin, direction);
            let ranges = (0..300).map(|t| sheared.meets(&mesh.corners(t)));
            let nearest = ranges.fold(f32::INFINITY, f32::min);
            let found = caster.cast(origin, direction);
            assert_eq!(found.map_or(f32::INFINITY, |hit| hit.range_m), nearest);
            hits += usize::from(found.is_some());
        }
        assert!(hits > 1000);
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
                let way = difference(target, origin);
                way.map(|x| x / dot(way, way).sqrt())
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
        assert_eq!(Raycaster::from_mesh(&Mesh::default()).cast([0.0; 3], [1.0, 0.0, 0.0]), None);
    }
}
