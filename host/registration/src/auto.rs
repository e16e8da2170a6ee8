//! Registration without an initial guess: candidates of several scales, checked on both scans.

mod finish;

use std::cell::OnceCell;

use echoloop_clouds::{Cloud, Pose};
use rayon::prelude::*;

use self::finish::Finish;
use crate::geometry::voxel;
use crate::global::matched;
use crate::overlap::{Looked, Rival, Scene, is_within};
use crate::prepared::{Surface, thin};
use crate::{
    AutoConfig, FeatureConfig, Icp, IcpConfig, Mac, MacConfig, Outcome, PrepareError, Registration,
    Source, StopReason, Suggestions, Target,
};

/// Voxels of the features over the finest one. Features at 0.8 m describe a door, at 2.5 m a house;
/// sparse scans show only houses. Of houses there are few, so they come first and by themselves.
const FINER_SCALES: [f64; 3] = [1.0, 1.5, 2.25];
const FIRST_SCALE: f64 = 3.125;

/// Candidates of the first scale that are refined.
const FIRST_REFINED: usize = 3;

/// Lead over a rival, standard deviations, from which the first scale suffices.
const FAR_LEAD: f64 = 20.0;

/// Largest distance of the first and of the last pairs when a candidate is refined, in voxels.
const REFINED_VOXELS: [f64; 2] = [5.0, 1.25];

/// Steps of a candidate's refinement.
const REFINED_ITERATIONS: usize = 30;

/// Robust global registration: candidates from several scales, checked on the points of both
/// scans.
///
/// 0. Both clouds are thinned once, to the voxels of the finest fit.
/// 1. Features of the coarsest of four voxel sizes, and the motions that most matches agree with
///    ([`Mac::candidates`]).
/// 2. A score of each on both scans ([`Scene::score`]); the best, and the guess that was given, are
///    refined with ICP.
/// 3. Of the refined ones the one that both scans prefer. Local methods finish it. If
///    what the scans then say of it ([`Scene::judge`]) leaves no doubt, and all others are far
///    behind, that is the end.
/// 4. Otherwise the same with the features of all sizes. A motion that the scans do not confirm is
///    slid along the direction that they hold least, and what is found there compared with it.
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

/// Both clouds, thinned once to the voxels of the finest fit. All that follows begins there: the
/// points of a scan crowd near the sensor, and tell nothing more of the place.
struct Clouds<'a> {
    suggestions: Suggestions<'a>,
    target: Thinned<'a>,
    source: Thinned<'a>,
    /// Edge of the voxels, m.
    voxel_m: f64,
}

impl<'a> Clouds<'a> {
    /// Thins both for a global voxel, m.
    fn new(target: &'a Cloud, source: &'a Cloud, global_voxel_m: f64) -> Self {
        let suggestions = Suggestions::new(target, source);
        let voxel_m = suggestions.finest_voxel_m().min(global_voxel_m);
        let thinned = |given| Thinned { given, thin: thin(given, voxel_m) };
        let (target, source) = rayon::join(|| thinned(target), || thinned(source));
        Self { suggestions, target, source, voxel_m }
    }

    /// The scenes of both, of points `scene_voxel_m` apart.
    fn scenes(&self, scene_voxel_m: f64) -> Result<(Scene, Scene), PrepareError> {
        let Self { target, source, voxel_m, .. } = self;
        let scene = |cloud: &Thinned| cloud.scene(*voxel_m, scene_voxel_m);
        let (target, source) = rayon::join(|| scene(target), || scene(source));
        Ok((target?, source?))
    }
}

/// A cloud as it came, and its voxels' means in the order of a tree.
struct Thinned<'a> {
    given: &'a Cloud,
    thin: Result<Cloud, PrepareError>,
}

impl Thinned<'_> {
    /// As it came where it cannot be thinned.
    fn cloud(&self) -> &Cloud {
        self.thin.as_ref().unwrap_or(self.given)
    }

    /// The scene of voxels of `voxel_m`. Each has the largest σ_R of its points: saturated echoes
    /// err alike.
    fn scene(&self, voxel_m: f64, scene_voxel_m: f64) -> Result<Scene, PrepareError> {
        let reports = self.given.range_sd_m.is_some();
        let with_sds = reports.then(|| voxel::downsample_to_largest_sd(self.given, voxel_m));
        Scene::new(with_sds.and_then(Result::ok).as_ref().unwrap_or(self.cloud()), scene_voxel_m)
    }
}

/// Both scans, prepared for scoring and refining motions.
struct Bench {
    target: Scene,
    source: Scene,
    icp: Icp,
    prepared: (Target, Source),
    /// Shift below which two candidates are one, m.
    same_m: f64,
}

/// The motion to begin with: the identity, or one that was given.
struct Guess {
    initial: Pose,
    refined: Pose,
    is_given: bool,
}

impl Auto {
    fn found(&self, clouds: &Clouds, initial: &Pose) -> Result<Outcome, StopReason> {
        let (target, source) = (clouds.target.cloud(), clouds.source.cloud());
        let bench = Bench::new(clouds, self.config.voxel_m)?;
        let is_given = *initial != Pose::identity();
        let guess = Guess { initial: *initial, refined: bench.refined(initial), is_given };
        let prepared = OnceCell::new();
        let finish = || {
            let new = || Finish::new(clouds, self.config.voxel_m);
            prepared.get_or_init(new).as_ref().map_err(|stop| *stop)
        };
        let first = self.candidates(target, source, FIRST_SCALE);
        let found =
            bench.found_with(&guess, first.clone(), self.config.max_refined.min(FIRST_REFINED));
        let mut uncertain = None;
        if let Some(start) = bench.only(&found) {
            let (outcome, kept, is_certain) = bench.finished(finish()?, start);
            let with_rival = bench.with_rival(outcome.clone(), &kept, &found, &guess);
            if with_rival.stop.is_success() && is_certain {
                return Ok(with_rival);
            }
            uncertain = outcome.stop.is_success().then_some((outcome, kept, is_certain));
        }
        let of = |scale: &f64| self.candidates(target, source, *scale);
        let mut candidates = FINER_SCALES.par_iter().map(of).collect::<Vec<_>>().concat();
        candidates.extend(first);
        let mut found = bench.found_with(&guess, candidates, self.config.max_refined);
        let start = bench.preferred(&found).ok_or(StopReason::NoConsensus)?;
        // Where it ended it would end again.
        let again = uncertain.filter(|(_, kept, _)| {
            let both = [kept.clone(), start.clone()];
            let preferred = bench.preferred(&both).map(|preferred| preferred.motion);
            bench.is_same(&kept.motion, &start.motion) && preferred == Some(kept.motion)
        });
        let (mut outcome, mut kept, _) = match again {
            Some(finished) => finished,
            None => bench.finished(finish()?, start),
        };
        if !outcome.stop.is_success() {
            let mut slides = bench.found(&bench.target.slides(&bench.source, &kept.motion));
            slides.insert(0, kept.clone());
            if let Some(slid) = bench.preferred(&slides).filter(|slid| slid.motion != kept.motion) {
                (outcome, kept, _) = bench.finished(finish()?, slid);
            }
            found.extend(slides);
        }
        Ok(bench.with_rival(outcome, &kept, &found, &guess))
    }

    /// The motions that the matches of one scale agree with.
    fn candidates(&self, target: &Cloud, source: &Cloud, scale: f64) -> Vec<Pose> {
        let features = FeatureConfig::from_voxel(scale * self.config.voxel_m);
        match (matched(target, source, &features), Mac::new(MacConfig::from_features(features))) {
            (Ok(matches), Ok(mac)) => mac.candidates(&matches, self.config.max_candidates),
            _ => Vec::new(),
        }
    }
}

impl Bench {
    fn new(clouds: &Clouds, voxel_m: f64) -> Result<Self, StopReason> {
        let [first_m, last_m] = REFINED_VOXELS.map(|voxels| voxels * voxel_m);
        let config = IcpConfig {
            first_pair_distance_m: Some(first_m),
            max_pair_distance_m: last_m,
            max_iterations: REFINED_ITERATIONS,
            ..IcpConfig::refinement(voxel_m)
        };
        let icp = Icp::new(config).map_err(|_| StopReason::BadSettings)?;
        let (target, source) = clouds.scenes(voxel_m)?;
        // Of the points that are surface: those that their sensor calls imprecise lead nowhere.
        let points = |scene: &Scene| Cloud::new(scene.points().to_vec());
        let surface = Surface::from(&config);
        let prepared = rayon::join(
            || Target::of_thinned(points(&target), &surface).0,
            || Source::of_thinned(points(&source), &surface),
        );
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

    /// The motions that ICP reaches from the best of some candidates and from the guess, in the
    /// order in which they are to be preferred.
    ///
    /// Only a motion that the scans clearly prefer replaces the first: the guess that was given, or
    /// else that of the best score among those that the scans agree with.
    fn found_with(&self, guess: &Guess, candidates: Vec<Pose>, most: usize) -> Vec<Looked> {
        let starts = self.best_of(candidates, most);
        let given = [guess.initial, guess.refined].into_iter().filter(|_| guess.is_given);
        let mut found: Vec<Looked> = given.map(|motion| self.look(motion)).collect();
        found.extend(self.found(&starts));
        if !guess.is_given && !found.iter().any(|other| self.is_same(&other.motion, &guess.refined))
        {
            found.push(self.look(guess.refined));
        }
        // A guess that lays nothing on anything says nothing.
        if !guess.is_given || !found.iter().take(2).any(Looked::touches) {
            found = Looked::agreeing_first(found);
        }
        found
    }

    /// The motion that the scans prefer, if they agree with it, and no other comes near to fitting
    /// them as well.
    fn only<'a>(&self, found: &'a [Looked]) -> Option<&'a Looked> {
        let start = self.preferred(found).filter(|start| start.agrees())?;
        is_far(self.target.rival(&self.source, start, found)).then_some(start)
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
    /// with, that stands; if it went far away, they have to prefer the end. True when it is beyond
    /// doubt.
    fn finished(&self, finish: &Finish, start: &Looked) -> (Outcome, Looked, bool) {
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
        let is_certain = judgement.is_beyond_doubt();
        let outcome = Outcome { target_from_source: kept.motion, covariance, ..finished }
            .judged(judgement, unit_m);
        // How the last step ended matters only where the scans agree with the motion.
        let is_supported = outcome.overlap.is_some_and(|overlap| overlap.agrees());
        let stop = if is_supported { outcome.stop } else { StopReason::Unconfirmed };
        (Outcome { stop, ..outcome }, kept, is_certain)
    }

    /// The outcome with the best other motion; ambiguous if that is as good. A guess that was given
    /// decides between motions that the scans do not tell apart.
    fn with_rival(
        &self,
        outcome: Outcome,
        kept: &Looked,
        found: &[Looked],
        guess: &Guess,
    ) -> Outcome {
        let rival = self.target.rival(&self.source, kept, found);
        let is_guessed = guess.is_given && !self.target.is_other(&kept.motion, &guess.refined);
        let is_ambiguous = rival.is_some_and(|rival| rival.is_as_good) && !is_guessed;
        let stop = match outcome.stop {
            StopReason::Converged if is_ambiguous => StopReason::Ambiguous,
            stop => stop,
        };
        Outcome { rival, stop, ..outcome }
    }
}

/// True when the other motion that fits best, if any, is far behind.
fn is_far(rival: Option<Rival>) -> bool {
    rival.is_none_or(|rival| !rival.is_as_good && rival.lead >= FAR_LEAD)
}

impl Registration for Auto {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        let clouds = Clouds::new(target, source, self.config.voxel_m);
        self.found(&clouds, initial).unwrap_or_else(|stop| Outcome::nothing(initial, stop))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::{Point3, Vector3};

    use super::*;

    /// Floor and four walls around the sensor, and perhaps a fifth, which fits one turn alone.
    fn room(has_fifth: bool) -> Cloud {
        let at = |i: i32| (i as f32 - 50.0) * 0.1;
        let places = (0..=100).flat_map(|i| (0..=100).map(move |k| (at(i), at(k))));
        let walls = |(x, y): (f32, f32)| {
            let up = y / 2.5;
            [[x, y, -2.0], [x, 5.0, up], [x, -5.0, up], [5.0, x, up], [-5.0, x, up]]
        };
        let fifth = places.clone().filter(|(x, _)| has_fifth && *x > 0.0);
        let fifth = fifth.map(|(x, y)| [2.5, x, y / 2.5]);
        Cloud::new(places.flat_map(walls).chain(fifth).map(Point3::from).collect())
    }

    fn turned() -> Pose {
        Pose::new(Vector3::zeros(), Vector3::z() * FRAC_PI_2)
    }

    #[test]
    fn points_that_are_there_more_than_once_count_once() {
        let room = room(true);
        let often = Cloud::new(room.points.iter().flat_map(|point| [*point; 3]).collect());
        let auto = Auto { config: AutoConfig::outdoor() };
        let [once, thrice] = [&room, &often].map(|c| auto.register(c, &room, &Pose::identity()));
        assert!(once.stop.is_success(), "{once:?}");
        assert_eq!(once, thrice);
    }

    #[test]
    fn only_a_rival_far_behind_asks_for_no_second_round() {
        let rival = |lead, is_as_good| {
            Some(Rival { target_from_source: Pose::identity(), lead, is_as_good })
        };
        assert!(is_far(None) && is_far(rival(25.0, false)));
        for near in [rival(15.0, false), rival(25.0, true), rival(f64::NAN, false)] {
            assert!(!is_far(near), "{near:?}");
        }
    }

    #[test]
    fn a_voxel_finer_than_those_of_the_fits_is_kept() {
        let room = room(true);
        for (global_voxel_m, expected_m) in [(0.02, 0.02), (0.8, 0.07)] {
            let clouds = Clouds::new(&room, &room, global_voxel_m);
            let expected_m = clouds.suggestions.finest_voxel_m().min(expected_m);
            assert_eq!(clouds.voxel_m, expected_m, "{global_voxel_m}");
        }
    }

    #[test]
    fn many_imprecise_points_of_a_voxel_are_no_evidence() {
        // A wall 3 m ahead, 100 points to each of its voxels, behind it one of precise points.
        let lattice = |count: i32, step_m: f32| {
            let at = move |i: i32| (i - count / 2) as f32 * step_m;
            (0..count).flat_map(move |y| (0..count).map(move |z| (at(y), at(z))))
        };
        let near = lattice(280, 0.007).map(|(y, z)| Point3::new(3.0, y, z));
        let far = lattice(200, 0.1).map(|(y, z)| Point3::new(12.0, y, z));
        let points: Vec<_> = near.chain(far).collect();
        let sds = points.iter().map(|p| if p.x < 4.0 { 0.15 } else { 0.01 }).collect();
        let cloud = Cloud { range_sd_m: Some(sds), ..Cloud::new(points) };
        let (scene, _) = Clouds::new(&cloud, &cloud, 0.8).scenes(0.8).unwrap();
        assert!(scene.points().len() > 100);
        assert!(scene.points().iter().all(|p| p.x > 4.0), "a wall of saturated echoes");
    }

    #[test]
    fn a_motion_is_the_only_one_if_no_other_that_was_found_fits() {
        for has_fifth in [true, false] {
            let room = room(has_fifth);
            let bench = Bench::new(&Clouds::new(&room, &room, 0.5), 0.5).unwrap();
            let found = [bench.look(Pose::identity()), bench.look(turned())];
            let only = bench.only(&found).map(|only| only.motion);
            assert_eq!(only, has_fifth.then(Pose::identity), "with a fifth wall: {has_fifth}");
        }
    }
}
