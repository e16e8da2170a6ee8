//! Test for ground in a mesh, and the plane fitted under one that has none.

use crate::raycast::Raycaster;
use crate::scene::{Mesh, Surface};

/// Side of the cells of which the lowest vertex counts, metres.
const CELL_M: f32 = 10.0;
/// Margin of an added plane around the mesh, metres: as far as the sensor sees.
const APRON_M: f32 = 130.0;
/// Side of the tiles of an added plane, metres; small ones keep the boxes of the ray caster tight.
const TILE_M: f32 = 10.0;

/// `z = a·x + b·y + c`, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Slope along x.
    pub a: f64,
    /// Slope along y.
    pub b: f64,
    /// Height at the origin, metres.
    pub c: f64,
}

impl Plane {
    /// Height at a point, metres.
    #[must_use]
    pub fn height(&self, x: f64, y: f64) -> f64 {
        self.a * x + self.b * y + self.c
    }

    /// True when the plane rises by at most 1 m per metre and its height at the origin is within
    /// the reach of a place, metres.
    #[must_use]
    pub fn is_ground(&self, max_reach_m: f32) -> bool {
        self.a.abs() <= 1.0 && self.b.abs() <= 1.0 && self.c.abs() <= f64::from(max_reach_m)
    }

    /// Asphalt plane under a mesh of these bounds, with the margin.
    pub(super) fn mesh(&self, low: [f32; 3], high: [f32; 3]) -> Mesh {
        let count =
            |i: usize| ((high[i] - low[i] + 2.0 * APRON_M) / TILE_M).ceil().min(400.0) as u32;
        let size = [count(0), count(1)];
        let line = |i: usize, k: u32| {
            low[i] - APRON_M + (high[i] - low[i] + 2.0 * APRON_M) * k as f32 / size[i] as f32
        };
        let mut mesh = Mesh::default();
        for j in 0..=size[1] {
            for i in 0..=size[0] {
                let (x, y) = (line(0, i), line(1, j));
                mesh.vertices.push([x, y, self.height(x.into(), y.into()) as f32]);
            }
        }
        let row = size[0] + 1;
        for corner in (0..size[1]).flat_map(|j| (0..size[0]).map(move |i| j * row + i)) {
            let [a, b, c, d] = [corner, corner + 1, corner + row + 1, corner + row];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        mesh.materials = vec![Surface::Asphalt.index(); mesh.triangles.len()];
        mesh
    }
}

/// True when the mesh fills a quarter of its bounds or more, and 40 % of that is ground.
///
/// A point is ground when a ray from above and one from below meet the same surface, near the
/// lowest point around it. Rays between houses meet nothing, a house is met at its roof and its
/// floor, and a roof without a floor lies too high.
pub(super) fn has_ground(mesh: &Mesh) -> bool {
    const SIDE: u32 = 64;
    const SHEET_M: f32 = 0.3;
    const RISE_M: f32 = 2.2;
    let Some((low, high)) = mesh.bounds() else {
        return false;
    };
    let caster = Raycaster::from_mesh(mesh);
    let floor = Floor::new(mesh, 0.5 * CELL_M);
    let surface = |k: u32| {
        let t = [(k % SIDE) as f32 + 0.5, (k / SIDE) as f32 + 0.5].map(|x| x / SIDE as f32);
        let at = [low[0] + t[0] * (high[0] - low[0]), low[1] + t[1] * (high[1] - low[1])];
        let (top, bottom) = (high[2] + 1.0, low[2] - 1.0);
        let down = caster.cast([at[0], at[1], top], [0.0, 0.0, -1.0]).map(|hit| top - hit.range_m);
        let up =
            caster.cast([at[0], at[1], bottom], [0.0, 0.0, 1.0]).map(|hit| bottom + hit.range_m);
        let (down, up) = (down?, up?);
        Some(down - up < SHEET_M && down - floor.around(at) < RISE_M)
    };
    let met: Vec<bool> = (0..SIDE * SIDE).filter_map(surface).collect();
    let ground = met.iter().filter(|&&is_ground| is_ground).count();
    // A quarter and 40 %, in integers.
    4 * met.len() > (SIDE * SIDE) as usize && 5 * ground > 2 * met.len()
}

/// Plane through the lowest vertices of the cells.
///
/// Least squares with Cauchy weights of the residual over its median: cells that hold only an
/// overhanging roof lie far above the plane and lose their weight.
pub(super) fn fit(mesh: &Mesh) -> Plane {
    let feet = Floor::new(mesh, CELL_M).feet();
    let lowest = feet.iter().map(|p| p[2]).fold(f64::INFINITY, f64::min);
    let level = Plane { a: 0.0, b: 0.0, c: if lowest.is_finite() { lowest } else { 0.0 } };
    // Too few cells to tell a slope from an overhang.
    if feet.len() < 12 {
        return level;
    }
    let mut plane = Plane { c: median(feet.iter().map(|p| p[2]).collect()), ..level };
    for _ in 0..30 {
        let residual = |p: &[f64; 3]| p[2] - plane.height(p[0], p[1]);
        // At least 5 cm: on a perfect plane the median is 0, which cannot divide.
        let scale = median(feet.iter().map(|p| residual(p).abs()).collect()).max(0.05);
        let weights: Vec<f64> = feet
            .iter()
            .map(|p| 1.0 / (1.0 + (residual(p) / scale) * (residual(p) / scale)))
            .collect();
        match weighted_fit(&feet, &weights) {
            Some(better) => plane = better,
            None => return level,
        }
    }
    plane
}

fn weighted_fit(points: &[[f64; 3]], weights: &[f64]) -> Option<Plane> {
    let mut normal = nalgebra::Matrix3::zeros();
    let mut right = nalgebra::Vector3::zeros();
    for (p, w) in points.iter().zip(weights) {
        let row = nalgebra::Vector3::new(p[0], p[1], 1.0);
        normal += *w * row * row.transpose();
        right += *w * p[2] * row;
    }
    let [a, b, c] = normal.cholesky()?.solve(&right).into();
    [a, b, c].iter().all(|x: &f64| x.is_finite()).then_some(Plane { a, b, c })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Lowest vertex of every cell.
struct Floor {
    low: [f32; 2],
    cell_m: f32,
    size: [usize; 2],
    lowest: Vec<Option<[f32; 3]>>,
}

impl Floor {
    fn new(mesh: &Mesh, cell_m: f32) -> Self {
        let (low, high) = mesh.bounds().unwrap_or_default();
        let size = [0, 1].map(|i| ((high[i] - low[i]) / cell_m) as usize + 1);
        let mut floor =
            Self { low: [low[0], low[1]], cell_m, size, lowest: vec![None; size[0] * size[1]] };
        for v in &mesh.vertices {
            let [i, j] = floor.cell([v[0], v[1]]);
            let cell = &mut floor.lowest[j * size[0] + i];
            if cell.is_none_or(|low| v[2] < low[2]) {
                *cell = Some(*v);
            }
        }
        floor
    }

    fn cell(&self, at: [f32; 2]) -> [usize; 2] {
        [0, 1].map(|i| {
            (((at[i] - self.low[i]) / self.cell_m).max(0.0) as usize).min(self.size[i] - 1)
        })
    }

    fn feet(&self) -> Vec<[f64; 3]> {
        self.lowest.iter().flatten().map(|p| p.map(f64::from)).collect()
    }

    /// Lowest vertex in the cell of a point and its neighbours.
    fn around(&self, at: [f32; 2]) -> f32 {
        let [i, j] = self.cell(at);
        let near = |k: usize, end: usize| k.saturating_sub(1)..(k + 2).min(end);
        let cells = near(j, self.size[1]).flat_map(|j| near(i, self.size[0]).map(move |i| (i, j)));
        cells
            .filter_map(|(i, j)| self.lowest[j * self.size[0] + i])
            .fold(f32::INFINITY, |low, p| low.min(p[2]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{SceneKind, generate};

    #[test]
    fn generated_places_have_ground_of_their_own() {
        for kind in SceneKind::ALL {
            assert!(has_ground(&generate(kind, 1).mesh), "{kind}");
        }
    }

    #[test]
    fn a_plane_is_found_under_overhanging_roofs() {
        let truth = Plane { a: 0.01, b: -0.02, c: 3.0 };
        let mut mesh = Mesh::default();
        for k in 0..400 {
            let (x, y) = (f64::from(k % 20) * 10.0, f64::from(k / 20) * 10.0);
            let roof = if k % 5 == 0 { 8.0 } else { 0.0 };
            mesh.vertices.push([x, y, truth.height(x, y) + roof].map(|v| v as f32));
        }
        let found = fit(&mesh);
        assert!((found.a - truth.a).abs() < 1e-3 && (found.b - truth.b).abs() < 1e-3, "{found:?}");
        assert!((found.height(95.0, 95.0) - truth.height(95.0, 95.0)).abs() < 0.05, "{found:?}");
    }

    #[test]
    fn a_single_box_stands_on_a_level_plane_at_its_foot() {
        let mesh = Mesh {
            vertices: vec![[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 5.0]],
            ..Mesh::default()
        };
        assert_eq!(fit(&mesh), Plane { a: 0.0, b: 0.0, c: 1.0 });
    }
}
