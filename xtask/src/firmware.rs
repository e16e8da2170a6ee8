//! `cargo xtask firmware`: the images, what they take, and that they cannot panic.

use std::env;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::image::{self, Size};
use crate::shell::{succeed, workspace};
use crate::toolchain::Toolchain;

/// Targets there are images for, the reference board's first, and the memory map of each.
pub(crate) const TARGETS: [(&str, &str); 4] = [
    ("thumbv7em-none-eabihf", "memory.x"),
    ("thumbv8m.main-none-eabihf", "firmware/image/link/an505.x"),
    ("riscv32imac-unknown-none-elf", "firmware/image/link/virt.x"),
    ("thumbv6m-none-eabi", "memory.x"),
];

/// The target of `examples/own_firmware`.
const COPIED: &str = TARGETS[0].0;

/// The profile of the images.
const PROFILE: &str = "firmware";

/// Where they are built.
pub(crate) const TARGET_DIR: &str = "target/firmware";

/// `rust-version` of the workspace.
const AT_LEAST: (u32, u32) = (1, 93);

/// What builds for a target.
///
/// # Errors
///
/// When nothing here does.
pub(crate) fn toolchain(target: &str) -> Result<Toolchain> {
    Toolchain::find(target, AT_LEAST)
}

/// Builds the images for the tests that run them, having linted what only they compile. A target
/// that nothing here builds for is skipped aloud; where `CI` is set, that is a failure.
///
/// # Errors
///
/// As [`run`].
pub(crate) fn for_tests(lint: bool) -> Result<()> {
    let mut found = Vec::new();
    for (target, _) in TARGETS {
        match toolchain(target) {
            Ok(toolchain) => {
                found.push(target.to_owned());
                if lint && target == COPIED {
                    link_copied(&toolchain)?;
                }
                if lint && toolchain.is_prebuilt() {
                    // By itself without the log, which the images have.
                    clippy(&toolchain, target, "echoloop-sensor")?;
                    clippy(&toolchain, target, "echoloop-image")?;
                    // What users copy, too.
                    clippy(&toolchain, target, "echoloop-own-firmware")?;
                }
            }
            Err(error) if env::var_os("CI").is_some() => return Err(error),
            Err(error) => eprintln!("SKIPPED: {error:#}"),
        }
    }
    if found.is_empty() { Ok(()) } else { run(&found, false) }
}

/// Links the firmware that users copy, for the target that docs/porting.md names.
fn link_copied(toolchain: &Toolchain) -> Result<()> {
    let mut command = toolchain.cargo(COPIED);
    command.current_dir(workspace()?).args(["build", "--quiet", "--bin", "own-firmware"]);
    command.args(["--package", "echoloop-own-firmware", "--profile", PROFILE]);
    command.args(["--target", COPIED, "--target-dir", TARGET_DIR]);
    succeed(toolchain.finish(&mut command))
}

/// Lints a package as it is compiled for a target; a warning is an error.
fn clippy(toolchain: &Toolchain, target: &str, package: &str) -> Result<()> {
    let mut command = toolchain.cargo(target);
    command.current_dir(workspace()?).args(["clippy", "--quiet", "--package", package]);
    command.args(["--profile", PROFILE, "--target", target, "--target-dir", TARGET_DIR]);
    succeed(command.args(["--", "-D", "warnings"]))
}

/// Builds one of the image crate's programs for a target.
///
/// # Errors
///
/// When there is no toolchain for it, or the build fails.
pub(crate) fn build(target: &str, program: &str) -> Result<PathBuf> {
    let toolchain = toolchain(target)?;
    eprintln!("{target}: {}", toolchain.describe());
    let root = workspace()?;
    let mut command = toolchain.cargo(target);
    command.current_dir(&root).args([
        "build",
        "--quiet",
        "--package",
        "echoloop-image",
        "--bin",
        program,
    ]);
    command.args(["--profile", PROFILE, "--target", target, "--target-dir", TARGET_DIR]);
    command.env("DEFMT_LOG", "info");
    succeed(toolchain.finish(&mut command))?;
    Ok(root.join(TARGET_DIR).join(target).join(PROFILE).join(program))
}

/// Builds the sensor's images and reports on them.
///
/// # Errors
///
/// When one cannot be built, does not fit its board, has no bound on its stack, or can panic.
pub(crate) fn run(targets: &[String], verbose: bool) -> Result<()> {
    let chosen: Vec<(&str, &str)> = match targets {
        [] => TARGETS.to_vec(),
        some => some.iter().map(|target| known(target)).collect::<Result<_>>()?,
    };
    let (mut rows, mut panics) = (Vec::new(), Vec::new());
    for (target, map) in chosen {
        let elf = build(target, "echoloop-sensor")?;
        rows.push((target, check(&elf, map)?));
        panics.extend(
            image::panics(&image::read(&elf)?)?.iter().map(|symbol| format!("{target}: {symbol}")),
        );
    }
    println!(
        "{:<30} {:>9} {:>9} {:>9}   of flash, RAM",
        "image", "flash B", "statics B", "stack B"
    );
    for (target, (size, flash, ram)) in &rows {
        let Size { flash: in_flash, statics, stack, .. } = size;
        let share = |part: u64, whole: u64| 100.0 * part as f64 / whole as f64;
        let (of_flash, of_ram) = (share(*in_flash, *flash), share(statics + stack, *ram));
        println!(
            "{target:<30} {in_flash:>9} {statics:>9} {stack:>9}   {of_flash:.1} %, {of_ram:.1} %"
        );
        if verbose {
            for (name, frame) in &size.deepest {
                println!("    {frame:>7}  {name}");
            }
            println!("    without frame information: {}", size.unknown.join(", "));
        }
    }
    if !panics.is_empty() {
        bail!("an input may reach a panic:\n  {}", panics.join("\n  "));
    }
    println!("no panic in any of them");
    Ok(())
}

fn known(target: &str) -> Result<(&'static str, &'static str)> {
    let names: Vec<&str> = TARGETS.iter().map(|(name, _)| *name).collect();
    let found = TARGETS.into_iter().find(|(name, _)| *name == target);
    found.with_context(|| format!("--target {target}: there are images for {}", names.join(", ")))
}

/// What an image takes, with flash and RAM of its board.
pub(crate) fn check(elf: &Path, map: &str) -> Result<(Size, u64, u64)> {
    let bytes = image::read(elf)?;
    let script = std::fs::read_to_string(workspace()?.join(map))
        .with_context(|| format!("cannot read {map}"))?;
    let (flash, ram) = image::regions(&script).with_context(|| map.to_owned())?;
    let size = image::measure(&bytes, (flash, ram)).with_context(|| elf.display().to_string())?;
    // For the test that measures it on a board.
    let record = elf.with_extension("stack");
    std::fs::write(&record, size.stack.to_string())
        .with_context(|| format!("cannot write {}", record.display()))?;
    if size.flash > flash.length || size.statics + size.stack > ram.length {
        bail!("{} does not fit {map}: {size:?}", elf.display());
    }
    Ok((size, flash.length, ram.length))
}
