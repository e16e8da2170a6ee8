//! Shapes that scenes are built from.

pub(crate) mod building;
pub(crate) mod dwelling;
pub(crate) mod grove;
pub(crate) mod house;
pub(crate) mod plants;
mod roof;
pub(crate) mod street;
pub(crate) mod terrain;
pub(crate) mod vehicle;

use super::material::Surface;
use super::mesh::Mesh;
use crate::vector::dot;
pub(crate) use crate::vector::{cross, sub};

/// A point, metres.
pub(crate) type Point = [f64; 3];

pub(crate) fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn scale(a: Point, s: f64) -> Point {
    a.map(|x| x * s)
}

/// Unit vector; the x axis for the zero vector.
pub(crate) fn unit(a: Point) -> Point {
    let length = dot(a, a).sqrt();
    if length > 0.0 { scale(a, 1.0 / length) } else { [1.0, 0.0, 0.0] }
}

/// Two unit vectors perpendicular to `axis` and to each other.
pub(crate) fn square_to(axis: Point) -> (Point, Point) {
    let helper = if axis[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let u = unit(cross(axis, helper));
    (u, cross(unit(axis), u))
}

/// Pose of a part: `world_from_part`, turned about z only.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    origin: Point,
    cos: f64,
    sin: f64,
}

impl Frame {
    pub(crate) fn new(origin: Point, yaw_rad: f64) -> Self {
        let (cos, sin) = (libm::cos(yaw_rad), libm::sin(yaw_rad));
        Self { origin, cos, sin }
    }

    /// World coordinates of a point of the part.
    pub(crate) fn at(&self, p: Point) -> Point {
        [
            self.origin[0] + self.cos * p[0] - self.sin * p[1],
            self.origin[1] + self.sin * p[0] + self.cos * p[1],
            self.origin[2] + p[2],
        ]
    }

    /// Frame given relative to this one.
    pub(crate) fn child(&self, origin: Point, yaw_rad: f64) -> Self {
        let turn = Self::new(self.at(origin), yaw_rad);
        let cos = self.cos * turn.cos - self.sin * turn.sin;
        let sin = self.sin * turn.cos + self.cos * turn.sin;
        Self { origin: turn.origin, cos, sin }
    }
}

/// End of a round bar: its centre, and its radius in metres.
pub(crate) type End = (Point, f64);

/// Builder of a mesh.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    /// Mesh so far.
    pub(crate) mesh: Mesh,
}

impl Builder {
    fn vertex(&mut self, p: Point) -> u32 {
        self.mesh.vertices.push(p.map(|x| x as f32));
        self.mesh.vertices.len() as u32 - 1
    }

    /// Adds a face; skips one that a pole or a seam has collapsed to a line.
    fn face(&mut self, corners: [u32; 3], surface: Surface) {
        let [a, b, c] = corners.map(|i| self.mesh.vertices[i as usize]);
        if a == b || b == c || c == a {
            return;
        }
        self.mesh.triangles.push(corners);
        self.mesh.materials.push(surface.index());
    }

    pub(crate) fn triangle(&mut self, corners: [Point; 3], surface: Surface) {
        let corners = corners.map(|p| self.vertex(p));
        self.face(corners, surface);
    }

    /// Quadrilateral with its corners in order.
    pub(crate) fn quad(&mut self, corners: [Point; 4], surface: Surface) {
        let [a, b, c, d] = corners.map(|p| self.vertex(p));
        self.face([a, b, c], surface);
        self.face([a, c, d], surface);
    }

    /// Sheet of `columns` × `rows` cells whose corners `point(column, row)` are shared.
    pub(crate) fn sheet(
        &mut self,
        columns: usize,
        rows: usize,
        point: impl Fn(usize, usize) -> Point,
        surface: impl Fn(usize, usize) -> Surface,
    ) {
        let base = self.mesh.vertices.len() as u32;
        let stride = columns as u32 + 1;
        for row in 0..=rows {
            for column in 0..=columns {
                self.vertex(point(column, row));
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let a = base + row as u32 * stride + column as u32;
                let surface = surface(column, row);
                self.face([a, a + 1, a + stride + 1], surface);
                self.face([a, a + stride + 1, a + stride], surface);
            }
        }
    }

    /// Closed box between two corners in the frame.
    pub(crate) fn cuboid(&mut self, frame: &Frame, low: Point, high: Point, surface: Surface) {
        let corner: [u32; 8] = std::array::from_fn(|i| {
            let side = |axis: usize| {
                if i >> axis & 1 == 0 { low[axis] } else { high[axis] }
            };
            self.vertex(frame.at([side(0), side(1), side(2)]))
        });
        for [a, b, c, d] in
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
        {
            self.face([corner[a], corner[b], corner[c]], surface);
            self.face([corner[a], corner[c], corner[d]], surface);
        }
    }

    /// Round bar with closed ends.
    pub(crate) fn tube(
        &mut self,
        (a, radius_a): End,
        (b, radius_b): End,
        sides: usize,
        surface: Surface,
    ) {
        let rim = self.branch((a, radius_a), (b, radius_b), sides, surface);
        let (tip_a, tip_b) = (self.vertex(a), self.vertex(b));
        for side in 0..sides as u32 {
            let [p, q] = [rim + 2 * side, rim + 2 * ((side + 1) % sides as u32)];
            self.face([tip_a, p, q], surface);
            self.face([tip_b, p + 1, q + 1], surface);
        }
    }

    /// Round bar without ends; returns its first vertex, from which the vertices of `a` and `b`
    /// alternate.
    pub(crate) fn branch(
        &mut self,
        (a, radius_a): End,
        (b, radius_b): End,
        sides: usize,
        surface: Surface,
    ) -> u32 {
        let (u, v) = square_to(unit(sub(b, a)));
        let base = self.mesh.vertices.len() as u32;
        for side in 0..sides {
            let turn = std::f64::consts::TAU * side as f64 / sides as f64;
            let out = add(scale(u, libm::cos(turn)), scale(v, libm::sin(turn)));
            self.vertex(add(a, scale(out, radius_a)));
            self.vertex(add(b, scale(out, radius_b)));
        }
        for side in 0..sides as u32 {
            let [p, q] = [base + 2 * side, base + 2 * ((side + 1) % sides as u32)];
            self.face([p, q, q + 1], surface);
            self.face([p, q + 1, p + 1], surface);
        }
        base
    }

    /// Leaf: a rhombus `length_m` long.
    pub(crate) fn leaf(
        &mut self,
        centre: Point,
        along: Point,
        normal: Point,
        length_m: f64,
        surface: Surface,
    ) {
        let side = scale(unit(cross(along, normal)), 0.3 * length_m);
        let half = scale(unit(along), 0.5 * length_m);
        let corners = [sub(centre, half), add(centre, side), add(centre, half), sub(centre, side)];
        self.quad(corners, surface);
    }
}
