//! Costs of a scan with the default parameters and with others.

use echoloop_closed_loop::cost::{CostKind, ScanCost};
use echoloop_closed_loop::run_folder::run::RunResult;

use crate::format::escape;
use crate::page::{figure_cell, row, table};

/// Table of costs as text, with a column for each of [`CostKind::ALL`].
#[derive(Clone, Debug, Default)]
pub struct Costs {
    /// Name and cells of each row.
    pub rows: Vec<(String, [String; 4])>,
    /// A sentence about the difference.
    pub verdict: String,
}

/// Mean costs of the scans of the held-out pairs, with the difference in the cost `told`. Empty
/// unless both costs are known.
pub fn costs(result: &RunResult, told: CostKind) -> Costs {
    let [before, after] = [&result.default_summary, &result.tuned_summary].map(|s| s.cost.as_ref());
    let Some((before, after)) = before.zip(after) else { return Costs::default() };
    let comparison = result.comparison.at_cost(told, before, after);
    let [low, high] = result.comparison.interval;
    let difference = result.comparison.difference;
    Costs {
        rows: vec![("default".into(), cells(before)), ("tuned".into(), cells(after))],
        verdict: format!(
            "Tuned: {comparison}. Its ‖T − T*‖_F is {difference:+.4} from the default's in the \
             mean, {low:+.4} to {high:+.4} with 95 %."
        ),
    }
}

/// A scan's costs as text.
pub(crate) fn cells(cost: &ScanCost) -> [String; 4] {
    CostKind::ALL.map(|kind| kind.text(kind.of(cost)))
}

/// The table; empty without rows.
pub(crate) fn section(costs: &Costs) -> String {
    if costs.rows.is_empty() {
        return String::new();
    }
    let titles = CostKind::ALL.map(CostKind::title);
    let heads = ["Parameters"].into_iter().chain(titles);
    let rows = costs.rows.iter().map(|(name, cells)| {
        row(name, titles.iter().zip(cells).map(|(head, cell)| figure_cell(head, cell)))
    });
    format!(
        "<section id=\"cost\"><h2>What a scan costs</h2><p class=\"lead\">{}</p>{}</section>\n",
        escape(&costs.verdict),
        table("figures", "Costs", heads.map(escape), &rows.collect::<String>())
    )
}
