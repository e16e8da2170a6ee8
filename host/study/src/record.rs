//! Record of a finished cell. It has no times, so that equal cells have equal records.

use serde::{Deserialize, Serialize};

use super::cell::Cell;
use echoloop_closed_loop::config::{DataConfig, RunConfig};
use echoloop_closed_loop::dataset::fingerprint::Content;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::parameters::{Values, written_values};

/// Record of a finished cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Version of this format.
    pub format: u32,
    /// The cell.
    pub cell: Cell,
    /// The seed.
    pub seed: u64,
    /// Version of the program.
    pub version: String,
    /// Checksum of the program's file; none where it cannot be read.
    pub build: Option<String>,
    /// Checksum of the cell's configuration.
    pub configuration: String,
    /// Scene and towns of the training pairs, where the held-out pairs are of others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trained_in: Option<TrainedIn>,
    /// Checksums of the scene, the front end and every scan.
    pub content: Content,
    /// Origin of the parameters: an [`Origin`](echoloop_closed_loop::search::Origin), written.
    pub origin: String,
    /// Generations searched.
    pub generations: usize,
    /// Registrations of the search.
    pub registrations: usize,
    /// All parameters.
    #[serde(serialize_with = "written_values")]
    pub parameters: Values,
    /// Pairs, and the limits of success.
    pub data: DataConfig,
    /// Errors of the parameters on the held-out pairs.
    pub summary: Summary,
}

/// A kind of country and the numbers of its towns.
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

#[cfg(test)]
pub(super) mod fixture {
    use super::*;
    use crate::{Scene, TableMethod};
    use echoloop_closed_loop::config::preset::Preset;
    use echoloop_closed_loop::evaluation::objective::PairError;

    /// The untuned cell of a method in a kind of scene.
    pub(crate) fn start(method: &str, scene: &str) -> Cell {
        let (method, scene) = (TableMethod::named(method), Scene::named(scene));
        Cell::start(Preset::Outdoor, method.expect("a method"), scene.expect("a scene"))
    }

    /// Summary of pairs with these translation errors, m, and as many degrees.
    pub(crate) fn summary(errors_m: &[f64]) -> Summary {
        let error = |(pair, &translation_m): (usize, &f64)| PairError {
            pair,
            translation_m,
            rotation_deg: translation_m,
            frobenius: translation_m,
            points: [100, 100],
            stop: String::new(),
            iterations: 1,
        };
        let errors = errors_m.iter().enumerate().map(error).collect();
        Summary::from_errors(errors, &DataConfig::default())
    }
}
