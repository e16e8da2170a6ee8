//! What a scan costs, with the default parameters and with others.

use super::data::Costs;
use super::format::escape;

/// The table, or nothing without rows.
pub(super) fn section(costs: &Costs) -> String {
    if costs.rows.is_empty() {
        return String::new();
    }
    let heads: String =
        costs.heads.iter().map(|head| format!("<th scope=\"col\">{}</th>", escape(head))).collect();
    let rows: String = costs.rows.iter().map(|(name, cells)| row(name, cells)).collect();
    format!(
        "<section id=\"cost\"><h2>What a scan costs</h2><p class=\"lead\">{}</p>\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Costs\">\
         <table class=\"figures\"><thead><tr><th scope=\"col\">Parameters</th>{heads}</tr></thead>\
         <tbody>{rows}</tbody></table></div></section>\n",
        escape(&costs.verdict)
    )
}

fn row(name: &str, cells: &[String]) -> String {
    let cells: String = cells
        .iter()
        .map(|cell| format!("<td><span class=\"value\">{}</span></td>", escape(cell)))
        .collect();
    format!("<tr><th scope=\"row\">{}</th>{cells}</tr>", escape(name))
}
