//! `cargo xtask firmware`: size and stack of the images, and a check that they cannot panic.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::image::{self, Map, Size};
use crate::shell::{succeed, workspace};
use crate::target::{ARMV6M, ARMV7EM, ARMV8M, CORTEX_M55, RV32, Target};
use crate::toolchain::Toolchain;

/// A program for a microcontroller.
pub(crate) struct Image {
    /// Name on pages: its target or its part, after its kind if it is not the whole sensor.
    pub(crate) name: &'static str,
    package: &'static str,
    program: &'static str,
    /// Target of its build.
    pub(crate) target: Target,
    /// Linker script that begins with its board's memory map.
    map: &'static str,
    /// Number of exceptions that can interrupt each other; all others are masked, or wait.
    nested: u64,
    /// Functions of its start that can panic by their constants alone, at every start or at none,
    /// whatever the input. A test of each shows that it does not.
    by_constants: &'static [&'static str],
}

impl Image {
    /// Image of an emulated board.
    const fn emulated(target: Target, map: &'static str, nested: u64) -> Self {
        let (package, program) = ("echoloop-image", "echoloop-sensor");
        Self { name: target.name, package, program, target, map, nested, by_constants: &[] }
    }

    /// Example with the detector alone, for the same board.
    const fn detector_of(name: &'static str, board: &Self) -> Self {
        let (package, program) = ("echoloop-detector-firmware", "detector-firmware");
        Self { name, package, program, ..Self::emulated(board.target, board.map, board.nested) }
    }

    /// See [`build`].
    pub(crate) fn build(&self) -> Result<PathBuf> {
        build(self.package, self.program, &self.target)
    }
}

/// An NMI in a hard fault, on Arm.
const FAULTS: u64 = 2;

/// The reference board.
const CORTEX_M4: Image = Image::emulated(ARMV7EM, "memory.x", FAULTS);
const CORTEX_M0: Image = Image::emulated(ARMV6M, "memory.x", FAULTS);
const RISC_V: Image = Image::emulated(RV32, "firmware/image/link/virt.x", 1);

/// The images, the reference board's first.
pub(crate) const IMAGES: [Image; 10] = [
    CORTEX_M4,
    Image::emulated(ARMV8M, "firmware/image/link/an505.x", FAULTS),
    Image::emulated(CORTEX_M55, "firmware/image/link/an547.x", FAULTS),
    RISC_V,
    CORTEX_M0,
    Image {
        name: "stm32f405",
        package: "echoloop-stm32f4",
        program: "echoloop-stm32f405",
        target: ARMV7EM,
        map: "firmware/stm32f4/link/stm32f405.x",
        nested: FAULTS + 1, // the link's interrupt or the tick: of one priority
        by_constants: &["echoloop_stm32f4::clock::start", "echoloop_part::log::debugger"],
    },
    Image {
        name: "nrf52840",
        package: "echoloop-nrf52840",
        program: "echoloop-nrf52840",
        target: ARMV7EM,
        map: "firmware/nrf52840/link/nrf52840.x",
        nested: FAULTS + 1, // the link's interrupt or the tick: of one priority
        by_constants: &["echoloop_part::log::debugger"],
    },
    Image::detector_of("detector thumbv7em-none-eabihf", &CORTEX_M4),
    Image {
        map: "examples/detector_firmware/riscv.x",
        ..Image::detector_of("detector riscv32imac-unknown-none-elf", &RISC_V)
    },
    Image::detector_of("detector thumbv6m-none-eabi", &CORTEX_M0),
];

/// Targets of lints: all but the least Arm, as all of its code is compiled for another, too.
const LINTED: [Target; 4] = [ARMV7EM, ARMV8M, CORTEX_M55, RV32];

/// The target of `examples/own_firmware`.
const COPIED: &Target = &IMAGES[0].target;

/// Packages that are also linted alone, without the log of the sensor's images, for [`COPIED`]:
/// their code depends on a target only as far as it is Arm.
const UNLOGGED: [&str; 2] = ["echoloop-sensor", "echoloop-own-firmware"];

/// The profile of the images.
const PROFILE: &str = "firmware";

/// `rust-version` of the workspace.
const AT_LEAST: (u32, u32) = (1, 93);

/// Toolchain for a target.
pub(crate) fn toolchain(target: &Target) -> Result<Toolchain> {
    Toolchain::find(target, AT_LEAST)
}

/// Builds and measures the images of some targets, or of all; with `lint`, lints their code first.
/// For tests, a target without a toolchain is reported and skipped, but where `CI` is set.
///
/// # Errors
///
/// When a target is unknown, a lint warns, or an image cannot be built, does not fit its board, has
/// no bound on its stack, or can panic.
pub(crate) fn checked(names: &[String], verbose: bool, lint: bool, for_tests: bool) -> Result<()> {
    let known: Vec<&str> = targets().iter().map(|target| target.name).collect();
    if let Some(unknown) = names.iter().find(|name| !known.contains(&name.as_str())) {
        bail!("--target {unknown}: there are images for {}", known.join(", "));
    }
    let is_chosen =
        |target: &&Target| names.is_empty() || names.iter().any(|name| name == target.name);
    let mut found = Vec::new();
    for target in targets().into_iter().filter(is_chosen) {
        match toolchain(target) {
            Ok(toolchain) => {
                found.push(target);
                if lint {
                    lint_for(target, &toolchain)?;
                }
            }
            Err(error) if !for_tests || env::var_os("CI").is_some() => return Err(error),
            Err(error) => eprintln!("SKIPPED: {error:#}"),
        }
    }
    let images: Vec<&Image> =
        IMAGES.iter().filter(|image| found.contains(&&image.target)).collect();
    if images.is_empty() { Ok(()) } else { run(&images, verbose) }
}

/// Links the example that users copy, and lints the code for this target alone.
fn lint_for(target: &Target, toolchain: &Toolchain) -> Result<()> {
    if target == COPIED {
        link_copied(toolchain)?;
    }
    if LINTED.contains(target) && toolchain.is_prebuilt() {
        let images = IMAGES.iter().filter(|image| image.target == *target);
        let unlogged = UNLOGGED.into_iter().filter(|_| target == COPIED);
        for package in images.map(|image| image.package).chain(unlogged) {
            clippy(toolchain, target, package)?;
        }
    }
    Ok(())
}

/// Every target once.
pub(crate) fn targets() -> Vec<&'static Target> {
    let mut targets: Vec<&Target> = Vec::new();
    for Image { target, .. } in &IMAGES {
        if !targets.contains(&target) {
            targets.push(target);
        }
    }
    targets
}

/// Links the firmware that users copy, for the target that docs/porting.md names.
fn link_copied(toolchain: &Toolchain) -> Result<()> {
    let mut command = toolchain.cargo(COPIED);
    command.current_dir(workspace()?).args(["build", "--quiet", "--bin", "own-firmware"]);
    command.args(["--package", "echoloop-own-firmware", "--profile", PROFILE]);
    for_target(&mut command, COPIED);
    succeed(toolchain.finish(&mut command))
}

/// Lints a package as it is compiled for a target; a warning is an error.
fn clippy(toolchain: &Toolchain, target: &Target, package: &str) -> Result<()> {
    let mut command = toolchain.cargo(target);
    command.current_dir(workspace()?).args(["clippy", "--quiet", "--package", package]);
    for_target(command.args(["--profile", PROFILE]), target);
    succeed(command.args(["--", "-D", "warnings"]))
}

/// Sets cargo's target and its folder.
fn for_target(command: &mut Command, target: &Target) {
    command.args(["--target", target.triple, "--target-dir"]).arg(target.folder());
}

/// Builds a program for a target.
pub(crate) fn build(package: &str, program: &str, target: &Target) -> Result<PathBuf> {
    let toolchain = toolchain(target)?;
    eprintln!("{}: {}", target.name, toolchain.describe());
    let root = workspace()?;
    let mut command = toolchain.cargo(target);
    command.current_dir(&root).args(["rustc", "--quiet", "--package", package, "--bin", program]);
    for_target(command.args(["--profile", PROFILE]), target);
    command.env("DEFMT_LOG", "info");
    // Relocations show the calls, for the bound on the stack.
    succeed(toolchain.finish(&mut command).args(["--", "-Clink-arg=--emit-relocs"]))?;
    Ok(root.join(target.folder()).join(target.triple).join(PROFILE).join(program))
}

/// Builds images and reports on them.
fn run(images: &[&Image], verbose: bool) -> Result<()> {
    let (mut rows, mut panics) = (Vec::new(), Vec::new());
    for image in images {
        let elf = image.build()?;
        rows.push((image.name, check(&elf, image)?));
        let found = image::panics(&image::read(&elf)?, image.by_constants)?;
        panics.extend(found.iter().map(|symbol| format!("{}: {symbol}", image.name)));
    }
    println!(
        "{:<38} {:>9} {:>9} {:>9}   of flash, RAM",
        "image", "flash B", "statics B", "stack B"
    );
    for (name, (size, map)) in &rows {
        let Size { flash: in_flash, statics, stack, .. } = size;
        let share = |part: u64, whole: u64| 100.0 * part as f64 / whole as f64;
        let of_flash = share(*in_flash, map.flash_bytes());
        let of_ram = share(statics + stack, map.ram.length);
        println!(
            "{name:<38} {in_flash:>9} {statics:>9} {stack:>9}   {of_flash:.1} %, {of_ram:.1} %"
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

/// Size of an image, and the memory map of its board, which it fits.
pub(crate) fn check(elf: &Path, image: &Image) -> Result<(Size, Map)> {
    let bytes = image::read(elf)?;
    let script = std::fs::read_to_string(workspace()?.join(image.map))
        .with_context(|| format!("cannot read {}", image.map))?;
    let map = image::regions(&script).with_context(|| image.map.to_owned())?;
    let size =
        image::measure(&bytes, &map, image.nested).with_context(|| elf.display().to_string())?;
    // For the test that measures it on a board.
    let record = elf.with_extension("stack");
    std::fs::write(&record, size.stack.to_string())
        .with_context(|| format!("cannot write {}", record.display()))?;
    ensure!(map.fits(&size), "{} does not fit {}: {size:?}", elf.display(), image.map);
    Ok((size, map))
}
