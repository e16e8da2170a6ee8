//! The runs behind the figures, each as one JSON value.

use std::collections::BTreeMap;
use std::env;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use serde_json::{Map, Value, json};

use super::book::{Kind, Run};
use crate::day::today;
use crate::shell::{built, cargo, first_line};
use crate::{cost, firmware};

/// Runs each; what cannot be run on this machine is skipped aloud.
pub(super) fn all(root: &Path, runs: &[&Run]) -> Result<BTreeMap<String, Value>> {
    if runs.iter().any(|run| run.kind == Kind::Echoloop) {
        cargo(["build", "--release", "--package", "echoloop-app", "--bin", "echoloop"])?;
    }
    let mut measured = BTreeMap::new();
    for run in runs {
        let output = match run.kind {
            Kind::Echoloop => echoloop(root, run)?,
            Kind::Images => images()?,
            Kind::Cost => cost::counted()?,
        };
        measured.extend(output.map(|output| (run.name.clone(), output)));
    }
    Ok(measured)
}

/// Day, commit and compiler of a run that was just made; an update makes sure that it is that code.
pub(super) fn stamp(run: &Run) -> Result<String> {
    let code = first_line("git", &["describe", "--always", "--exclude", "*"])?;
    let compiler = match run.kind {
        Kind::Echoloop => first_line("rustc", &["--version"])?,
        Kind::Images | Kind::Cost => {
            firmware::toolchain(&firmware::IMAGES[0].target)?.version().into()
        }
    };
    let compiler = compiler.split(" (").next().unwrap_or_default();
    Ok(format!("{}, {code}, {compiler}", today()))
}

/// What the program prints; `None` when the run needs data that are not here.
fn echoloop(root: &Path, run: &Run) -> Result<Option<Value>> {
    const DATA: &str = "$ECHOLOOP_DATA";
    let data = env::var("ECHOLOOP_DATA").ok();
    if data.is_none() && run.arguments.iter().any(|argument| argument.contains(DATA)) {
        eprintln!("SKIPPED: {}: ECHOLOOP_DATA is not set", run.name);
        return Ok(None);
    }
    let data = data.unwrap_or_default();
    let arguments = run.arguments.iter().map(|argument| argument.replace(DATA, &data));
    let mut command = Command::new(built(root).join("release/echoloop"));
    command.current_dir(root).args(arguments).args(["--json", "--quiet"]);
    if run.arguments.first().is_some_and(|command| command == "tune") {
        command.arg("--runs").arg(built(root).join("figures"));
    }
    eprintln!("+ {command:?}");
    let output = command.stderr(Stdio::inherit()).output().context("cannot run echoloop")?;
    ensure!(output.status.success(), "{}: echoloop failed", run.name);
    Ok(Some(serde_json::from_slice(&output.stdout).context("echoloop prints JSON")?))
}

/// Sizes of the images; `None` when one cannot be built here.
fn images() -> Result<Option<Value>> {
    let mut sizes = Map::new();
    for image in &firmware::IMAGES {
        if let Err(error) = firmware::toolchain(&image.target) {
            eprintln!("SKIPPED: the images: {error:#}");
            return Ok(None);
        }
        let (size, _) = firmware::check(&image.build()?, image)?;
        let size = json!({"flash": size.flash, "statics": size.statics, "stack": size.stack});
        sizes.insert(image.name.to_owned(), size);
    }
    Ok(Some(Value::Object(sizes)))
}
