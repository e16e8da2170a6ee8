//! Registration without an initial guess: candidates of several scales, checked on both scans.

use echoloop_clouds::{Cloud, Pose};
use rayon::prelude::*;

use crate::global::matched;
use crate::overlap::{Overlap, Scene};
use crate::{
    AutoConfig, FeatureConfig, Gicp, GicpConfig, Icp, IcpConfig, Mac, MacConfig, Outcome,
    Registration, Source, StopReason, Suggestions, Target,
};

/// Voxels of the features over the finest one. Features at 0.8 m describe a door, at 2.5 m a house;
/// sparse scans show only houses.
const SCALES: [f64; 4] = [1.0, 1.5, 2.25, 3.125];

/// Largest distance of the first and of the last pairs when a candidate is refined, in voxels.
const REFINED_VOXELS: [f64; 2] = [5.0, 1.25];

/// Share of its first score that a motion must keep when it is finished; else the first stands.
/// Scores resolve decimetres: below that GICP is the finer.
const KEPT_SCORE: f64 = 0.95;

/// Steps of a candidate's refinement.
const REFINED_ITERATIONS: usize = 30;

/// Robust global registration: candidates from several scales, checked on the points of both
/// scans.
///
/// 1. Features at four voxel sizes. For each, the motions that most matches agree with
///    ([`Mac::candidates`]), and the guess that was given.
/// 2. A score of each on both scans ([`Scene::overlap`]); the best are refined with ICP.
/// 3. A score of the refined ones; GICP at the clouds' own voxel finishes the best.
/// 4. A motion that the scans do not confirm is [`StopReason::Unconfirmed`]; one that may slide
///    without their noticing is [`StopReason::Degenerate`].
///
/// Matches and their inliers are evidence of one scale only. The points of both scans are
/// independent evidence, also of open space.
#[derive(Clone, Debug)]
pub struct Auto {
    pub(super) config: AutoConfig,
}

/// A motion, and its score on the scans.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    target_from_source: Pose,
    overlap: Overlap,
}

/// Both scans, prepared for scoring and refining motions.
struct Bench {
    target: Scene,
    source: Scene,
    icp: Icp,
    prepared: (Target, Source),
}

impl Auto {
    fn found(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Result<Outcome, StopReason> {
        let bench = Bench::new(target, source, self.config.voxel_m)?;
        let mut guesses = self.guesses(target, source);
        guesses.push(*initial);
        let best = best_of(bench.scored(&guesses), self.config.max_refined);
        let refined: Vec<Pose> =
            best.par_iter().map(|candidate| bench.refined(&candidate.target_from_source)).collect();
        let best = best_of(bench.scored(&refined), 1);
        let start = best.first().ok_or(StopReason::NoConsensus)?.target_from_source;
        let finished = finish(target, source, self.config.voxel_m, &start)?;
        Ok(bench.conclude(start, finished))
    }

    /// The candidates of every scale, the finest first.
    fn guesses(&self, target: &Cloud, source: &Cloud) -> Vec<Pose> {
        let of = |scale: &f64| {
            let features = FeatureConfig::from_voxel(scale * self.config.voxel_m);
            let matches = matched(target, source, &features).ok()?;
            let mac = Mac::new(MacConfig::from_features(features)).ok()?;
            Some(mac.candidates(&matches, self.config.max_candidates))
        };
        SCALES.par_iter().filter_map(of).collect::<Vec<_>>().concat()
    }
}

/// The candidates with the best scores, best first; of equals the earlier.
fn best_of(mut candidates: Vec<Candidate>, most: usize) -> Vec<Candidate> {
    candidates.sort_by(|a, b| b.overlap.score().total_cmp(&a.overlap.score()));
    candidates.truncate(most);
    candidates
}

/// GICP at the clouds' own voxel, from a motion whose error is a part of `voxel_m`.
fn finish(
    target: &Cloud,
    source: &Cloud,
    voxel_m: f64,
    start: &Pose,
) -> Result<Outcome, StopReason> {
    let config = GicpConfig::from(&Suggestions::new(target, source).refinement(voxel_m));
    let gicp = Gicp::new(config).map_err(|_| StopReason::BadSettings)?;
    Ok(gicp.register(target, source, start))
}

impl Bench {
    fn new(target: &Cloud, source: &Cloud, voxel_m: f64) -> Result<Self, StopReason> {
        let [first_m, last_m] = REFINED_VOXELS.map(|voxels| voxels * voxel_m);
        let config = IcpConfig {
            first_pair_distance_m: Some(first_m),
            max_pair_distance_m: last_m,
            max_iterations: REFINED_ITERATIONS,
            ..IcpConfig::refinement(voxel_m)
        };
        let icp = Icp::new(config).map_err(|_| StopReason::BadSettings)?;
        let prepared = (Target::prepare(target, &config)?, Source::prepare(source, &config)?);
        let (target, source) = (Scene::new(target, voxel_m)?, Scene::new(source, voxel_m)?);
        Ok(Self { target, source, icp, prepared })
    }

    fn scored(&self, motions: &[Pose]) -> Vec<Candidate> {
        motions.par_iter().map(|motion| self.candidate(motion)).collect()
    }

    fn candidate(&self, motion: &Pose) -> Candidate {
        let overlap = self.target.overlap(&self.source, motion);
        Candidate { target_from_source: *motion, overlap }
    }

    /// The motion that ICP reaches from a candidate, converged or not.
    fn refined(&self, start: &Pose) -> Pose {
        let (target, source) = &self.prepared;
        self.icp.align(target, source, start).target_from_source
    }

    /// The finished motion, unless the scans clearly prefer the one it began with.
    fn conclude(&self, start: Pose, finished: Outcome) -> Outcome {
        let (before, after) =
            (self.candidate(&start), self.candidate(&finished.target_from_source));
        let fell = after.overlap.score() < KEPT_SCORE * before.overlap.score();
        let kept = if fell { before } else { after };
        let stop = if kept.overlap.confirms() { finished.stop } else { StopReason::Unconfirmed };
        Outcome {
            target_from_source: kept.target_from_source,
            overlap: Some(kept.overlap),
            // The covariance belongs to the finished motion.
            covariance: finished.covariance.filter(|_| !fell),
            stop,
            ..finished
        }
        .with_open_directions(&self.target, &self.source)
    }
}

impl Registration for Auto {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        self.found(target, source, initial).unwrap_or_else(|stop| Outcome::nothing(initial, stop))
    }
}
