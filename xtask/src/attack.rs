//! `cargo xtask attack`: the attacks of `tests/tests/attack` with any number of cases.

use std::fs;

use anyhow::{Result, bail};

use crate::shell::{cargo_command, succeed, today, workspace};

/// Cases to run.
#[derive(Debug, clap::Args)]
pub(crate) struct Attack {
    /// Only this kind: a file of tests/tests/attack/kind.
    #[arg(long)]
    kind: Option<String>,
    /// Cases of each kind.
    #[arg(long, default_value_t = 10_000)]
    cases: u64,
    /// Seed of all cases.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only this case, as a failure names it.
    #[arg(long, requires = "kind")]
    case: Option<u64>,
}

/// Runs the cases; each kind ends with a line for the record. Built as the tests are, so that
/// numbers that overflow panic.
pub(crate) fn run(args: &Attack) -> Result<()> {
    let filter = match &args.kind {
        Some(kind) => known(kind)?,
        None => "kind::".into(),
    };
    let mut command = cargo_command()?;
    command.args(["test", "--package", "echoloop-tests", "--test", "attack", &filter]);
    command.args(["--", "--nocapture", "--test-threads", "1"]);
    command.env("ECHOLOOP_ATTACK_CASES", args.cases.to_string());
    command.env("ECHOLOOP_ATTACK_SEED", args.seed.to_string());
    if let Some(case) = args.case {
        command.env("ECHOLOOP_ATTACK_CASE", case.to_string());
    }
    succeed(&mut command)?;
    eprintln!("{}: all borne", today());
    Ok(())
}

/// Filter for the tests of a kind. An unknown one is refused: cargo would run no test, and pass.
fn known(kind: &str) -> Result<String> {
    let kinds = kinds()?;
    if !kinds.iter().any(|known| known == kind) {
        bail!("there is no attack {kind:?}; there are {}", kinds.join(", "));
    }
    Ok(format!("kind::{kind}::"))
}

/// Kinds of attacks: files of their folder.
fn kinds() -> Result<Vec<String>> {
    let mut kinds = Vec::new();
    for entry in fs::read_dir(workspace()?.join("tests/tests/attack/kind"))? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        kinds.extend(name.strip_suffix(".rs").filter(|kind| *kind != "mod").map(str::to_owned));
    }
    kinds.sort();
    Ok(kinds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_a_file_that_is_compiled_and_anything_else_is_refused() {
        assert_eq!(known("bytes").unwrap(), "kind::bytes::");
        assert!(known("mod").is_err() && known("").is_err());
        let root = workspace().unwrap();
        let compiled = fs::read_to_string(root.join("tests/tests/attack/kind/mod.rs")).unwrap();
        for kind in kinds().unwrap() {
            assert!(compiled.contains(&format!("mod {kind};")), "{kind}");
        }
    }
}
