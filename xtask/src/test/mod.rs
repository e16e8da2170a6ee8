//! `cargo xtask test`: the set-up of the machine, then steps, each a command that can be run alone.

mod setup;
mod step;
mod verified;

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Instant;

use anyhow::{Result, anyhow, ensure};

use crate::firmware::{targets, toolchain};
use crate::peers;
use crate::shell::workspace;
use crate::target::{ARMV7EM, RV32, Target};
use step::{Step, Steps, distinct_lines};
use verified::Verified;

/// Choice of the checks to run.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Test {
    /// Only the tests.
    #[arg(long)]
    only_tests: bool,
    /// Also every image although no source of theirs changed, the tests that are ignored for their
    /// length, and the optimisers of the Python registry; then writes the record.
    #[arg(long, conflicts_with = "only_tests")]
    all: bool,
    /// Installs missing programs by apt-get or Homebrew, without asking.
    #[arg(long)]
    install: bool,
}

/// Targets whose images are built and run at each change: those of the reference board, of both
/// parts on sale and of the RISC-V board.
const ALWAYS: [Target; 2] = [ARMV7EM, RV32];

/// Environment variables of the tests: the folder of the data sets, the targets whose images are
/// not built, the file that lists what is skipped.
const DATA: &str = "ECHOLOOP_DATA";
const LEFT_OUT: &str = "ECHOLOOP_LEFT_OUT";
const SKIPPED: &str = "ECHOLOOP_SKIPPED";

/// Runs the steps, and prints the time of each and what was skipped.
///
/// # Errors
///
/// When a step fails, or `--install` cannot install a program.
pub(crate) fn run(args: &Test) -> Result<()> {
    let (begun, root) = (Instant::now(), workspace()?);
    let has_all = setup::programs(&root, args.install)?;
    ensure!(has_all || !args.all, "--all needs the programs above: --install");
    setup::add_targets(&ALWAYS.each_ref());
    let state = Verified::now(&root, toolchain(&ARMV7EM)?.version())?;
    let chosen = chosen(args, &root, &state);
    setup::add_targets(&chosen);
    let plan = Plan::new(args, &root, &chosen)?;
    let skipped = plan.skipped.clone();
    let steps = Steps::default();
    let outcome = plan.run(&steps);
    eprintln!("\n{}", steps.table(begun.elapsed()));
    distinct_lines(&skipped).iter().for_each(|line| eprintln!("SKIPPED: {line}"));
    outcome?;
    if args.all { state.write(&root) } else { Ok(()) }
}

/// Targets whose images are built: all of them unless the record of verified sources holds.
fn chosen(args: &Test, root: &Path, state: &Verified) -> Vec<&'static Target> {
    match state.differs_from_record(root) {
        Some(why) => eprintln!("note: all images are built: {why}"),
        None if !args.all => {
            return targets().into_iter().filter(|t| ALWAYS.contains(t)).collect();
        }
        None => {}
    }
    targets()
}

/// Steps in order; those of the images run beside those of the host.
struct Plan {
    images: Vec<Step>,
    host: Vec<Step>,
    after: Vec<Step>,
    /// File that gathers what the tests skip.
    skipped: PathBuf,
}

impl Plan {
    fn new(args: &Test, root: &Path, chosen: &[&Target]) -> Result<Self> {
        let skipped = root.join("target/xtask/skipped");
        fs::create_dir_all(root.join("target/xtask"))?;
        fs::write(&skipped, "")?;
        let host = if args.only_tests { vec![building()?] } else { host_steps()? };
        let mut after = vec![tests(root, chosen)?.with(SKIPPED, &skipped)];
        after.push(Step::own("python", &["python", "--test"])?);
        if peers::are_installed(root)? {
            after.push(Step::own("clouds", &["peers", "--clouds"])?);
        }
        if args.all {
            after.push(ignored_tests(root)?.with(SKIPPED, &skipped));
            after.push(Step::own("searches", &["peers", "--searches"])?);
        }
        Ok(Self { images: image_steps(args, chosen)?, host, after, skipped })
    }

    /// An image is linked by one core, in a target folder of its own, so host steps run beside it.
    fn run(self, steps: &Steps) -> Result<()> {
        let Self { images, host, after, .. } = self;
        thread::scope(|scope| {
            let images = scope.spawn(|| steps.run(images));
            let host = steps.run(host);
            host.and(images.join().map_err(|_| anyhow!("the images' thread panicked"))?)
        })?;
        steps.run(after)
    }
}

fn image_steps(args: &Test, chosen: &[&Target]) -> Result<Vec<Step>> {
    let targets: Vec<&str> = chosen.iter().flat_map(|t| ["--target", t.name]).collect();
    let lint = (!args.only_tests).then_some("--lint");
    // With all images, a target without a toolchain is an error, not skipped.
    let for_tests = (!args.all).then_some("--for-tests");
    let flags = ["firmware"].into_iter().chain(lint).chain(for_tests);
    let mut steps = vec![Step::own("images", &flags.chain(targets.clone()).collect::<Vec<_>>())?];
    if !args.only_tests {
        steps.push(Step::own("cost", &[&["cost"], &targets[..]].concat())?);
    }
    Ok(steps)
}

/// All tests; those on boards whose images were not built are left out.
fn tests(root: &Path, chosen: &[&Target]) -> Result<Step> {
    let all = targets();
    let left_out: Vec<&str> =
        all.iter().filter(|target| !chosen.contains(target)).map(|target| target.name).collect();
    Ok(with_data(Step::cargo("tests", &["test", "--workspace"])?, root)
        .with(LEFT_OUT, left_out.join(",")))
}

/// Tests that are too long for each change, without those that tests of `tests/needs` call.
fn ignored_tests(root: &Path) -> Result<Step> {
    let arguments = ["test", "--workspace", "--", "--ignored", "--skip", "tests::a_test_"];
    Ok(with_data(Step::cargo("long tests", &arguments)?, root))
}

fn with_data(step: Step, root: &Path) -> Step {
    match setup::data(root, env::var_os(DATA).map(PathBuf::from)) {
        Some(folder) => step.with(DATA, folder),
        None => step,
    }
}

fn host_steps() -> Result<Vec<Step>> {
    let lints = ["clippy", "--workspace", "--all-targets", "--quiet", "--", "-D", "warnings"];
    Ok(vec![
        Step::cargo("format", &["fmt", "--all", "--check"])?,
        Step::cargo("lints", &lints)?,
        Step::cargo("documentation", &["doc", "--workspace", "--no-deps", "--quiet"])?
            .with("RUSTDOCFLAGS", "-D warnings"),
        building()?,
    ])
}

fn building() -> Result<Step> {
    Step::cargo("building", &["test", "--workspace", "--no-run"])
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVERYTHING: Test = Test { only_tests: false, all: true, install: false };
    const USUAL: Test = Test { all: false, ..EVERYTHING };

    fn shown(steps: &[Step]) -> Vec<&str> {
        steps.iter().map(Step::shown).collect()
    }

    #[test]
    fn the_tests_know_the_images_that_are_not_built_and_the_others_are_counted() {
        let chosen = ALWAYS.each_ref();
        let flags = "--target thumbv7em-none-eabihf --target riscv32imac-unknown-none-elf";
        assert_eq!(
            shown(&image_steps(&USUAL, &chosen).unwrap()),
            [
                format!("cargo xtask firmware --lint --for-tests {flags}"),
                format!("cargo xtask cost {flags}")
            ]
        );
        let tests = tests(Path::new("/nowhere"), &chosen).unwrap();
        let left_out = "thumbv8m.main-none-eabihf,cortex-m55,thumbv6m-none-eabi";
        assert_eq!(tests.variable(LEFT_OUT).unwrap(), left_out);
    }

    #[test]
    fn with_all_no_image_is_left_out_and_a_missing_toolchain_is_an_error() {
        let tests = tests(Path::new("/nowhere"), &targets()).unwrap();
        assert_eq!(tests.variable(LEFT_OUT).unwrap(), "");
        let images = image_steps(&EVERYTHING, &targets()).unwrap();
        assert!(!images[0].shown().contains("--for-tests"), "{}", images[0].shown());
        let only_tests = Test { only_tests: true, ..USUAL };
        let images = image_steps(&only_tests, &ALWAYS.each_ref()).unwrap();
        assert!(images.len() == 1 && !images[0].shown().contains("--lint"));
    }

    #[test]
    fn a_record_that_holds_leaves_the_images_of_the_usual_boards_unless_all_are_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("firmware")).unwrap();
        let state = Verified::now(&workspace().unwrap(), "rustc 1").unwrap();
        let names =
            |args| chosen(args, folder.path(), &state).iter().map(|t| t.name).collect::<Vec<_>>();
        assert_eq!(names(&USUAL).len(), targets().len(), "there is no record");
        state.write(folder.path()).unwrap();
        assert_eq!(names(&USUAL), [ARMV7EM.name, RV32.name]);
        assert_eq!(names(&EVERYTHING).len(), targets().len());
    }
}
