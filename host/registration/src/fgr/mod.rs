//! Fast global registration: one annealed least squares over matches of features, from no initial
//! guess.

mod annealed;
mod open3d;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
mod tuples;

use echoloop_clouds::{Cloud, Pose};

use open3d::{Frame, Optimised};

use super::features::{PointPair, matching, pairs};
use super::{FgrConfig, FgrMode, Outcome, Registration, StopReason, global};
use crate::correspondences::{Inliers, LengthBounds, Refit, Until};

/// Least count of matches that determine a motion.
const LEAST_MATCHES: usize = 3;

/// Right matches keep their lengths to this, over the voxel: both ends are means of a voxel's
/// points.
const LENGTH_TOLERANCE: f64 = 0.6;

/// Edges shorter than this, over the voxel, say nothing.
const LEAST_LENGTH: f64 = 7.0;

/// Most fits of the final refit.
const MAX_FITS: usize = 12;

/// Fast global registration (Zhou, Park and Koltun, ECCV 2016).
///
/// 1. Points matched by their features ([`super::features`]), each the other's nearest.
/// 2. The tuple test: matches are weighed by the triples they form that keep their lengths.
/// 3. Annealed least squares over those, from a kernel as wide as the scene to one of the pair
///    distance.
/// 4. A final refit to all matches, and the count of those that agree.
///
/// Measured beside other programs: benches/record/registration-peers.md.
///
/// ```
/// use echoloop_registration::clouds::pose::rotation_error_deg;
/// use echoloop_registration::{Cloud, Fgr, FgrConfig, Pose, Registration};
///
/// // A hilly field, and the same from a sensor that faces elsewhere. No initial guess is needed.
/// let field = |x: f32, y: f32| [x, y, (0.7 * x).sin() + (0.5 * y + 0.2 * x).cos() - 3.0].into();
/// let at = |i: i32| field((i % 120 - 60) as f32 * 0.2, (i / 120 - 60) as f32 * 0.2);
/// let target = Cloud::new((0..14_400).map(at).collect());
/// let truth = Pose::new([3.0, -2.0, 0.1].into(), [0.0, 0.0, 2.0].into());
/// let moved = target.points.iter().map(|p| truth.inverse_transform_point(&p.cast()).cast());
/// let source = Cloud::new(moved.collect());
///
/// let fgr = Fgr::new(FgrConfig::outdoor())?;
/// let outcome = fgr.register(&target, &source, &Pose::identity());
/// assert!(outcome.stop.is_success());
/// assert!(rotation_error_deg(&outcome.target_from_source, &truth) < 1.0);
/// # Ok::<(), echoloop_registration::ConfigError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Fgr {
    pub(super) config: FgrConfig,
}

impl Fgr {
    /// Finds the motion that most matches agree with. Without one the outcome carries the identity
    /// and a reason; matches that are not finite count as wrong.
    pub fn solve(&self, pairs: &[PointPair]) -> Outcome {
        let sound = sound(pairs);
        let frame = || {
            let (source, target) =
                (sound.iter().map(|p| p.source.coords), sound.iter().map(|p| p.target.coords));
            Frame::new(source, target)
        };
        self.outcome(&sound, pairs.len(), frame, &Pose::identity())
    }

    /// The outcome for the finite `pairs` of `matches` matches. Only mode `open3d` calls `frame`.
    fn outcome(
        &self,
        pairs: &[PointPair],
        matches: usize,
        frame: impl FnOnce() -> Frame,
        initial: &Pose,
    ) -> Outcome {
        let found = match self.config.mode {
            FgrMode::Annealed => self.annealed(pairs),
            FgrMode::Open3d => self.open3d(pairs, &frame()),
        };
        let nothing = |stop| (Outcome::nothing(initial, stop), Inliers::default());
        let (outcome, inliers) = found.unwrap_or_else(nothing);
        outcome.agreeing(inliers, (matches, pairs.len()), None)
    }

    fn annealed(&self, pairs: &[PointPair]) -> Result<(Outcome, Inliers), StopReason> {
        let (delta_m, voxel_m) = (self.config.max_pair_distance_m, self.config.features.voxel_m);
        if pairs.len() < LEAST_MATCHES {
            return Err(StopReason::TooFewMatches);
        }
        let bounds = LengthBounds {
            tolerance_m: LENGTH_TOLERANCE * voxel_m,
            least_length_m: LEAST_LENGTH * voxel_m,
        };
        let most = self.config.max_tuples.saturating_mul(3);
        let passed = tuples::passed(pairs, &bounds, most, self.config.seed);
        let run = annealed::anneal(pairs, &passed, delta_m, self.config.max_iterations);
        let run = run.ok_or(StopReason::NoConsensus)?;
        let (motion, inliers) = refit(pairs, &run.target_from_source, delta_m);
        let stop = self.verdict(pairs.len(), &inliers, run.converged);
        Ok((Outcome { iterations: run.iterations, ..Outcome::nothing(&motion, stop) }, inliers))
    }

    /// Open3D returns its motion whether or not it converged and matches agree with it. So does
    /// this, with the reason that both tests give.
    fn open3d(&self, pairs: &[PointPair], frame: &Frame) -> Result<(Outcome, Inliers), StopReason> {
        let passed = open3d::tuple_test(pairs, self.config.max_tuples, self.config.seed);
        if passed.len() < open3d::LEAST_MATCHES {
            return Err(StopReason::TooFewMatches);
        }
        let iterations = self.config.max_iterations;
        let found = open3d::optimised(&passed, frame, iterations, |_, mu| mu);
        let Optimised { target_from_source, converged } = found.ok_or(StopReason::NoConsensus)?;
        let inliers = Inliers::count(pairs, &target_from_source, self.config.max_pair_distance_m);
        let stop = self.verdict(pairs.len(), &inliers, converged);
        Ok((Outcome { iterations, ..Outcome::nothing(&target_from_source, stop) }, inliers))
    }

    /// The reason of the end of a run over `matches` matches.
    fn verdict(&self, matches: usize, inliers: &Inliers, converged: bool) -> StopReason {
        let reach = self.config.max_pair_distance_m / self.config.features.voxel_m;
        if (inliers.count as f64) < least_inliers(matches, reach) {
            return StopReason::NoConsensus;
        }
        if converged { StopReason::Converged } else { StopReason::MaxIterations }
    }
}

/// The last fit to all matches, not only to those that passed the tuple test.
///
/// Points are means of voxels, so right matches may lie a little beyond δ: the weights reach twice
/// as far. The most inliers win; on a tie, the nearer ones.
fn refit(pairs: &[PointPair], start: &Pose, delta_m: f64) -> (Pose, Inliers) {
    let refit = Refit { width_m: 2.0 * delta_m, max_fits: MAX_FITS, until: Until::NoChange };
    let best = refit.run(pairs, start, |pose| {
        let inliers = Inliers::count(pairs, pose, delta_m);
        (inliers.count, -inliers.rmse_m)
    });
    let (count, negative_rmse_m) = best.score;
    (best.target_from_source, Inliers { count, rmse_m: -negative_rmse_m })
}

impl Registration for Fgr {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        let (target, source) = match global::described(target, source, &self.config.features) {
            Ok(clouds) => clouds,
            Err(stop) => return Outcome::nothing(initial, stop),
        };
        let matches =
            pairs(&matching::mutual(&source.features, &target.features), &source, &target);
        let frame = || {
            let coords = |points: &[nalgebra::Point3<f32>]| -> Vec<_> {
                points.iter().map(|p| p.coords.cast()).collect()
            };
            let (from, to) = (coords(&source.points), coords(&target.points));
            Frame::new(from.into_iter(), to.into_iter())
        };
        self.outcome(&sound(&matches), matches.len(), frame, initial)
    }
}

/// The matches whose numbers are finite, and small enough to be squared.
fn sound(pairs: &[PointPair]) -> Vec<PointPair> {
    let sound =
        |pair: &&PointPair| pair.source.iter().chain(pair.target.iter()).all(|v| v.abs() <= 1e6);
    pairs.iter().filter(sound).copied().collect()
}

/// The widest pair distance, in voxels, that [`least_inliers`] was fitted to.
const FITTED_REACH: f64 = 1.0 / 0.3;

/// Least number of `n` matches that must agree with a trusted motion, with a pair distance of
/// `reach` voxels.
///
/// ```text
/// (15 + 0.2 √n) max(0.75, 1.2 reach - 0.2), but never more than n / 2
/// ```
///
/// Fitted to what chance gives, on simulated scans: 70 pairs of unrelated ones (440 to 6100
/// matches, a voxel of 0.3 m), 44 of sparse ones (80 to 300 matches, voxels of 0.6 to 1.3 m), and
/// as many right motions. Of the 44, 2 are accepted: check a motion with few agreeing matches by
/// other means.
fn least_inliers(n: usize, reach: f64) -> f64 {
    let by_chance =
        (15.0 + 0.2 * (n as f64).sqrt()) * (1.2 * reach.min(FITTED_REACH) - 0.2).max(0.75);
    by_chance.min(0.5 * n as f64)
}
