//! Project commands: `cargo xtask test`.

mod attack;
mod cost;
mod figures;
mod firmware;
mod fuzz;
mod image;
mod patterns;
mod peers;
mod pictures;
mod program;
mod proof;
mod python;
mod record;
mod shell;
mod study;
mod surroundings;
mod target;
mod test;
mod thumb;
mod toolchain;
mod towns;

use anyhow::Result;
use clap::Parser;

use shell::{cargo, cargo_command, succeed};

/// Project commands.
#[derive(Parser)]
#[command(name = "cargo xtask")]
enum Task {
    /// Everything that must hold before a change lands: format, lints, documentation, images, all
    /// tests, cost on microcontrollers. Adds the compiler's targets that are missing.
    Test(test::Test),
    /// The sensor's images for microcontrollers, with flash, RAM and worst-case stack; fails when
    /// one can panic.
    Firmware {
        /// Only for this target, a triple or cortex-m55; may be repeated.
        #[arg(long)]
        target: Vec<String>,
        /// Also print the deepest path of calls.
        #[arg(short, long)]
        verbose: bool,
        /// Also lint the code that only the images compile.
        #[arg(long)]
        lint: bool,
        /// Skip a target without a toolchain, unless CI is set.
        #[arg(long, hide = true)]
        for_tests: bool,
    },
    /// The speed record: every criterion bench.
    Bench,
    /// The long comparison: every board in QEMU against the PC, waveform by waveform.
    OnTarget {
        /// Waveforms for each board.
        #[arg(long, default_value_t = 100_000)]
        waveforms: u32,
    },
    /// The long storm: a program that tunes a sensor over a line that does six harms to one message
    /// in twenty each.
    Storm {
        /// Frames to send and answers to get.
        #[arg(long, default_value_t = 10_000_000)]
        frames: u64,
        /// Seed of all harms.
        #[arg(long, default_value_t = 41)]
        seed: u64,
    },
    /// Runs every fuzz target for a while: random bytes on the link, in the flash and to every
    /// reader.
    Fuzz {
        /// Only this one: a file of fuzz/fuzz_targets, as session or obj.
        #[arg(long)]
        target: Option<String>,
        /// Time of each target, s.
        #[arg(long, default_value_t = 60)]
        seconds: u32,
    },
    /// Seeded damage to files and to the link, case by case: the tests' attacks with more cases.
    Attack(attack::Attack),
    /// Counts the instructions of every stage on microcontrollers, in QEMU; fails when one grew by
    /// more than 2 %.
    Cost {
        /// Write the table anew instead.
        #[arg(long, conflicts_with = "target")]
        update: bool,
        /// Only on processors of this target; may be repeated.
        #[arg(long)]
        target: Vec<String>,
    },
    /// The figures that README and docs print: makes the cheap runs, and compares them with record
    /// and pages.
    Figures(figures::Figures),
    /// Registration against Open3D, small_gicp and KISS-Matcher on the same files, or the waveform
    /// path against numpy and scipy; needs python3 and the Python registry.
    Peers(peers::Peers),
    /// The wheel of the Python module, in target/python; needs python3 and the Python registry.
    Python {
        /// The module as the tests have it, and its tests, instead.
        #[arg(long)]
        test: bool,
    },
    /// The pictures of scenes in the docs, drawn again.
    Pictures,
    /// The picture of the beams before and after tuning, drawn again: six minutes.
    Beams,
    /// The picture of what mirrors, bright signs and another LiDAR add to a scan, drawn again.
    Surroundings,
    /// Pairs of the nine towns: the time to trace, store and read them, in the docs.
    Towns,
    /// Registration with each scan pattern, at equal time and at equal energy; goes on where it was
    /// left.
    Patterns(patterns::Patterns),
    /// Both halves tuned together against either half, the halves combined, a sensor set by hand,
    /// an ideal detector and random points. Hours; goes on where it was left.
    Proof(proof::Proof),
    /// Gain of tuning the LiDAR, registration or both on held-out pairs, by every method in every
    /// kind of scene, by both strategies. Hours; goes on where it was left.
    Study(study::Study),
}

fn main() -> Result<()> {
    match Task::parse() {
        Task::Test(args) => test::run(&args),
        Task::Firmware { target, verbose, lint, for_tests } => {
            firmware::checked(&target, verbose, lint, for_tests)
        }
        Task::Bench => cargo(["bench", "--workspace"]),
        Task::OnTarget { waveforms } => on_target(waveforms),
        Task::Storm { frames, seed } => storm(frames, seed),
        Task::Fuzz { target, seconds } => fuzz::run(target.as_deref(), seconds),
        Task::Attack(args) => attack::run(&args),
        Task::Cost { update, target } => cost::run(update, &target),
        Task::Figures(args) => figures::run(&args),
        Task::Peers(args) => peers::run(args),
        Task::Python { test } => python::run(test),
        Task::Pictures => pictures::run(),
        Task::Beams => pictures::beams(),
        Task::Surroundings => surroundings::run(),
        Task::Towns => towns::run(),
        Task::Patterns(args) => patterns::run(&args),
        Task::Proof(args) => proof::run(&args),
        Task::Study(args) => study::run(&args),
    }
}

fn on_target(waveforms: u32) -> Result<()> {
    firmware::checked(&[], false, false, true)?;
    let mut command = cargo_command()?;
    command.args(["test", "--package", "echoloop-tests", "--test", "on_target", "every_board"]);
    command.args(["--", "--nocapture"]);
    succeed(command.env("ECHOLOOP_WAVEFORMS", waveforms.to_string()))
}

/// The long storm. Built as the tests are, so that an overflow panics.
fn storm(frames: u64, seed: u64) -> Result<()> {
    let mut command = cargo_command()?;
    command.args(["test", "--package", "echoloop-tests", "--test", "link", "a_storm_of"]);
    command.args(["--", "--nocapture"]);
    command.env("ECHOLOOP_FRAMES", frames.to_string());
    succeed(command.env("ECHOLOOP_SEED", seed.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::workspace;
    use std::fs;
    use std::path::{Path, PathBuf};

    /// Every page below a folder.
    fn pages(folder: &Path) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let built = |path: &PathBuf| path.ends_with("target") || path.ends_with(".git");
        let (folders, files): (Vec<_>, Vec<_>) =
            entries.filter(|path| !built(path)).partition(|path| path.is_dir());
        let own = files.into_iter().filter(|path| path.extension().is_some_and(|e| e == "md"));
        own.chain(folders.iter().flat_map(|folder| pages(folder))).collect()
    }

    #[test]
    fn every_project_command_of_the_pages_is_understood() {
        let mut seen = 0;
        for page in pages(&workspace().unwrap()) {
            let text = fs::read_to_string(&page).unwrap();
            for rest in text.split("cargo xtask ").skip(1) {
                let command = rest.split(['`', '\n', '#', '|', '<']).next().unwrap();
                let words = ["xtask"].into_iter().chain(command.split_whitespace());
                let result = Task::try_parse_from(words).map(drop);
                assert!(result.is_ok(), "{}: {command}\n{result:?}", page.display());
                seen += 1;
            }
        }
        assert!(seen > 20, "only {seen} commands");
    }
}
