//! The parts in order, with the style and the script they need.

use super::sections::Report;
use super::format::escape;
use super::sections::{
    clouds, convergence, correlation, cost, evaluation, front, identity, importance, pairs,
    trajectories,
};

const STYLE: &str = include_str!("report.css");
const CAMERA: &str = include_str!("camera.js");
const VIEWER: &str = include_str!("viewer.js");
const SAVE: &str = include_str!("save.js");

/// Nothing may be fetched: the browser enforces what the report promises.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";

pub(super) fn page(report: &Report) -> String {
    let sections = [
        header(report),
        evaluation::section(&report.table),
        cost::section(&report.costs),
        front::section(&report.front),
        convergence::section(&report.convergence),
        trajectories::section(report),
        importance::section(&report.importance),
        correlation::section(report.correlation.as_ref(), report.convergence.generation.len()),
        pairs::section(report),
        clouds::section(report.clouds.as_ref()),
        identity::section(&report.identity),
        notes(&report.notes),
    ]
    .concat();
    document(&report.title, &sections, &[CAMERA, SAVE, VIEWER].concat())
}

/// Puts buttons under charts that save them.
pub(super) fn save_script() -> &'static str {
    SAVE
}

/// A whole page around sections.
pub(super) fn document(title: &str, sections: &str, script: &str) -> String {
    document_with("", "", title, sections, script)
}

/// As [`document`], with more style, and a class for its middle.
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

/// Names and values.
pub(super) fn facts(facts: &[(String, String)]) -> String {
    let fact = |(name, value): &(String, String)| {
        format!("<div><dt>{}</dt><dd>{}</dd></div>", escape(name), escape(value))
    };
    let facts: String = facts.iter().map(fact).collect();
    if facts.is_empty() { facts } else { format!("<dl class=\"facts\">{facts}</dl>\n") }
}

fn header(report: &Report) -> String {
    let facts = facts(&report.facts);
    format!(
        "<header><p class=\"eyebrow\">Echoloop</p><h1>{}</h1><p class=\"subtitle\">{}</p>\
         {}{}{facts}</header>\n",
        escape(&report.title),
        escape(&report.subtitle),
        evaluation::headline(report),
        evaluation::tiles(&report.table)
    )
}

fn notes(notes: &[String]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    let items: String = notes.iter().map(|note| format!("<li>{}</li>", escape(note))).collect();
    format!("<section id=\"notes\"><h2>Notes</h2><ul class=\"notes\">{items}</ul></section>\n")
}
