//! Front of error against a cost, as results hold it.

use echoloop_statistics::{mean, mean_interval};
use serde::{Deserialize, Serialize};

use crate::cost::{CostKind, ScanCost};
use crate::evaluation::compare::{Comparison, worths};
use crate::evaluation::summary::Summary;
use crate::parameters::{Values, written_values};

/// Error and cost of parameters on the held-out pairs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// Mean ‖T_est − T*‖_F, each at most the cap of the search.
    pub error: f64,
    /// 95 % interval of that mean, by bootstrap over pairs.
    pub interval: [f64; 2],
    /// Share of pairs that succeed, percent.
    pub recall_pct: f64,
    /// Median e_t over all pairs, m.
    pub median_translation_m: f64,
    /// Mean cost of a scan.
    pub cost: ScanCost,
}

/// Point of the front.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrontPoint {
    /// All parameters.
    #[serde(serialize_with = "written_values")]
    pub values: Values,
    /// Error and cost.
    #[serde(flatten)]
    pub mark: Mark,
    /// Error minus that of the start, pair by pair.
    pub comparison: Comparison,
}

/// Front of error against a cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Front {
    /// Kind of cost.
    pub cost: CostKind,
    /// Number of held-out pairs.
    pub pairs: usize,
    /// Error and cost of the start.
    pub default: Mark,
    /// Error and cost of the parameters that the search before selected.
    pub tuned: Mark,
    /// Points, cheapest first, selected on training pairs.
    pub points: Vec<FrontPoint>,
}

impl Front {
    /// Front from summaries on the held-out pairs: start, selected parameters, then the points.
    pub(super) fn new(cost: CostKind, cap: f64, evaluated: Vec<(Values, Summary)>) -> Self {
        let unknown = Mark {
            error: f64::NAN,
            interval: [f64::NAN; 2],
            recall_pct: f64::NAN,
            median_translation_m: f64::NAN,
            cost: ScanCost::UNKNOWN,
        };
        let mark = |i: usize| evaluated.get(i).map_or(unknown, |(_, summary)| mark(summary, cap));
        let (default, tuned) = (mark(0), mark(1));
        let start = evaluated.first().map_or(&[][..], |(_, start)| &start.errors);
        let point = |(i, (values, summary)): (usize, &(Values, Summary))| FrontPoint {
            values: values.clone(),
            mark: mark(i),
            comparison: Comparison::new(start, &summary.errors, cap),
        };
        let mut points: Vec<FrontPoint> = evaluated.iter().enumerate().skip(2).map(point).collect();
        points.sort_by(|a, b| cost.of(&a.mark.cost).total_cmp(&cost.of(&b.mark.cost)));
        Self { cost, pairs: start.len(), default, tuned, points }
    }

    /// Cheapest point whose error is not significantly higher than the start's.
    pub fn cheapest_as_good(&self) -> Option<&FrontPoint> {
        self.points.iter().find(|point| !point.comparison.is_worse())
    }

    /// Cheapest point whose mean error is no higher than the start's.
    pub fn cheapest_no_higher(&self) -> Option<&FrontPoint> {
        self.points.iter().find(|point| point.comparison.difference <= 0.0)
    }

    /// Sentence: `the same error at 1/40 of the energy, as far as 40 pairs tell; …`.
    pub fn verdict(&self) -> String {
        let phrase = |point: &FrontPoint| {
            point.comparison.at_cost(self.cost, &self.default.cost, &point.mark.cost)
        };
        if self.default.recall_pct == 0.0 {
            let pairs = self.pairs;
            return format!("not told, for it registers none of {pairs} pairs, as a blind sensor");
        }
        let Some(cheapest) = self.cheapest_as_good() else {
            return "no point errs as little as the default".into();
        };
        let first = format!("{}, as far as {} pairs tell", phrase(cheapest), self.pairs);
        match self.cheapest_no_higher() {
            Some(point) if point == cheapest => first,
            Some(point) => format!("{first}; with a mean that is no higher, {}", phrase(point)),
            None => format!("{first}; no point has a mean that is no higher"),
        }
    }
}

fn mark(summary: &Summary, cap: f64) -> Mark {
    let worths = worths(&summary.errors, cap);
    Mark {
        error: mean(&worths),
        interval: mean_interval(&worths),
        recall_pct: summary.recall_pct,
        median_translation_m: summary.median_translation_m,
        cost: summary.cost.unwrap_or(ScanCost::UNKNOWN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DataConfig;
    use crate::evaluation::objective::PairError;

    /// Summary of 40 pairs with errors `error ± spread` in turns, and its energy.
    fn evaluated(energy_j: f64, error: f64, spread: f64) -> (Values, Summary) {
        let pair = |pair: usize| {
            let frobenius = error + [spread, -spread][pair % 2];
            PairError { pair, frobenius, ..PairError::default() }
        };
        let cost = Some(ScanCost { energy_j, instructions: 1.0, bits: 1.0, seconds: 1.0 });
        let summary = Summary::from_errors((0..40).map(pair).collect(), &DataConfig::default());
        (Values::new(), Summary { cost, ..summary })
    }

    #[test]
    fn a_front_is_sorted_and_names_the_cost_of_the_start_s_error() {
        let front = Front::new(
            CostKind::Energy,
            1.0,
            vec![
                evaluated(1e-3, 0.10, 0.0),
                evaluated(5e-4, 0.05, 0.0),
                evaluated(2e-6, 0.09, 0.0),
                evaluated(1e-8, 0.50, 0.0),
                evaluated(1e-6, 0.105, 0.03),
            ],
        );
        let energies: Vec<f64> = front.points.iter().map(|p| p.mark.cost.energy_j).collect();
        assert_eq!(energies, [1e-8, 1e-6, 2e-6]);
        let errors = front.points.iter().map(|point| point.comparison.error());
        assert!(errors.eq(["a higher error", "the same error", "a lower error"]));
        assert_eq!(
            front.verdict(),
            "the same error at 1/1000 of the energy, as far as 40 pairs tell; with a mean that is \
             no higher, a lower error at 1/500 of the energy"
        );
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(front.default.error, 0.1) && near(front.tuned.error, 0.05), "{front:?}");
        let none = Front::new(
            CostKind::Energy,
            1.0,
            vec![evaluated(1.0, 0.1, 0.0), evaluated(1.0, 0.1, 0.0), evaluated(1e-3, 0.2, 0.0)],
        );
        assert_eq!(none.verdict(), "no point errs as little as the default");
        let (nothing, mut summary) = evaluated(1.0, 1.0, 0.0);
        summary.recall_pct = 0.0;
        let blind = (nothing, summary);
        let dark = evaluated(1e-9, 1.0, 0.0);
        let front = Front::new(CostKind::Energy, 1.0, vec![blind.clone(), blind, dark]);
        assert!(front.verdict().contains("registers none of 40 pairs"), "{}", front.verdict());
    }
}
