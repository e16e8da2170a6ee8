//! `cargo xtask cost`: instructions of the stages on microcontrollers, against a committed table.
//!
//! `firmware/image/src/bin/cost` checks the kernels and counts; QEMU runs it with a clock that
//! advances by instructions, so every run counts the same. The table is `firmware/image/cost.tsv`;
//! `benches/record/cost.md` is drawn from it.

mod machine;
mod page;
mod table;

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use std::{env, fs, thread};

use anyhow::{Context, Result, bail, ensure};

use crate::firmware;
use crate::shell::{first_line, on_path, today, workspace};
use machine::{MACHINES, Machine};
use page::{Aim, CMSIS_FAST, PAGE, aims};
use table::{TABLE, TOLERANCE_PERCENT, Table, compare, parse};

/// Timeout of an emulator.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Counts on the processors of some targets, or on all, and compares with the committed table, or
/// rewrites it.
///
/// # Errors
///
/// When the image finds a kernel that differs from its portable form, or a figure grew.
pub(crate) fn run(update: bool, targets: &[String]) -> Result<()> {
    let is_counted = |machine: &&Machine| {
        targets.is_empty() || targets.iter().any(|name| name == machine.target.name)
    };
    let machines: Vec<&Machine> = MACHINES.iter().filter(is_counted).collect();
    let Some(counted) = count(&machines)? else { return Ok(()) };
    if update { write(&counted) } else { check(counted) }
}

fn write(counted: &Table) -> Result<()> {
    let root = workspace()?;
    fs::write(root.join(TABLE), counted.to_text())?;
    fs::write(root.join(PAGE), page::draw(counted)?)?;
    println!("wrote {TABLE} and {PAGE}");
    Ok(())
}

/// Compares with the committed table and the aims; processors that were not counted keep their
/// committed figures.
fn check(mut counted: Table) -> Result<()> {
    let root = workspace()?;
    let text =
        fs::read_to_string(root.join(TABLE)).with_context(|| format!("cannot read {TABLE}"))?;
    let committed = Table::from_text(&text)?;
    let figures = counted.figures.len();
    counted.complete(&committed);
    let (ours, theirs) = (&counted.measured_with, &committed.measured_with);
    if counted.compiler() != committed.compiler() {
        ensure!(
            env::var_os("CI").is_none(),
            "counted with {ours}, the table with {theirs}: cargo xtask cost --update"
        );
        println!("{ours} against {theirs}: not compared; the kernels equal their portable forms");
        return Ok(());
    }
    let (grown, shrunk) = compare(&committed, &counted);
    shrunk.iter().for_each(|line| println!("less: {line}"));
    ensure!(
        grown.is_empty(),
        "{} figures grew by more than {TOLERANCE_PERCENT} %, in instructions per waveform:\n  {}\n\
         the table was counted with {theirs}, this with {ours}\n\
         if it is worth it: cargo xtask cost --update, and say why in the commit",
        grown.len(),
        grown.join("\n  "),
    );
    let drawn = fs::read_to_string(root.join(PAGE)).unwrap_or_default();
    ensure!(
        drawn == page::draw(&committed)?,
        "{PAGE} is not what {TABLE} says: cargo xtask cost --update"
    );
    aims(&counted)?.iter().try_for_each(Aim::check)?;
    println!("{figures} figures, none grew by more than {TOLERANCE_PERCENT} %");
    Ok(())
}

/// Counts as JSON: `/processor/kernel/case/stage`, instructions a waveform, and
/// `/cmsis-dsp/arm_fir_fast_q15`, instructions a sample of the filter that ours is compared with.
/// `None` when a toolchain or an emulator is missing.
///
/// # Errors
///
/// When the image finds a kernel that differs from its portable form; where `CI` is set, when
/// something is missing.
pub(crate) fn counted() -> Result<Option<serde_json::Value>> {
    let Some(table) = count(&MACHINES.iter().collect::<Vec<_>>())? else { return Ok(None) };
    let mut tree = serde_json::json!({});
    for ([processor, kernel, case, stage], instructions) in table.figures {
        tree[processor][kernel][case][stage] = instructions.into();
    }
    tree["cmsis-dsp"]["arm_fir_fast_q15"] = CMSIS_FAST.into();
    Ok(Some(tree))
}

/// Figures of some processors; `None`, reported, when a toolchain or an emulator is missing, which
/// is an error where `CI` is set.
fn count(machines: &[&Machine]) -> Result<Option<Table>> {
    match machines.iter().try_for_each(|machine| check_installed(machine)) {
        Ok(()) => count_all(machines).map(Some),
        Err(error) if env::var_os("CI").is_some() => {
            bail!("the cost on a microcontroller cannot be counted: {error:#}")
        }
        Err(error) => {
            eprintln!("SKIPPED: the cost on a microcontroller was not counted: {error:#}");
            Ok(None)
        }
    }
}

/// Fails when a machine's toolchain or emulator is missing.
fn check_installed(Machine { target, emulator, package, .. }: &Machine) -> Result<()> {
    firmware::toolchain(target)?;
    ensure!(on_path(emulator), "no {emulator}; run: apt-get install {package}");
    Ok(())
}

fn count_all(machines: &[&Machine]) -> Result<Table> {
    let mut table = Table { measured_with: measured_with()?, figures: Vec::new() };
    let mut images = BTreeMap::new();
    for machine in machines {
        let target = &machine.target;
        if !images.contains_key(target.name) {
            let image = firmware::build("echoloop-image", "echoloop-cost", target)?;
            images.insert(target.name, image);
        }
        let image = &images[target.name];
        let output =
            emulate(machine, image).with_context(|| format!("{} in QEMU", machine.processor))?;
        let figures = output.lines().filter_map(|line| line.strip_prefix("cost\t"));
        for figure in figures {
            table.figures.push(parse(&format!("{}\t{figure}", machine.processor))?);
        }
    }
    Ok(table)
}

/// Output of an image; fails unless its last line is `end`.
fn emulate(machine: &Machine, image: &Path) -> Result<String> {
    let mut command = Command::new(machine.emulator);
    command
        .args(["-M", machine.machine, "-display", "none", "-monitor", "none", "-serial", "stdio"])
        .args(["-icount", &format!("shift={},sleep=off", machine.shift)])
        .args(["-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(image);
    if machine.machine == "virt" {
        command.args(["-bios", "none"]);
    }
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn()?;
    let mut stdout = child.stdout.take().context("no output")?;
    let reader = thread::spawn(move || {
        let mut output = String::new();
        stdout.read_to_string(&mut output).map(|_| output)
    });
    let deadline = Instant::now() + TIMEOUT;
    let status = loop {
        match child.try_wait()? {
            Some(status) => break Some(status),
            None if Instant::now() > deadline => break None,
            None => thread::sleep(Duration::from_millis(5)),
        }
    };
    if status.is_none() {
        child.kill()?;
        child.wait()?;
    }
    let output = reader.join().ok().context("cannot read")??;
    let last = output.lines().last().unwrap_or("nothing");
    match status {
        None => bail!("did not end in {TIMEOUT:?}; its last line: {last}"),
        Some(status) => {
            ensure!(status.success() && last == "end", "{status}; its last line: {last}")
        }
    }
    Ok(output)
}

/// Versions and date.
fn measured_with() -> Result<String> {
    let rustc = firmware::toolchain(&MACHINES[0].target)?.version().to_owned();
    let qemu = first_line("qemu-system-arm", &["--version"])?;
    let qemu = qemu.replace("QEMU emulator version", "QEMU");
    let qemu = qemu.split(" (").next().unwrap_or_default();
    Ok(format!("{rustc}, {qemu}, {}", today()))
}
