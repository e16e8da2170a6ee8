//! The document around the sections of a page, with its style and script.

use super::format::escape;

const STYLE: &str = include_str!("report.css");
const SAVE: &str = include_str!("save.js");

/// Content security policy: the browser refuses to fetch anything.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";

/// Script that puts buttons under charts, which save them.
pub(super) fn save_script() -> &'static str {
    SAVE
}

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
