//! Runs of the figures, each with one JSON value for its output.

use std::collections::BTreeMap;
use std::env;
use std::path::Path;

use anyhow::{Context, Result};
use serde_json::{Map, Value, json};

use super::list::{Kind, Run};
use crate::record::printed;
use crate::shell::{build_release, built, echoloop, first_line, today};
use crate::{cost, firmware};

/// Outputs of runs by name. A run that this machine cannot make is reported and left out.
pub(super) fn all(root: &Path, runs: &[&Run]) -> Result<BTreeMap<String, Value>> {
    if runs.iter().any(|run| run.kind == Kind::Echoloop) {
        build_release()?;
    }
    let mut measured = BTreeMap::new();
    for run in runs {
        let output = match run.kind {
            Kind::Echoloop => of_echoloop(root, run)?,
            Kind::Images => images()?,
            Kind::Cost => cost::counted()?,
        };
        measured.extend(output.map(|output| (run.name.clone(), output)));
    }
    Ok(measured)
}

/// Day, commit and compiler of a run just made. An update refuses changed code before.
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

/// Output of `echoloop`; `None` when the run needs data that are not here.
fn of_echoloop(root: &Path, run: &Run) -> Result<Option<Value>> {
    const DATA: &str = "$ECHOLOOP_DATA";
    let data = env::var("ECHOLOOP_DATA").ok();
    if data.is_none() && run.arguments.iter().any(|argument| argument.contains(DATA)) {
        eprintln!("SKIPPED: {}: ECHOLOOP_DATA is not set", run.name);
        return Ok(None);
    }
    let data = data.unwrap_or_default();
    let arguments = run.arguments.iter().map(|argument| argument.replace(DATA, &data));
    let mut command = echoloop()?;
    command.args(arguments).args(["--json", "--quiet"]);
    if run.arguments.first().is_some_and(|command| command == "tune") {
        command.arg("--runs").arg(built(root).join("figures"));
    }
    printed(&mut command).map(|printed| Some(printed.json)).with_context(|| run.name.clone())
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
