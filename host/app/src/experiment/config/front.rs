//! `[front]`: whether a front of error against a cost is searched for, and how.

use serde::{Deserialize, Serialize};

use super::error::{RunConfigError, require};
use crate::experiment::cost::CostKind;
use crate::experiment::preset::Protocol;

/// How to search for a front.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FrontConfig {
    /// Against which cost: energy, instructions, bits, seconds. Left out: there is no front.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<CostKind>,
    /// Points of the front at most.
    pub points: usize,
    /// Candidates a generation.
    pub population: usize,
    /// Generations.
    pub generations: u32,
    /// Training pairs that a candidate sees: the same for all, in the same noise.
    pub pairs: usize,
}

impl Default for FrontConfig {
    fn default() -> Self {
        Self { cost: None, points: 24, population: 40, generations: 20, pairs: 5 }
    }
}

impl FrontConfig {
    pub(super) fn check(&self, protocol: Protocol) -> Result<(), RunConfigError> {
        let sensors = matches!(protocol, Protocol::Lidar | Protocol::Joint);
        require(
            "front.cost",
            self.cost.map_or("none", CostKind::name),
            self.cost.is_none() || sensors,
            "left out unless tune.protocol is lidar or joint: only the sensor's parameters cost",
        )?;
        let Self { points, population, generations, pairs, .. } = *self;
        require("front.points", points, (2..=1000).contains(&points), "2 to 1000")?;
        let some = (4..=10_000).contains(&population);
        require("front.population", population, some, "4 to 10000")?;
        let some = (1..=100_000).contains(&generations);
        require("front.generations", generations, some, "1 to 100000")?;
        require("front.pairs", pairs, (1..=10_000).contains(&pairs), "1 to 10000")
    }
}
