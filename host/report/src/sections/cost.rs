//! Costs of a scan with the default parameters and with others.

use echoloop_closed_loop::cost::{CostKind, ScanCost};
use echoloop_closed_loop::run_folder::run::RunResult;

use crate::format::escape;

/// Table of costs as text, a column a cost.
#[derive(Clone, Debug, Default)]
pub struct Costs {
    /// Names of the costs.
    pub heads: Vec<String>,
    /// Name and cells of each row.
    pub rows: Vec<(String, Vec<String>)>,
    /// A sentence about the difference.
    pub verdict: String,
}

/// Mean costs of the scans of the held-out pairs, with the difference in the cost `told`. Empty
/// unless both costs are known.
pub fn costs(result: &RunResult, told: CostKind) -> Costs {
    let summaries = [("default", &result.default_summary), ("tuned", &result.tuned_summary)];
    let known: Vec<(&str, &ScanCost)> = summaries
        .into_iter()
        .filter_map(|(name, summary)| Some((name, summary.cost.as_ref()?)))
        .collect();
    let [(_, before), (_, after)] = known[..] else { return Costs::default() };
    let comparison = result.comparison.at_cost(told, before, after);
    let [low, high] = result.comparison.interval;
    let difference = result.comparison.difference;
    Costs {
        heads: heads(),
        rows: known.iter().map(|(name, cost)| ((*name).to_owned(), cells(cost))).collect(),
        verdict: format!(
            "Tuned: {comparison}. Its ‖T − T*‖_F is {difference:+.4} from the default's in the \
             mean, {low:+.4} to {high:+.4} with 95 %."
        ),
    }
}

/// Names of all costs.
pub(crate) fn heads() -> Vec<String> {
    CostKind::ALL.map(|kind| kind.title().to_owned()).to_vec()
}

/// A scan's costs as text, in the order of [`heads`].
pub(crate) fn cells(cost: &ScanCost) -> Vec<String> {
    CostKind::ALL.map(|kind| kind.text(kind.of(cost))).to_vec()
}

/// The table; empty without rows.
pub(crate) fn section(costs: &Costs) -> String {
    if costs.rows.is_empty() {
        return String::new();
    }
    let heads: String =
        costs.heads.iter().map(|head| format!("<th scope=\"col\">{}</th>", escape(head))).collect();
    let rows: String =
        costs.rows.iter().map(|(name, cells)| row(name, &costs.heads, cells)).collect();
    format!(
        "<section id=\"cost\"><h2>What a scan costs</h2><p class=\"lead\">{}</p>\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Costs\">\
         <table class=\"figures\"><thead><tr><th scope=\"col\">Parameters</th>{heads}</tr></thead>\
         <tbody>{rows}</tbody></table></div></section>\n",
        escape(&costs.verdict)
    )
}

fn row(name: &str, heads: &[String], cells: &[String]) -> String {
    let cells: String =
        heads.iter().zip(cells).map(|(head, cell)| figure_cell(head, cell)).collect();
    format!("<tr><th scope=\"row\">{}</th>{cells}</tr>", escape(name))
}

/// A cell that repeats its column's name: on a narrow page a row becomes a card.
pub(super) fn figure_cell(head: &str, cell: &str) -> String {
    format!("<td data-head=\"{}\"><span class=\"value\">{}</span></td>", escape(head), escape(cell))
}
