//! `[front]`: search for a front of error against a cost.

use echoloop_parameters::{Bounds, section};
use serde::{Deserialize, Serialize};

use super::choices::COSTS;
use crate::cost::CostKind;

section! {
    /// Search for a front of error against a cost.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, expecting = "a table, [front]")]
    pub struct FrontConfig in "front" {
        #[serde(skip_serializing_if = "Option::is_none")]
        cost: Option<CostKind>, "", Bounds::OneOf(&COSTS),
            "Against which cost. Left out: there is no front.";
        points: usize, "points", Bounds::between(2.0, 1000.0),
            "Points of the front at most.";
        population: usize, "candidates", Bounds::between(4.0, 1e4),
            "Candidates a generation.";
        generations: u32, "generations", Bounds::between(1.0, 1e5),
            "Generations.";
        pairs: usize, "pairs", Bounds::between(1.0, 1e4),
            "Training pairs that a candidate sees: the same for all, in the same noise.";
    }
}

impl Default for FrontConfig {
    fn default() -> Self {
        Self { cost: None, points: 24, population: 40, generations: 20, pairs: 5 }
    }
}
