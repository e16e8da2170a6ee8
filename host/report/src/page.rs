//! Parts of every page: the document with its style and script, heads, lists, tables.

use super::format::escape;

const STYLE: &str = include_str!("report.css");

/// Script that puts buttons under charts, which save them.
pub(super) const SAVE: &str = include_str!("save.js");

/// Content security policy: the browser refuses to fetch anything.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";

/// A document without style of its own.
pub(super) fn document(title: &str, sections: &str, script: &str) -> String {
    document_with("", "", title, sections, script)
}

/// A document with more style and a class of its `main` element.
pub(super) fn document_with(
    style: &str,
    class: &str,
    title: &str,
    sections: &str,
    script: &str,
) -> String {
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<link rel=\"icon\" href=\"data:,\">\n\
         <title>{}</title>\n<style>\n{STYLE}{style}</style>\n</head>\n<body>\n\
         <main{class}>\n{sections}</main>\n<script>\n{script}</script>\n</body>\n</html>\n",
        escape(title)
    )
}

/// A list of names and values; empty without any.
pub(super) fn facts(facts: &[(String, String)]) -> String {
    let fact = |(name, value): &(String, String)| {
        format!("<div><dt>{}</dt><dd>{}</dd></div>", escape(name), escape(value))
    };
    let facts: String = facts.iter().map(fact).collect();
    if facts.is_empty() { facts } else { format!("<dl class=\"facts\">{facts}</dl>\n") }
}

/// Head of a page, with HTML below its title.
pub(super) fn header(title: &str, below: &str) -> String {
    let title = escape(title);
    format!("<header><p class=\"eyebrow\">Echoloop</p><h1>{title}</h1>{below}</header>\n")
}

pub(super) fn subtitle(text: &str) -> String {
    format!("<p class=\"subtitle\">{}</p>", escape(text))
}

/// A list of remarks, each as HTML.
pub(super) fn notes(remarks: impl Iterator<Item = String>) -> String {
    let items: String = remarks.map(|remark| format!("<li>{remark}</li>")).collect();
    format!("<ul class=\"notes\">{items}</ul>")
}

/// The section of remarks.
pub(super) fn notes_section(remarks: &[String]) -> String {
    let notes = notes(remarks.iter().map(|remark| escape(remark)));
    format!("<section id=\"notes\"><h2>Notes</h2>{notes}</section>\n")
}

/// A table that scrolls where it is too wide. Heads and rows are HTML.
pub(super) fn table(
    class: &str,
    label: &str,
    heads: impl IntoIterator<Item = String>,
    rows: &str,
) -> String {
    let heads: String =
        heads.into_iter().map(|head| format!("<th scope=\"col\">{head}</th>")).collect();
    format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{label}\"><table \
         class=\"{class}\"><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>"
    )
}

/// A row of a table: its name, then cells as HTML.
pub(super) fn row(name: &str, cells: impl IntoIterator<Item = String>) -> String {
    let cells: String = cells.into_iter().collect();
    format!("<tr><th scope=\"row\">{}</th>{cells}</tr>", escape(name))
}

/// A cell that repeats its column's name: on a narrow page a row becomes a card.
pub(super) fn figure_cell(head: &str, cell: &str) -> String {
    format!("<td data-head=\"{}\"><span class=\"value\">{}</span></td>", escape(head), escape(cell))
}
