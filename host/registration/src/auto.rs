//! Registration without an initial guess: candidates of several scales, checked on both scans.

mod finish;

use echoloop_clouds::{Cloud, Pose};
use rayon::prelude::*;

use self::finish::Finish;
use crate::global::matched;
use crate::overlap::{Looked, Scene, is_within};
use crate::{
    AutoConfig, FeatureConfig, Icp, IcpConfig, Mac, MacConfig, Outcome, Registration, Source,
    StopReason, Target,
};

/// Voxels of the features over the finest one. Features at 0.8 m describe a door, at 2.5 m a house;
/// sparse scans show only houses.
const SCALES: [f64; 4] = [1.0, 1.5, 2.25, 3.125];

/// Largest distance of the first and of the last pairs when a candidate is refined, in voxels.
const REFINED_VOXELS: [f64; 2] = [5.0, 1.25];

/// Steps of a candidate's refinement.
const REFINED_ITERATIONS: usize = 30;

/// Robust global registration: candidates from several scales, checked on the points of both
/// scans.
///
/// 1. Features at four voxel sizes. For each, the motions that most matches agree with
///    ([`Mac::candidates`]).
/// 2. A score of each on both scans ([`Scene::score`]); the best, and the guess that was given, are
///    refined with ICP.
/// 3. Of the refined ones the one that both scans prefer; local methods finish it ([`Finish`]).
/// 4. What the scans say of it ([`Scene::judge`]). If they do not confirm it, it is slid along the
///    direction that they hold least, and what is found there is compared with it.
/// 5. The best of the other candidates, its rival: one as good makes the motion ambiguous.
///
/// Matches and their inliers are evidence of one scale only. The points of both scans are
/// independent evidence, also of open space.
#[derive(Clone, Debug)]
pub struct Auto {
    pub(super) config: AutoConfig,
}

/// Two candidates are one if they differ by less than this: a shift, in voxels, …
const SAME_VOXELS: f64 = 0.6;

/// … and a turn, rad.
const SAME_RAD: f64 = 0.05;

/// Both scans, prepared for scoring and refining motions.
struct Bench {
    target: Scene,
    source: Scene,
    icp: Icp,
    prepared: (Target, Source),
    /// Shift below which two candidates are one, m.
    same_m: f64,
}

impl Auto {
    fn found(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Result<Outcome, StopReason> {
        let bench = Bench::new(target, source, self.config.voxel_m)?;
        let starts = bench.best_of(self.guesses(target, source), self.config.max_refined);
        let guess = bench.refined(initial);
        // Only a motion that the scans clearly prefer replaces the first: the guess that was given,
        // or else that of the best score among those that the scans agree with.
        let is_given = *initial != Pose::identity();
        let given = [*initial, guess].into_iter().filter(|_| is_given);
        let mut found: Vec<Looked> = given.map(|motion| bench.look(motion)).collect();
        found.extend(bench.found(&starts));
        if !is_given && !found.iter().any(|other| bench.is_same(&other.motion, &guess)) {
            found.push(bench.look(guess));
        }
        // A guess that lays nothing on anything says nothing.
        if !is_given || !found.iter().take(2).any(Looked::touches) {
            found = Looked::agreeing_first(found);
        }
        let finish = Finish::new(target, source, self.config.voxel_m)?;
        let start = bench.preferred(&found).ok_or(StopReason::NoConsensus)?;
        let (mut outcome, mut kept) = bench.finished(&finish, start);
        if !outcome.stop.is_success() {
            let mut slides = bench.found(&bench.target.slides(&bench.source, &kept.motion));
            slides.insert(0, kept.clone());
            if let Some(slid) = bench.preferred(&slides).filter(|slid| slid.motion != kept.motion) {
                (outcome, kept) = bench.finished(&finish, slid);
            }
            found.extend(slides);
        }
        Ok(bench.with_rival(outcome, &kept, &found, is_given.then_some(guess)))
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
        Ok(Self { target, source, icp, prepared, same_m: SAME_VOXELS * voxel_m })
    }

    /// The candidates with the best scores, best first; of equals the earlier, and one of those
    /// that are the same.
    fn best_of(&self, motions: Vec<Pose>, most: usize) -> Vec<Pose> {
        let score = |motion: Pose| (self.target.score(&self.source, &motion), motion);
        let mut scored: Vec<(f64, Pose)> = motions.into_par_iter().map(score).collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best: Vec<Pose> = Vec::new();
        for (_, motion) in scored {
            if best.len() < most && !best.iter().any(|other| self.is_same(other, &motion)) {
                best.push(motion);
            }
        }
        best
    }

    fn is_same(&self, one: &Pose, other: &Pose) -> bool {
        is_within(one, other, self.same_m, SAME_RAD)
    }

    /// The motion that ICP reaches from a candidate, converged or not.
    fn refined(&self, start: &Pose) -> Pose {
        let (target, source) = &self.prepared;
        self.icp.align(target, source, start).target_from_source
    }

    /// The motions that ICP reaches from some starts, best first.
    fn found(&self, starts: &[Pose]) -> Vec<Looked> {
        let refined = starts.par_iter().map(|start| self.refined(start)).collect();
        let found = self.best_of(refined, usize::MAX);
        found.into_iter().map(|motion| self.look(motion)).collect()
    }

    fn look(&self, motion: Pose) -> Looked {
        self.target.look(&self.source, motion)
    }

    fn preferred<'a>(&self, found: &'a [Looked]) -> Option<&'a Looked> {
        self.target.preferred(&self.source, found)
    }

    /// The motion that finishing ends at, judged. If the scans clearly prefer the one it began
    /// with, that stands; if it went far away, they have to prefer the end.
    fn finished(&self, finish: &Finish, start: &Looked) -> (Outcome, Looked) {
        let unit_m = self.target.unit_m();
        let finished = finish.from(&start.motion, unit_m);
        let end = finished.target_from_source;
        let mut both = [self.look(end), start.clone()];
        if self.target.is_other(&start.motion, &end) {
            both.reverse();
        }
        let kept = self.preferred(&both).unwrap_or(start).clone();
        // The covariance belongs to the end.
        let covariance = finished.covariance.filter(|_| kept.motion == end);
        let judgement = self.target.judge_further(&self.source, &kept);
        let outcome = Outcome { target_from_source: kept.motion, covariance, ..finished }
            .judged(judgement, unit_m);
        // How the last step ended matters only where the scans agree with the motion.
        let is_supported = outcome.overlap.is_some_and(|overlap| overlap.agrees());
        let stop = if is_supported { outcome.stop } else { StopReason::Unconfirmed };
        (Outcome { stop, ..outcome }, kept)
    }

    /// The outcome with the best other motion; ambiguous if that is as good. A guess that was given
    /// decides between motions that the scans do not tell apart.
    fn with_rival(
        &self,
        outcome: Outcome,
        kept: &Looked,
        found: &[Looked],
        guess: Option<Pose>,
    ) -> Outcome {
        let rival = self.target.rival(&self.source, kept, found);
        let is_guessed = guess.is_some_and(|guess| !self.target.is_other(&kept.motion, &guess));
        let is_ambiguous = rival.is_some_and(|rival| rival.is_as_good) && !is_guessed;
        let stop = match outcome.stop {
            StopReason::Converged if is_ambiguous => StopReason::Ambiguous,
            stop => stop,
        };
        Outcome { rival, stop, ..outcome }
    }
}

impl Registration for Auto {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        self.found(target, source, initial).unwrap_or_else(|stop| Outcome::nothing(initial, stop))
    }
}
