//! Registration, the waveform path and the optimiser against their peers: a Python environment with
//! them, our side built, both on the same files or functions.

mod environment;
mod searches;

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::shell::{build_as_tested, built, cargo, succeed, workspace};
use environment::{environment, holds};

/// What to measure besides speed.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Peers {
    /// A minute, to see that all runs; the tables go to target/peers.
    #[arg(long)]
    quick: bool,
    /// Recall on hard pairs instead of speed.
    #[arg(long)]
    recall: bool,
    /// Cost from 5,000 to a million points instead of speed.
    #[arg(long)]
    scaling: bool,
    /// All three.
    #[arg(long)]
    all: bool,
    /// The waveform path beside numpy and scipy instead of registration, and how its cost grows.
    #[arg(long, conflicts_with_all = ["recall", "scaling", "all"])]
    waveforms: bool,
    /// The optimiser beside pycma and cmaes instead of registration: evaluations, not time.
    #[arg(long, conflicts_with_all = ["recall", "scaling", "all", "waveforms"])]
    optimiser: bool,
    /// Only see that Open3D reads our clouds with every attribute, and we its: seconds. The
    /// measurements of registration see it first.
    #[arg(
        long,
        conflicts_with_all = ["quick", "recall", "scaling", "all", "waveforms", "optimiser"],
    )]
    clouds: bool,
    /// Only see that pycma, Optuna and Nevergrad drive the loop through `evaluate --stream`: a
    /// minute.
    #[arg(
        long,
        conflicts_with_all = [
            "quick", "recall", "scaling", "all", "waveforms", "optimiser", "clouds",
        ],
    )]
    searches: bool,
}

/// Where the peers of registration are installed, and which.
const ENVIRONMENT: &str = "target/peers/venv";
const REQUIREMENTS: &str = "benches/peers/requirements.txt";

/// Measures, and writes registration-peers.md, waveform-cost.md or optimiser.md below
/// benches/record.
pub(crate) fn run(peers: Peers) -> Result<()> {
    if peers.clouds {
        let root = workspace()?;
        let python = environment(&root.join(ENVIRONMENT), &root.join(REQUIREMENTS))?;
        build_as_tested()?;
        return clouds(&root, &python, &built(&root).join("debug/echoloop"));
    }
    if peers.searches {
        return searches::run();
    }
    if peers.waveforms {
        return beside(&WAVEFORMS, peers.quick);
    }
    if peers.optimiser { beside(&OPTIMISER, peers.quick) } else { registration(peers) }
}

fn registration(peers: Peers) -> Result<()> {
    let root = workspace()?;
    let work = root.join("target/peers");
    let scripts = root.join("benches/peers");
    let python = environment(&root.join(ENVIRONMENT), &root.join(REQUIREMENTS))?;
    cargo([
        "build",
        "--release",
        "--package",
        "echoloop-app",
        "--package",
        "echoloop-benches",
        "--bin",
        "echoloop",
        "--bin",
        "stages",
    ])?;
    let built = built(&root).join("release");
    clouds(&root, &python, &built.join("echoloop"))?;
    let page = if peers.quick {
        work.join("quick.md")
    } else {
        root.join("benches/record/registration-peers.md")
    };
    let mut command = Command::new(python);
    command.arg(scripts.join("run.py")).arg("--work").arg(&work).arg("--out").arg(page);
    command.arg("--stages").arg(built.join("stages")).arg("--echoloop").arg(built.join("echoloop"));
    command.args(peers.quick.then_some("--quick")).arg("--parts").args(peers.parts());
    succeed(&mut command)
}

/// Has Open3D read the clouds of our command, and the other way round.
fn clouds(root: &Path, python: &Path, echoloop: &Path) -> Result<()> {
    let mut command = Command::new(python);
    command.arg(root.join("benches/peers/clouds.py")).arg("--echoloop").arg(echoloop);
    succeed(command.arg("--work").arg(root.join("target/peers/attributes")))
}

/// True where the peers of registration are installed; else says what is left out.
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

/// A measurement whose script is given our program and writes its page.
struct Beside {
    /// The script and what it needs: its own file of the folder, and its requirements.
    name: &'static str,
    /// Our program, which the script takes as `--NAME`.
    program: &'static str,
    /// Below benches/record.
    page: &'static str,
}

const WAVEFORMS: Beside =
    Beside { name: "waveforms", program: "waveform_path", page: "waveform-cost.md" };
const OPTIMISER: Beside = Beside { name: "optimiser", program: "optimiser", page: "optimiser.md" };

fn beside(what: &Beside, quick: bool) -> Result<()> {
    let root = workspace()?;
    let work = root.join("target/peers");
    let scripts = root.join("benches/peers");
    let name = what.name;
    let requirements = scripts.join(format!("requirements-{name}.txt"));
    let python = environment(&work.join(format!("venv-{name}")), &requirements)?;
    cargo(["build", "--release", "--package", "echoloop-benches", "--bin", what.program])?;
    let page = if quick {
        work.join(format!("quick-{name}.md"))
    } else {
        root.join("benches/record").join(what.page)
    };
    let mut command = Command::new(python);
    command.arg(scripts.join(format!("{name}.py"))).arg("--work").arg(&work).arg("--out").arg(page);
    command.arg(format!("--{name}")).arg(built(&root).join("release").join(what.program));
    command.args(quick.then_some("--quick"));
    // One thread each, whatever numpy was built with.
    succeed(command.env("OMP_NUM_THREADS", "1").env("OPENBLAS_NUM_THREADS", "1"))
}

impl Peers {
    fn parts(self) -> Vec<&'static str> {
        let asked = [("recall", self.recall), ("scaling", self.scaling)];
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
        let parts = |recall, scaling, all| {
            let [quick, waveforms, optimiser, clouds, searches] = [false; 5];
            Peers { quick, recall, scaling, all, waveforms, optimiser, clouds, searches }.parts()
        };
        assert_eq!(parts(false, false, false), ["speed"]);
        assert_eq!(parts(true, false, false), ["recall"]);
        assert_eq!(parts(true, true, false), ["recall", "scaling"]);
        assert_eq!(parts(false, false, true), ["speed", "recall", "scaling"]);
    }
}
