//! Triangle mesh with one material a triangle.

use thiserror::Error;

use crate::vector::{cross, dot, sub};

/// Triangles in metres, z up, right-handed.
///
/// Faces count from both sides, so winding carries no meaning.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Corner positions, metres.
    pub vertices: Vec<[f32; 3]>,
    /// Three indices into `vertices` a triangle.
    pub triangles: Vec<[u32; 3]>,
    /// One index into the scene's material table a triangle.
    pub materials: Vec<u8>,
}

/// Reason why a mesh cannot be scanned.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeshFault {
    /// It has no faces.
    #[error("it has no faces")]
    NoFaces,
    /// A vertex is not finite.
    #[error("vertex {vertex} is not finite: ({}, {}, {})", at[0], at[1], at[2])]
    NotFinite {
        /// Index of the vertex, from 0.
        vertex: usize,
        /// Its coordinates, metres.
        at: [f32; 3],
    },
    /// A triangle names a vertex that does not exist.
    #[error("face {face} names vertex {index}, but there are only {vertices}")]
    IndexOutOfRange {
        /// Index of the face, from 0.
        face: usize,
        /// Index of the vertex it names.
        index: i64,
        /// Number of vertices.
        vertices: usize,
    },
    /// A triangle names a material that does not exist, or not every triangle names one.
    #[error("face {face} has no valid material")]
    NoMaterial {
        /// Index of the face, from 0.
        face: usize,
    },
    /// Every triangle is a line or a point.
    #[error("all {faces} faces have zero area")]
    NoArea {
        /// Number of faces.
        faces: usize,
    },
    /// The plane given as ground is too steep, too far, or not finite.
    #[error(
        "its ground z = {}·x + {}·y + {} must rise by at most 1 m per metre and lie within its \
         reach",
        plane[0], plane[1], plane[2]
    )]
    Ground {
        /// Slope along x, slope along y, height at the origin in metres.
        plane: [f64; 3],
    },
    /// The mesh is larger than any place: its unit is wrong, or its origin is far away.
    #[error(
        "it reaches {reach_m} m from its origin, more than {max_m} m: is its unit the metre and \
         its origin near?"
    )]
    TooLarge {
        /// Largest absolute coordinate, metres.
        reach_m: f32,
        /// The limit, metres.
        max_m: f32,
    },
}

impl Mesh {
    /// Three corners of a triangle, metres.
    ///
    /// # Panics
    ///
    /// When `triangle` or one of its indices is out of range; [`Mesh::check`] rules the latter out.
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [[f32; 3]; 3] {
        self.triangles[triangle].map(|i| self.vertices[i as usize])
    }

    /// Smallest and largest coordinates of all vertices, metres; `None` without vertices.
    #[must_use]
    pub fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(lo, hi), v| {
            (std::array::from_fn(|i| lo[i].min(v[i])), std::array::from_fn(|i| hi[i].max(v[i])))
        }))
    }

    /// Area of a triangle, m².
    #[must_use]
    pub fn area_m2(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.corners(triangle).map(|p| p.map(f64::from));
        let normal = cross(sub(b, a), sub(c, a));
        0.5 * dot(normal, normal).sqrt()
    }

    /// Adds another mesh to this one.
    pub fn append(&mut self, other: &Self) {
        let base = self.vertices.len() as u32;
        self.vertices.extend_from_slice(&other.vertices);
        let shifted = other.triangles.iter().map(|t| t.map(|i| i + base));
        self.triangles.extend(shifted);
        self.materials.extend_from_slice(&other.materials);
    }

    /// Checks that rays can be cast at this mesh.
    ///
    /// # Errors
    ///
    /// The first [`MeshFault`] found.
    pub fn check(&self, materials: usize, max_m: f32) -> Result<(), MeshFault> {
        self.check_vertices(max_m)?;
        self.check_triangles(materials)?;
        let faces = self.triangles.len();
        if !(0..faces).any(|t| self.area_m2(t) > 0.0) {
            return Err(MeshFault::NoArea { faces });
        }
        Ok(())
    }

    fn check_vertices(&self, max_m: f32) -> Result<(), MeshFault> {
        if self.triangles.is_empty() {
            return Err(MeshFault::NoFaces);
        }
        let bad = |v: &[f32; 3]| !v.iter().all(|x| x.is_finite());
        if let Some(vertex) = self.vertices.iter().position(bad) {
            let at = self.vertices[vertex];
            return Err(MeshFault::NotFinite { vertex, at });
        }
        let reach_m = self.vertices.iter().flatten().fold(0.0, |r: f32, x| r.max(x.abs()));
        if reach_m > max_m {
            return Err(MeshFault::TooLarge { reach_m, max_m });
        }
        Ok(())
    }

    fn check_triangles(&self, materials: usize) -> Result<(), MeshFault> {
        let vertices = self.vertices.len();
        for (face, triangle) in self.triangles.iter().enumerate() {
            if let Some(&index) = triangle.iter().find(|&&i| i as usize >= vertices) {
                let index = i64::from(index);
                return Err(MeshFault::IndexOutOfRange { face, index, vertices });
            }
            if self.materials.get(face).is_none_or(|&m| usize::from(m) >= materials) {
                return Err(MeshFault::NoMaterial { face });
            }
        }
        Ok(())
    }
}

/// FNV-1a over every vertex, corner and surface.
#[cfg(test)]
pub(crate) fn fingerprint(mesh: &Mesh) -> u64 {
    let vertices = mesh.vertices.iter().flatten().map(|v| v.to_bits());
    let rest = mesh.triangles.iter().flatten().copied();
    let words = vertices.chain(rest).chain(mesh.materials.iter().map(|&m| u32::from(m)));
    words.fold(0xcbf2_9ce4_8422_2325, |hash, word| {
        (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3)
    })
}
