//! What is kept of a cell that is done. No times: equal cells have equal records.

use serde::{Deserialize, Serialize};

use super::cell::Cell;
use echoloop_closed_loop::config::{DataConfig, RunConfig};
use echoloop_closed_loop::dataset::fingerprint::Content;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::parameters::{Values, written_values};

/// A cell that is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Version of this format.
    pub format: u32,
    /// Which cell.
    pub cell: Cell,
    /// The seed.
    pub seed: u64,
    /// Version of the program.
    pub version: String,
    /// Checksum of the program's file, where it can be read.
    pub build: Option<String>,
    /// Checksum of the cell's configuration.
    pub configuration: String,
    /// Where it was tuned, where that is not where it is judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trained_in: Option<TrainedIn>,
    /// Checksums of the scene, the front end and every scan.
    pub content: Content,
    /// Where the parameters come from: an [`Origin`](echoloop_closed_loop::search::Origin),
    /// written.
    pub origin: String,
    /// Generations searched.
    pub generations: usize,
    /// Registrations of the search.
    pub registrations: usize,
    /// All parameters.
    #[serde(serialize_with = "written_values")]
    pub parameters: Values,
    /// What counts as a success, and which pairs there are.
    pub data: DataConfig,
    /// The parameters on the held-out pairs.
    pub summary: Summary,
}

/// A kind of country and its towns, by their numbers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainedIn {
    /// As `scene.source`.
    pub source: String,
    /// As `scene.towns`.
    pub towns: Vec<u64>,
}

impl From<&RunConfig> for TrainedIn {
    fn from(config: &RunConfig) -> Self {
        Self { source: config.scene.source.clone(), towns: config.scene.towns.clone() }
    }
}

impl Record {
    /// Version of the format that is written.
    pub const FORMAT: u32 = 1;
}
