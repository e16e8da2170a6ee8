//! Rewrites the list and the pages.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use super::list::{Figure, List, Printed, Run, fill};
use super::page::replace;
use super::{Compared, text};

/// Replaces recorded values by measured ones in the list and the pages, and the stamps of the runs
/// made.
///
/// # Errors
///
/// When a page does not print the recorded value, so that the place of the new one is unknown.
pub(super) fn write(
    root: &Path,
    file: &str,
    made: &[(&Run, String)],
    list: &List,
    rows: &[Compared<'_>],
) -> Result<()> {
    // Read once, and written at the end.
    let mut changed: BTreeMap<&str, String> = BTreeMap::new();
    let mut change = |path, edit: &dyn Fn(&str) -> Result<String>| {
        let text = changed.remove(path).map_or_else(|| text(root, path), Ok)?;
        changed.insert(path, edit(&text)?);
        anyhow::Ok(())
    };
    for (run, stamp) in made {
        change(file, &|text| stamped(text, run, stamp))?;
    }
    for figure in &list.figure {
        let new = values(figure, rows);
        if new != figure.recorded {
            change(file, &|text| recorded(text, figure, &new))?;
            for Printed { page, text } in &figure.printed {
                let (old, new) = (figure.line(text), fill(text, &new));
                let lost = || format!("{page}: {}: it does not print {old:?}", figure.name);
                change(page, &|text| replace(text, &old, &new).with_context(lost))?;
            }
        }
    }
    for (path, text) in changed {
        fs::write(root.join(path), text).with_context(|| format!("cannot write {path}"))?;
        println!("wrote {path}");
    }
    Ok(())
}

/// A figure's values after this measurement.
fn values(figure: &Figure, rows: &[Compared<'_>]) -> BTreeMap<String, String> {
    let mut values = figure.recorded.clone();
    let of_it = rows.iter().filter(|row| std::ptr::eq(row.figure, figure));
    values.extend(of_it.map(|row| (row.value.to_owned(), row.measured.clone())));
    values
}

/// The list with new values in the figure's line `recorded = { … }`.
fn recorded(text: &str, figure: &Figure, new: &BTreeMap<String, String>) -> Result<String> {
    let values: Vec<String> =
        new.iter().map(|(name, value)| format!("{name} = {value:?}")).collect();
    let header = format!("[[figure]]\nname = {:?}\n", figure.name);
    set(text, &header, "recorded", &format!("{{ {} }}", values.join(", ")))
}

/// The list with a new stamp in the run's line `measured = "…"`.
fn stamped(text: &str, run: &Run, stamp: &str) -> Result<String> {
    set(text, &format!("[[run]]\nname = {:?}\n", run.name), "measured", &format!("{stamp:?}"))
}

/// The list with a new value in the first line `key = …` after a header.
fn set(text: &str, header: &str, key: &str, value: &str) -> Result<String> {
    let begin = text.find(header).with_context(|| format!("no {header:?}"))? + header.len() - 1;
    let line = format!("\n{key} = ");
    let line = begin + text[begin..].find(&line).context("no line of its own")? + line.len();
    let end = line + text[line..].find('\n').context("no whole line")?;
    Ok(format!("{}{value}{}", &text[..line], &text[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIST: &str = "\
        [[run]]\nname = \"q\"\nkind = \"cost\"\nmeasured = \"once\"\n\n\
        [[run]]\nname = \"a\"\nkind = \"cost\"\nmeasured = \"once\"\n\n\
        [[figure]]\nname = \"a\"\nrun = \"q\"\nvalues.x = { at = \"/x\" }\n\
        recorded = { x = \"1\" }\n\
        printed = [{ page = \"page.md\", text = \"{x} by\" }]\n\n\
        [[figure]]\nname = \"b\"\nrun = \"a\"\nvalues.x = { at = \"/x\" }\n\
        recorded = { x = \"2\" }\nprinted = []\n";

    #[test]
    fn a_figure_s_record_is_rewritten_and_nothing_else() {
        let list = List::from_text(LIST).unwrap();
        let new = BTreeMap::from([("x".to_owned(), "3".to_owned())]);
        let text = recorded(LIST, &list.figure[1], &new).unwrap();
        assert_eq!(text, LIST.replace("x = \"2\"", "x = \"3\""));
    }

    #[test]
    fn a_run_s_stamp_is_rewritten_and_nothing_else() {
        let list = List::from_text(LIST).unwrap();
        let text = stamped(LIST, &list.run[1], "now").unwrap();
        assert_eq!(text.matches("once").count(), 1);
        let again = List::from_text(&text).unwrap();
        assert_eq!([&*again.run[0].measured, &*again.run[1].measured], ["once", "now"]);
    }
}
