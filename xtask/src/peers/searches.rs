//! Other optimisers in our loop: the scripts of host/app/searches, run as a user would.

use std::env;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use anyhow::{Context, Result, anyhow, ensure};
use serde_json::Value;

use super::environment::environment;
use crate::shell::{build_as_tested, built};

const SCRIPTS: [&str; 3] = ["pycma_search.py", "optuna_search.py", "nevergrad_search.py"];

/// A small town, and axes of every kind: lengths, a choice, a count.
const FLAGS: &[&str] = &[
    "--set=scene.towns=[1]",
    "--set=scanner.pattern=grid",
    "--set=scanner.columns=48",
    "--set=scanner.rows=16",
    "--set=scanner.elevation_deg=60.0",
    "--set=data.train_pairs=4",
    "--set=data.test_pairs=1",
    "--set=tune.protocol=default",
    "--tune=lidar.power=1..100,log",
    "--tune=lidar.timing",
    "--tune=lidar.shots",
    "--tune=registration.voxel_m",
];

/// Installs the optimisers, and runs a search of each.
///
/// # Errors
///
/// When one cannot be installed, does not run, or finds nothing better than the start.
pub(crate) fn run(root: &Path) -> Result<()> {
    let scripts = root.join("host/app/searches");
    let folder = root.join("target/peers/venv-searches");
    let python = environment(&folder, &scripts.join("requirements.txt"))?;
    build_as_tested()?;
    let ours = built(root).join("debug");
    let start = answers(start(&ours)?)?;
    for script in SCRIPTS {
        let mut command = Command::new(&python);
        command.arg(scripts.join(script)).args(FLAGS).env("PATH", with_first(&ours)?);
        let output = command.output().with_context(|| format!("cannot run {script}"))?;
        let found = answers(output).with_context(|| script.to_owned())?;
        println!("{script}: {found:.4} where the start has {start:.4}");
        ensure!(found < start, "{script} found nothing better than the start");
    }
    Ok(())
}

/// Answer of the loop to the start.
fn start(ours: &Path) -> Result<Output> {
    let mut command = Command::new(ours.join("echoloop"));
    command.args(["evaluate", "--stream", "--quiet"]).args(FLAGS);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
    let mut input = child.stdin.take().context("it has an input")?;
    writeln!(input, "{{\"parameters\": {{}}}}")?;
    drop(input);
    Ok(child.wait_with_output()?)
}

/// Fitness in the last line of an output.
fn answers(output: Output) -> Result<f64> {
    let said = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "it failed: {said}");
    let text = String::from_utf8_lossy(&output.stdout);
    let last = text.lines().last().context("it says nothing")?;
    let answer: Value = serde_json::from_str(last).with_context(|| last.to_owned())?;
    answer["fitness"].as_f64().ok_or_else(|| anyhow!("no fitness in {last}"))
}

/// The PATH with a folder before all others.
fn with_first(folder: &Path) -> Result<std::ffi::OsString> {
    let path = env::var_os("PATH").unwrap_or_default();
    let folders = std::iter::once(folder.to_owned()).chain(env::split_paths(&path));
    env::join_paths(folders).context("a PATH")
}
