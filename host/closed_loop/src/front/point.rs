//! The front as it is written down.

use echoloop_statistics::{mean, mean_interval};
use serde::{Deserialize, Serialize};

use crate::cost::{CostKind, ScanCost};
use crate::evaluation::compare::{Comparison, worths};
use crate::evaluation::summary::Summary;
use crate::parameters::{Values, written_values};

/// What parameters are worth on the held-out pairs, and what they cost there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// Mean ‖T_est − T*‖_F, each at most the cap of the search.
    pub error: f64,
    /// Its 95 % interval, by bootstrap over pairs.
    pub interval: [f64; 2],
    /// Share of pairs that succeed, percent.
    pub recall_pct: f64,
    /// Median e_t over all pairs, m.
    pub median_translation_m: f64,
    /// What a scan costs.
    pub cost: ScanCost,
}

/// A point of the front.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrontPoint {
    /// All parameters.
    #[serde(serialize_with = "written_values")]
    pub values: Values,
    /// What they are worth.
    #[serde(flatten)]
    pub mark: Mark,
    /// Their error less that of the start, on the same pairs.
    pub comparison: Comparison,
}

/// A front of error against a cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Front {
    /// The cost.
    pub cost: CostKind,
    /// Held-out pairs.
    pub pairs: usize,
    /// The start.
    pub default: Mark,
    /// What the search before the front's chose.
    pub tuned: Mark,
    /// Cheapest first. Chosen on training pairs.
    pub points: Vec<FrontPoint>,
}

impl Front {
    /// Of start, choice, and the points, each judged on the held-out pairs.
    pub(super) fn new(cost: CostKind, cap: f64, judged: Vec<(Values, Summary)>) -> Self {
        let unknown = Mark {
            error: f64::NAN,
            interval: [f64::NAN; 2],
            recall_pct: f64::NAN,
            median_translation_m: f64::NAN,
            cost: ScanCost::UNKNOWN,
        };
        let mark = |i: usize| judged.get(i).map_or(unknown, |(_, summary)| mark(summary, cap));
        let (default, tuned) = (mark(0), mark(1));
        let start = judged.first().map_or(&[][..], |(_, start)| &start.errors);
        let point = |(i, (values, summary)): (usize, &(Values, Summary))| FrontPoint {
            values: values.clone(),
            mark: mark(i),
            comparison: Comparison::new(start, &summary.errors, cap),
        };
        let mut points: Vec<FrontPoint> = judged.iter().enumerate().skip(2).map(point).collect();
        points.sort_by(|a, b| cost.of(&a.mark.cost).total_cmp(&cost.of(&b.mark.cost)));
        Self { cost, pairs: start.len(), default, tuned, points }
    }

    /// The cheapest point whose error is not beyond doubt higher than the start's.
    pub fn cheapest_as_good(&self) -> Option<&FrontPoint> {
        self.points.iter().find(|point| !point.comparison.is_worse())
    }

    /// The cheapest point whose mean error is no higher than the start's.
    pub fn cheapest_no_higher(&self) -> Option<&FrontPoint> {
        self.points.iter().find(|point| point.comparison.difference <= 0.0)
    }

    /// `the same error at 1/40 of the energy, as far as 40 pairs tell; …`
    pub fn verdict(&self) -> String {
        let said = |point: &FrontPoint| {
            point.comparison.at_cost(self.cost, &self.default.cost, &point.mark.cost)
        };
        if self.default.recall_pct == 0.0 {
            let pairs = self.pairs;
            return format!("not told, for it registers none of {pairs} pairs, as a blind sensor");
        }
        let Some(cheapest) = self.cheapest_as_good() else {
            return "no point errs as little as the default".into();
        };
        let first = format!("{}, as far as {} pairs tell", said(cheapest), self.pairs);
        match self.cheapest_no_higher() {
            Some(point) if point == cheapest => first,
            Some(point) => format!("{first}; with a mean that is no higher, {}", said(point)),
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

    /// So many J, and pairs that err by so much, one up, one down.
    fn judged(energy_j: f64, error: f64, spread: f64) -> (Values, Summary) {
        let pair = |pair: usize| {
            let frobenius = error + [spread, -spread][pair % 2];
            let stop = String::new();
            let (points, iterations) = ([1, 1], 1);
            PairError {
                pair,
                translation_m: 0.1,
                rotation_deg: 0.1,
                frobenius,
                points,
                stop,
                iterations,
            }
        };
        let cost = Some(ScanCost { energy_j, instructions: 1.0, bits: 1.0, seconds: 1.0 });
        let summary = Summary::from_errors((0..40).map(pair).collect(), &DataConfig::default());
        (Values::new(), Summary { cost, ..summary })
    }

    #[test]
    fn a_front_is_sorted_and_says_for_what_the_start_s_error_is_to_be_had() {
        let front = Front::new(
            CostKind::Energy,
            1.0,
            vec![
                judged(1e-3, 0.10, 0.0),
                judged(5e-4, 0.05, 0.0),
                judged(2e-6, 0.09, 0.0),
                judged(1e-8, 0.50, 0.0),
                judged(1e-6, 0.105, 0.03),
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
            vec![judged(1.0, 0.1, 0.0), judged(1.0, 0.1, 0.0), judged(1e-3, 0.2, 0.0)],
        );
        assert_eq!(none.verdict(), "no point errs as little as the default");
        let (nothing, mut summary) = judged(1.0, 1.0, 0.0);
        summary.recall_pct = 0.0;
        let blind = (nothing, summary);
        let dark = judged(1e-9, 1.0, 0.0);
        let front = Front::new(CostKind::Energy, 1.0, vec![blind.clone(), blind, dark]);
        assert!(front.verdict().contains("registers none of 40 pairs"), "{}", front.verdict());
    }
}
