//! Rewrites the list and the pages.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use super::Compared;
use super::book::{Book, Figure, Printed, fill};

/// Writes what was measured where the recorded values stand.
///
/// # Errors
///
/// When a page does not print what was recorded: then nobody knows where the new figure belongs.
pub(super) fn write(root: &Path, list: &str, book: &Book, rows: &[Compared<'_>]) -> Result<()> {
    let mut texts = Texts { root, changed: BTreeMap::new() };
    for figure in &book.figure {
        let new = values(figure, rows);
        if new != figure.recorded {
            texts.change(list, |text| record(text, figure, &new))?;
            for Printed { page, text } in &figure.printed {
                let (old, new) = (figure.line(text), fill(text, &new));
                texts
                    .change(page, |text| replace(text, &old, &new).with_context(|| page.clone()))?;
            }
        }
    }
    texts.write()
}

/// A figure's values after this measurement.
fn values(figure: &Figure, rows: &[Compared<'_>]) -> BTreeMap<String, String> {
    let mut values = figure.recorded.clone();
    let of_it = rows.iter().filter(|row| std::ptr::eq(row.figure, figure));
    values.extend(of_it.map(|row| (row.value.to_owned(), row.measured.clone())));
    values
}

/// Files that are read once and written at the end, all or none.
struct Texts<'a> {
    root: &'a Path,
    changed: BTreeMap<String, String>,
}

impl Texts<'_> {
    fn change(&mut self, path: &str, edit: impl FnOnce(&str) -> Result<String>) -> Result<()> {
        let text = match self.changed.get(path) {
            Some(text) => text.clone(),
            None => fs::read_to_string(self.root.join(path))
                .with_context(|| format!("cannot read {path}"))?,
        };
        self.changed.insert(path.to_owned(), edit(&text)?);
        Ok(())
    }

    fn write(self) -> Result<()> {
        for (path, text) in self.changed {
            fs::write(self.root.join(&path), text)
                .with_context(|| format!("cannot write {path}"))?;
            println!("wrote {path}");
        }
        Ok(())
    }
}

fn replace(text: &str, old: &str, new: &str) -> Result<String> {
    ensure!(text.contains(old), "it does not print {old:?}");
    Ok(text.replace(old, new))
}

/// The list with new values in the figure's line `recorded = { … }`.
fn record(text: &str, figure: &Figure, new: &BTreeMap<String, String>) -> Result<String> {
    let begin = text.find(&format!("name = {:?}\nrun", figure.name)).context("its name and run")?;
    let line = begin + text[begin..].find("recorded = {").context("its recorded values")?;
    let end = line + text[line..].find('\n').context("a whole line")?;
    let values: Vec<String> =
        new.iter().map(|(name, value)| format!("{name} = {value:?}")).collect();
    Ok(format!("{}recorded = {{ {} }}{}", &text[..line], values.join(", "), &text[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIST: &str = "measured = \"now\"\n\n[[run]]\nname = \"r\"\nkind = \"cost\"\n\n[[figure]]\n\
        name = \"a\"\nrun = \"r\"\nvalues.x = { at = \"/x\" }\nrecorded = { x = \"1\" }\nprinted = []\n\n\
        [[figure]]\nname = \"b\"\nrun = \"r\"\nvalues.x = { at = \"/x\" }\nrecorded = { x = \"2\" }\n\
        printed = []\n";

    #[test]
    fn a_figure_s_record_is_rewritten_and_nothing_else() {
        let book = Book::of_text(LIST).unwrap();
        let new = BTreeMap::from([("x".to_owned(), "3".to_owned())]);
        let text = record(LIST, &book.figure[1], &new).unwrap();
        assert_eq!(text, LIST.replace("x = \"2\"", "x = \"3\""));
    }

    #[test]
    fn a_page_that_prints_something_else_is_not_touched() {
        assert_eq!(replace("recall 95 %", "95", "97").unwrap(), "recall 97 %");
        assert!(replace("recall 95 %", "90", "97").is_err());
    }
}
