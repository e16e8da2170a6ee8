//! Pairs of scans, traced, stored or recorded.

use std::sync::Arc;

use echoloop_clouds::Pose;
use echoloop_frontend::SceneResponse;
use echoloop_sensors::serve::Views;

use super::response::Response;
use crate::beams::Beams;

/// Two scans of a place and their true motion.
#[derive(Clone, Debug)]
pub struct ScanPair {
    /// Name of the town.
    pub place: String,
    /// T*: `first_from_second`.
    pub truth: Pose,
    /// Pose of the sensor, first and second; of a moving sensor, in the middle of each scan.
    pub world_from_sensor: [Pose; 2],
    /// Response of the first scan.
    pub first: Response,
    /// Response of the second scan.
    pub second: Response,
    /// Numbers of the two viewpoints ([`viewpoints`]), for a sensor turned by a turntable.
    pub viewpoints: [u32; 2],
    /// Overlap, 0 to 1: share of what either scan sees that the other sees, too
    /// (`Sight::overlap` of the simulator).
    pub overlap: f64,
}

/// Numbers of a pair's viewpoints, from 1: two for each training pair, then for each held-out pair,
/// then for each pair of the check. A single scan is viewpoint 1.
///
/// ```text
/// training pair p   2p + 1                     2p + 2                     p = 0..
/// held-out pair p   2·train_pairs + 2p + 1     2·train_pairs + 2p + 2
/// of the check p    2·train_pairs + 2·test_pairs + 2p + 1, and the next
/// ```
pub fn viewpoints(place: usize) -> [u32; 2] {
    [1, 2].map(|scan| 2 * place as u32 + scan)
}

/// Pairs of a run.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Beams of each scan.
    pub beams: Beams,
    /// Pairs to tune on.
    pub train: Vec<ScanPair>,
    /// Held-out pairs, to judge on.
    pub test: Vec<ScanPair>,
    /// Pairs for the final selection alone: in the towns of the training pairs, seen by no search,
    /// at the baseline of the held-out pairs.
    pub check: Vec<ScanPair>,
    /// Triangles in all towns.
    pub triangles: usize,
}

impl Dataset {
    /// All pairs, in the order of their viewpoints' numbers.
    pub fn pairs(&self) -> impl Iterator<Item = &ScanPair> {
        self.train.iter().chain(&self.test).chain(&self.check)
    }

    /// Responses of all viewpoints to the sensor's own aim, in the order of their numbers.
    pub fn views(&self) -> impl Iterator<Item = Arc<SceneResponse>> {
        self.responses().map(|response| response.to(&self.beams))
    }

    /// True when the beams of its pairs are those of one aim, as of stored pairs.
    pub fn has_one_aim(&self) -> bool {
        self.responses().next().is_some_and(|response| matches!(response, Response::Fixed(_)))
    }

    fn responses(&self) -> impl Iterator<Item = &Response> {
        self.pairs().flat_map(|pair| [&pair.first, &pair.second])
    }
}

/// Viewpoints to serve, whatever the aim.
impl Views for Dataset {
    fn view(&self, number: u32, cell: u32) -> Option<Arc<SceneResponse>> {
        let index = (number as usize).checked_sub(1)?;
        Some(self.responses().nth(index)?.to_cell(&self.beams, cell))
    }
}
