//! Viewpoint of a single sensor, for a place in which no pair fits.

use nalgebra::Isometry3;

use super::ground::{GroundMap, REACH_M, is_level, most_fall_m};
use super::{PairPlan, PairSearch, STRUCTURE_SHARE, ViewpointError, pose};
use crate::raycast::Raycaster;
use crate::scene::Scene;

/// Places tried for each kind of footing.
const ATTEMPTS: usize = 2000;

/// Random stream, distinct from those of the pairs.
const STREAM: u64 = 110;

/// Height above the ground from which on a surface is a crown, a roof or a bridge, metres.
const ABOVE_GROUND_M: f64 = 0.5;

/// Largest share of the vertices around a place that may lie below its possible ground.
const MAX_BELOW: f64 = 0.2;

/// Largest share of the points within 6 m to every side that may have nothing below them: ground
/// extends around a place.
const MAX_VOIDS: f64 = 0.25;

/// Support of a sensor, the best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Footing {
    /// Open ground.
    Open,
    /// Ground below a canopy or a roof.
    Covered,
    /// The uppermost surface, with ground below it: a crown, a roof, a bridge.
    Top,
}

/// Order of the search: a footing, and true where enough structure must be in view.
const SEARCH_ORDER: [(Footing, bool); 5] = [
    (Footing::Open, true),
    (Footing::Covered, true),
    (Footing::Open, false),
    (Footing::Covered, false),
    (Footing::Top, false),
];

/// Viewpoint of a single sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standpoint {
    /// Pose: x forward, y left, z up.
    pub world_from_sensor: Isometry3<f64>,
    /// Support of the sensor.
    pub footing: Footing,
    /// True when as much structure is in view as a pair needs.
    pub sees_enough: bool,
}

/// Finds a viewpoint for a single sensor, with the seed, height and tilt of the plan.
///
/// Tries open ground as for a pair, then covered ground, first with enough structure in view and
/// then without; last any top surface. Nothing may be within a metre sideways.
///
/// # Errors
///
/// [`ViewpointError`] when the plan makes no sense or no place is fit.
pub fn find_standpoint(
    scene: &Scene,
    caster: &Raycaster,
    plan: &PairPlan,
) -> Result<Standpoint, ViewpointError> {
    plan.check()?;
    let mut search = PairSearch::new(scene, caster, plan, STREAM);
    for (footing, must_see) in SEARCH_ORDER {
        for _ in 0..ATTEMPTS {
            let candidate = search.draw(0);
            let at = candidate.places[0];
            let Some(eye) = search.stand(scene, at, footing) else { continue };
            let seen = eye.map(|x| x as f32);
            if !search.is_free(seen, footing) {
                continue;
            }
            let sees_enough = search.structure(seen, candidate.headings[0]) >= STRUCTURE_SHARE;
            // Last, because it visits the whole mesh.
            let off_ground =
                || search.ground.is_not_ground(scene, caster, at, eye[2] - plan.height_m);
            if (sees_enough || !must_see) && (footing == Footing::Top || !off_ground()) {
                let world_from_sensor = pose(eye, candidate.headings[0], candidate.tilts[0]);
                return Ok(Standpoint { world_from_sensor, footing, sees_enough });
            }
        }
    }
    Err(ViewpointError::Nowhere {
        scene: scene.name.clone(),
        attempts: SEARCH_ORDER.len() * ATTEMPTS,
    })
}

impl PairSearch<'_> {
    fn stand(&self, scene: &Scene, at: [f64; 2], footing: Footing) -> Option<[f64; 3]> {
        let ground = |at| self.ground.lowest(scene, self.caster, at);
        let z = match footing {
            Footing::Covered => ground(at).filter(|z| is_level(ground, at, *z))?,
            Footing::Open | Footing::Top => self.ground.footing(self.caster, at)?,
        };
        Some([at[0], at[1], z + self.plan.height_m])
    }

    fn is_free(&self, eye: [f32; 3], footing: Footing) -> bool {
        match footing {
            Footing::Covered => {
                let down = self.caster.cast(eye, [0.0, 0.0, -1.0]);
                let stands = down.is_some_and(|hit| hit.range_m > self.plan.height_m as f32 - 0.1);
                let covered = self.caster.cast(eye, [0.0, 0.0, 1.0]).is_some();
                stands && covered && self.is_clear_sideways(self.caster, eye)
            }
            Footing::Open | Footing::Top => self.is_clear(self.caster, eye),
        }
    }
}

/// True when a sensor stands on something other than ground: a crown, a roof, a bridge.
pub fn stands_off_ground(
    scene: &Scene,
    caster: &Raycaster,
    world_from_sensor: &Isometry3<f64>,
) -> bool {
    let [x, y, z]: [f64; 3] = world_from_sensor.translation.vector.into();
    let down = caster.cast([x, y, z].map(|x| x as f32), [0.0, 0.0, -1.0]);
    let z = down.map(|hit| z - f64::from(hit.range_m));
    z.is_some_and(|z| GroundMap::new(scene).is_not_ground(scene, caster, [x, y], z))
}

impl GroundMap {
    /// True when a surface at height `z` is no ground: there is ground below it, too many vertices
    /// around it lie below its possible ground, or too little surface is around it.
    fn is_not_ground(&self, scene: &Scene, caster: &Raycaster, at: [f64; 2], z: f64) -> bool {
        let below = self.lowest(scene, caster, at);
        below.is_some_and(|ground| z - ground > ABOVE_GROUND_M)
            || share_below(scene, at, z) > MAX_BELOW
            || self.share_of_voids(caster, at) > MAX_VOIDS
    }

    /// Share of the points around a place with nothing below them.
    fn share_of_voids(&self, caster: &Raycaster, at: [f64; 2]) -> f64 {
        let steps = || (-3..=3).map(|k| 2.0 * f64::from(k));
        let around = || steps().flat_map(|dx| steps().map(move |dy| [at[0] + dx, at[1] + dy]));
        let nothing = around().filter(|at| self.seen_from_above(caster, *at).is_none());
        nothing.count() as f64 / around().count() as f64
    }

    /// Height of the lowest surface that faces up, metres. The underside of a slab faces down.
    fn lowest(&self, scene: &Scene, caster: &Raycaster, [x, y]: [f64; 2]) -> Option<f64> {
        /// Step past a surface, so that it is not hit again.
        const PAST_M: f32 = 0.01;
        /// Surfaces tried at most: a crown has some ten.
        const MAX_SURFACES: usize = 64;
        let mut from_m = self.depth_m;
        for _ in 0..MAX_SURFACES {
            let hit = caster.cast([x as f32, y as f32, from_m], [0.0, 0.0, 1.0])?;
            let height_m = from_m + hit.range_m;
            if faces_up(scene.mesh.corners(hit.triangle as usize)) {
                return Some(height_m.into());
            }
            from_m = height_m + PAST_M;
        }
        None
    }
}

/// Share of the vertices around a place that lie below its possible ground.
fn share_below(scene: &Scene, at: [f64; 2], z: f64) -> f64 {
    let near = |v: &[f32; 3]| {
        let away = [0, 1].map(|i| f64::from(v[i]) - at[i]);
        let away_m = (away[0] * away[0] + away[1] * away[1]).sqrt();
        (away_m < REACH_M).then(|| f64::from(v[2]) < z - most_fall_m(away_m))
    };
    let lower = scene.mesh.vertices.iter().filter_map(near);
    let (all, below) =
        lower.fold((0usize, 0usize), |(all, below), lower| (all + 1, below + usize::from(lower)));
    below as f64 / all.max(1) as f64
}

fn faces_up([a, b, c]: [[f32; 3]; 3]) -> bool {
    let side = |p: [f32; 3]| [p[0] - a[0], p[1] - a[1]];
    let (u, v) = (side(b), side(c));
    u[0] * v[1] > u[1] * v[0]
}
