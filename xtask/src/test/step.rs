//! A step of the test command: a command that can be run alone, and the time that it took.

use std::env;
use std::path::Path;
use std::process::Command;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use wait4::Wait4;

use crate::shell::cargo_command;

/// A named command.
pub(super) struct Step {
    name: &'static str,
    /// The command as one types it.
    shown: String,
    command: Command,
}

impl Step {
    /// A command of cargo's.
    pub(super) fn cargo(name: &'static str, arguments: &[&str]) -> Result<Self> {
        Ok(Self::new(name, "cargo", cargo_command()?, arguments))
    }

    /// A command of this program's.
    pub(super) fn own(name: &'static str, arguments: &[&str]) -> Result<Self> {
        let program = env::current_exe().context("the path of this program")?;
        Ok(Self::new(name, "cargo xtask", Command::new(program), arguments))
    }

    fn new(name: &'static str, typed: &str, mut command: Command, arguments: &[&str]) -> Self {
        command.args(arguments);
        if env::var_os("CI").is_some() {
            command.env("CARGO_INCREMENTAL", "0"); // everything is built once
        }
        Self { name, shown: format!("{typed} {}", arguments.join(" ")), command }
    }

    /// The command as one types it.
    #[cfg(test)]
    pub(super) fn shown(&self) -> &str {
        &self.shown
    }

    /// A variable that was set for the command.
    #[cfg(test)]
    pub(super) fn variable(&self, key: &str) -> Option<&std::ffi::OsStr> {
        self.command.get_envs().find(|(name, _)| *name == key)?.1
    }

    /// Sets a variable of the command's environment.
    pub(super) fn with(mut self, key: &str, value: impl AsRef<std::ffi::OsStr>) -> Self {
        self.command.env(key, value);
        self
    }
}

/// Time of a finished step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Spent {
    /// User and system time of the command and of all that it waited for.
    cpu: Duration,
    wall: Duration,
}

/// Finished steps, in the order in which they ended.
#[derive(Default)]
pub(super) struct Steps(Mutex<Vec<(String, String, Spent)>>);

impl Steps {
    /// Runs steps one after the other, up to the first that fails.
    ///
    /// # Errors
    ///
    /// Names the step that failed.
    pub(super) fn run(&self, steps: Vec<Step>) -> Result<()> {
        steps.into_iter().try_for_each(|step| self.run_one(step))
    }

    fn run_one(&self, step: Step) -> Result<()> {
        let Step { name, shown, mut command } = step;
        eprintln!("+ {name}: {shown}");
        let begun = Instant::now();
        let mut child = command.spawn().with_context(|| format!("cannot run {shown}"))?;
        let ended = child.wait4().with_context(|| format!("cannot wait for {shown}"))?;
        let cpu = ended.rusage.utime + ended.rusage.stime;
        let spent = Spent { cpu, wall: begun.elapsed() };
        eprintln!("{name}: {}", seconds(spent));
        let mut rows = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        rows.push((name.to_owned(), shown.clone(), spent));
        if !ended.status.success() {
            bail!("{name} failed: {shown}");
        }
        Ok(())
    }

    /// The table of all finished steps, with their total; `wall` is the total wall time.
    pub(super) fn table(&self, wall: Duration) -> String {
        let rows = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let cpu = rows.iter().map(|(_, _, spent)| spent.cpu).sum();
        let sum = ("all".to_owned(), String::new(), Spent { cpu, wall });
        let head = format!("{:<14} {:>8} {:>8}   command\n", "step", "CPU s", "wall s");
        let lines = rows.iter().chain([&sum]).map(|(name, shown, spent)| {
            let (cpu, wall) = (spent.cpu.as_secs_f64(), spent.wall.as_secs_f64());
            format!("{name:<14} {cpu:>8.1} {wall:>8.1}   {shown}").trim_end().to_owned() + "\n"
        });
        head + &lines.collect::<String>()
    }
}

fn seconds(spent: Spent) -> String {
    format!("{:.1} CPU s, {:.1} s", spent.cpu.as_secs_f64(), spent.wall.as_secs_f64())
}

/// The lines of a file, each once, in the order in which they came; none without the file.
pub(super) fn distinct_lines(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        if !lines.iter().any(|known| known == line) {
            lines.push(line.to_owned());
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(name: &'static str, script: &str) -> Step {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        Step { name, shown: script.to_owned(), command }
    }

    /// Adds numbers for some milliseconds, in a child of the shell's own.
    const BUSY: &str = "sh -c 'i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done'; exit 0";

    #[test]
    #[cfg(unix)]
    fn the_cpu_time_of_a_step_includes_its_grandchildren_and_no_sleep() {
        let steps = Steps::default();
        steps.run(vec![shell("busy", BUSY), shell("idle", "sleep 0.3")]).unwrap();
        let rows = steps.0.into_inner().unwrap();
        let [(_, _, busy), (_, _, idle)] = &rows[..] else { panic!("{rows:?}") };
        assert!(busy.cpu > Duration::from_millis(20), "{busy:?}");
        assert!(idle.cpu < Duration::from_millis(100), "{idle:?}");
        assert!(idle.wall >= Duration::from_millis(300), "{idle:?}");
    }

    #[test]
    #[cfg(unix)]
    fn a_failed_step_is_named_and_timed_and_stops_the_rest() {
        let steps = Steps::default();
        let row = vec![shell("one", "true"), shell("two", "exit 3"), shell("three", "true")];
        let error = steps.run(row).unwrap_err().to_string();
        assert_eq!(error, "two failed: exit 3");
        let table = steps.table(Duration::from_secs(5));
        let names: Vec<_> = table.lines().map(|l| l.split(' ').next().unwrap()).collect();
        assert_eq!(names, ["step", "one", "two", "all"], "{table}");
        assert!(table.lines().last().unwrap().ends_with(" 5.0"), "{table}");
    }

    #[test]
    fn a_line_that_many_tests_write_is_listed_once() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("skipped");
        assert!(distinct_lines(&file).is_empty());
        std::fs::write(&file, "b\na\nb\n").unwrap();
        assert_eq!(distinct_lines(&file), ["b", "a"]);
    }
}
