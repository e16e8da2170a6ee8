//! `cargo xtask study`: does tuning both halves together win?
//!
//! Every cell is a run of `echoloop tune`: a strategy, a protocol, a method, a kind of scene, a
//! condition and a seed. A cell that is done is a line of `benches/record/study.jsonl`, with the
//! error of every held-out pair, so a study goes on where it was left, on any machine. The table
//! of `docs/study.md` is written from those lines alone. `--front` does the same for fronts of
//! error against energy.

mod cell;
mod front;
mod record;
mod table;
mod warm;

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::record::{append, echoloop, lines, printed, stamp, write_page};
use crate::shell::{built, cargo, commit, workspace};
use cell::{Cell, Condition, Method, Protocol, Scene, Strategy};
use front::FrontLine;
use record::Line;

const RECORD: &str = "benches/record/study.jsonl";
const FRONTS: &str = "benches/record/fronts.jsonl";
const PAGE: &str = "docs/study.md";

/// Which cells.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Study {
    /// Only these strategies.
    #[arg(long, value_delimiter = ',', default_value = "fast,paper")]
    strategy: Vec<Strategy>,
    /// Only these protocols.
    #[arg(long, value_delimiter = ',')]
    protocol: Vec<Protocol>,
    /// Only these methods.
    #[arg(long, value_delimiter = ',')]
    method: Vec<Method>,
    /// Only these kinds of scene.
    #[arg(long, value_delimiter = ',')]
    scene: Vec<Scene>,
    /// Under these conditions.
    #[arg(long, value_delimiter = ',', default_value = "clear")]
    condition: Vec<Condition>,
    /// Of these seeds; the towns of a seed are its own.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4,5")]
    seed: Vec<u64>,
    /// Fronts of error against energy instead, of these kinds and seeds.
    #[arg(long, conflicts_with_all = ["strategy", "protocol", "method", "condition"])]
    front: bool,
    /// Runs nothing: writes the page from the record.
    #[arg(long)]
    page: bool,
}

/// Runs the cells that the record lacks, then writes the page.
///
/// # Errors
///
/// When runs fail, which the others do not wait for, or the record cannot be read or written. What
/// is done stays done.
pub(crate) fn run(asked: &Study) -> Result<()> {
    let root = workspace()?;
    let (record, fronts) = (root.join(RECORD), root.join(FRONTS));
    let mut ended = Ok(());
    if !asked.page {
        cargo(["build", "--release", "--package", "echoloop-app", "--bin", "echoloop"])?;
        match asked.front {
            true => asked.run_fronts(&fronts)?,
            false => ended = asked.run_cells(&record),
        }
    }
    write_page(PAGE, "cargo xtask study", &table::tables(&checked(&record)?))?;
    write_page(PAGE, "cargo xtask study --front", &front::tables(&lines(&fronts)?))?;
    ended
}

impl Study {
    fn run_cells(&self, record: &Path) -> Result<()> {
        let done = checked(record)?;
        let is_done = |cell: &Cell| done.iter().any(|line| line.cell == *cell);
        let left: Vec<Cell> = self.cells().into_iter().filter(|cell| !is_done(cell)).collect();
        let mut failed = Vec::new();
        for (number, cell) in left.iter().enumerate() {
            eprintln!("{} of {}: {cell}", number + 1, left.len());
            let line = |result: &Value| Line::new(cell.clone(), stamp()?, result);
            let made = arguments(cell, record)
                .and_then(|arguments| measured(&cell.to_string(), arguments, line));
            match made {
                Ok(line) => append(record, &line)?,
                Err(error) => failed.push(format!("{cell}: {error:#}")),
            }
        }
        ensure!(failed.is_empty(), "no line of:\n{}", failed.join("\n"));
        Ok(())
    }

    fn run_fronts(&self, record: &Path) -> Result<()> {
        let done: Vec<FrontLine> = lines(record)?;
        for &seed in &self.seed {
            for scene in chosen(&self.scene) {
                let cell = front::cell(scene, seed);
                if done.iter().any(|line| line.cell == cell) {
                    continue;
                }
                let mut arguments = cell.arguments();
                arguments.extend(["--pareto".into(), "energy".into()]);
                let line = |result: &Value| FrontLine::new(cell.clone(), stamp()?, result);
                append(record, &measured(&format!("front {cell}"), arguments, line)?)?;
            }
        }
        Ok(())
    }

    /// All cells asked for: a seed is done before the next begins.
    fn cells(&self) -> Vec<Cell> {
        let mut cells = Vec::new();
        for &seed in &self.seed {
            for &condition in &self.condition {
                for method in chosen(&self.method) {
                    for scene in chosen(&self.scene) {
                        for &strategy in &self.strategy {
                            let cell = |protocol| Cell {
                                strategy,
                                protocol,
                                method,
                                scene,
                                condition,
                                seed,
                            };
                            // A warm start in its own towns would say nothing of others.
                            if strategy != Strategy::Warm || seed != warm::SEED {
                                cells.extend(chosen(&self.protocol).into_iter().map(cell));
                            }
                        }
                    }
                }
            }
        }
        cells
    }
}

/// What `echoloop tune` is told of a cell.
fn arguments(cell: &Cell, record: &Path) -> Result<Vec<String>> {
    let mut arguments = cell.arguments();
    if cell.strategy == Strategy::Warm {
        let folder = built(&workspace()?).join("study/warm");
        arguments.extend(warm::flags(cell, &lines(record)?, &folder)?);
    }
    Ok(arguments)
}

/// The values asked for, or all.
fn chosen<T: clap::ValueEnum + Clone>(some: &[T]) -> Vec<T> {
    if some.is_empty() { T::value_variants().to_vec() } else { some.to_vec() }
}

/// The record's lines, each with the same pairs before and after.
fn checked(record: &Path) -> Result<Vec<Line>> {
    let lines: Vec<Line> = lines(record)?;
    for (i, line) in lines.iter().enumerate() {
        let pairs = [line.start.errors.len(), line.tuned.errors.len()];
        ensure!(pairs[0] == pairs[1] && pairs[0] > 0, "{RECORD}: line {}: pairs {pairs:?}", i + 1);
    }
    Ok(lines)
}

/// Makes one run, or goes on with it, if this code began it; its folder goes when its line is made.
fn measured<T>(
    name: &str,
    arguments: Vec<String>,
    line: impl FnOnce(&Value) -> Result<T>,
) -> Result<T> {
    let runs = built(&workspace()?).join("study").join(commit()?);
    let folder = runs.join(name.replace(' ', "-"));
    let latest = folder.join("latest");
    let mut command = echoloop()?;
    match latest.join("history.jsonl").exists() {
        true => command.args(["tune", "--json", "--resume"]).arg(&latest),
        false => command.args(["tune", "--json", "--runs"]).arg(&folder).args(arguments),
    };
    let line = line(&printed(&mut command)?)?;
    fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    Ok(line)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Asked {
        #[command(flatten)]
        study: Study,
    }

    fn cells(flags: &[&str]) -> Vec<Cell> {
        Asked::parse_from([&["study"], flags].concat()).study.cells()
    }

    #[test]
    fn all_of_it_is_every_search_of_clear_air_by_both_strategies_a_seed_after_the_other() {
        let all = cells(&[]);
        // Strategies, protocols, methods, kinds, seeds.
        assert_eq!(all.len(), 2 * 3 * 4 * 3 * 5);
        assert!(all.is_sorted_by_key(|cell| cell.seed));
        assert!(all.iter().all(|cell| cell.condition == Condition::Clear));
        let once: std::collections::BTreeSet<&Cell> = all.iter().collect();
        assert_eq!(once.len(), all.len(), "one comes twice");
    }

    #[test]
    fn a_part_is_what_was_asked_for_and_no_warm_start_is_of_its_own_towns() {
        let asked = ["--strategy=warm", "--protocol=joint", "--method=icp", "--scene=structured"];
        let seeds: Vec<u64> = cells(&asked).iter().map(|cell| cell.seed).collect();
        assert_eq!(seeds, [2, 3, 4, 5]);
        let fog = cells(&["--condition=fog", "--seed=2", "--method=mac", "--strategy=fast"]);
        assert_eq!(fog.len(), 3 * 3);
        assert!(fog.iter().all(|c| c.condition == Condition::Fog && c.method == Method::Mac));
    }
}
