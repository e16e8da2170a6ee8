//! The page of several runs side by side.

use super::format::{NONE, escape};
use super::page::{document, facts};
use super::sections::{Costs, EvaluationTable, cost, evaluation};

/// Runs side by side; the others are compared with the first.
#[derive(Clone, Debug, Default)]
pub struct RunsPage {
    /// Heading of the page.
    pub title: String,
    /// Name and description of each run.
    pub facts: Vec<(String, String)>,
    /// Runs that cannot be compared, with the reason, a sentence each.
    pub remarks: Vec<String>,
    /// A row a run.
    pub table: EvaluationTable,
    /// Costs of a scan.
    pub costs: Costs,
    /// Differences between the runs.
    pub differing: Vec<DifferingTable>,
}

/// Values that differ between the runs.
#[derive(Clone, Debug, Default)]
pub struct DifferingTable {
    /// Heading.
    pub title: String,
    /// Names of the runs.
    pub runs: Vec<String>,
    /// A name and its value in each run; `None` where a run has none.
    pub rows: Vec<(String, Vec<Option<String>>)>,
}

impl RunsPage {
    /// The page, complete.
    pub fn to_html(&self) -> String {
        let remarks: String =
            self.remarks.iter().map(|text| format!("<li>{}</li>", escape(text))).collect();
        let lead = "Tuned parameters on held-out pairs. Differences are from the first run, pair \
                    by pair where the pairs are the same.";
        let sections = [
            format!(
                "<header><p class=\"eyebrow\">Echoloop</p><h1>{}</h1>{}<ul \
                 class=\"notes\">{remarks}</ul></header>\n",
                escape(&self.title),
                facts(&self.facts)
            ),
            evaluation::table("Side by side", lead, &self.table),
            cost::section(&self.costs),
            self.differing.iter().map(differing).collect(),
        ];
        document(&self.title, &sections.concat(), "")
    }
}

fn differing(table: &DifferingTable) -> String {
    let title = escape(&table.title);
    if table.rows.is_empty() {
        return format!("<section><h2>{title}</h2><p class=\"lead\">None.</p></section>\n");
    }
    let heads: String =
        table.runs.iter().map(|run| format!("<th scope=\"col\">{}</th>", escape(run))).collect();
    let rows: String = table.rows.iter().map(|(name, values)| row(name, values)).collect();
    format!(
        "<section><h2>{title}</h2><div class=\"scroll\" tabindex=\"0\" role=\"region\" \
         aria-label=\"{title}\"><table class=\"plain\"><thead><tr><th scope=\"col\">name</th>\
         {heads}</tr></thead><tbody>{rows}</tbody></table></div></section>\n"
    )
}

fn row(name: &str, values: &[Option<String>]) -> String {
    let cell =
        |value: &Option<String>| format!("<td>{}</td>", escape(value.as_deref().unwrap_or(NONE)));
    let cells: String = values.iter().map(cell).collect();
    format!("<tr><th scope=\"row\">{}</th>{cells}</tr>", escape(name))
}
