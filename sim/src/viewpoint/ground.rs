//! Ground of a place: neither roof, car, canopy nor slope.

use std::cell::RefCell;
use std::collections::HashMap;

use crate::raycast::Raycaster;
use crate::scene::Scene;

/// Distance between survey points, metres.
const STEP_M: f64 = 2.0;
/// Radius in which lower ground is searched, metres: half the width of a large roof.
pub(super) const REACH_M: f64 = 24.0;
/// Largest slope of ground, metres per metre.
const MAX_SLOPE: f64 = 0.35;
/// Largest step of ground, metres: kerbs, tufts.
const ROUGH_M: f64 = 0.35;

/// Heights of the top surface on a grid around the area of the viewpoints. Each is computed on
/// first use: a place of 10 km has 25 million, of which a few thousand lie around its viewpoints.
///
/// A point is ground when no neighbour lies below the cone that falls away from it with the largest
/// slope: the slope-based filter of airborne LiDAR (Vosselman 2000).
pub(super) struct GroundMap {
    low: [f64; 2],
    size: [usize; 2],
    heights: RefCell<HashMap<usize, Option<f64>>>,
    /// Heights above and below all surfaces, metres.
    sky_m: f32,
    pub(super) depth_m: f32,
}

impl GroundMap {
    pub(super) fn new(scene: &Scene) -> Self {
        let (low, high) = scene.area;
        let bounds = scene.mesh.bounds();
        let sky_m = bounds.map_or(0.0, |(_, top)| top[2]) + 1.0;
        let depth_m = bounds.map_or(0.0, |(bottom, _)| bottom[2]) - 1.0;
        let low = low.map(|x| f64::from(x) - REACH_M);
        let size = [0, 1].map(|i| ((f64::from(high[i]) + REACH_M - low[i]) / STEP_M) as usize + 1);
        Self { low, size, heights: RefCell::default(), sky_m, depth_m }
    }

    /// Height of open ground at a point where a sensor can stand, metres.
    pub(super) fn footing(&self, caster: &Raycaster, at: [f64; 2]) -> Option<f64> {
        let z = self.seen_from_above(caster, at)?;
        (is_level(|at| self.seen_from_above(caster, at), at, z) && self.is_lowest(caster, at, z))
            .then_some(z)
    }

    /// Height of the top surface, metres.
    pub(super) fn seen_from_above(&self, caster: &Raycaster, at: [f64; 2]) -> Option<f64> {
        let hit = caster.cast([at[0] as f32, at[1] as f32, self.sky_m], [0.0, 0.0, -1.0])?;
        Some(f64::from(self.sky_m - hit.range_m))
    }

    /// Height of the top surface at a grid point, metres.
    fn height(&self, caster: &Raycaster, [i, j]: [usize; 2]) -> Option<f64> {
        let at = [self.low[0] + STEP_M * i as f64, self.low[1] + STEP_M * j as f64];
        let mut heights = self.heights.borrow_mut();
        *heights.entry(j * self.size[0] + i).or_insert_with(|| self.seen_from_above(caster, at))
    }

    /// True when no grid point within [`REACH_M`] lies below the cone.
    fn is_lowest(&self, caster: &Raycaster, at: [f64; 2], z: f64) -> bool {
        let range = |axis: usize| {
            let middle = (at[axis] - self.low[axis]) / STEP_M;
            let first = (middle - REACH_M / STEP_M).max(0.0) as usize;
            first..((middle + REACH_M / STEP_M) as usize + 1).min(self.size[axis])
        };
        range(1).all(|j| {
            range(0).all(|i| {
                let (dx, dy) = (
                    self.low[0] + STEP_M * i as f64 - at[0],
                    self.low[1] + STEP_M * j as f64 - at[1],
                );
                let fall = most_fall_m((dx * dx + dy * dy).sqrt());
                self.height(caster, [i, j]).is_none_or(|low| z - low <= fall)
            })
        })
    }
}

/// Largest fall of ground over a distance, metres.
pub(super) fn most_fall_m(away_m: f64) -> f64 {
    ROUGH_M + MAX_SLOPE * away_m
}

/// True when a surface with the heights `height` differs little half a metre beside a point at
/// height `z`.
pub(super) fn is_level(height: impl Fn([f64; 2]) -> Option<f64>, at: [f64; 2], z: f64) -> bool {
    [[0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]].iter().all(|d| {
        let beside = height([at[0] + d[0], at[1] + d[1]]);
        beside.is_some_and(|b| (b - z).abs() < 0.5 * MAX_SLOPE + ROUGH_M)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;

    /// Flat ground with a side of 10 km, in two triangles.
    fn plain() -> Scene {
        let half_m = 5000.0;
        let corner = |x: f32, y: f32| [x * half_m, y * half_m, 0.0];
        let vertices = vec![corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)];
        let mesh = Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]], materials: vec![0, 0] };
        let area = ([-half_m; 2], [half_m; 2]);
        Scene::new("plain", mesh, area)
    }

    #[test]
    fn in_a_place_of_10_km_only_heights_around_a_viewpoint_are_computed() {
        let scene = plain();
        let caster = Raycaster::from_mesh(&scene.mesh);
        let ground = GroundMap::new(&scene);
        assert!(ground.size[0] * ground.size[1] > 25_000_000);
        assert!(ground.heights.borrow().is_empty());
        let found = ground.footing(&caster, [1234.5, -2345.6]);
        assert!(found.is_some_and(|height_m| height_m.abs() < 1e-3), "{found:?}");
        let around = (2.0 * REACH_M / STEP_M + 2.0) as usize;
        let looked_up = ground.heights.borrow().len();
        assert!((1..=around * around).contains(&looked_up), "{looked_up}");
    }
}
