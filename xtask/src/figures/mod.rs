//! `cargo xtask figures`: the figures that README and docs print, measured again.
//!
//! `benches/record/figures.toml` lists them: the run that makes them, where they stand in its
//! output, what was recorded, and the lines of the pages that print them. Two things may differ,
//! and each is a failure: the run from the record, and the page from the record.

mod book;
mod measure;
mod update;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::workspace;
use book::{Book, Figure};

const BOOK: &str = "benches/record/figures.toml";

/// What to measure.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Figures {
    /// Also what takes longer than two minutes.
    #[arg(long)]
    all: bool,
    /// Only this run of the list; may be repeated.
    #[arg(long, value_name = "RUN")]
    only: Vec<String>,
    /// Writes what was measured into the list and the pages instead.
    #[arg(long)]
    update: bool,
}

/// One value of a figure, measured again.
struct Compared<'a> {
    figure: &'a Figure,
    value: &'a str,
    recorded: &'a str,
    measured: String,
    same: bool,
}

/// Measures, compares with the record and the record with the pages.
///
/// # Errors
///
/// When a run fails, a measured figure is not the recorded one, or a page prints another.
pub(crate) fn run(asked: &Figures) -> Result<()> {
    let root = workspace()?;
    let book = read(&root)?;
    let measured = measure::all(&root, &asked.chosen(&book)?)?;
    let rows = compare(&book, &measured)?;
    rows.iter().for_each(print);
    if asked.update {
        return update::write(&root, BOOK, &book, &rows);
    }
    let wrong = rows.iter().filter(|row| !row.same).count();
    let missing = book.missing(&root)?;
    missing.iter().for_each(|line| println!("not printed: {line}"));
    ensure!(
        wrong == 0 && missing.is_empty(),
        "{wrong} figures are not as recorded, {} pages do not print the record; \
         if the code is right: cargo xtask figures --update",
        missing.len()
    );
    println!("{} figures are as recorded, and the pages print them", rows.len());
    Ok(())
}

fn read(root: &Path) -> Result<Book> {
    let text =
        fs::read_to_string(root.join(BOOK)).with_context(|| format!("cannot read {BOOK}"))?;
    Book::of_text(&text).with_context(|| BOOK.to_owned())
}

impl Figures {
    /// The runs that were asked for: named ones, or all that are not slow.
    fn chosen<'a>(&self, book: &'a Book) -> Result<Vec<&'a book::Run>> {
        for name in &self.only {
            let known: Vec<&str> = book.run.iter().map(|run| run.name.as_str()).collect();
            ensure!(known.contains(&name.as_str()), "--only {name}: there are {known:?}");
        }
        let chosen = |run: &&book::Run| match self.only.is_empty() {
            true => self.all || !run.slow,
            false => self.only.contains(&run.name),
        };
        Ok(book.run.iter().filter(chosen).collect())
    }
}

/// Every value of every figure whose run was measured.
fn compare<'a>(book: &'a Book, measured: &BTreeMap<String, Value>) -> Result<Vec<Compared<'a>>> {
    let mut rows = Vec::new();
    for figure in &book.figure {
        let Some(output) = measured.get(&figure.run) else { continue };
        for (value, place) in &figure.values {
            let recorded = figure.recorded.get(value).map_or("", String::as_str);
            let found = place.read(output).with_context(|| figure.name.clone())?;
            let same = place.agrees(recorded, &found);
            rows.push(Compared { figure, value, recorded, measured: found, same });
        }
    }
    Ok(rows)
}

fn print(row: &Compared<'_>) {
    let Compared { figure, value, recorded, measured, same } = row;
    let verdict = if *same { "" } else { "  <-- differs" };
    println!("{:<44} {value:<14} {recorded:>12} {measured:>12}{verdict}", figure.name);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pages_print_the_recorded_figures() {
        let root = workspace().unwrap();
        let missing = read(&root).unwrap().missing(&root).unwrap();
        assert!(missing.is_empty(), "{missing:#?}");
    }

    #[test]
    fn every_figure_is_of_a_run_of_the_list_and_has_what_it_prints() {
        let book = read(&workspace().unwrap()).unwrap();
        for figure in &book.figure {
            assert!(book.run.iter().any(|run| run.name == figure.run), "{}", figure.name);
            let recorded: Vec<_> = figure.recorded.keys().collect();
            assert_eq!(recorded, figure.values.keys().collect::<Vec<_>>(), "{}", figure.name);
            for printed in &figure.printed {
                let line = figure.line(&printed.text);
                assert!(!line.contains('{'), "{}: {line}", figure.name);
            }
        }
    }
}
