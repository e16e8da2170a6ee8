//! Viewpoints: pairs of sensor poses in a scene at which a surveyor could stand.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use thiserror::Error;

use crate::raycast::Raycaster;
use crate::scene::{Placement, Scene};
use echoloop_random::Generator;

mod ground;
mod overlap;
mod single_viewpoint;
mod split;

use ground::GroundMap;
pub use overlap::Sight;
pub use single_viewpoint::{Footing, Standpoint, find_standpoint, stands_off_ground};
pub use split::Split;
use split::Territory;

/// Free space a sensor needs to every side, metres.
const CLEARANCE_M: f32 = 1.0;
/// Largest range of structure, metres.
const STRUCTURE_M: f32 = 60.0;
/// Least share of rays into the field of view that must meet structure.
const STRUCTURE_SHARE: f64 = 0.3;
/// Largest distance of a sensor from the middle of its lane, metres.
const MAX_LANE_OFFSET_M: f64 = 0.5;
/// Candidates within the split's part of the place that are tried per pair before giving up.
const ATTEMPTS_A_PAIR: usize = 2000;
/// Candidates drawn one after the other outside that part before giving up. Of pairs 40 m apart one
/// in some thousand has both ends in parts for training, and a draw takes no ray.
const MOST_STRAYED: usize = 1_000_000;

/// Plan of the pairs to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairPlan {
    /// Pairs wanted.
    pub count: usize,
    /// Horizontal distance from the first sensor to the second, metres.
    pub baseline_m: f64,
    /// Largest distance of a pair as a multiple of `baseline_m`; each is drawn uniformly up to it.
    pub baseline_factor: f64,
    /// Number of pairs, the first ones, with such a distance; the others are `baseline_m` apart.
    pub farther: usize,
    /// Largest deviation from the first heading of the second heading, and of the direction from
    /// the first sensor to the second, degrees.
    pub heading_range_deg: f64,
    /// Largest roll and pitch of each sensor, degrees.
    pub tilt_range_deg: f64,
    /// Height of the sensor above the ground, metres.
    pub height_m: f64,
    /// Seed of the random numbers: the same seed gives the same pairs.
    pub seed: u64,
    /// Part of the place to stand in.
    pub split: Split,
}

impl Default for PairPlan {
    fn default() -> Self {
        Self {
            count: 10,
            baseline_m: 5.0,
            baseline_factor: 1.0,
            farther: usize::MAX,
            heading_range_deg: 20.0,
            tilt_range_deg: 2.0,
            height_m: 2.0,
            seed: 0,
            split: Split::Train,
        }
    }
}

/// Two poses that see the same surroundings; `world_from_first⁻¹ · world_from_second` is the true
/// result of a registration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePair {
    /// First pose: x forward, y left, z up.
    pub world_from_first: Isometry3<f64>,
    /// Second pose.
    pub world_from_second: Isometry3<f64>,
}

/// Number of rejected candidates, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejections {
    /// In the other split's part of the place, or too near it.
    pub territory: usize,
    /// No ground below, or on a roof, a car, a slope, or under a canopy.
    pub footing: usize,
    /// A surface within a metre.
    pub clearance: usize,
    /// The two poses do not see each other.
    pub sight: usize,
    /// Too little structure in view.
    pub structure: usize,
    /// Turned down by the caller: too much or too little overlap.
    pub unwanted: usize,
}

/// Reason why no pairs could be sampled.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ViewpointError {
    /// The plan cannot be satisfied in any place.
    #[error("{field} is {value}, expected {expected}")]
    BadPlan {
        /// The field of [`PairPlan`].
        field: &'static str,
        /// Its value.
        value: f64,
        /// Expected value.
        expected: &'static str,
    },
    /// The place has no viewpoint even for a single sensor.
    #[error(
        "{scene} has no place where a sensor could stand, after {attempts} tried: no level ground, \
         or something within a metre everywhere"
    )]
    Nowhere {
        /// The scene's name.
        scene: String,
        /// Number of places tried.
        attempts: usize,
    },
    /// The place has too few viewpoints.
    #[error(
        "{scene} has no viable viewpoint for pair {found} of {wanted} after {attempts} candidates \
         ({} in the other split, {} without footing, {} hemmed in, {} out of sight, {} with too \
         little to see, {} that share too much or too little)",
        rejected.territory, rejected.footing, rejected.clearance, rejected.sight,
        rejected.structure, rejected.unwanted
    )]
    NoViewpoint {
        /// The scene's name.
        scene: String,
        /// Number of pairs found.
        found: usize,
        /// Number of pairs wanted.
        wanted: usize,
        /// Number of candidates tried.
        attempts: usize,
        /// Reasons for their rejection.
        rejected: Rejections,
    },
}

/// Samples pairs of poses.
///
/// # Errors
///
/// [`ViewpointError`] when the plan makes no sense or the place has too few viewpoints.
pub fn sample_pairs(
    scene: &Scene,
    caster: &Raycaster,
    plan: &PairPlan,
) -> Result<Vec<PosePair>, ViewpointError> {
    sample_pairs_between(scene, [caster; 2], plan, &Some, &|_, _| ())
}

/// As [`sample_pairs`], for a place that differs between the first scan and the second.
///
/// `accept` maps each pair to a result, or turns it down with `None`. `progress` is called after
/// every candidate with the number of pairs found and of candidates tried, because a large place
/// takes long.
///
/// # Errors
///
/// As for [`sample_pairs`].
pub fn sample_pairs_between<T>(
    scene: &Scene,
    [caster, later]: [&Raycaster; 2],
    plan: &PairPlan,
    accept: &dyn Fn(PosePair) -> Option<T>,
    progress: &dyn Fn(usize, usize),
) -> Result<Vec<T>, ViewpointError> {
    plan.check()?;
    // Train and test have their own random streams, so that the poses of one do not depend on the
    // number of the other.
    let search = PairSearch::new(scene, caster, plan, 100 + plan.split as u64);
    let mut search = PairSearch { later, ..search };
    let (mut pairs, mut attempts, mut strayed) = (Vec::new(), 0, 0);
    while pairs.len() < plan.count
        && attempts - search.rejected.territory < plan.max_attempts(pairs.len())
        && strayed < MOST_STRAYED
    {
        let outside = search.rejected.territory;
        if let Some(pair) = search.try_candidate(pairs.len()) {
            let accepted = accept(pair);
            search.rejected.unwanted += usize::from(accepted.is_none());
            pairs.extend(accepted);
        }
        attempts += 1;
        strayed = if search.rejected.territory > outside { strayed + 1 } else { 0 };
        progress(pairs.len(), attempts);
    }
    if pairs.len() < plan.count {
        return Err(ViewpointError::NoViewpoint {
            scene: scene.name.clone(),
            found: pairs.len(),
            wanted: plan.count,
            attempts,
            rejected: search.rejected,
        });
    }
    Ok(pairs)
}

impl PairPlan {
    /// Candidates tried at most within the split's part of the place once `found` pairs exist: the
    /// budget of all pairs, or of ten more where that is less.
    fn max_attempts(&self, found: usize) -> usize {
        self.count.min(found + 10) * ATTEMPTS_A_PAIR
    }

    fn check(&self) -> Result<(), ViewpointError> {
        let rules = [
            ("baseline_m", self.baseline_m, self.baseline_m >= 0.0, "a distance in metres"),
            (
                "baseline_factor",
                self.baseline_factor,
                self.baseline_factor >= 1.0,
                "a factor of 1 or more",
            ),
            ("height_m", self.height_m, self.height_m > 0.0, "a height in metres"),
            (
                "heading_range_deg",
                self.heading_range_deg,
                (0.0..=180.0).contains(&self.heading_range_deg),
                "an angle of 0 to 180 degrees",
            ),
            (
                "tilt_range_deg",
                self.tilt_range_deg,
                (0.0..=45.0).contains(&self.tilt_range_deg),
                "an angle of 0 to 45 degrees",
            ),
        ];
        match rules.into_iter().find(|(_, value, holds, _)| !holds || !value.is_finite()) {
            Some((field, value, _, expected)) => {
                Err(ViewpointError::BadPlan { field, value, expected })
            }
            None => Ok(()),
        }
    }
}

/// Candidate pair that is not checked yet.
struct Candidate {
    /// x and y of both sensors, metres.
    places: [[f64; 2]; 2],
    /// Headings of both, radians.
    headings: [f64; 2],
    /// Pitch and roll of both, radians.
    tilts: [[f64; 2]; 2],
}

/// Counter of the reason for which a candidate is rejected.
type Rejection = fn(&mut Rejections) -> &mut usize;

/// State of the search for pairs.
struct PairSearch<'a> {
    caster: &'a Raycaster,
    /// Surfaces at the time of the second scan.
    later: &'a Raycaster,
    plan: &'a PairPlan,
    area: ([f32; 2], [f32; 2]),
    roads: &'a [Placement],
    ground: GroundMap,
    territory: Territory,
    rejected: Rejections,
    rng: Generator,
}

impl<'a> PairSearch<'a> {
    /// Search with the random stream `stream`.
    fn new(scene: &'a Scene, caster: &'a Raycaster, plan: &'a PairPlan, stream: u64) -> Self {
        Self {
            caster,
            later: caster,
            plan,
            area: scene.area,
            roads: &scene.roads,
            ground: GroundMap::new(scene),
            territory: Territory::new(scene.area, plan.split),
            rejected: Rejections::default(),
            rng: Generator::new(plan.seed, stream),
        }
    }

    /// Draws and checks one candidate, with `found` pairs so far; counts a rejection.
    fn try_candidate(&mut self, found: usize) -> Option<PosePair> {
        let candidate = self.draw(found);
        let verdict = self.verify(&candidate);
        verdict.map_err(|reason| *reason(&mut self.rejected) += 1).ok()
    }

    /// Draws a candidate, with `found` pairs so far.
    fn draw(&mut self, found: usize) -> Candidate {
        let Placement { at: [x, y, _], heading_rad: heading } = self.draw_placement();
        let reach = self.plan.heading_range_deg.to_radians();
        let tilt = self.plan.tilt_range_deg.to_radians();
        let way = heading + self.rng.spread(reach);
        let distance_m = self.distance_m(found);
        let step = [libm::cos(way), libm::sin(way)].map(|x| x * distance_m);
        Candidate {
            places: [[x, y], [x + step[0], y + step[1]]],
            headings: [heading, heading + self.rng.spread(reach)],
            tilts: [0; 2].map(|_| [0; 2].map(|_| self.rng.spread(tilt))),
        }
    }

    /// Draws a place and a heading: beside the middle of a lane where there are roads, anywhere
    /// otherwise.
    fn draw_placement(&mut self) -> Placement {
        let (low, high) = self.area;
        if self.roads.is_empty() {
            let [x, y] = [0, 1].map(|i| self.rng.range(f64::from(low[i]), f64::from(high[i])));
            return Placement { at: [x, y, 0.0], heading_rad: self.rng.turn() };
        }
        let Placement { at: [x, y, z], heading_rad } = self.roads[self.rng.index(self.roads.len())];
        let lane_offset_m = self.rng.spread(MAX_LANE_OFFSET_M);
        let (sin, cos) = (libm::sin(heading_rad), libm::cos(heading_rad));
        Placement { at: [x - lane_offset_m * sin, y + lane_offset_m * cos, z], heading_rad }
    }

    /// Distance of the next pair, metres. Takes no random number for a pair at the distance
    /// `baseline_m`.
    fn distance_m(&mut self, found: usize) -> f64 {
        let PairPlan { baseline_m, baseline_factor, farther, .. } = *self.plan;
        match baseline_factor > 1.0 && found < farther {
            true => self.rng.range(baseline_m, baseline_factor * baseline_m),
            false => baseline_m,
        }
    }

    /// Checks a candidate, cheap tests first.
    fn verify(&self, candidate: &Candidate) -> Result<PosePair, Rejection> {
        let require = |holds: bool, reason: Rejection| if holds { Ok(()) } else { Err(reason) };
        require(candidate.places.iter().all(|p| self.territory.owns(*p)), |r| &mut r.territory)?;
        let stand = |[x, y]: [f64; 2]| {
            let no_footing: Rejection = |r| &mut r.footing;
            let z = self.ground.footing(self.caster, [x, y]).ok_or(no_footing)?;
            Ok([x, y, z + self.plan.height_m])
        };
        let eyes = [stand(candidate.places[0])?, stand(candidate.places[1])?];
        let seen = eyes.map(|eye| eye.map(|x| x as f32));
        let is_clear = self.is_clear(self.caster, seen[0]) && self.is_clear(self.later, seen[1]);
        require(is_clear, |r| &mut r.clearance)?;
        require(self.are_in_sight(seen[0], seen[1]), |r| &mut r.sight)?;
        let enough = |k: usize| self.structure(seen[k], candidate.headings[k]) >= STRUCTURE_SHARE;
        require(enough(0) && enough(1), |r| &mut r.structure)?;
        let [first, second] =
            [0, 1].map(|k| pose(eyes[k], candidate.headings[k], candidate.tilts[k]));
        Ok(PosePair { world_from_first: first, world_from_second: second })
    }

    /// True when nothing is overhead and nothing within [`CLEARANCE_M`] sideways, at the sensor and
    /// at the hip of its carrier.
    fn is_clear(&self, caster: &Raycaster, eye: [f32; 3]) -> bool {
        self.is_clear_sideways(caster, eye) && caster.cast(eye, [0.0, 0.0, 1.0]).is_none()
    }

    fn is_clear_sideways(&self, caster: &Raycaster, eye: [f32; 3]) -> bool {
        let hip = [eye[0], eye[1], eye[2] - 0.5 * self.plan.height_m as f32];
        let around = |from: [f32; 3]| {
            level_rays(16, 0.0, 0.0, std::f64::consts::TAU)
                .all(|d| caster.cast_within(from, d, CLEARANCE_M).is_none())
        };
        around(eye) && around(hip)
    }

    /// True when three of five points are visible: the second sensor and four points 0.5 m beside
    /// it. Leaves may hide the others.
    fn are_in_sight(&self, first: [f32; 3], second: [f32; 3]) -> bool {
        let offsets =
            [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [-0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, -0.5, 0.0]];
        let moved =
            |o: [f32; 3]| self.caster.sees(first, std::array::from_fn(|i| second[i] + o[i]));
        offsets.into_iter().filter(|o| moved(*o)).count() >= 3
    }

    /// Share of rays into the front half, at and above the horizon, with a hit within
    /// [`STRUCTURE_M`].
    fn structure(&self, eye: [f32; 3], heading: f64) -> f64 {
        let quarter = std::f64::consts::FRAC_PI_2;
        let rays: Vec<[f32; 3]> = [0.0_f64, 4.0, 8.0, 12.0]
            .into_iter()
            .flat_map(|e| level_rays(24, e.to_radians(), heading - quarter, heading + quarter))
            .collect();
        let hits = rays.iter().filter(|d| self.caster.cast_within(eye, **d, STRUCTURE_M).is_some());
        hits.count() as f64 / rays.len() as f64
    }
}

/// Directions at one elevation, evenly spaced in azimuth, radians.
fn level_rays(count: u32, elevation: f64, from: f64, to: f64) -> impl Iterator<Item = [f32; 3]> {
    let (up, out) = (libm::sin(elevation), libm::cos(elevation));
    (0..count).map(move |k| {
        let turn = from + (to - from) * (f64::from(k) + 0.5) / f64::from(count);
        [out * libm::cos(turn), out * libm::sin(turn), up].map(|x| x as f32)
    })
}

/// `Rz(heading) · Ry(pitch) · Rx(roll)`, from the half angles of libm so that every machine gets
/// the same bits.
fn pose([x, y, z]: [f64; 3], heading: f64, [pitch, roll]: [f64; 2]) -> Isometry3<f64> {
    let half = |angle: f64| (libm::cos(0.5 * angle), libm::sin(0.5 * angle));
    let ((cy, sy), (cp, sp), (cr, sr)) = (half(heading), half(pitch), half(roll));
    let turn = Quaternion::new(cy, 0.0, 0.0, sy)
        * Quaternion::new(cp, 0.0, sp, 0.0)
        * Quaternion::new(cr, sr, 0.0, 0.0);
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(turn))
}

#[cfg(test)]
mod tests;
