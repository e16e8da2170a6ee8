//! The page that is drawn from the table, and the aims that it names.

use std::fmt::Write;

use anyhow::{Context, Result, ensure};

use super::machine::{MACHINES, Machine};
use super::table::{TABLE, TOLERANCE_PERCENT, Table};

/// Where it lies.
pub(super) const PAGE: &str = "benches/record/cost.md";

/// Instructions a sample of CMSIS-DSP's FIR filters: 256 samples, 16 taps, Cortex-M4, counted the
/// same way in QEMU 7.2; gcc 12.2 -O3, ARM_MATH_LOOPUNROLL.
const CMSIS: [(&str, f64); 2] = [
    ("CMSIS-DSP `arm_fir_fast_q15`, 32-bit sums", CMSIS_FAST),
    ("CMSIS-DSP `arm_fir_q15`, 64-bit sums", 42.4),
];
/// The faster of them.
pub(super) const CMSIS_FAST: f64 = 30.9;
/// The case and the kernel that CMSIS-DSP's figures compare with.
const COMPARED: (&str, &str, &str) = ("cortex-m4", "dual_multiply", "256x16 one echo");
/// The whole pipeline's aim: this many times the reference of its filter alone.
const PIPELINE_AIM: f64 = 1.5;

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

/// Instructions a sample that the aims are about.
pub(super) struct Aims {
    /// Of the filter; at most [`CMSIS_FAST`].
    filter: f64,
    /// Of the whole pipeline; at most [`PIPELINE_AIM`] times that.
    pipeline: f64,
}

impl Aims {
    /// Reads them from a table.
    ///
    /// # Errors
    ///
    /// When the compared case is not in it.
    pub(super) fn from_table(table: &Table) -> Result<Self> {
        let (_, kernel, _) = COMPARED;
        let filter = per_sample(table, kernel, "filter")?;
        Ok(Self { filter, pipeline: per_sample(table, kernel, "pipeline")? })
    }

    /// # Errors
    ///
    /// Says which aim is missed.
    pub(super) fn check(&self) -> Result<()> {
        let Self { filter, pipeline } = self;
        let aim = PIPELINE_AIM * CMSIS_FAST;
        ensure!(
            *filter <= CMSIS_FAST,
            "the filter takes {filter:.1} instructions a sample, the aim is {CMSIS_FAST}"
        );
        ensure!(
            *pipeline <= aim,
            "the pipeline takes {pipeline:.2} instructions a sample, the aim is {aim:.2}"
        );
        Ok(())
    }

    /// The aims as a sentence of the page, and whether they are held.
    fn sentence(&self) -> String {
        let Self { filter, pipeline } = self;
        let aim = PIPELINE_AIM * CMSIS_FAST;
        let verdict = |is: f64, aim: f64| if is <= aim { "held" } else { "**not held**" };
        let (of_filter, of_pipeline) = (verdict(*filter, CMSIS_FAST), verdict(*pipeline, aim));
        format!(
            "Aims: filter at most {CMSIS_FAST}: {of_filter}.\n\
             Whole pipeline with one echo at most {PIPELINE_AIM} times that, {aim:.1}: \
             {of_pipeline} ({pipeline:.1})."
        )
    }
}

/// The table as a page to read, per sample.
///
/// # Errors
///
/// When the compared case is not in it.
pub(super) fn draw(table: &Table) -> Result<String> {
    let mut page = head(&table.measured_with);
    page += &beside_cmsis(table)?;
    writeln!(page, "\n{}", Aims::from_table(table)?.sentence())?;
    let mut drawn: Vec<(&str, String)> = Vec::new();
    for Machine { processor, target, emulator, machine, .. } in &MACHINES {
        let figures = stages(table, processor)?;
        let same = drawn.iter().find(|(_, other)| *other == figures);
        let shown = same.map_or_else(
            || figures.clone(),
            |(other, _)| format!("The same as {other}, which runs the same image.\n"),
        );
        let on = format!("`{target}` on `{emulator} -M {machine}`");
        write!(page, "\n## {processor}\n\n{on}, instructions per sample.\n\n{shown}")?;
        drawn.push((processor, figures));
    }
    Ok(page)
}

fn head(measured_with: &str) -> String {
    format!(
        "# Cost on the microcontroller\n\n\
         Drawn by `cargo xtask cost --update` from `{TABLE}`; `cargo xtask cost` counts\n\
         again and fails when a figure grew by more than {TOLERANCE_PERCENT} %.\n\
         Counted with {measured_with}.\n\n\
         Instructions, not cycles: QEMU counts them exactly and knows no pipeline, cache or wait\n\
         state. The same image first compares the kernels with their portable form. Where \
         there are\n\
         several shots, each costs `shot` and all of them `sum` more; the pipeline has neither.\n\n"
    )
}

/// Our filter and theirs, one row each.
fn beside_cmsis(table: &Table) -> Result<String> {
    let mut text = String::from(
        "## The filter beside CMSIS-DSP\n\n\
         256 samples, 16 taps, Cortex-M4, the filter alone. Our sums are exact and rounded to\n\
         nearest; CMSIS-DSP's are cut off, and it copies its input into its state, which here the\n\
         baseline stage has done. CMSIS-DSP was compiled by gcc 12.2 with -O3 and\n\
         ARM_MATH_LOOPUNROLL, and counted in QEMU 7.2 too.\n\n\
         | | instructions per sample |\n|---|---|\n",
    );
    let (_, fastest, _) = COMPARED;
    for kernel in [fastest, "portable"] {
        writeln!(text, "| ours, `{kernel}` | {:.1} |", per_sample(table, kernel, "filter")?)?;
    }
    for (name, instructions) in CMSIS {
        writeln!(text, "| {name} | {instructions} |")?;
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
    use crate::shell::workspace;

    #[test]
    fn the_page_is_what_the_table_says_and_the_aims_are_held() {
        let read = |path| std::fs::read_to_string(workspace().unwrap().join(path)).unwrap();
        let table = Table::from_text(&read(TABLE)).unwrap();
        assert_eq!(draw(&table).unwrap(), read(PAGE), "cargo xtask cost --update");
        Aims::from_table(&table).unwrap().check().unwrap();
    }
}
