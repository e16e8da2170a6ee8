//! Cells of a campaign, run by `echoloop` in a process of its own, and kept as lines of the plan's
//! record. How campaigns are run: `host/campaign`.

use std::fs;

use anyhow::{Context, Result, ensure};
use echoloop_campaign::{Cell, Line, Plan, Unfinished, append, lines};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::record::{printed, stamp};
use crate::shell::{build_release, built, commit, echoloop, workspace};

/// Lines of a plan's record.
///
/// # Errors
///
/// When one cannot be read.
pub(crate) fn recorded<T: DeserializeOwned>(plan: &Plan) -> Result<Vec<Line<T>>> {
    Ok(lines(&workspace()?.join(&plan.record))?)
}

/// Runs the cells that the record lacks, and adds their lines. `more` gives further arguments of a
/// cell from the lines so far, or `None` where it has no run; `read` reads the JSON that the run
/// printed.
///
/// # Errors
///
/// When the record cannot be read or written, and in the end when runs failed.
pub(crate) fn run<T: Serialize + DeserializeOwned>(
    plan: &Plan,
    cells: &[Cell],
    more: impl Fn(&Cell, &[Line<T>]) -> Result<Option<Vec<String>>>,
    read: impl Fn(&Value) -> Result<T>,
) -> Result<()> {
    build_release()?;
    let mut recorded: Vec<Line<T>> = recorded(plan)?;
    let mut failed = Vec::new();
    let is_done = |cell: &Cell| Some(recorded.iter().any(|line| line.cell == *cell));
    let left = Unfinished::of(cells, is_done);
    left.run(|index, place| -> Result<()> {
        let cell = left.cells[index];
        let run = || -> Result<Option<Line<T>>> {
            let Some(more) = more(cell, &recorded)? else { return Ok(None) };
            eprintln!("{place}: {cell}");
            let set = plan.settings(cell).into_iter().map(|setting| format!("--set={setting}"));
            let arguments = set.chain(more).collect();
            let result = finished(plan, cell, arguments, &read)?;
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

/// Result of a run. An interrupted `tune` of the same commit is resumed; its folder is removed when
/// the result is read.
fn finished<T>(
    plan: &Plan,
    cell: &Cell,
    arguments: Vec<String>,
    read: impl Fn(&Value) -> Result<T>,
) -> Result<T> {
    let mut command = echoloop()?;
    command.args([&*plan.command, "--json"]);
    if plan.command != "tune" {
        return read(&printed(command.args(arguments))?);
    }
    let record = plan.record.rsplit('/').next().unwrap_or(&plan.record).replace(".jsonl", "");
    let runs = built(&workspace()?).join(record).join(commit()?);
    let folder = runs.join(cell.to_string().replace(' ', "-"));
    let latest = folder.join("latest");
    match latest.join("history.jsonl").exists() {
        true => command.arg("--resume").arg(&latest),
        false => command.arg("--runs").arg(&folder).args(arguments),
    };
    let result = read(&printed(&mut command)?)?;
    fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    Ok(result)
}
