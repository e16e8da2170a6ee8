//! `[tune]`: how to search.

use serde::{Deserialize, Serialize};

use super::axes::OwnAxes;
use super::error::{RunConfigError, require};
use super::weights::Weights;
use crate::experiment::cost::CostKind;
use crate::experiment::preset::{ErrorMean, LidarPreset, Objective, Protocol, Strategy};

/// How to search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TuneConfig {
    /// How: what is left out below follows it.
    pub strategy: Strategy,
    /// What is tuned.
    pub protocol: Protocol,
    /// Which of the sensor's parameters are tuned: `usual`, ten, the `paper`'s eight, or `full`,
    /// all of them.
    pub lidar: LidarPreset,
    /// Generations.
    pub generations: u32,
    /// Of a run that was extended: as many of the last search as if there were these generations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extended_to: Option<u32>,
    /// Candidates a generation; 0: as many as there are parameters, as in the paper.
    pub population: usize,
    /// Training pairs a generation sees, drawn anew each time and shared by its candidates; 0: all,
    /// as in the paper.
    pub pairs_per_generation: usize,
    /// How the errors of a candidate's pairs are put together: `arithmetic`, as in the paper, or
    /// `geometric`.
    pub error_mean: ErrorMean,
    /// No pair counts for more than this, ‖T_est − T*‖_F; 0: no cap, as in the paper.
    pub error_cap: f64,
    /// Whether the candidates of a generation meet the same noise.
    pub common_noise: bool,
    /// Start of the step size, in the unit cube.
    pub sigma: f64,
    /// Candidates judged again on all training pairs at the end, besides the mean and the start.
    pub shortlist: usize,
    /// What is made small: the `error` alone, or `weighted`, also what a scan costs.
    pub objective: Objective,
    /// Instead of either the least of this cost: `energy`, `instructions`, `bits` or `seconds`, …
    #[serde(skip_serializing_if = "Option::is_none")]
    pub minimise: Option<CostKind>,
    /// … at no more than so many times the start's error, and no more pairs lost.
    pub at_most_error: f64,
    /// What costs count when they are weighted.
    pub weights: Weights,
    /// Which parameters are searched, and how far, where that is not as usual.
    #[serde(skip_serializing_if = "OwnAxes::is_empty")]
    pub axes: OwnAxes,
}

impl Default for TuneConfig {
    fn default() -> Self {
        Self::for_strategy(Strategy::default())
    }
}

impl TuneConfig {
    /// What a strategy does unless it is told otherwise.
    pub fn for_strategy(strategy: Strategy) -> Self {
        let fast = Self {
            strategy,
            protocol: Protocol::Joint,
            lidar: LidarPreset::Usual,
            generations: 30,
            extended_to: None,
            population: 0,
            pairs_per_generation: 3,
            error_mean: ErrorMean::Geometric,
            error_cap: 1.0,
            common_noise: true,
            sigma: 0.2,
            shortlist: 4,
            objective: Objective::Weighted,
            minimise: None,
            at_most_error: 1.2,
            weights: Weights::default(),
            axes: OwnAxes::default(),
        };
        match strategy {
            Strategy::Fast => fast,
            Strategy::Paper => Self {
                lidar: LidarPreset::Paper,
                generations: 30,
                pairs_per_generation: 0,
                error_mean: ErrorMean::Arithmetic,
                error_cap: 0.0,
                common_noise: false,
                shortlist: 0,
                objective: Objective::Error,
                ..fast
            },
        }
    }

    /// Generations of the last search, before it is given its share of them.
    pub fn last_generations(&self) -> u32 {
        self.extended_to.unwrap_or(self.generations)
    }

    /// Whether it matters what a scan costs.
    pub fn counts_costs(&self) -> bool {
        self.objective == Objective::Weighted || self.minimise.is_some()
    }

    pub(super) fn check(&self) -> Result<(), RunConfigError> {
        let generations = self.generations;
        require(
            "tune.generations",
            generations,
            (1..=100_000).contains(&generations),
            "1 to 100000",
        )?;
        let extended_to = self.extended_to.unwrap_or(generations);
        require(
            "tune.extended_to",
            extended_to,
            (generations..=100_000).contains(&extended_to),
            "tune.generations to 100000",
        )?;
        let population = self.population;
        require(
            "tune.population",
            population,
            population != 1 && population <= 10_000,
            "0 (automatic) or 2 to 10000",
        )?;
        require(
            "tune.error_cap",
            self.error_cap,
            self.error_cap >= 0.0 && self.error_cap.is_finite(),
            "0 or more",
        )?;
        require(
            "tune.sigma",
            self.sigma,
            self.sigma > 0.0 && self.sigma <= 1.0,
            "above 0, at most 1",
        )?;
        require("tune.shortlist", self.shortlist, self.shortlist <= 1000, "at most 1000")?;
        require(
            "tune.at_most_error",
            self.at_most_error,
            (1.0..=100.0).contains(&self.at_most_error),
            "1 to 100",
        )?;
        let is_ours = self.strategy == Strategy::Fast;
        let objective = format!("{:?}", self.objective).to_lowercase();
        let only_error = "error with tune.strategy = paper, which knows no costs";
        require("tune.objective", objective, is_ours || !self.counts_costs(), only_error)?;
        self.weights.check()
    }
}
