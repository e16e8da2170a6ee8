//! `[tune]`: the search.

use std::collections::BTreeMap;

use echoloop_parameters::{Bounds, Kind, Parameter, Refused, section};
use serde::{Deserialize, Serialize};

use super::axes::OwnAxes;
use super::choices::COSTS;
use super::weights::Weights;
use crate::config::preset::{ErrorMean, LidarPreset, Objective, Protocol, Sampler, Strategy};
use crate::cost::CostKind;

section! {
    /// The search.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, expecting = "a table, [tune]")]
    pub struct TuneConfig in "tune" {
        strategy: Strategy, "", Strategy::BOUNDS,
            "How to search: what is left out below follows it.";
        protocol: Protocol, "", Protocol::BOUNDS,
            "What is tuned: nothing, the sensor, registration, or both.";
        lidar: LidarPreset, "", LidarPreset::BOUNDS,
            "Which of the sensor's parameters are tuned: `usual`, ten and a steered sensor's aim, \
             the `paper`'s eight, the `aim` alone, or `full`, all of them.";
        sampler: Sampler, "", Sampler::BOUNDS,
            "How candidates are drawn: by `cma-es`, or `random`, to compare with.";
        generations: u32, "generations", Bounds::between(1.0, 1e5),
            "Generations of a search of one half. In a search of both each half has two thirds of \
             them, and a stage that goes on from a winner one third.";
        registrations: usize, "registrations", Bounds::zero_or("by generations", 1.0, 1e9),
            "Instead of `generations`: about as many registrations, whatever is tuned, so that \
             protocols can be compared. The final selection takes some more.";
        #[serde(skip_serializing_if = "Option::is_none")]
        extended_to: Option<u32>, "generations", Bounds::between(1.0, 1e5),
            "Of a run that was extended: as many of the last search as if there were these \
             generations.";
        population: usize, "candidates", Bounds::zero_or("automatic", 2.0, 1e4),
            "Candidates a generation; 0: as many as there are parameters, as in the paper.";
        pairs_per_generation: usize, "pairs", Bounds::at_least(0.0),
            "Training pairs a generation sees, drawn anew each time and shared by its candidates; \
             0: all, as in the paper.";
        error_mean: ErrorMean, "", ErrorMean::BOUNDS,
            "How the errors of a candidate's pairs are put together: `arithmetic`, as in the \
             paper; `geometric`, by which a lost pair counts little; `square-root`, between the \
             two.";
        error_cap: f64, "", Bounds::at_least(0.0),
            "No pair counts for more than this, ‖T_est − T*‖_F; 0: no cap, as in the paper.";
        common_noise: bool, "", Bounds::FLAG,
            "Whether the candidates of a generation meet the same noise.";
        sigma: f64, "of the cube", Bounds::above(0.0, 1.0),
            "Start of the step size, in the unit cube.";
        survey: usize, "aims", Bounds::between(0.0, 1000.0),
            "Aims of a steered sensor that are compared on the training pairs before the search, \
             which begins at the best; 0: none.";
        shortlist: usize, "candidates", Bounds::between(0.0, 1000.0),
            "Candidates judged again on all training pairs at the end, besides the mean and the \
             start.";
        objective: Objective, "", Objective::BOUNDS,
            "What is made small: the `error` alone, or `weighted`, also what a scan costs.";
        #[serde(skip_serializing_if = "Option::is_none")]
        minimise: Option<CostKind>, "", Bounds::OneOf(&COSTS),
            "Instead of either the least of this cost, at an error as by `at_most_error`.";
        at_most_error: f64, "times", Bounds::between(1.0, 100.0),
            "With `minimise`: no more than so many times the start's error, on ten pairs or more \
             with one standard error on top, and no more pairs lost.";
    }
    beside {
        /// Weights of the costs.
        pub weights: Weights,
        /// Axes of the search that are not as usual.
        #[serde(skip_serializing_if = "OwnAxes::is_empty")]
        pub axes: OwnAxes,
        /// Sets of parameters by name at which the search may begin instead of the start.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub warm_starts: Vec<BTreeMap<String, f64>>,
    }
}

/// List of tables with a key for each parameter that begins elsewhere.
pub(super) const WARM_STARTS: Parameter = Parameter {
    key: "tune.warm_starts",
    unit: "",
    kind: Kind::Text,
    bounds: Bounds::Words("tables of parameters by name, as [{\"lidar.power\" = 5}]"),
    help: "Where the search may begin, too, as tuned elsewhere: the best on the training pairs.",
};

impl Default for TuneConfig {
    fn default() -> Self {
        Self::for_strategy(Strategy::default())
    }
}

impl TuneConfig {
    /// Defaults of a strategy.
    pub fn for_strategy(strategy: Strategy) -> Self {
        let fast = Self {
            strategy,
            protocol: Protocol::Joint,
            lidar: LidarPreset::Usual,
            sampler: Sampler::CmaEs,
            generations: 15,
            registrations: 0,
            extended_to: None,
            population: 0,
            pairs_per_generation: 3,
            error_mean: ErrorMean::SquareRoot,
            error_cap: 1.0,
            common_noise: true,
            sigma: 0.2,
            survey: 16,
            shortlist: 4,
            objective: Objective::Weighted,
            minimise: None,
            at_most_error: 1.2,
            weights: Weights::default(),
            axes: OwnAxes::default(),
            warm_starts: Vec::new(),
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
                survey: 0,
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

    /// Cost by which a choice is described: the one that is minimised, or energy.
    pub fn told_cost(&self) -> CostKind {
        self.minimise.unwrap_or_default()
    }

    /// True when the search considers the cost of a scan.
    pub fn counts_costs(&self) -> bool {
        self.objective == Objective::Weighted || self.minimise.is_some()
    }

    pub(super) fn check(&self) -> Result<(), Refused> {
        self.check_keys()?;
        let knows_costs = self.strategy != Strategy::Paper;
        for key in Self::KEYS {
            match (key.key, self.extended_to) {
                ("tune.extended_to", Some(to)) if to < self.generations => {
                    return Err(key.refused(to, "tune.generations to 100000"));
                }
                ("tune.extended_to", Some(to)) if self.registrations > 0 => {
                    let expected = "left out beside tune.registrations";
                    return Err(key.refused(to, expected));
                }
                ("tune.objective", _) if self.objective == Objective::Weighted && !knows_costs => {
                    let expected = "error with tune.strategy = paper, which knows no costs";
                    return Err(key.refused("weighted", expected));
                }
                ("tune.minimise", _) if !knows_costs => {
                    if let Some(kind) = self.minimise {
                        let expected = "left out with tune.strategy = paper, which knows no costs";
                        return Err(key.refused(format!("{kind:?}").to_lowercase(), expected));
                    }
                }
                _ => {}
            }
        }
        if !self.warm_starts.is_empty() && self.strategy == Strategy::Paper {
            let expected = "none with tune.strategy = paper, which has one start";
            return Err(WARM_STARTS.refused(self.warm_starts.len(), expected));
        }
        self.weights.check_keys()
    }
}
