//! Pairs of scans to register: scene responses and true motions, traced once for every candidate to
//! come.

mod motion;

use std::path::Path;
use std::sync::Arc;

use echoloop_files::shown;
use echoloop_frontend::SceneResponse;
use echoloop_sim::import::{ImportError, load_scene};
use echoloop_sim::raycast::Raycaster;
use echoloop_sim::scanner::{BeamOptics, Scanner};
use echoloop_sim::scene::{Scene, SceneKind, generate};
use echoloop_sim::viewpoint::{PairPlan, PosePair, Split, ViewpointError, sample_pairs_aloud};
use thiserror::Error;

use crate::experiment::beams::Beams;
use crate::experiment::config::{RunConfig, RunConfigError};
use crate::experiment::seed::{Purpose, derive};
use echoloop_registration::pose::{Pose, relative};
use motion::Path as MotionPath;

/// Why there are no pairs.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// The mesh cannot be used.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// `scene.source` is neither a kind nor a file.
    #[error(
        "scene.source = {0:?} is neither structured, semi-structured, unstructured nor a mesh file \
         that exists"
    )]
    Source(String),
    /// A key of `[scene]` is out of bounds.
    #[error(transparent)]
    Config(#[from] RunConfigError),
    /// Nowhere to stand.
    #[error("{scene}: {source}")]
    Viewpoints {
        /// The scene.
        scene: String,
        /// Why.
        source: ViewpointError,
    },
}

/// Two scans of a place.
#[derive(Clone, Debug)]
pub struct ScanPair {
    /// The town.
    pub place: String,
    /// T*: `first_from_second`.
    pub truth: Pose,
    /// Where the sensor stood, first and second; of one that moved, in the middle of each scan.
    pub world_from_sensor: [Pose; 2],
    /// What the first scan sees.
    pub first: Arc<SceneResponse>,
    /// What the second scan sees.
    pub second: Arc<SceneResponse>,
    /// Numbers of the two viewpoints, for a sensor that somebody else turns: see [`viewpoints`].
    pub viewpoints: [u32; 2],
}

/// Numbers of a pair's viewpoints, from 1: those of the training pairs, two each, then those of the
/// pairs to judge on. A scan alone is of viewpoint 1.
///
/// ```text
/// training pair p   2p + 1                   2p + 2                     p = 0..
/// held-out pair p   2·train_pairs + 2p + 1   2·train_pairs + 2p + 2
/// ```
pub fn viewpoints(place: usize) -> [u32; 2] {
    [1, 2].map(|scan| 2 * place as u32 + scan)
}

/// The pairs of a run.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Where the beams point, and when.
    pub beams: Beams,
    /// Pairs to tune on.
    pub train: Vec<ScanPair>,
    /// Pairs to judge on.
    pub test: Vec<ScanPair>,
    /// Triangles in all towns.
    pub triangles: usize,
}

/// A scene ready to be scanned.
pub struct Place {
    /// The scene.
    pub scene: Scene,
    /// Its ray caster.
    pub caster: Raycaster,
}

impl Dataset {
    /// Makes or loads the scenes, finds viewpoints, traces every scan. `progress` hears a fraction
    /// of 1 and what is done.
    ///
    /// # Errors
    ///
    /// [`DatasetError`].
    pub fn build(config: &RunConfig, progress: &dyn Fn(f64, &str)) -> Result<Self, DatasetError> {
        let beams = config.scanner.beams();
        let mut dataset = Self { beams, train: Vec::new(), test: Vec::new(), triangles: 0 };
        let towns = towns(config);
        let total = (config.data.train_pairs + config.data.test_pairs) as f64;
        for (index, town) in towns.iter().enumerate() {
            let place = place(config, *town)?;
            dataset.triangles += place.scene.mesh.triangles.len();
            for split in [Split::Train, Split::Test] {
                let done = |d: &Self| (d.train.len() + d.test.len()) as f64 / total;
                let looking = |found, tried| {
                    if tried % 100 == 0 {
                        let text = format!("viewpoint {} after {tried} tries", found + 1);
                        progress(done(&dataset), &text);
                    }
                };
                let poses = poses(config, &place, split, (index, towns.len()), *town, &looking)?;
                for pair in poses {
                    progress(done(&dataset), &place.scene.name);
                    let number = match split {
                        Split::Train => dataset.train.len(),
                        Split::Test => config.data.train_pairs + dataset.test.len(),
                    };
                    let pair = trace(config, &place, &pair, viewpoints(number), &dataset.beams);
                    match split {
                        Split::Train => dataset.train.push(pair),
                        Split::Test => dataset.test.push(pair),
                    }
                }
            }
        }
        progress(1.0, "");
        Ok(dataset)
    }

    /// What is seen from every viewpoint, in the order of their numbers.
    pub fn views(&self) -> impl Iterator<Item = &Arc<SceneResponse>> {
        self.train.iter().chain(&self.test).flat_map(|pair| [&pair.first, &pair.second])
    }
}

/// Seeds of the towns; an imported mesh is one town. No more towns than pairs.
fn towns(config: &RunConfig) -> Vec<u64> {
    let mut towns = config.scene.towns.clone();
    if config.scene.source.parse::<SceneKind>().is_err() {
        towns.truncate(1);
    }
    towns.truncate(config.data.train_pairs.min(config.data.test_pairs).max(1));
    towns
}

/// Makes or loads one town.
///
/// # Errors
///
/// [`DatasetError`].
pub fn place(config: &RunConfig, town: u64) -> Result<Place, DatasetError> {
    let source = &config.scene.source;
    let scene = match source.parse::<SceneKind>() {
        Ok(kind) => generate(kind, town),
        Err(_) => {
            let path = Path::new(source);
            let looks_like_a_file = path.extension().is_some() || path.exists();
            if !looks_like_a_file {
                return Err(DatasetError::Source(shown(source)));
            }
            load_scene(path, &config.scene.import()?)?
        }
    };
    let caster = Raycaster::new(&scene);
    Ok(Place { scene, caster })
}

/// This town's share of the pairs.
fn poses(
    config: &RunConfig,
    place: &Place,
    split: Split,
    (index, towns): (usize, usize),
    town: u64,
    looking: &dyn Fn(usize, usize),
) -> Result<Vec<PosePair>, DatasetError> {
    let data = &config.data;
    let (total, purpose, baseline_factor) = match split {
        Split::Train => (data.train_pairs, Purpose::TrainPoses, data.train_baseline_factor),
        Split::Test => (data.test_pairs, Purpose::TestPoses, 1.0),
    };
    let count = total / towns + usize::from(index < total % towns);
    let plan = PairPlan {
        count,
        baseline_m: data.baseline_m,
        baseline_factor,
        heading_range_deg: data.heading_range_deg,
        tilt_range_deg: data.tilt_range_deg,
        height_m: config.scanner.height_m,
        seed: derive(config.seed, purpose, town),
        split,
    };
    sample_pairs_aloud(&place.scene, &place.caster, &plan, &|_| true, looking)
        .map_err(|source| DatasetError::Viewpoints { scene: place.scene.name.clone(), source })
}

fn trace(
    config: &RunConfig,
    place: &Place,
    pair: &PosePair,
    viewpoints: [u32; 2],
    beams: &Beams,
) -> ScanPair {
    let truth = relative(&pair.world_from_first, &pair.world_from_second);
    let look = |pose, viewpoint| Arc::new(respond_at(config, place, pose, viewpoint, beams));
    ScanPair {
        place: place.scene.name.clone(),
        truth,
        world_from_sensor: [pair.world_from_first, pair.world_from_second],
        first: look(&pair.world_from_first, viewpoints[0]),
        second: look(&pair.world_from_second, viewpoints[1]),
        viewpoints,
    }
}

/// What a scan alone sees from a pose: of viewpoint 1.
pub fn respond(
    config: &RunConfig,
    place: &Place,
    world_from_sensor: &Pose,
    beams: &Beams,
) -> SceneResponse {
    respond_at(config, place, world_from_sensor, 1, beams)
}

/// What the scan of a viewpoint sees; of a sensor that moves, the pose is that of the middle of the
/// scan.
pub fn respond_at(
    config: &RunConfig,
    place: &Place,
    world_from_sensor: &Pose,
    viewpoint: u32,
    beams: &Beams,
) -> SceneResponse {
    let optics = BeamOptics {
        divergence_mrad: config.receiver.divergence_mrad,
        subrays: config.receiver.subrays,
    };
    let directions = beams.directions(viewpoint);
    let directions: Vec<[f32; 3]> = directions.iter().map(|&d| d.into()).collect();
    let (caster, materials) = (&place.caster, &place.scene.materials);
    if config.motion.is_still() {
        return Scanner::scan(caster, materials, world_from_sensor, &directions, &optics);
    }
    let seed = derive(config.seed, Purpose::Motion, viewpoint.into());
    let path = MotionPath::new(&config.motion, beams, *world_from_sensor, seed);
    Scanner::scan_moving(
        caster,
        materials,
        |beam| path.world_from_sensor(beam),
        &directions,
        &optics,
    )
}
