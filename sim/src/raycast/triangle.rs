//! Watertight intersection of a ray and a triangle.

use crate::vector::{cross, dot, sub};

/// Triangle of the hierarchy.
#[derive(Clone, Copy)]
pub(super) struct Triangle {
    pub(super) corners: [[f32; 3]; 3],
    /// Index in its mesh.
    pub(super) index: u32,
    pub(super) material: u8,
}

/// Ray in coordinates in which it runs from the origin along +z with unit slope.
#[derive(Clone, Copy)]
pub(super) struct ShearedRay {
    pub(super) origin: [f32; 3],
    /// The two other axes, then the dominant axis.
    pub(super) axes: [usize; 3],
    pub(super) shear: [f32; 3],
}

impl ShearedRay {
    #[inline(always)]
    pub(super) fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let z = dominant_axis(direction);
        let axes = axes(z);
        let shear = [
            direction[axes[0]] / direction[z],
            direction[axes[1]] / direction[z],
            1.0 / direction[z],
        ];
        Self { origin, axes, shear }
    }

    /// Distance to a triangle, infinite for a miss.
    #[inline(always)]
    pub(super) fn distance_m(&self, corners: &[[f32; 3]; 3]) -> f32 {
        let [a, b, c] = [self.shift(&corners[0]), self.shift(&corners[1]), self.shift(&corners[2])];
        let mut edges =
            [c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]];
        if edges.contains(&0.0) {
            // On an edge as far as f32 can tell: exact products give both neighbours one answer.
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

    #[inline(always)]
    fn shift(&self, p: &[f32; 3]) -> [f32; 3] {
        let along = |i: usize| p[self.axes[i]] - self.origin[self.axes[i]];
        let [x, y, z] = [along(0), along(1), along(2)];
        [x - self.shear[0] * z, y - self.shear[1] * z, self.shear[2] * z]
    }
}

/// The two axes that are not `z`, and `z`.
#[inline(always)]
pub(super) fn axes(z: usize) -> [usize; 3] {
    [(z + 1) % 3, (z + 2) % 3, z]
}

/// Axis of the largest component of a direction.
#[inline(always)]
pub(super) fn dominant_axis(direction: [f32; 3]) -> usize {
    let magnitude = direction.map(f32::abs);
    (0..3).fold(0, |best, i| if magnitude[i] > magnitude[best] { i } else { best })
}

pub(super) fn cos_incidence(&[a, b, c]: &[[f32; 3]; 3], direction: [f32; 3]) -> f32 {
    let normal = cross(sub(b, a), sub(c, a));
    let length = (dot(normal, normal) * dot(direction, direction)).sqrt();
    if length > 0.0 { (dot(normal, direction) / length).abs().min(1.0) } else { 0.0 }
}
