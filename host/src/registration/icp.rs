//! Iterative closest point, point to plane.

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::normal_equations::{NormalEquations, Step};
use super::{ConfigError, IcpConfig, Observability, Outcome, PrepareError, Registration, Source, StopReason, Target};
use crate::cloud::Cloud;
use crate::pose::Pose;

/// Points a thread takes at a time. Sums are per chunk and added in order: the same bytes on any number of threads.
const CHUNK: usize = 512;

/// Unknowns of a motion: fewer pairs cannot determine it.
const UNKNOWNS: usize = 6;

/// What the pair distance of a coarse start shrinks by, an iteration.
const SHRINK: f64 = 0.7;

/// A search looks this much farther than a pair may be, so that its result outlives small steps.
const REACH: f32 = 1.25;

/// Rounding of `f32` distances, relative, with room: a match within this of a tie is searched anew.
const ROUNDING: f32 = 1e-6;

/// Point-to-plane ICP: pair each point with the nearest, step to the least squares, repeat.
#[derive(Clone, Debug)]
pub struct Icp {
    config: IcpConfig,
}

impl Icp {
    /// # Errors
    ///
    /// [`ConfigError`] names the field that cannot run.
    pub fn new(config: IcpConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self { config })
    }

    /// The settings.
    pub fn config(&self) -> &IcpConfig {
        &self.config
    }

    /// Finds the motion that lays `source` on `target`, both prepared with these settings, from `initial`.
    ///
    /// Points whose nearest has no normal form no pair. With too few pairs the outcome carries `initial`; with a
    /// direction left open it moves in the others.
    pub fn align(&self, target: &Target, source: &Source, initial: &Pose) -> Outcome {
        let mut outcome = Outcome::nothing(initial, StopReason::MaxIterations);
        let mut matches = vec![Match::UNKNOWN; source.len()];
        let mut reach_m = self.config.first_pair_distance_m.unwrap_or(self.config.max_pair_distance_m);
        while outcome.iterations < self.config.max_iterations {
            let sums = sum_pairs(target, source, &outcome.target_from_source, reach_m as f32, &mut matches);
            if sums.pairs < UNKNOWNS {
                return Outcome {
                    pairs: sums.pairs,
                    iterations: outcome.iterations,
                    ..Outcome::nothing(initial, StopReason::TooFewPairs)
                };
            }
            let (step, seen) = sums.solve(self.config.least_information);
            let fine = reach_m <= self.config.max_pair_distance_m;
            let before = (outcome.inlier_fraction, outcome.rmse_m);
            outcome.advance(&step, &sums, seen, source.len());
            let change = (outcome.inlier_fraction - before.0, outcome.rmse_m - before.1);
            if fine && (self.is_still(&step) || outcome.iterations > 1 && self.is_settled(change)) {
                outcome.stop = StopReason::Still;
                break;
            }
            reach_m = (reach_m * SHRINK).max(self.config.max_pair_distance_m);
        }
        if seen_degenerate(&outcome) {
            outcome.stop = StopReason::Degenerate;
        }
        outcome
    }

    fn is_still(&self, step: &Step) -> bool {
        step.shift_m < self.config.still_m && step.angle_rad < self.config.still_rad
    }

    /// Open3D's end: neither the share of paired points nor their RMSE changes.
    fn is_settled(&self, (fraction, rmse_m): (f64, f64)) -> bool {
        fraction.abs() < self.config.still_fraction && rmse_m.abs() < self.config.still_rmse_m
    }
}

impl Registration for Icp {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        let target = Target::prepare(target, &self.config);
        let source = Source::prepare(source, &self.config);
        match (target, source) {
            (Ok(target), Ok(source)) => self.align(&target, &source, initial),
            (Err(PrepareError::Empty), _) | (_, Err(PrepareError::Empty)) => {
                Outcome::nothing(initial, StopReason::EmptyCloud)
            }
            _ => Outcome::nothing(initial, StopReason::BadSettings),
        }
    }
}

fn seen_degenerate(outcome: &Outcome) -> bool {
    outcome.observability.is_some_and(|seen| seen.is_degenerate())
}

impl Outcome {
    /// Takes a step, and remembers the pairs it came from.
    fn advance(&mut self, step: &Step, sums: &NormalEquations, seen: Observability, points: usize) {
        self.target_from_source = step.motion * self.target_from_source;
        self.target_from_source.rotation.renormalize();
        self.iterations += 1;
        self.pairs = sums.pairs;
        self.inlier_fraction = sums.pairs as f64 / points.max(1) as f64;
        self.rmse_m = sums.rmse_m();
        self.plane_rmse_m = sums.plane_rmse_m();
        self.observability = Some(seen);
    }
}

/// What the last search for a source point found. It holds until the point has moved far enough for another target
/// point to be nearer, which the triangle inequality tells without a search.
#[derive(Clone, Copy, Debug)]
struct Match {
    /// The nearest target point.
    index: Option<u32>,
    /// All others were at least this far, m.
    others_m: f32,
    /// Where the search was made.
    at: Point3<f32>,
}

impl Match {
    /// Never holds.
    const UNKNOWN: Self = Self { index: None, others_m: f32::NEG_INFINITY, at: Point3::new(0.0, 0.0, 0.0) };

    /// Searches from here.
    fn search(target: &Target, at: Point3<f32>, reach_m: f32) -> Self {
        let nearest = target.tree.nearest(&at, reach_m * REACH);
        Self { index: nearest.index, others_m: nearest.others_squared_m2.sqrt(), at }
    }

    /// How far the match is now; absent when there is none within reach, or another may be nearer.
    fn distance_m(&self, target: &Target, at: &Point3<f32>, reach_m: f32) -> Option<f32> {
        let distance_m = self.index.map_or(reach_m, |index| (target.tree.points()[index as usize] - at).norm());
        let others_m = self.others_m * (1.0 - ROUNDING) - (at - self.at).norm();
        (distance_m.min(reach_m) * (1.0 + ROUNDING) < others_m).then_some(distance_m)
    }

    /// The nearest target point strictly within reach of `at`: the same as a search would find.
    fn update(&mut self, target: &Target, at: Point3<f32>, reach_m: f32) -> Option<usize> {
        let distance_m = self.distance_m(target, &at, reach_m).or_else(|| {
            *self = Self::search(target, at, reach_m);
            self.index.map(|index| (target.tree.points()[index as usize] - at).norm())
        });
        let index = self.index?;
        (distance_m? < reach_m).then_some(index as usize)
    }
}

/// Pairs each source point with the nearest target point within reach, and sums what the least squares needs.
fn sum_pairs(
    target: &Target,
    source: &Source,
    target_from_source: &Pose,
    reach_m: f32,
    matches: &mut [Match],
) -> NormalEquations {
    let rotation = target_from_source.rotation.to_rotation_matrix().into_inner();
    let motion = (rotation, target_from_source.translation.vector);
    let sums: Vec<NormalEquations> = matches
        .par_chunks_mut(CHUNK)
        .zip(source.points.par_chunks(CHUNK))
        .map(|(matches, points)| sum_chunk(target, points, &motion, reach_m, matches))
        .collect();
    sums.iter().fold(NormalEquations::default(), NormalEquations::merge)
}

fn sum_chunk(
    target: &Target,
    points: &[Point3<f32>],
    (rotation, translation): &(Matrix3<f64>, Vector3<f64>),
    reach_m: f32,
    matches: &mut [Match],
) -> NormalEquations {
    let mut sums = NormalEquations::default();
    for (point, found) in points.iter().zip(matches) {
        let moved = Point3::from(rotation * point.coords.cast::<f64>() + translation);
        let Some(index) = found.update(target, moved.cast(), reach_m) else {
            continue;
        };
        let normal = target.normals[index];
        if normal != Vector3::zeros() {
            sums.add(&moved, &target.tree.points()[index].cast(), &normal.cast());
        }
    }
    sums
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_kept_match_is_the_one_a_search_finds(
            points in prop::collection::vec(prop::array::uniform3(-5.0f32..5.0), 1..200),
            start in prop::array::uniform3(-6.0f32..6.0),
            steps in prop::collection::vec((prop::array::uniform3(-1.0f32..1.0), 0.0f32..1.0, 0.2f32..4.0), 1..40),
        ) {
            let cloud = Cloud::new(points.iter().map(|&p| p.into()).collect());
            let target = Target::prepare(&cloud, &IcpConfig { voxel_m: 1e-3, ..IcpConfig::outdoor() }).unwrap();
            let (mut kept, mut at) = (Match::UNKNOWN, Point3::from(start));
            for (direction, length, reach_m) in steps {
                at += Vector3::from(direction) * length.powi(3);
                let expected = target.tree.nearest(&at, reach_m).index;
                prop_assert_eq!(kept.update(&target, at, reach_m), expected.map(|index| index as usize));
            }
        }
    }
}
