//! What is kept of a cell that is done. No times: equal cells have equal records.

use serde::{Deserialize, Serialize};

use super::cell::Cell;
use crate::experiment::config::DataConfig;
use crate::experiment::content::Content;
use crate::experiment::evaluate::Summary;
use crate::experiment::params::{Values, written_values};

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
    /// Checksums of the scene, the front end and every scan.
    pub content: Content,
    /// Where the parameters come from: `start`, or generation and candidate.
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

impl Record {
    /// Version of the format that is written.
    pub const FORMAT: u32 = 1;
}
