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
/// The case that the aims are about.
const CASE: &str = "256x16 one echo";
/// The processor and the kernel that CMSIS-DSP's figures compare with.
const M4: (&str, &str) = ("cortex-m4", "dual_multiply");
/// Those that take eight samples at a time.
const M55: (&str, &str) = ("cortex-m55", "mve");
/// The whole pipeline's aim: this many times the reference of its filter alone.
const PIPELINE_AIM: f64 = 1.5;
/// Eight at a time against two: this much of the filter and of the pipeline.
const VECTOR_AIMS: (f64, f64) = (1.0 / 3.0, 0.5);

/// What a search costs that begins at the wrong place, counted once with the guess of
/// `firmware/image/src/bin/cost/stages.rs` moved by 1, 4 and 40 codes.
const ASTRAY: &str = "\n\
    `mve` looks for the median where the last waveform had it, and finds it in one pass within\n\
    a code, as here. 4 codes off, its statistics take 3.6 instructions per sample more, 40 codes\n\
    off 7.1; the histogram of `dual_multiply` takes no more for 40.\n";

/// Samples of a case, from its name: `256x16 one echo` has 256.
fn samples(case: &str) -> Result<f64> {
    let digits = case.split('x').next().unwrap_or_default();
    digits.parse().with_context(|| format!("no samples in the name of case {case:?}"))
}

/// Instructions a sample of the case that the aims are about.
fn per_sample(table: &Table, (processor, kernel): (&str, &str), stage: &str) -> Result<f64> {
    let counted = table.get(processor, kernel, CASE, stage);
    let instructions =
        counted.with_context(|| format!("no {stage} of {kernel} on {processor} in the table"))?;
    Ok(instructions as f64 / samples(CASE)?)
}

/// Instructions a sample that may not be more than some.
struct Aim {
    what: &'static str,
    is: f64,
    at_most: f64,
}

impl Aim {
    fn is_held(&self) -> bool {
        self.is <= self.at_most
    }

    fn verdict(&self) -> &'static str {
        if self.is_held() { "held" } else { "**not held**" }
    }
}

/// What the record is held to.
pub(super) struct Aims {
    filter: Aim,
    pipeline: Aim,
    vector_filter: Aim,
    vector_pipeline: Aim,
}

impl Aims {
    /// Reads them from a table.
    ///
    /// # Errors
    ///
    /// When the compared case is not in it.
    pub(super) fn from_table(table: &Table) -> Result<Self> {
        let (m4_filter, m4_pipeline) =
            (per_sample(table, M4, "filter")?, per_sample(table, M4, "pipeline")?);
        let (of_filter, of_pipeline) = VECTOR_AIMS;
        Ok(Self {
            filter: Aim { what: "the filter", is: m4_filter, at_most: CMSIS_FAST },
            pipeline: Aim {
                what: "the pipeline",
                is: m4_pipeline,
                at_most: PIPELINE_AIM * CMSIS_FAST,
            },
            vector_filter: Aim {
                what: "the filter on a Cortex-M55",
                is: per_sample(table, M55, "filter")?,
                at_most: of_filter * m4_filter,
            },
            vector_pipeline: Aim {
                what: "the pipeline on a Cortex-M55",
                is: per_sample(table, M55, "pipeline")?,
                at_most: of_pipeline * m4_pipeline,
            },
        })
    }

    /// # Errors
    ///
    /// Says which aim is missed.
    pub(super) fn check(&self) -> Result<()> {
        let Self { filter, pipeline, vector_filter, vector_pipeline } = self;
        for aim in [filter, pipeline, vector_filter, vector_pipeline] {
            let Aim { what, is, at_most } = aim;
            ensure!(
                aim.is_held(),
                "{what} takes {is:.2} instructions a sample, the aim is {at_most:.2}"
            );
        }
        Ok(())
    }

    /// The aims as a sentence of the page, and whether they are held.
    fn sentence(&self) -> String {
        let Self { filter, pipeline, .. } = self;
        format!(
            "Aims: filter at most {CMSIS_FAST}: {}.\n\
             Whole pipeline with one echo at most {PIPELINE_AIM} times that, {:.1}: {} ({:.1}).",
            filter.verdict(),
            pipeline.at_most,
            pipeline.verdict(),
            pipeline.is
        )
    }

    /// Two samples at a time beside eight.
    fn beside_vectors(&self) -> String {
        let Self { filter, pipeline, vector_filter, vector_pipeline } = self;
        let mut text = String::from(
            "## Two samples at a time and eight\n\n\
             The same case, instructions per sample. `mve` is for Armv8.1-M's vector unit.\n\n\
             | | Cortex-M4, `dual_multiply` | Cortex-M55, `mve` | aim | |\n|---|---|---|---|---|\n",
        );
        for (name, two, eight) in
            [("filter", filter, vector_filter), ("pipeline", pipeline, vector_pipeline)]
        {
            let (is, at_most, verdict) = (eight.is, eight.at_most, eight.verdict());
            text += &format!("| {name} | {:.1} | {is:.1} | {at_most:.1} | {verdict} |\n", two.is);
        }
        text + ASTRAY
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
    let aims = Aims::from_table(table)?;
    write!(page, "\n{}\n\n{}", aims.sentence(), aims.beside_vectors())?;
    let mut drawn: Vec<(&str, String)> = Vec::new();
    for Machine { processor, target, emulator, machine, .. } in &MACHINES {
        let figures = stages(table, processor)?;
        let same = drawn.iter().find(|(_, other)| *other == figures);
        let shown = same.map_or_else(
            || figures.clone(),
            |(other, _)| format!("The same as {other}, which runs the same image.\n"),
        );
        let on = format!("`{}` on `{emulator} -M {machine}`", target.name);
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
