//! Set-up of a machine for the test command: compiler targets, programs of the system, data.

use std::env;
use std::fs;
use std::io::{self, BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, bail};

use crate::firmware::toolchain;
use crate::shell::{first_line, on_path, succeed};
use crate::target::Target;

/// A program that tests start.
struct Program {
    /// Names, any of which suffices.
    names: &'static [&'static str],
    /// Debian's package.
    debian: &'static str,
    /// Homebrew's arguments after `install`.
    homebrew: &'static [&'static str],
    /// Consequence of its absence.
    without: &'static str,
}

const PROGRAMS: [Program; 3] = [
    Program {
        names: &["qemu-system-arm"],
        debian: "qemu-system-arm",
        homebrew: &["qemu"],
        without: "images for Arm are not run on their boards",
    },
    Program {
        names: &["qemu-system-riscv32"],
        debian: "qemu-system-misc",
        homebrew: &["qemu"],
        without: "images for RISC-V are not run on their board",
    },
    Program {
        names: &["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"],
        debian: "chromium",
        homebrew: &["--cask", "chromium"],
        without: "pages are not opened in a browser",
    },
];

/// Adds the compiler's targets that are missing, by rustup.
pub(super) fn add_targets(targets: &[&Target]) {
    let mut missing: Vec<&str> = targets
        .iter()
        .filter(|target| toolchain(target).is_err())
        .map(|target| target.triple)
        .collect();
    missing.dedup();
    if missing.is_empty() || !on_path("rustup") {
        return; // the images' step says which toolchain would do
    }
    let mut command = Command::new("rustup");
    if let Err(error) = succeed(command.args(["target", "add"]).args(&missing)) {
        eprintln!("note: {error:#}");
    }
}

/// Installs missing programs with `--install` or the user's consent, else prints what is not
/// tested. True when all are present.
///
/// # Errors
///
/// When a program cannot be installed.
pub(super) fn programs(root: &Path, install: bool) -> Result<bool> {
    let missing: Vec<&Program> =
        PROGRAMS.iter().filter(|program| !program.names.iter().any(|n| on_path(n))).collect();
    if missing.is_empty() {
        return Ok(true);
    }
    let manager = manager();
    let commands = manager.map(|manager| manager.commands(&missing)).unwrap_or_default();
    if !commands.is_empty() && (install || agreed_on_terminal(root, &commands)) {
        commands.iter().try_for_each(|words| succeed(&mut command(words)))?;
        return Ok(true);
    }
    for Program { names, debian, without, .. } in missing {
        eprintln!("note: no {}: {without} (--install, or Debian's package {debian})", names[0]);
    }
    if install {
        bail!("--install needs apt-get or brew on the PATH");
    }
    Ok(false)
}

/// A manager of the system's packages.
#[derive(Clone, Copy)]
enum Manager {
    /// By root itself, or by sudo.
    Apt {
        sudo: bool,
    },
    Homebrew,
}

fn manager() -> Option<Manager> {
    if on_path("apt-get") {
        let is_root = first_line("id", &["-u"]).is_ok_and(|id| id == "0");
        return Some(Manager::Apt { sudo: !is_root });
    }
    on_path("brew").then_some(Manager::Homebrew)
}

impl Manager {
    /// Commands that install the packages of these programs.
    fn commands(self, programs: &[&Program]) -> Vec<Vec<&'static str>> {
        let mut commands: Vec<Vec<&'static str>> = Vec::new();
        match self {
            Self::Apt { sudo } => {
                let apt = || sudo.then_some("sudo").into_iter().chain(["apt-get"]);
                commands.push(apt().chain(["update"]).collect());
                let install = apt().chain(["install", "-y", "--no-install-recommends"]);
                commands.push(install.chain(programs.iter().map(|p| p.debian)).collect());
            }
            Self::Homebrew => {
                for program in programs {
                    let words = ["brew", "install"].iter().chain(program.homebrew);
                    let words = words.copied().collect();
                    if !commands.contains(&words) {
                        commands.push(words);
                    }
                }
            }
        }
        commands
    }
}

fn command(words: &[&str]) -> Command {
    let mut command = Command::new(words[0]);
    command.args(&words[1..]);
    command
}

/// Asks on a terminal, the first time only; without a terminal the answer is no.
fn agreed_on_terminal(root: &Path, commands: &[Vec<&str>]) -> bool {
    let marker = root.join("target/xtask/asked-to-install");
    let is_terminal = io::stdin().is_terminal() && io::stderr().is_terminal();
    if !is_terminal || env::var_os("CI").is_some() || marker.exists() {
        return false;
    }
    eprintln!("Some tests need programs that are not installed. Asked once; later: --install.");
    commands.iter().for_each(|words| eprintln!("    {}", words.join(" ")));
    eprint!("Run these commands? [y/N] ");
    let _ = io::stderr().flush();
    let mut answer = String::new();
    let read = io::stdin().lock().read_line(&mut answer);
    let _ = fs::create_dir_all(root.join("target/xtask")).and_then(|()| fs::write(marker, &answer));
    read.is_ok() && is_yes(&answer)
}

fn is_yes(answer: &str) -> bool {
    ["y", "yes"].contains(&answer.trim().to_lowercase().as_str())
}

/// Folder of the data sets: `named`, or `shared/data` beside the project.
pub(super) fn data(root: &Path, named: Option<PathBuf>) -> Option<PathBuf> {
    let beside = root.parent().map(|parent| parent.join("shared/data"));
    named.or_else(|| beside.filter(|folder| folder.is_dir()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joined(manager: Manager, programs: &[&Program]) -> Vec<String> {
        manager.commands(programs).iter().map(|words| words.join(" ")).collect()
    }

    #[test]
    fn missing_packages_are_installed_by_one_apt_command_after_an_update() {
        let [arm, riscv, browser] = &PROGRAMS;
        let root = Manager::Apt { sudo: false };
        let install = "apt-get install -y --no-install-recommends";
        assert_eq!(
            joined(root, &[arm, browser]),
            ["apt-get update".to_owned(), format!("{install} qemu-system-arm chromium")]
        );
        let user = joined(Manager::Apt { sudo: true }, &[riscv]);
        assert_eq!(
            user,
            ["sudo apt-get update".to_owned(), format!("sudo {install} qemu-system-misc")]
        );
    }

    #[test]
    fn homebrew_installs_each_package_once() {
        let [arm, riscv, browser] = &PROGRAMS;
        let commands = joined(Manager::Homebrew, &[arm, riscv, browser]);
        assert_eq!(commands, ["brew install qemu", "brew install --cask chromium"]);
    }

    #[test]
    fn only_a_yes_is_a_yes() {
        assert!(is_yes("y\n") && is_yes("Yes \n"));
        assert!(!is_yes("\n") && !is_yes("no\n") && !is_yes("yesterday"));
    }

    #[test]
    fn data_sets_are_found_beside_the_project_unless_a_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("project");
        assert_eq!(data(&root, None), None);
        fs::create_dir_all(folder.path().join("shared/data")).unwrap();
        assert_eq!(data(&root, None), Some(folder.path().join("shared/data")));
        assert_eq!(data(&root, Some("/named".into())), Some("/named".into()));
    }
}
