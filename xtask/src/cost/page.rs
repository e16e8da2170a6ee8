//! Page of the table, and the aims on it.

use std::fmt::Write;

use anyhow::{Context, Result, ensure};

use super::machine::{MACHINES, Machine};
use super::table::{TABLE, TOLERANCE_PERCENT, Table};

/// The page.
pub(super) const PAGE: &str = "benches/record/cost.md";

/// Instructions a sample of CMSIS-DSP's FIR filters: 256 samples, 16 taps, Cortex-M4, counted the
/// same way in QEMU 7.2; gcc 12.2 -O3, ARM_MATH_LOOPUNROLL.
const CMSIS: [(&str, f64); 2] = [
    ("CMSIS-DSP `arm_fir_fast_q15`, 32-bit sums", CMSIS_FAST),
    ("CMSIS-DSP `arm_fir_q15`, 64-bit sums", 42.4),
];
/// The faster of them.
pub(super) const CMSIS_FAST: f64 = 30.9;
/// Case of the aims.
const CASE: &str = "256x16 one echo";
/// Processor and kernel beside CMSIS-DSP's figures.
const M4: (&str, &str) = ("cortex-m4", "dual_multiply");
/// Processor and kernel that take eight samples at a time.
const M55: (&str, &str) = ("cortex-m55", "mve");
/// Aim of the whole pipeline, as a multiple of CMSIS-DSP's filter.
const PIPELINE_AIM: f64 = 1.5;
/// Aims with eight samples at a time, as shares of the filter and of the pipeline with two.
const VECTOR_AIMS: (f64, f64) = (1.0 / 3.0, 0.5);

/// Cost of a search for the median from a wrong guess, counted once with the guess of
/// `firmware/image/src/bin/cost/stages.rs` moved by 1, 4 and 40 codes.
const WRONG_GUESS: &str = "\n\
    `mve` looks for the median where the last waveform had it, and finds it in one pass within\n\
    a code, as here. 4 codes off, its statistics take 3.6 instructions per sample more, 40 codes\n\
    off 7.1; the histogram of `dual_multiply` takes no more for 40.\n";

/// Samples of a case, from its name: `256x16 one echo` has 256.
fn samples(case: &str) -> Result<f64> {
    let digits = case.split('x').next().unwrap_or_default();
    digits.parse().with_context(|| format!("no samples in the name of case {case:?}"))
}

/// Instructions a sample in [`CASE`].
fn per_sample(table: &Table, (processor, kernel): (&str, &str), stage: &str) -> Result<f64> {
    let counted = table.get(processor, kernel, CASE, stage);
    let instructions =
        counted.with_context(|| format!("no {stage} of {kernel} on {processor} in the table"))?;
    Ok(instructions as f64 / samples(CASE)?)
}

/// A bound on the instructions a sample.
pub(super) struct Aim {
    title: &'static str,
    is: f64,
    at_most: f64,
}

impl Aim {
    fn verdict(&self) -> &'static str {
        if self.is <= self.at_most { "held" } else { "**not held**" }
    }

    /// Fails when it is not held.
    pub(super) fn check(&self) -> Result<()> {
        let Self { title, is, at_most } = self;
        ensure!(
            is <= at_most,
            "{title} takes {is:.2} instructions a sample, the aim is {at_most:.2}"
        );
        Ok(())
    }
}

/// Aims of the filter and the pipeline on a Cortex-M4, then of both on a Cortex-M55.
pub(super) fn aims(table: &Table) -> Result<[Aim; 4]> {
    let counted = |on, stage| per_sample(table, on, stage);
    let aim = |title, is, at_most| Aim { title, is, at_most };
    let [filter, pipeline] = [counted(M4, "filter")?, counted(M4, "pipeline")?];
    let (of_filter, of_pipeline) = VECTOR_AIMS;
    Ok([
        aim("the filter", filter, CMSIS_FAST),
        aim("the pipeline", pipeline, PIPELINE_AIM * CMSIS_FAST),
        aim("the filter on a Cortex-M55", counted(M55, "filter")?, of_filter * filter),
        aim("the pipeline on a Cortex-M55", counted(M55, "pipeline")?, of_pipeline * pipeline),
    ])
}

/// The aims as a sentence of the page, with their verdicts, and two samples at a time beside eight.
fn verdicts([filter, pipeline, vector_filter, vector_pipeline]: &[Aim; 4]) -> String {
    let row = |name: &str, two: &Aim, eight: &Aim| {
        let (is, at_most, verdict) = (eight.is, eight.at_most, eight.verdict());
        format!("| {name} | {:.1} | {is:.1} | {at_most:.1} | {verdict} |\n", two.is)
    };
    format!(
        "Aims: filter at most {CMSIS_FAST}: {}.\n\
         Whole pipeline with one echo at most {PIPELINE_AIM} times that, {:.1}: {} ({:.1}).\n\n\
         ## Two samples at a time and eight\n\n\
         The same case, instructions per sample. `mve` is for Armv8.1-M's vector unit.\n\n\
         | | Cortex-M4, `dual_multiply` | Cortex-M55, `mve` | aim | |\n|---|---|---|---|---|\n\
         {}{}{WRONG_GUESS}",
        filter.verdict(),
        pipeline.at_most,
        pipeline.verdict(),
        pipeline.is,
        row("filter", filter, vector_filter),
        row("pipeline", pipeline, vector_pipeline),
    )
}

/// The table as a page to read, per sample.
pub(super) fn draw(table: &Table) -> Result<String> {
    let mut page = head(&table.measured_with);
    page += &beside_cmsis(table)?;
    write!(page, "\n{}", verdicts(&aims(table)?))?;
    let mut drawn: Vec<(&str, String)> = Vec::new();
    for Machine { processor, target, emulator, machine, .. } in &MACHINES {
        let figures = stages(table, processor)?;
        let body = match drawn.iter().find(|(_, other)| *other == figures) {
            Some((other, _)) => format!("The same as {other}, which runs the same image.\n"),
            None => figures.clone(),
        };
        let on = format!("`{}` on `{emulator} -M {machine}`", target.name);
        write!(page, "\n## {processor}\n\n{on}, instructions per sample.\n\n{body}")?;
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

/// A row for our filter by each kernel, and for each of CMSIS-DSP's.
fn beside_cmsis(table: &Table) -> Result<String> {
    let mut text = String::from(
        "## The filter beside CMSIS-DSP\n\n\
         256 samples, 16 taps, Cortex-M4, the filter alone. Our sums are exact and rounded to\n\
         nearest; CMSIS-DSP's are cut off, and it copies its input into its state, which here the\n\
         baseline stage has done. CMSIS-DSP was compiled by gcc 12.2 with -O3 and\n\
         ARM_MATH_LOOPUNROLL, and counted in QEMU 7.2 too.\n\n\
         | | instructions per sample |\n|---|---|\n",
    );
    let (processor, fastest) = M4;
    for kernel in [fastest, "portable"] {
        let filter = per_sample(table, (processor, kernel), "filter")?;
        writeln!(text, "| ours, `{kernel}` | {filter:.1} |")?;
    }
    for (name, instructions) in CMSIS {
        writeln!(text, "| {name} | {instructions} |")?;
    }
    Ok(text)
}

/// Table of a processor: a row for each case and kernel, a column for each stage.
fn stages(table: &Table, processor: &str) -> Result<String> {
    let of_it = || table.figures.iter().filter(|(name, _)| name[0] == processor);
    let mut rows = of_it().map(|([_, kernel, case, _], _)| (case, kernel)).collect::<Vec<_>>();
    rows.dedup();
    let of_row = |row| of_it().filter(move |([_, kernel, case, _], _)| (case, kernel) == row);
    let Some(&first) = rows.first() else { return Ok("Not counted.\n".to_owned()) };
    let titles: Vec<&str> = of_row(first).map(|([.., stage], _)| &**stage).collect();
    let rule = "---|".repeat(titles.len());
    let mut text =
        format!("| samples × taps | kernel | {} |\n|---|---|{rule}\n", titles.join(" | "));
    for (case, kernel) in rows {
        let n = samples(case)?;
        let counts = of_row((case, kernel)).map(|(_, count)| format!("{:.2}", *count as f64 / n));
        let (case, counts) = (case.replacen('x', " × ", 1), counts.collect::<Vec<_>>().join(" | "));
        writeln!(text, "| {case} | `{kernel}` | {counts} |")?;
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
        aims(&table).unwrap().iter().for_each(|aim| aim.check().unwrap());
    }
}
