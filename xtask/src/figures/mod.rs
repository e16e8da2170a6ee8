//! `cargo xtask figures`: the figures that README and docs print, measured again.
//!
//! `benches/record/figures.toml` lists their runs, their places in the output, the recorded values
//! and the lines of the pages that print them. A run that differs from the record is a failure, and
//! so is a page. A run that this machine cannot make is reported and skipped; that fails where it
//! was named by `--only`, where `CI` is set, and where nothing is left to compare.

mod list;
mod measure;
mod page;
mod update;

use std::collections::BTreeMap;
use std::path::Path;
use std::{env, fs};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::shell::{output, workspace};
use list::{Figure, List, Run};

const LIST: &str = "benches/record/figures.toml";

/// Runs to make.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Figures {
    /// Also the runs that take more than two minutes.
    #[arg(long)]
    all: bool,
    /// Only this run of the list; may be repeated.
    #[arg(long, value_name = "RUN")]
    only: Vec<String>,
    /// Write the measured values into the list and the pages instead.
    #[arg(long)]
    update: bool,
}

/// A value of a figure, measured again.
struct Compared<'a> {
    figure: &'a Figure,
    value: &'a str,
    recorded: &'a str,
    measured: String,
}

/// Makes the runs, and compares them with the record and the record with the pages.
///
/// # Errors
///
/// When a run fails or a skipped one had to be made, or when a measured value or a page differs
/// from the record; with `--update`, when one still does after writing.
pub(crate) fn run(args: &Figures) -> Result<()> {
    let root = workspace()?;
    let list = read(&root)?;
    let chosen = args.chosen(&list)?;
    if args.update {
        refuse_changed_code(&list)?;
    }
    let measured = measure::all(&root, &chosen)?;
    let rows = compare(&list, &measured)?;
    rows.iter().for_each(print);
    let (made, skipped): (Vec<&Run>, Vec<&Run>) =
        chosen.iter().partition(|run| measured.contains_key(&run.name));
    let strict = !args.only.is_empty() || env::var_os("CI").is_some();
    refuse_gaps(rows.len(), &skipped, strict)?;
    if args.update {
        let stamp = |run| Ok((run, measure::stamp(run)?));
        let made = made.into_iter().map(stamp).collect::<Result<Vec<_>>>()?;
        update::write(&root, LIST, &made, &list, &rows)?;
    }
    check(&root, &read(&root)?, &measured)
}

/// Fails when the code has uncommitted changes, as a stamp names the commit. The list and the
/// pages, which an update writes, may have changed.
fn refuse_changed_code(list: &List) -> Result<()> {
    let status = output("git", &["status", "--porcelain", "--untracked-files=no"])?;
    let changed = changed_code(&status, list);
    ensure!(changed.is_empty(), "--update stamps a commit, so commit first: {changed:?}");
    Ok(())
}

/// Files that `git status --porcelain` names, but for those that an update writes.
fn changed_code<'a>(status: &'a str, list: &List) -> Vec<&'a str> {
    let pages = list.figure.iter().flat_map(|figure| &figure.printed);
    let written: Vec<&str> = pages.map(|printed| &*printed.page).chain([LIST]).collect();
    let named = status.lines().filter_map(|line| line.get(3..));
    named.filter(|path| !written.contains(path)).collect()
}

/// Fails when a run was skipped that had to be made, or nothing was compared at all.
fn refuse_gaps(compared: usize, skipped: &[&Run], strict: bool) -> Result<()> {
    let names: Vec<&str> = skipped.iter().map(|run| run.name.as_str()).collect();
    ensure!(compared > 0, "nothing was compared; skipped: {names:?}");
    ensure!(names.is_empty() || !strict, "skipped: {names:?}");
    Ok(())
}

/// Compares the record, as the file has it now, with the runs, and the pages with the record.
fn check(root: &Path, list: &List, measured: &BTreeMap<String, Value>) -> Result<()> {
    let rows = compare(list, measured)?;
    let wrong = rows.iter().filter(|row| row.recorded != row.measured).count();
    let missing = list.missing(|page| text(root, page))?;
    ensure!(
        wrong == 0 && missing.is_empty(),
        "{wrong} values are not as recorded, {} pages do not print the record\n  {}\n\
         if the code is right: cargo xtask figures --update; \
         if a page is not: write there what it does not print",
        missing.len(),
        missing.join("\n  ")
    );
    for run in list.run.iter().filter(|run| !measured.contains_key(&run.name)) {
        println!("not measured now: {}: {}", run.name, run.measured);
    }
    println!(
        "{} values of {} runs are as recorded, and the pages print what is recorded",
        rows.len(),
        measured.len()
    );
    Ok(())
}

fn read(root: &Path) -> Result<List> {
    List::from_text(&text(root, LIST)?).with_context(|| LIST.to_owned())
}

fn text(root: &Path, path: &str) -> Result<String> {
    fs::read_to_string(root.join(path)).with_context(|| format!("cannot read {path}"))
}

impl Figures {
    /// Runs named by `--only`; without it all, or all but the slow ones.
    fn chosen<'a>(&self, list: &'a List) -> Result<Vec<&'a Run>> {
        for name in &self.only {
            let known: Vec<&str> = list.run.iter().map(|run| run.name.as_str()).collect();
            ensure!(known.contains(&name.as_str()), "--only {name}: there are {known:?}");
        }
        let chosen = |run: &&Run| match self.only.is_empty() {
            true => self.all || !run.slow,
            false => self.only.contains(&run.name),
        };
        Ok(list.run.iter().filter(chosen).collect())
    }
}

/// Every value of every figure whose run was made.
fn compare<'a>(list: &'a List, measured: &BTreeMap<String, Value>) -> Result<Vec<Compared<'a>>> {
    let mut rows = Vec::new();
    for figure in &list.figure {
        let Some(output) = measured.get(&figure.run) else { continue };
        for (value, place) in &figure.values {
            let recorded = figure.recorded.get(value).map_or("", String::as_str);
            let found = place.read(output).with_context(|| figure.name.clone())?;
            rows.push(Compared { figure, value, recorded, measured: found });
        }
    }
    Ok(rows)
}

fn print(row: &Compared<'_>) {
    let Compared { figure, value, recorded, measured } = row;
    let verdict = if recorded == measured { "" } else { "  <-- differs" };
    println!("{:<44} {value:<14} {recorded:>12} {measured:>12}{verdict}", figure.name);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pages_print_the_recorded_figures() {
        let root = workspace().unwrap();
        let missing = read(&root).unwrap().missing(|page| text(&root, page)).unwrap();
        assert!(missing.is_empty(), "{missing:#?}");
    }

    #[test]
    fn every_figure_has_a_run_and_its_values_and_every_run_has_a_figure() {
        let list = read(&workspace().unwrap()).unwrap();
        for run in &list.run {
            assert!(list.figure.iter().any(|figure| figure.run == run.name), "{}", run.name);
        }
        for figure in &list.figure {
            assert!(list.run.iter().any(|run| run.name == figure.run), "{}", figure.name);
            let recorded: Vec<_> = figure.recorded.keys().collect();
            assert_eq!(recorded, figure.values.keys().collect::<Vec<_>>(), "{}", figure.name);
            for printed in &figure.printed {
                let line = figure.line(&printed.text);
                assert!(!line.contains('{'), "{}: {line}", figure.name);
                assert!(printed.text.contains('{'), "{}: {line} has no figure", figure.name);
            }
        }
    }

    #[test]
    fn a_skipped_run_fails_in_strict_mode_or_where_nothing_was_compared() {
        let list = read(&workspace().unwrap()).unwrap();
        let skipped = [&list.run[0]];
        assert!(refuse_gaps(1, &[], true).is_ok());
        assert!(refuse_gaps(1, &skipped, false).is_ok());
        assert!(refuse_gaps(1, &skipped, true).is_err());
        assert!(refuse_gaps(0, &skipped, false).is_err());
        assert!(refuse_gaps(0, &[], false).is_err());
    }

    #[test]
    fn an_update_is_refused_where_more_than_pages_and_list_has_changed() {
        let list = read(&workspace().unwrap()).unwrap();
        let pages = " M README.md\n M benches/record/figures.toml\nM  docs/microcontroller.md\n";
        assert_eq!(changed_code(pages, &list), [""; 0]);
        let code = format!("{pages} M xtask/src/main.rs\nR  a.md -> b.md\n");
        assert_eq!(changed_code(&code, &list), ["xtask/src/main.rs", "a.md -> b.md"]);
    }
}
