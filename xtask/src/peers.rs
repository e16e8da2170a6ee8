//! `cargo xtask peers`: registration, the waveform path and the optimiser beside their peers in
//! Python, on the same files or functions.

pub(crate) mod environment;
mod searches;

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::python as module;
use crate::shell::{build_as_tested, build_release, built, cargo, succeed, workspace};
use environment::{environment, holds};

/// Comparison to make.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub(crate) struct Peers {
    /// Take a minute, to see that all runs; the tables go to target/peers.
    #[arg(long)]
    quick: bool,
    /// Recall on hard pairs instead of speed.
    #[arg(long)]
    recall: bool,
    /// Cost from 5,000 to a million points instead of speed.
    #[arg(long)]
    scaling: bool,
    /// Calls of our Python module beside those of theirs, instead of speed.
    #[arg(long)]
    python: bool,
    /// All four.
    #[arg(long)]
    all: bool,
    /// The waveform path beside numpy and scipy instead of registration, and how its cost grows.
    #[arg(long, conflicts_with_all = ["recall", "scaling", "python", "all"])]
    waveforms: bool,
    /// The optimiser beside pycma and cmaes instead of registration: evaluations, not time.
    #[arg(long, conflicts_with_all = ["recall", "scaling", "python", "all", "waveforms"])]
    optimiser: bool,
    /// Only check that Open3D reads our clouds with every attribute, and we its: seconds. The
    /// measurements of registration begin with it.
    #[arg(
        long,
        conflicts_with_all = [
            "quick", "recall", "scaling", "python", "all", "waveforms", "optimiser",
        ],
    )]
    clouds: bool,
    /// Only check that pycma, Optuna and Nevergrad drive the loop through `evaluate --stream`: a
    /// minute.
    #[arg(
        long,
        conflicts_with_all = [
            "quick", "recall", "scaling", "python", "all", "waveforms", "optimiser", "clouds",
        ],
    )]
    searches: bool,
}

/// Environment of the peers of registration, and their packages.
const ENVIRONMENT: &str = "target/peers/venv";
const REQUIREMENTS: &str = "benches/peers/requirements.txt";

/// Measures, and writes registration-peers.md, waveform-cost.md or optimiser.md below
/// benches/record.
pub(crate) fn run(peers: Peers) -> Result<()> {
    let root = workspace()?;
    if peers.clouds {
        let python = environment(&root.join(ENVIRONMENT), &root.join(REQUIREMENTS))?;
        build_as_tested()?;
        clouds(&root, &python, &built(&root).join("debug/echoloop"))
    } else if peers.searches {
        searches::run(&root)
    } else if peers.waveforms {
        beside(&root, peers.quick, "waveforms", "waveform_path", "waveform-cost")
    } else if peers.optimiser {
        beside(&root, peers.quick, "optimiser", "optimiser", "optimiser")
    } else {
        registration(&root, peers)
    }
}

fn registration(root: &Path, peers: Peers) -> Result<()> {
    let python = environment(&root.join(ENVIRONMENT), &root.join(REQUIREMENTS))?;
    build_release()?;
    cargo(["build", "--release", "--package", "echoloop-benches", "--bin", "stages"])?;
    let built = built(root).join("release");
    let (stages, echoloop) = (built.join("stages"), built.join("echoloop"));
    clouds(root, &python, &echoloop)?;
    if peers.parts().contains(&"python") {
        let wheels = module::wheel(root)?;
        let mut pip = Command::new(&python);
        pip.args(["-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps"]);
        succeed(pip.args(["--no-index", "echoloop", "--find-links"]).arg(wheels))?;
    }
    let page = if peers.quick { "quick" } else { "registration-peers" };
    let mut command = script(root, &python, "run.py", page, peers.quick);
    command.arg("--stages").arg(stages).arg("--echoloop").arg(echoloop);
    succeed(command.arg("--parts").args(peers.parts()))
}

/// A script of benches/peers that writes a page below benches/record, or with `quick` in its work
/// folder.
fn script(root: &Path, python: &Path, name: &str, page: &str, quick: bool) -> Command {
    let work = root.join("target/peers");
    let folder = if quick { work.clone() } else { root.join("benches/record") };
    let mut command = Command::new(python);
    command.arg(root.join("benches/peers").join(name)).arg("--work").arg(work);
    command.arg("--out").arg(folder.join(page).with_extension("md"));
    command.args(quick.then_some("--quick"));
    command
}

/// Has Open3D read the clouds of our command, and the other way round.
fn clouds(root: &Path, python: &Path, echoloop: &Path) -> Result<()> {
    let mut command = Command::new(python);
    command.arg(root.join("benches/peers/clouds.py")).arg("--echoloop").arg(echoloop);
    succeed(command.arg("--work").arg(root.join("target/peers/attributes")))
}

/// True when the peers of registration are installed; otherwise reports the check that is skipped.
pub(crate) fn are_installed(root: &Path) -> Result<bool> {
    let are = holds(&root.join(ENVIRONMENT), &root.join(REQUIREMENTS))?;
    if !are {
        eprintln!(
            "SKIPPED: no Open3D in target/peers, so our clouds were not read by it: \
             cargo xtask peers --clouds"
        );
    }
    Ok(are)
}

/// Runs the script of a name, which has packages of its own, takes our program as `--NAME`, and
/// writes its page.
fn beside(root: &Path, quick: bool, name: &str, program: &str, page: &str) -> Result<()> {
    let requirements = root.join(format!("benches/peers/requirements-{name}.txt"));
    let folder = root.join(format!("target/peers/venv-{name}"));
    let python = environment(&folder, &requirements)?;
    cargo(["build", "--release", "--package", "echoloop-benches", "--bin", program])?;
    let quick_page = format!("quick-{name}");
    let page = if quick { &quick_page } else { page };
    let mut command = script(root, &python, &format!("{name}.py"), page, quick);
    command.arg(format!("--{name}")).arg(built(root).join("release").join(program));
    // One thread each, whatever numpy was built with.
    succeed(command.env("OMP_NUM_THREADS", "1").env("OPENBLAS_NUM_THREADS", "1"))
}

impl Peers {
    fn parts(self) -> Vec<&'static str> {
        let asked = [("recall", self.recall), ("scaling", self.scaling), ("python", self.python)];
        let mut parts: Vec<_> =
            asked.iter().filter(|(_, asked)| *asked || self.all).map(|(part, _)| *part).collect();
        if self.all || parts.is_empty() {
            parts.insert(0, "speed");
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_is_measured_unless_something_else_is_asked_and_all_is_all() {
        let parts = |recall, scaling, python, all| {
            let none = Peers::default();
            Peers { recall, scaling, python, all, ..none }.parts()
        };
        assert_eq!(parts(false, false, false, false), ["speed"]);
        assert_eq!(parts(true, false, false, false), ["recall"]);
        assert_eq!(parts(true, true, false, false), ["recall", "scaling"]);
        assert_eq!(parts(false, false, true, false), ["python"]);
        assert_eq!(parts(false, false, false, true), ["speed", "recall", "scaling", "python"]);
    }
}
