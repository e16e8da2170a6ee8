//! Project commands: `cargo xtask test`.

mod firmware;
mod fuzz;
mod image;
mod thumb;
mod toolchain;

use std::env;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use clap::Parser;

/// Project commands.
#[derive(Parser)]
#[command(name = "cargo xtask")]
enum Task {
    /// Everything that must hold before a change lands: format, lints, firmware for a microcontroller, all tests.
    Test {
        /// Only the tests.
        #[arg(long)]
        only_tests: bool,
    },
    /// The sensor's images for microcontrollers, with flash, RAM and worst-case stack; fails when one can panic.
    Firmware {
        /// Only for this target; may be repeated.
        #[arg(long, value_name = "TRIPLE")]
        target: Vec<String>,
        /// Also print the deepest path of calls.
        #[arg(short, long)]
        verbose: bool,
    },
    /// The speed record: every criterion bench.
    Bench,
    /// Bytes nobody chose, on the link and in the flash: every fuzz target for a while.
    Fuzz {
        /// How long each target runs.
        #[arg(long, default_value_t = 60)]
        seconds: u32,
    },
}

/// The target whose build shows that the firmware needs no std.
const MICROCONTROLLER: &str = "thumbv7em-none-eabihf";

fn main() -> Result<()> {
    match Task::parse() {
        Task::Test { only_tests } => test(only_tests),
        Task::Firmware { target, verbose } => firmware::run(&target, verbose),
        Task::Bench => cargo(["bench", "--workspace"]),
        Task::Fuzz { seconds } => fuzz::run(seconds),
    }
}

fn test(only_tests: bool) -> Result<()> {
    say_what_is_missing();
    if !only_tests {
        cargo(["fmt", "--all", "--check"])?;
        cargo(["clippy", "--workspace", "--all-targets", "--quiet", "--", "-D", "warnings"])?;
        build_firmware()?;
    }
    cargo(["test", "--workspace"])
}

/// Tests skip what they cannot do, aloud; this says it before they begin.
fn say_what_is_missing() {
    if env::var_os("ECHOLOOP_DATA").is_none() {
        eprintln!(
            "note: ECHOLOOP_DATA is not set: tests on real scans and meshes will be skipped (see README.md, Data)"
        );
    }
    let browser = ["chromium", "chromium-browser", "google-chrome"].into_iter().any(on_path);
    if !browser {
        eprintln!("note: no Chromium: the report will not be looked at (apt-get install chromium)");
    }
}

fn on_path(name: &str) -> bool {
    let Some(path) = env::var_os("PATH") else { return false };
    env::split_paths(&path).any(|folder| folder.join(name).is_file())
}

/// Builds the firmware crates alone, so that no feature of the host's leaks in, for a target without std.
fn build_firmware() -> Result<()> {
    if !target_is_installed()? {
        let how = format!("run: rustup target add {MICROCONTROLLER}");
        if env::var_os("CI").is_some() {
            bail!("no core library for {MICROCONTROLLER}; {how}");
        }
        eprintln!("SKIPPED: the firmware was not built for {MICROCONTROLLER}; {how}");
        return Ok(());
    }
    for features in ["", "defmt"] {
        let arguments = ["--features", features, "--target", MICROCONTROLLER, "--target-dir", "target/firmware"];
        cargo(["build", "--quiet", "--release", "--package", "echoloop-sensor"].into_iter().chain(arguments))?;
    }
    Ok(())
}

fn target_is_installed() -> Result<bool> {
    let rustc = env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc)
        .args(["--print", "target-libdir", "--target", MICROCONTROLLER])
        .output()
        .context("cannot run rustc")?;
    let folder = String::from_utf8_lossy(&output.stdout);
    Ok(output.status.success() && Path::new(folder.trim()).is_dir())
}

/// Runs cargo in the workspace's root, and fails when it does.
fn cargo<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Result<()> {
    let root = workspace()?;
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root).args(arguments);
    let shown = format!("{command:?}");
    eprintln!("+ {shown}");
    if !command.status().with_context(|| format!("cannot run {shown}"))?.success() {
        bail!("failed: {shown}");
    }
    Ok(())
}

/// The workspace's root.
fn workspace() -> Result<PathBuf> {
    Ok(Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?.to_owned())
}
