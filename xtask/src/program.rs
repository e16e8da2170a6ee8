//! Cells of a campaign, run by `echoloop` in a process of its own, and kept as lines of the plan's
//! record. How campaigns are run: `host/campaign`.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use echoloop_campaign::{Cell, Line, Plan, Unfinished, append, lines};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;

use crate::record::{Printed, printed, stamp};
use crate::shell::{build_release, built, commit, echoloop, workspace};

/// A run of `echoloop` for a cell.
pub(crate) struct Job {
    /// Command of `echoloop`.
    pub(crate) command: String,
    /// Arguments besides the plan's settings.
    pub(crate) arguments: Vec<String>,
}

impl Job {
    /// The plan's command.
    pub(crate) fn of(plan: &Plan, arguments: Vec<String>) -> Self {
        Self { command: plan.command.clone(), arguments }
    }
}

/// Lines of a plan's record.
///
/// # Errors
///
/// When one cannot be read.
pub(crate) fn recorded<T: DeserializeOwned>(plan: &Plan) -> Result<Vec<Line<T>>> {
    Ok(lines(&workspace()?.join(&plan.record))?)
}

/// Runs the cells that the record lacks, and adds their lines. `job` gives the run of a cell from
/// the lines so far, or `None` where it has none; `price` the seconds of processor time that a cell
/// will take, where the lines tell; `read` reads what the run printed.
///
/// # Errors
///
/// When the record cannot be read or written, and in the end when runs failed.
pub(crate) fn run<T: Serialize + DeserializeOwned>(
    plan: &Plan,
    cells: &[Cell],
    job: impl Fn(&Cell, &[Line<T>]) -> Result<Option<Job>>,
    price: impl Fn(&Cell, &[Line<T>]) -> Option<f64>,
    read: impl Fn(&Printed) -> Result<T>,
) -> Result<()> {
    build_release()?;
    let mut recorded: Vec<Line<T>> = recorded(plan)?;
    let mut failed = Vec::new();
    let is_done = |cell: &Cell| Some(recorded.iter().any(|line| line.cell == *cell));
    let left = Unfinished::of(cells, is_done);
    left.run(|index, place| -> Result<()> {
        let cell = left.cells[index];
        let run = || -> Result<Option<Line<T>>> {
            let Some(mut job) = job(cell, &recorded)? else { return Ok(None) };
            eprintln!("{place}: {cell}{}", priced(&left.cells[index..], |c| price(c, &recorded)));
            let set = plan.settings(cell).into_iter().map(|setting| format!("--set={setting}"));
            job.arguments = set.chain(job.arguments).collect();
            let result = finished(plan, cell, job, &read)?;
            Ok(Some(Line { cell: cell.clone(), made: stamp()?, result }))
        };
        match run() {
            Ok(None) => {}
            Ok(Some(line)) => {
                append(&workspace()?.join(&plan.record), &line)?;
                recorded.push(line);
            }
            Err(error) => failed.push(format!("{cell}: {error:#}")),
        }
        Ok(())
    })?;
    ensure!(failed.is_empty(), "failed runs:\n{}", failed.join("\n"));
    Ok(())
}

/// Writes parameters into a file that a flag of `echoloop` takes.
pub(crate) fn write_parameters(path: &Path, parameters: &BTreeMap<String, f64>) -> Result<()> {
    let folder = path.parent().unwrap_or(path);
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    fs::write(path, json!({ "parameters": parameters }).to_string())
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Words on the processor time that cells will take; none where that of no cell is known. A cell of
/// unknown time counts as the mean of the others.
pub(crate) fn priced(cells: &[&Cell], price: impl Fn(&Cell) -> Option<f64>) -> String {
    let known: Vec<f64> = cells.iter().filter_map(|cell| price(cell)).collect();
    if known.is_empty() {
        return String::new();
    }
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    let hours = mean * cells.len() as f64 / 3600.0;
    format!("; {} left, about {hours:.1} hours of a processor", cells.len())
}

/// Result of a run. An interrupted `tune` of the same commit is resumed; its folder is removed when
/// the result is read.
fn finished<T>(
    plan: &Plan,
    cell: &Cell,
    Job { command: name, arguments }: Job,
    read: impl Fn(&Printed) -> Result<T>,
) -> Result<T> {
    let mut command = echoloop()?;
    command.args([&*name, "--json"]);
    if name != "tune" {
        return read(&printed(command.args(arguments))?);
    }
    let record = plan.record.rsplit('/').next().unwrap_or(&plan.record).replace(".jsonl", "");
    let runs = built(&workspace()?).join(record).join(commit()?);
    let folder = runs.join(cell.to_string().replace(' ', "-"));
    let latest = folder.join("latest");
    match latest.join("history.jsonl").exists() {
        true => command.arg("--repair").arg("--resume").arg(&latest),
        false => command.arg("--runs").arg(&folder).args(arguments),
    };
    let result = read(&printed(&mut command)?)?;
    fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    Ok(result)
}
