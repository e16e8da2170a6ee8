//! What a scan costs, with the default parameters and with others.

use super::Costs;
use crate::format::escape;

/// The table, or nothing without rows.
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

/// A cell of a table of figures, which on a narrow page says what its column is.
pub(super) fn figure_cell(head: &str, cell: &str) -> String {
    format!("<td data-head=\"{}\"><span class=\"value\">{}</span></td>", escape(head), escape(cell))
}
