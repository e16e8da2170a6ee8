//! `cargo xtask cost`: what the stages cost on a microcontroller, in instructions, against a
//! committed table.
//!
//! `firmware/image/src/bin/cost` checks the kernels and counts; QEMU runs it with a clock that
//! advances by instructions, so every run counts the same. The table is `firmware/image/cost.tsv`;
//! `docs/cost.md` is drawn from it.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use std::{env, fs, thread};

use anyhow::{Context, Result, bail, ensure};

use crate::{firmware, workspace};

/// A processor, and how QEMU runs an image on it.
struct Machine {
    processor: &'static str,
    target: &'static str,
    emulator: &'static str,
    /// Debian's name of what the emulator is in.
    package: &'static str,
    machine: &'static str,
    /// Nanoseconds an instruction takes, as a power of two: SysTick sees 64, minstret is scaled by
    /// it.
    shift: u32,
}

const MACHINES: [Machine; 4] = {
    const fn arm(processor: &'static str, target: &'static str, machine: &'static str) -> Machine {
        let (emulator, package) = ("qemu-system-arm", "qemu-system-arm");
        Machine { processor, target, emulator, package, machine, shift: 6 }
    }
    [
        arm("cortex-m4", "thumbv7em-none-eabihf", "mps2-an386"),
        arm("cortex-m7", "thumbv7em-none-eabihf", "mps2-an500"),
        arm("cortex-m33", "thumbv8m.main-none-eabihf", "mps2-an505"),
        Machine {
            processor: "rv32imac",
            target: "riscv32imac-unknown-none-elf",
            emulator: "qemu-system-riscv32",
            package: "qemu-system-misc",
            machine: "virt",
            shift: 0,
        },
    ]
};

/// Instructions a sample of CMSIS-DSP's FIR filters: 256 samples, 16 taps, Cortex-M4, counted the
/// same way in QEMU 7.2; gcc 12.2 -O3, ARM_MATH_LOOPUNROLL.
const CMSIS: [(&str, f64); 2] = [
    ("CMSIS-DSP `arm_fir_fast_q15`, 32-bit sums", CMSIS_FAST),
    ("CMSIS-DSP `arm_fir_q15`, 64-bit sums", 42.4),
];
const CMSIS_FAST: f64 = 30.9;
/// The case and the kernel that CMSIS-DSP's figures compare with.
const COMPARED: (&str, &str, &str) = ("cortex-m4", "dual_multiply", "256x16 one echo");
/// The whole pipeline's aim: this many times the reference of its filter alone.
const PIPELINE_AIM: f64 = 1.5;

/// A figure may grow by this much before it fails.
const TOLERANCE_PERCENT: u64 = 2;
/// … or by this many instructions, where that is more: the clock's resolution.
const TOLERANCE_INSTRUCTIONS: u64 = 2;

/// An emulator that runs longer hangs.
const PATIENCE: Duration = Duration::from_secs(60);

const TABLE: &str = "firmware/image/cost.tsv";
const DOCUMENT: &str = "docs/cost.md";

/// Processor, kernel, case, stage: what a figure is of.
type Name = [String; 4];

/// Instructions per waveform, and with what they were counted.
#[derive(Debug, Default, PartialEq)]
struct Table {
    /// Versions and date, one line.
    measured_with: String,
    /// In the order they were counted.
    figures: Vec<(Name, u64)>,
}

/// Counts and compares with the committed table, or rewrites it.
///
/// # Errors
///
/// When the image finds a kernel that differs from its twin, or a figure grew.
pub(crate) fn run(update: bool) -> Result<()> {
    let root = workspace()?;
    if !can_build()? || !can_emulate()? {
        return Ok(());
    }
    let counted = count_all()?;
    if update {
        fs::write(root.join(TABLE), counted.to_text())?;
        fs::write(root.join(DOCUMENT), document(&counted)?)?;
        println!("wrote {TABLE} and {DOCUMENT}");
        return Ok(());
    }
    let text =
        fs::read_to_string(root.join(TABLE)).with_context(|| format!("cannot read {TABLE}"))?;
    let committed = Table::of_text(&text)?;
    let compiler =
        |table: &Table| table.measured_with.split(", ").next().unwrap_or_default().to_owned();
    if compiler(&counted) != compiler(&committed) {
        ensure!(
            env::var_os("CI").is_none(),
            "counted with {}, the table with {}: cargo xtask cost --update",
            counted.measured_with,
            committed.measured_with
        );
        println!(
            "{} against {}: not compared; the kernels equal their twins",
            counted.measured_with, committed.measured_with
        );
        return Ok(());
    }
    let (grown, shrunk) = compare(&committed, &counted);
    shrunk.iter().for_each(|line| println!("less: {line}"));
    if !grown.is_empty() {
        bail!(
            "{} figures grew by more than {TOLERANCE_PERCENT} %, in instructions per waveform:\n  {}\n\
             the table was counted with {}, this with {}\n\
             if it is worth it: cargo xtask cost --update, and say why in the commit",
            grown.len(),
            grown.join("\n  "),
            committed.measured_with,
            counted.measured_with
        );
    }
    let drawn = fs::read_to_string(root.join(DOCUMENT)).unwrap_or_default();
    ensure!(
        drawn == document(&committed)?,
        "{DOCUMENT} is not what {TABLE} says: cargo xtask cost --update"
    );
    let [filter, pipeline] = aims(&counted)?;
    ensure!(
        filter <= CMSIS_FAST,
        "the filter takes {filter:.1} instructions a sample, the aim is {CMSIS_FAST}"
    );
    let aim = PIPELINE_AIM * CMSIS_FAST;
    ensure!(
        pipeline <= aim,
        "the pipeline takes {pipeline:.2} instructions a sample, the aim is {aim:.2}"
    );
    println!("{} figures, none grew by more than {TOLERANCE_PERCENT} %", counted.figures.len());
    Ok(())
}

/// Whether there is a toolchain for every processor; where nobody would see that there is none,
/// that is an error.
fn can_build() -> Result<bool> {
    for machine in &MACHINES {
        match firmware::toolchain(machine.target) {
            Err(error) if env::var_os("CI").is_some() => return Err(error),
            Err(error) => {
                eprintln!("SKIPPED: the cost on a microcontroller was not counted: {error:#}");
                return Ok(false);
            }
            Ok(_) => {}
        }
    }
    Ok(true)
}

/// Whether every emulator is there; where nobody would see that one is not, that is an error.
fn can_emulate() -> Result<bool> {
    let Some(missing) = MACHINES.iter().find(|machine| !crate::on_path(machine.emulator)) else {
        return Ok(true);
    };
    let how = format!("no {}; run: apt-get install {}", missing.emulator, missing.package);
    if env::var_os("CI").is_some() {
        bail!("the cost on a microcontroller cannot be counted: {how}");
    }
    eprintln!("SKIPPED: the cost on a microcontroller was not counted: {how}");
    Ok(false)
}

fn count_all() -> Result<Table> {
    let mut table = Table { measured_with: measured_with()?, figures: Vec::new() };
    let mut images = BTreeMap::new();
    for machine in &MACHINES {
        if !images.contains_key(machine.target) {
            images.insert(machine.target, firmware::build(machine.target, "echoloop-cost")?);
        }
        let image = &images[machine.target];
        let output =
            emulate(machine, image).with_context(|| format!("{} in QEMU", machine.processor))?;
        let figures = output.lines().filter_map(|line| line.strip_prefix("cost\t"));
        for figure in figures {
            table.figures.push(parse(&format!("{}\t{figure}", machine.processor))?);
        }
    }
    Ok(table)
}

/// The image's output; fails unless it says that all went well.
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
    let deadline = Instant::now() + PATIENCE;
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
        None => bail!("did not end in {PATIENCE:?}; its last line: {last}"),
        Some(status) => {
            ensure!(status.success() && last == "end", "{status}; its last line: {last}")
        }
    }
    Ok(output)
}

/// Versions and date.
fn measured_with() -> Result<String> {
    let first_line = |program: &str, argument: &str| -> Result<String> {
        let output = Command::new(program)
            .arg(argument)
            .output()
            .with_context(|| format!("cannot run {program}"))?;
        Ok(String::from_utf8_lossy(&output.stdout).lines().next().unwrap_or_default().to_owned())
    };
    let rustc = firmware::toolchain(MACHINES[0].target)?.version().to_owned();
    let qemu = first_line("qemu-system-arm", "--version")?.replace("QEMU emulator version", "QEMU");
    let qemu = qemu.split(" (").next().unwrap_or_default().to_owned();
    Ok(format!("{rustc}, {qemu}, {}", first_line("date", "+%F")?))
}

fn parse(line: &str) -> Result<(Name, u64)> {
    let fields: Vec<&str> = line.split('\t').collect();
    let [processor, kernel, case, stage, instructions] = fields[..] else {
        bail!("not a figure: {line:?}")
    };
    Ok(([processor, kernel, case, stage].map(str::to_owned), instructions.parse()?))
}

impl Table {
    fn of_text(text: &str) -> Result<Self> {
        let (comments, figures): (Vec<&str>, Vec<&str>) =
            text.lines().partition(|line| line.starts_with('#'));
        let measured_with = comments
            .first()
            .and_then(|line| line.strip_prefix("# "))
            .unwrap_or_default()
            .to_owned();
        Ok(Self { measured_with, figures: figures.into_iter().map(parse).collect::<Result<_>>()? })
    }

    fn to_text(&self) -> String {
        let mut text = format!(
            "# {}\n# Instructions per waveform: `cargo xtask cost` compares, with `--update` rewrites.\n\
             # processor\tkernel\tcase\tstage\tinstructions\n",
            self.measured_with
        );
        for (name, instructions) in &self.figures {
            text += &format!("{}\t{instructions}\n", name.join("\t"));
        }
        text
    }

    fn get(&self, processor: &str, kernel: &str, case: &str, stage: &str) -> Option<u64> {
        let wanted = [processor, kernel, case, stage];
        self.figures.iter().find(|(name, _)| *name == wanted).map(|(_, instructions)| *instructions)
    }
}

/// What grew by more than the tolerance, or came or went; and what shrank by more.
fn compare(committed: &Table, counted: &Table) -> (Vec<String>, Vec<String>) {
    let old: BTreeMap<&Name, u64> = committed.figures.iter().map(|(name, n)| (name, *n)).collect();
    let new: BTreeMap<&Name, u64> = counted.figures.iter().map(|(name, n)| (name, *n)).collect();
    let exceeds = |more: u64, less: u64| {
        more > (less * (100 + TOLERANCE_PERCENT) / 100).max(less + TOLERANCE_INSTRUCTIONS)
    };
    let (mut grown, mut shrunk) = (Vec::new(), Vec::new());
    for (name, &before) in &old {
        let [processor, kernel, case, stage] = name;
        let title = format!("{stage} of {kernel} on {processor}, {case}");
        let Some(&now) = new.get(name) else {
            grown.push(format!("{title}: {before} -> not counted"));
            continue;
        };
        let percent = 100.0 * (now as f64 / before.max(1) as f64 - 1.0);
        let line = format!("{title}: {before} -> {now} ({percent:+.1} %)");
        if exceeds(now, before) {
            grown.push(line);
        } else if exceeds(before, now) {
            shrunk.push(line);
        }
    }
    let unknown = new.iter().filter(|(name, _)| !old.contains_key(*name));
    grown.extend(
        unknown.map(|(name, now)| format!("{}: not in the table -> {now}", name.join(" "))),
    );
    (grown, shrunk)
}

/// Samples of a case, from its name: `256x16 one echo` has 256.
fn samples(case: &str) -> Result<f64> {
    let digits = case.split('x').next().unwrap_or_default();
    digits.parse().with_context(|| format!("no samples in the name of case {case:?}"))
}

/// Instructions a sample of the compared case.
fn per_sample(table: &Table, kernel: &str, stage: &str) -> Result<f64> {
    let (processor, _, case) = COMPARED;
    let instructions = table
        .get(processor, kernel, case, stage)
        .context("the compared case is not in the table")?;
    Ok(instructions as f64 / samples(case)?)
}

/// What the aims are about: filter and pipeline.
fn aims(table: &Table) -> Result<[f64; 2]> {
    let (_, kernel, _) = COMPARED;
    Ok([per_sample(table, kernel, "filter")?, per_sample(table, kernel, "pipeline")?])
}

/// The table as a page to read, per sample.
fn document(table: &Table) -> Result<String> {
    let (_, kernel, _) = COMPARED;
    let [filter, pipeline] = aims(table)?;
    let mut text = format!(
        "# Cost on the microcontroller\n\n\
         Drawn by `cargo xtask cost --update` from `{TABLE}`; `cargo xtask cost` counts again and fails when a figure grew by\n\
         more than {TOLERANCE_PERCENT} %. Counted with {}.\n\n\
         Instructions, not cycles: QEMU counts them exactly and knows no pipeline, cache or wait state. The same image first\n\
         compares the kernels with their portable twin.\n\n\
         ## The filter beside CMSIS-DSP\n\n\
         256 samples, 16 taps, Cortex-M4, the filter alone. Our sums are exact and rounded to nearest; CMSIS-DSP's are cut off,\n\
         and it copies its input into its state, which here the baseline stage has done. CMSIS-DSP was compiled by gcc 12.2\n\
         with -O3 and ARM_MATH_LOOPUNROLL, and counted in QEMU 7.2 too.\n\n\
         | | instructions per sample |\n|---|---|\n",
        table.measured_with
    );
    writeln!(
        text,
        "| ours, `{kernel}` | {filter:.1} |\n| ours, `portable` | {:.1} |",
        per_sample(table, "portable", "filter")?
    )?;
    for (name, instructions) in CMSIS {
        writeln!(text, "| {name} | {instructions} |")?;
    }
    let verdict = |is: f64, aim: f64| if is <= aim { "held" } else { "**not held**" };
    writeln!(
        text,
        "\nAims: filter at most {CMSIS_FAST}: {}. Whole pipeline with one echo at most {PIPELINE_AIM} times that, {:.1}: {} ({pipeline:.1}).",
        verdict(filter, CMSIS_FAST),
        PIPELINE_AIM * CMSIS_FAST,
        verdict(pipeline, PIPELINE_AIM * CMSIS_FAST)
    )?;
    let mut drawn: Vec<(&str, String)> = Vec::new();
    for Machine { processor, target, emulator, machine, .. } in &MACHINES {
        let figures = stages(table, processor)?;
        let twin = drawn.iter().find(|(_, other)| *other == figures);
        let shown = twin.map_or_else(
            || figures.clone(),
            |(other, _)| format!("The same as {other}, which runs the same image.\n"),
        );
        write!(
            text,
            "\n## {processor}\n\n`{target}` on `{emulator} -M {machine}`, instructions per sample.\n\n{shown}"
        )?;
        drawn.push((processor, figures));
    }
    Ok(text)
}

/// A row of a processor's table: a case, a kernel, and the instructions of each stage.
struct Row<'a> {
    case: &'a str,
    kernel: &'a str,
    stages: Vec<(&'a str, u64)>,
}

/// One processor's figures: a row for each case and kernel, a column for each stage.
fn stages(table: &Table, processor: &str) -> Result<String> {
    let mut rows: Vec<Row> = Vec::new();
    for ([_, kernel, case, stage], instructions) in
        table.figures.iter().filter(|(name, _)| name[0] == processor)
    {
        match rows.last_mut().filter(|row| row.case == case && row.kernel == kernel) {
            Some(row) => row.stages.push((stage, *instructions)),
            None => rows.push(Row { case, kernel, stages: vec![(stage, *instructions)] }),
        }
    }
    let Some(first) = rows.first() else { return Ok("Not counted.\n".to_owned()) };
    let titles: Vec<&str> = first.stages.iter().map(|(stage, _)| *stage).collect();
    let rule = "---|".repeat(titles.len());
    let mut text =
        format!("| samples × taps | kernel | {} |\n|---|---|{rule}\n", titles.join(" | "));
    for Row { case, kernel, stages } in rows {
        let n = samples(case)?;
        let cells: Vec<String> =
            stages.iter().map(|(_, count)| format!("{:.2}", *count as f64 / n)).collect();
        writeln!(
            text,
            "| {} | `{kernel}` | {} |",
            case.replacen('x', " × ", 1),
            cells.join(" | ")
        )?;
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(figures: &[(&str, u64)]) -> Table {
        let name = |stage: &str| ["m4", "scalar", "8x2", stage].map(str::to_owned);
        let figures = figures.iter().map(|(stage, n)| (name(stage), *n)).collect();
        Table { measured_with: "rustc".to_owned(), figures }
    }

    #[test]
    fn a_table_comes_back_from_its_text() {
        let written = table(&[("filter", 1000), ("report", 0)]);
        assert_eq!(Table::of_text(&written.to_text()).unwrap(), written);
    }

    #[test]
    fn two_percent_more_passes_and_a_little_above_fails_by_name() {
        let before = table(&[("filter", 1000), ("report", 0)]);
        assert_eq!(compare(&before, &table(&[("filter", 1020), ("report", 2)])), (vec![], vec![]));
        let (grown, _) = compare(&before, &table(&[("filter", 1021), ("report", 0)]));
        assert_eq!(grown, ["filter of scalar on m4, 8x2: 1000 -> 1021 (+2.1 %)"]);
    }

    #[test]
    fn a_figure_that_came_or_went_fails_and_one_that_shrank_is_told() {
        let before = table(&[("filter", 1000)]);
        assert_eq!(compare(&before, &table(&[("peaks", 5)])).0.len(), 2);
        assert_eq!(
            compare(&before, &table(&[("filter", 900)])),
            (vec![], vec!["filter of scalar on m4, 8x2: 1000 -> 900 (-10.0 %)".to_owned()])
        );
    }
}
