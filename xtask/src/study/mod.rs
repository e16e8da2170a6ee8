//! `cargo xtask study`: does tuning both halves together win?
//!
//! Every cell is a run of `echoloop tune`: a strategy, a protocol, a method, a kind of scene, a
//! condition and a seed. A cell that is done is a line of `benches/record/study.jsonl`, with the
//! error of every held-out pair, so a study goes on where it was left, on any machine. The table
//! of `docs/study.md` is written from those lines alone.

mod cell;
mod record;
mod table;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::record::{append, lines, written_into};
use crate::shell::{built, cargo, commit, workspace};
use cell::{Cell, Condition, Method, Protocol, Scene, Strategy};
use record::Line;

const RECORD: &str = "benches/record/study.jsonl";
const PAGE: &str = "docs/study.md";

/// Which cells.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Study {
    /// Only these strategies.
    #[arg(long, value_delimiter = ',')]
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
    /// Under these conditions [default: clear].
    #[arg(long, value_delimiter = ',')]
    condition: Vec<Condition>,
    /// Of these seeds; the towns of a seed are its own.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4,5")]
    seed: Vec<u64>,
    /// Runs nothing: writes the page from the record.
    #[arg(long)]
    page: bool,
}

/// Runs the cells that the record lacks, then writes the page.
///
/// # Errors
///
/// When a run fails, or the record cannot be read or written. What is done stays done.
pub(crate) fn run(asked: &Study) -> Result<()> {
    let root = workspace()?;
    let record = root.join(RECORD);
    if !asked.page {
        let done = checked(&record)?;
        let is_done = |cell: &Cell| done.iter().any(|line| line.cell == *cell);
        let left: Vec<Cell> = asked.cells().into_iter().filter(|cell| !is_done(cell)).collect();
        cargo(["build", "--release", "--package", "echoloop-host", "--bin", "echoloop"])?;
        for (number, cell) in left.iter().enumerate() {
            eprintln!("{} of {}: {cell}", number + 1, left.len());
            append(&record, &measured(cell)?)?;
        }
    }
    let page = root.join(PAGE);
    let text = fs::read_to_string(&page).with_context(|| format!("cannot read {PAGE}"))?;
    let new = written_into(&text, "cargo xtask study", &table::tables(&checked(&record)?))?;
    fs::write(&page, new).with_context(|| format!("cannot write {PAGE}"))
}

impl Study {
    /// All cells asked for: a seed is done before the next begins.
    fn cells(&self) -> Vec<Cell> {
        let all = |chosen: &[Condition]| match chosen {
            [] => vec![Condition::Clear],
            some => some.to_vec(),
        };
        let mut cells = Vec::new();
        for &seed in &self.seed {
            for condition in all(&self.condition) {
                for method in chosen(&self.method) {
                    for scene in chosen(&self.scene) {
                        for strategy in chosen(&self.strategy) {
                            cells.extend(chosen(&self.protocol).into_iter().map(|protocol| Cell {
                                strategy,
                                protocol,
                                method,
                                scene,
                                condition,
                                seed,
                            }));
                        }
                    }
                }
            }
        }
        cells
    }
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

/// Runs one cell, or goes on with it.
fn measured(cell: &Cell) -> Result<Line> {
    let folder = folder(cell)?;
    let latest = folder.join("latest");
    let mut command = Command::new(built(&workspace()?).join("release/echoloop"));
    match latest.join("history.jsonl").exists() {
        true => command.args(["tune", "--json", "--resume"]).arg(&latest),
        false => command.args(["tune", "--json", "--runs"]).arg(&folder).args(cell.arguments()),
    };
    eprintln!("+ {command:?}");
    let output = command.stderr(Stdio::inherit()).output().context("cannot run echoloop")?;
    ensure!(output.status.success(), "{cell}: echoloop failed");
    let result = serde_json::from_slice(&output.stdout).context("echoloop prints JSON")?;
    let code = commit()?;
    let line = Line::new(cell.clone(), code, &result)?;
    fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    Ok(line)
}

fn folder(cell: &Cell) -> Result<PathBuf> {
    Ok(built(&workspace()?).join("study").join(cell.to_string().replace(' ', "-")))
}
