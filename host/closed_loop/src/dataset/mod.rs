//! Pairs of scans to register: scene responses and true motions, traced once for all candidates.

mod facts;
pub mod fingerprint;
mod held_out;
mod motion;
mod pairs;
mod recording;
mod response;
mod single_viewpoint;
pub mod source;
mod store;
pub mod survey;

use std::path::Path;
use std::sync::Arc;

use echoloop_dsp::ScanPattern;
use echoloop_frontend::SceneResponse;
use echoloop_sim::mirror::wet_streets;
use echoloop_sim::other_lidar::OtherLidar;
use echoloop_sim::raycast::Raycaster;
use echoloop_sim::scanner::{self, BeamOptics};
use echoloop_sim::scene::Scene;
use echoloop_sim::stray_light::{add_glare, brighten_signs, cats_eye_m2};
use echoloop_sim::viewpoint::{
    PairPlan, PosePair, Sight, Split, ViewpointError, sample_pairs_between,
};
use thiserror::Error;

use crate::beams::Beams;
use crate::config::{Interference, Mirrors, Motion, Retroreflectors, RunConfig};
use crate::dataset::source::{Source, SourceError};
use crate::seed::{Purpose, derive};
use echoloop_clouds::pose::{Pose, relative};
pub use facts::{Facts, Overlaps, apart_m};
use motion::Path as MotionPath;
pub use pairs::{Dataset, ScanPair, viewpoints};
pub use recording::RecordingError;
use response::Raster;
pub use response::Response;
pub use single_viewpoint::single_viewpoint;
pub use store::{StoreError, stored, stored_config};

/// Reason that there are no pairs.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// No scene.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// Stored pairs cannot be used.
    #[error("scene.stored: {0}")]
    Stored(#[from] StoreError),
    /// Recorded scans cannot be used.
    #[error("scene.source: {0}")]
    Recording(#[from] RecordingError),
    /// Too few viewpoints in the scene.
    #[error("{scene}: {source}")]
    Viewpoints {
        /// Name of the scene.
        scene: String,
        /// Reason.
        source: ViewpointError,
    },
}

/// Scene ready to be scanned.
pub struct Place {
    /// Mesh, materials and name.
    pub scene: Scene,
    /// Ray caster of the first scan of a pair.
    pub caster: Raycaster,
    /// Ray caster of the second scan, where something moves between the two.
    pub later: Option<Raycaster>,
}

impl Place {
    /// Ray casters of the first and the second scan of a pair.
    pub fn casters(&self) -> [&Raycaster; 2] {
        [&self.caster, self.later.as_ref().unwrap_or(&self.caster)]
    }
}

impl Dataset {
    /// Makes or loads the scenes, finds viewpoints and traces every scan. Reads the scans instead
    /// where `scene.stored` names a file or `scene.source` a folder of recordings. `progress` is
    /// called with the fraction done, 0 to 1, and a few words.
    pub fn build(config: &RunConfig, progress: &dyn Fn(f64, &str)) -> Result<Self, DatasetError> {
        Self::of(config, None, 0, progress)
    }

    /// As [`Self::build`], for the sake of one split: a town without room for pairs of the other
    /// has none of them.
    pub fn build_for(
        config: &RunConfig,
        split: Split,
        progress: &dyn Fn(f64, &str),
    ) -> Result<Self, DatasetError> {
        Self::of(config, Some(split), 0, progress)
    }

    /// As [`Self::build`], with `data.check_pairs` pairs of [`Self::check`]. They are drawn after
    /// the training pairs, at the baseline of the held-out ones. A town without room for its share
    /// has none, nor have stored and recorded pairs.
    pub fn build_with_check(
        config: &RunConfig,
        progress: &dyn Fn(f64, &str),
    ) -> Result<Self, DatasetError> {
        Self::of(config, None, config.data.check_pairs, progress)
    }

    fn of(
        config: &RunConfig,
        needed: Option<Split>,
        check_pairs: usize,
        progress: &dyn Fn(f64, &str),
    ) -> Result<Self, DatasetError> {
        let beams = config.scanner.beams();
        if !config.scene.stored.is_empty() {
            return Ok(store::load_stored(Path::new(&config.scene.stored), config, beams)?);
        }
        if let Source::Recording(folder) = Source::of(&config.scene.source) {
            return Ok(recording::load(&folder, config, beams, progress)?);
        }
        let mut dataset = Self::empty(beams);
        let is_needed = |split| needed.is_none_or(|needed| needed == split);
        let towns = towns(config);
        let RunConfig { data, .. } = config;
        let total = (data.train_pairs + data.test_pairs + check_pairs) as f64;
        for (index, &town) in towns.iter().enumerate() {
            let place = Arc::new(place(config, town)?);
            dataset.triangles += place.scene.mesh.triangles.len();
            let sight = sight(&place, &dataset.beams);
            let at = (index, towns.len());
            for (split, more) in [(Split::Train, share_of(check_pairs, at)), (Split::Test, 0)] {
                let count = share(config, split, at);
                let done = dataset.pairs().count() as f64 / total;
                let looking = |found, tried| {
                    if tried % 100 == 0 {
                        progress(done, &format!("viewpoint {} after {tried} tries", found + 1));
                    }
                };
                let plan = pair_plan(config, split, count, town);
                let planned = poses_and_more(config, &place, &sight, (&plan, more), &looking);
                let planned = match planned {
                    Err(error) if is_no_room(&error) && !is_needed(split) => continue,
                    planned => planned?,
                };
                for (number, pair) in planned.iter().enumerate() {
                    progress(dataset.pairs().count() as f64 / total, &place.scene.name);
                    let (before, pairs) = match split {
                        Split::Test => (data.train_pairs, &mut dataset.test),
                        Split::Train if number < count => (0, &mut dataset.train),
                        Split::Train => (data.train_pairs + data.test_pairs, &mut dataset.check),
                    };
                    let numbers = viewpoints(before + pairs.len());
                    pairs.push(trace(config, &place, pair, numbers, &dataset.beams));
                }
            }
        }
        progress(1.0, "");
        Ok(dataset)
    }

    fn empty(beams: Beams) -> Self {
        Self { beams, train: Vec::new(), test: Vec::new(), check: Vec::new(), triangles: 0 }
    }
}

/// True when scans are traced, neither stored nor recorded.
fn is_traced(config: &RunConfig) -> bool {
    let is_recording = Source::is_recording(&config.scene.source);
    config.scene.stored.is_empty() && !is_recording
}

/// Seeds of the towns, at most one for each pair.
pub fn towns(config: &RunConfig) -> Vec<u64> {
    let mut towns = Source::of(&config.scene.source).seeds(&config.scene.towns);
    towns.truncate(config.data.train_pairs.min(config.data.test_pairs).max(1));
    towns
}

/// Makes or loads one town.
pub fn place(config: &RunConfig, town: u64) -> Result<Place, DatasetError> {
    let mut scene = Source::of(&config.scene.source).scene(&config.scene, town)?;
    if config.scene.mirrors == Mirrors::Wet {
        wet_streets(&mut scene.materials);
    }
    if config.scene.retroreflectors == Retroreflectors::Bright {
        brighten_signs(&mut scene.materials);
    }
    let caster = Raycaster::new(&scene);
    let later = scene.mesh_after(config.data.interval_s).map(|mesh| Raycaster::from_mesh(&mesh));
    Ok(Place { scene, caster, later })
}

/// Field of view of these beams in a place, for overlaps.
pub fn sight<'a>(place: &'a Place, beams: &Beams) -> Sight<'a> {
    let directions: Vec<[f32; 3]> = beams.directions(1).iter().map(|&d| d.into()).collect();
    Sight::new(&place.caster, &directions)
}

/// Plan of `count` pairs of a town by the configuration.
pub fn pair_plan(config: &RunConfig, split: Split, count: usize, town: u64) -> PairPlan {
    let data = &config.data;
    let (purpose, baseline_factor) = match split {
        Split::Train => (Purpose::TrainPoses, data.train_baseline_factor),
        Split::Test => (Purpose::TestPoses, 1.0),
    };
    PairPlan {
        count,
        baseline_m: data.hard_baseline_m(),
        baseline_factor,
        farther: count, // pairs of the check, after them, have the plain baseline
        heading_range_deg: data.hard_heading_range_deg(),
        tilt_range_deg: data.tilt_range_deg,
        height_m: config.scanner.height_m,
        seed: derive(config.seed, purpose, town),
        split,
    }
}

/// Number of pairs of a town, `(index, towns)`.
pub fn share(config: &RunConfig, split: Split, town: (usize, usize)) -> usize {
    match split {
        Split::Train => share_of(config.data.train_pairs, town),
        Split::Test => share_of(config.data.test_pairs, town),
    }
}

/// Share of `total` for a town by its index.
fn share_of(total: usize, (index, towns): (usize, usize)) -> usize {
    total / towns + usize::from(index < total % towns)
}

/// Poses of the two scans of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedPair {
    /// Poses of the sensor, first and second.
    pub poses: PosePair,
    /// Overlap, 0 to 1: share of what either scanner sees that the other sees, too.
    pub overlap: f64,
}

/// Pairs of a town by a plan, with an overlap within the configuration's bounds. `looking` is
/// called with the number of pairs found and of candidates tried.
///
/// # Errors
///
/// [`DatasetError::Viewpoints`].
pub fn poses(
    config: &RunConfig,
    place: &Place,
    sight: &Sight<'_>,
    plan: &PairPlan,
    looking: &dyn Fn(usize, usize),
) -> Result<Vec<PlannedPair>, DatasetError> {
    let accept = |poses: PosePair| {
        let overlap = sight.overlap(&poses);
        config.data.wants(overlap).then_some(PlannedPair { poses, overlap })
    };
    sample_pairs_between(&place.scene, place.casters(), plan, &accept, looking)
        .map_err(|source| DatasetError::Viewpoints { scene: place.scene.name.clone(), source })
}

/// As [`poses`], with `more` pairs after those of the plan, at the plain baseline; without them
/// where they do not all fit.
fn poses_and_more(
    config: &RunConfig,
    place: &Place,
    sight: &Sight<'_>,
    (plan, more): (&PairPlan, usize),
    looking: &dyn Fn(usize, usize),
) -> Result<Vec<PlannedPair>, DatasetError> {
    let of = |count| poses(config, place, sight, &PairPlan { count, ..*plan }, looking);
    match of(plan.count + more) {
        Err(error) if is_no_room(&error) && more > 0 => of(plan.count),
        found => found,
    }
}

fn is_no_room(error: &DatasetError) -> bool {
    use ViewpointError::NoViewpoint;
    matches!(error, DatasetError::Viewpoints { source: NoViewpoint { .. }, .. })
}

fn trace(
    config: &RunConfig,
    place: &Arc<Place>,
    planned: &PlannedPair,
    viewpoints: [u32; 2],
    beams: &Beams,
) -> ScanPair {
    let pair = &planned.poses;
    let world_from_sensor = [pair.world_from_first, pair.world_from_second];
    let [first, second] = [0, 1].map(|i| {
        let view = View::new(config, place, i > 0, &world_from_sensor[i], viewpoints[i]);
        match beams.pattern() {
            ScanPattern::Steered(steered) => {
                Response::Steered(Arc::new(Raster::new(view, steered.raster)))
            }
            _ => Response::Fixed(Arc::new(view.response(beams))),
        }
    });
    ScanPair {
        place: place.scene.name.clone(),
        truth: relative(&pair.world_from_first, &pair.world_from_second),
        world_from_sensor,
        first,
        second,
        viewpoints,
        overlap: planned.overlap,
    }
}

/// Response of the scan of a viewpoint, 1 for a single scan. The pose of a moving sensor is that in
/// the middle of the scan.
pub fn respond_at(
    config: &RunConfig,
    place: &Arc<Place>,
    world_from_sensor: &Pose,
    viewpoint: u32,
    beams: &Beams,
) -> SceneResponse {
    View::new(config, place, false, world_from_sensor, viewpoint).response(beams)
}

/// View of a scene from a viewpoint.
struct View {
    place: Arc<Place>,
    /// True where what moves in the scene has moved on.
    is_later: bool,
    optics: BeamOptics,
    other: Option<OtherLidar>,
    motion: Motion,
    /// Seed of the sensor's jitter.
    seed: u64,
    world_from_sensor: Pose,
    viewpoint: u32,
}

impl View {
    fn new(
        config: &RunConfig,
        place: &Arc<Place>,
        is_later: bool,
        world_from_sensor: &Pose,
        viewpoint: u32,
    ) -> Self {
        let RunConfig { scene, receiver, .. } = config;
        let cats_eye_m2 = match scene.retroreflectors {
            Retroreflectors::Dim => 0.0,
            Retroreflectors::Bright => cats_eye_m2(receiver.aperture_m2(), receiver.transmission),
        };
        let caster = place.casters()[usize::from(is_later)];
        let sensor = world_from_sensor.translation.vector.cast::<f32>().into();
        let other = || {
            let seed = derive(config.seed, Purpose::OtherLidar, viewpoint.into());
            OtherLidar::near(caster, sensor, seed)
        };
        let has_other = scene.interference != Interference::None;
        Self {
            place: Arc::clone(place),
            is_later,
            optics: BeamOptics {
                divergence_mrad: receiver.divergence_mrad,
                subrays: receiver.subrays,
                mirrors: scene.mirrors != Mirrors::None,
                cats_eye_m2,
            },
            other: has_other.then(other),
            motion: config.motion,
            seed: derive(config.seed, Purpose::Motion, viewpoint.into()),
            world_from_sensor: *world_from_sensor,
            viewpoint,
        }
    }

    /// True when the sensor moves while it scans.
    fn moves(&self) -> bool {
        !self.motion.is_still()
    }

    /// Response to these beams.
    fn response(&self, beams: &Beams) -> SceneResponse {
        let directions = beams.directions(self.viewpoint);
        let directions: Vec<[f32; 3]> = directions.iter().map(|&d| d.into()).collect();
        let mut response = match self.moves() {
            false => self.along(&directions),
            true => {
                let path = MotionPath::new(&self.motion, beams, self.world_from_sensor, self.seed);
                self.from(|beam| path.world_from_sensor(beam), &directions)
            }
        };
        let is_dazzled = self.optics.cats_eye_m2 > 0.0;
        if is_dazzled || self.other.is_some() {
            response.fired_with = beams.fired_with();
        }
        if is_dazzled {
            add_glare(&mut response, &directions, self.optics.divergence_mrad);
        }
        SceneResponse { cells: beams.cells(), ..response }
    }

    /// Response to beams along unit vectors of the sensor's frame, from where it stands.
    fn along(&self, directions: &[[f32; 3]]) -> SceneResponse {
        self.from(|_| self.world_from_sensor, directions)
    }

    fn from(&self, pose: impl Fn(usize) -> Pose + Sync, directions: &[[f32; 3]]) -> SceneResponse {
        let (caster, materials) = (self.caster(), &self.place.scene.materials[..]);
        let Self { optics, other, .. } = self;
        let mut response = scanner::scan_moving(caster, materials, &pose, directions, optics);
        if let Some(other) = other {
            other.light(&mut response, (caster, materials), &pose, directions, optics);
        }
        response
    }

    fn caster(&self) -> &Raycaster {
        self.place.casters()[usize::from(self.is_later)]
    }
}

/// Configuration with these values set.
#[cfg(test)]
fn configured(sets: &[&str]) -> RunConfig {
    let overrides: Vec<_> = sets.iter().map(|set| set.parse().expect("an override")).collect();
    crate::config::load(None, &overrides).expect("a configuration")
}

#[cfg(test)]
mod tests {
    use echoloop_frontend::Return;

    use super::*;

    fn config(more: &[&str]) -> RunConfig {
        let few = ["scanner.columns=24", "scanner.rows=8", "data.train_pairs=4"];
        configured(&[&few[..], &["data.test_pairs=3", "data.check_pairs=5"], more].concat())
    }

    fn truths(pairs: &[ScanPair]) -> Vec<(String, Pose)> {
        pairs.iter().map(|pair| (pair.place.clone(), pair.truth)).collect()
    }

    /// Baseline of each pair, seen from above, m.
    fn apart_m(pairs: &[ScanPair]) -> Vec<f64> {
        let apart = |pair: &ScanPair| {
            let [a, b] = pair.world_from_sensor.map(|pose| pose.translation.vector.xy());
            (a - b).norm()
        };
        pairs.iter().map(apart).collect()
    }

    #[test]
    fn mirrors_add_images_and_a_wet_street_returns_less() {
        let seen = |mirrors: &str| {
            let config = config(&["scene.source=structured", mirrors]);
            let dataset = Dataset::build(&config, &|_, _| ()).unwrap();
            let seen = dataset.train[0].first.to(&dataset.beams);
            let strongest =
                |beam: usize| seen.of(beam).iter().map(|of| of.strength_per_m2).fold(0.0, f32::max);
            (seen.returns.len(), (0..seen.len()).map(strongest).collect::<Vec<_>>())
        };
        let (dry, none) = seen("scene.mirrors=none");
        let (glass, _) = seen("scene.mirrors=glass");
        let (wet, darker) = seen("scene.mirrors=wet");
        assert!(dry < glass && glass < wet, "{dry}, {glass}, {wet} returns");
        let less = none.iter().zip(&darker).filter(|(dry, wet)| **wet < 0.8 * **dry).count();
        assert!(less > none.len() / 5, "{less} of {} beams", none.len());
    }

    #[test]
    fn bright_signs_glare_into_beams_fired_at_the_same_moment_only() {
        // Beams that see a sign, and those that see glare beside one.
        let seen = |pattern: &str| {
            let pairs = ["data.train_pairs=1", "data.test_pairs=1", "data.check_pairs=0"];
            let own = ["scene.source=structured", "scanner.columns=360", pattern];
            let bright = ["scene.retroreflectors=bright"];
            let config = configured(&[&pairs[..], &own[..], &bright[..]].concat());
            let dataset = Dataset::build(&config, &|_, _| ()).unwrap();
            let scan = dataset.train[0].first.to(&dataset.beams);
            // White reflects 1/π.
            let is_sign = |of: &Return| of.strength_per_m2 * of.range_m.powi(2) > 3.0;
            let signs = (0..scan.len()).filter(|&beam| scan.of(beam).iter().any(is_sign)).count();
            let glared = |beam: &usize| !scan.glare_in(*beam as u32).is_empty();
            (signs, (0..scan.len()).filter(glared).count())
        };
        let (signs, glares) = seen("scanner.pattern=os1-64");
        assert!(signs > 4 && glares > signs, "{signs} signs, {glares} beside them");
        for pattern in ["scanner.pattern=vlp-16", "scanner.pattern=steered"] {
            let (signs, glares) = seen(pattern);
            assert!(signs > 0 && glares == 0, "{pattern}: {signs} signs, {glares} beside them");
        }
    }

    #[test]
    fn pairs_of_the_check_have_the_baseline_of_the_held_out_ones() {
        let config = config(&["scene.towns=[1,2]"]);
        let found = Dataset::build_with_check(&config, &|_, _| ()).unwrap();
        let is_as_asked = |apart: &f64| (apart - config.data.baseline_m).abs() < 1e-9;
        assert!(apart_m(&found.check).iter().chain(&apart_m(&found.test)).all(is_as_asked));
        assert!(!apart_m(&found.train).iter().any(is_as_asked));
        // Three of the five are in the first town.
        let places: Vec<&str> = found.check.iter().map(|pair| pair.place.as_str()).collect();
        assert_eq!(places, [0, 0, 0, 1, 1].map(|town: usize| found.train[2 * town].place.as_str()));
        let numbers: Vec<u32> = found.pairs().flat_map(|pair| pair.viewpoints).collect();
        assert_eq!(numbers, (1..=2 * (4 + 3 + 5)).collect::<Vec<u32>>());
    }

    #[test]
    fn at_an_equal_baseline_the_pairs_of_the_check_are_the_next_training_pairs() {
        let config = config(&["scene.towns=[1,2]", "data.train_baseline_factor=1"]);
        let found = Dataset::build_with_check(&config, &|_, _| ()).unwrap();
        let mut more = config.clone();
        more.data.train_pairs = 9;
        let more = Dataset::build(&more, &|_, _| ()).unwrap();
        // Each town has two of four pairs; of nine, five and four.
        let all = truths(&more.train);
        assert_eq!(truths(&found.check), [&all[2..5], &all[7..9]].concat());
    }

    #[test]
    fn a_check_changes_no_other_pair() {
        let config = config(&[]);
        let checked = Dataset::build_with_check(&config, &|_, _| ()).unwrap();
        let plain = Dataset::build(&config, &|_, _| ()).unwrap();
        assert_eq!((plain.check.len(), checked.check.len()), (0, 5));
        assert_eq!(truths(&plain.train), truths(&checked.train));
        assert_eq!(truths(&plain.test), truths(&checked.test));
        assert_eq!(plain.triangles, checked.triangles);
        assert!(plain.views().eq(checked.views().take(2 * (4 + 3))));
    }

    #[test]
    fn a_split_needs_no_room_for_the_other() {
        let both_config = config(&["scene.towns=[1,2]", "data.baseline_m=12"]);
        let both = Dataset::build(&both_config, &|_, _| ()).unwrap();
        // No training pair is so far apart.
        let mut far = both_config.clone();
        far.data.train_baseline_factor = 1e7;
        assert!(Dataset::build(&far, &|_, _| ()).is_err());
        assert!(Dataset::build_for(&far, Split::Train, &|_, _| ()).is_err());
        let found = Dataset::build_for(&far, Split::Test, &|_, _| ()).unwrap();
        assert!(found.train.is_empty());
        assert_eq!(truths(&found.test), truths(&both.test));
        let numbers = |pairs: &[ScanPair]| -> Vec<[u32; 2]> {
            pairs.iter().map(|pair| pair.viewpoints).collect()
        };
        assert_eq!(numbers(&found.test), numbers(&both.test));
    }

    #[test]
    fn a_town_without_room_for_more_pairs_gives_those_that_it_has_room_for() {
        let mut config = config(&["scene.source=structured"]);
        let town = towns(&config)[0];
        let place = place(&config, town).unwrap();
        let sight = sight(&place, &config.scanner.beams());
        let plan = pair_plan(&config, Split::Train, 1, town);
        let found = |config: &RunConfig, more| {
            poses_and_more(config, &place, &sight, (&plan, more), &|_, _| ())
        };
        let first = found(&config, 0).unwrap();
        assert_eq!(found(&config, 1).unwrap()[..1], first);
        // Only the first pair has exactly its overlap.
        (config.data.least_overlap, config.data.most_overlap) =
            (first[0].overlap, first[0].overlap);
        assert_eq!(found(&config, 1).unwrap(), first);
        config.data.most_overlap = 0.0;
        assert!(found(&config, 1).is_err());
    }
}
