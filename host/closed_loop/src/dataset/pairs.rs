//! Pairs of scans, however they came about.

use std::sync::Arc;

use echoloop_frontend::SceneResponse;
use echoloop_registration::pose::Pose;

use crate::beams::Beams;

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
    /// Share of what either scan sees that the other sees, too: `Sight::overlap` of the simulator.
    pub overlap: f64,
}

/// Numbers of a pair's viewpoints, from 1: those of the training pairs, two each, then those of the
/// pairs to judge on, then those of the check. A scan alone is of viewpoint 1.
///
/// ```text
/// training pair p   2p + 1                     2p + 2                     p = 0..
/// held-out pair p   2·train_pairs + 2p + 1     2·train_pairs + 2p + 2
/// of the check p    2·train_pairs + 2·test_pairs + 2p + 1, and the next
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
    /// Pairs for the last choice alone: of the training pairs' towns, seen by no search, and as far
    /// apart as the pairs to judge on.
    pub check: Vec<ScanPair>,
    /// Triangles in all towns.
    pub triangles: usize,
}

impl Dataset {
    /// All pairs, in the order of their viewpoints' numbers.
    pub fn pairs(&self) -> impl Iterator<Item = &ScanPair> {
        self.train.iter().chain(&self.test).chain(&self.check)
    }

    /// What is seen from every viewpoint, in the order of their numbers.
    pub fn views(&self) -> impl Iterator<Item = &Arc<SceneResponse>> {
        self.pairs().flat_map(|pair| [&pair.first, &pair.second])
    }
}
