//! Table of figures, and the differences of two.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, bail};

/// The table.
pub(super) const TABLE: &str = "firmware/image/cost.tsv";

/// Greatest growth of a figure that passes.
pub(super) const TOLERANCE_PERCENT: u64 = 2;
/// The same in instructions, where that is more: the clock's resolution.
const TOLERANCE_INSTRUCTIONS: u64 = 2;

/// Processor, kernel, case and stage of a figure.
pub(super) type Name = [String; 4];

/// Instructions per waveform, and the tools that counted them.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Table {
    /// Versions and date, one line.
    pub(super) measured_with: String,
    /// In the order they were counted.
    pub(super) figures: Vec<(Name, u64)>,
}

/// A figure of a line: processor, kernel, case, stage, instructions.
pub(super) fn parse(line: &str) -> Result<(Name, u64)> {
    let fields: Vec<&str> = line.split('\t').collect();
    let [processor, kernel, case, stage, instructions] = fields[..] else {
        bail!("not a figure: {line:?}")
    };
    Ok(([processor, kernel, case, stage].map(str::to_owned), instructions.parse()?))
}

impl Table {
    pub(super) fn from_text(text: &str) -> Result<Self> {
        let (comments, figures): (Vec<&str>, Vec<&str>) =
            text.lines().partition(|line| line.starts_with('#'));
        let measured_with = comments
            .first()
            .and_then(|line| line.strip_prefix("# "))
            .unwrap_or_default()
            .to_owned();
        Ok(Self { measured_with, figures: figures.into_iter().map(parse).collect::<Result<_>>()? })
    }

    pub(super) fn to_text(&self) -> String {
        let mut text = format!(
            "# {}\n\
             # Instructions per waveform: `cargo xtask cost` compares, with `--update` rewrites.\n\
             # processor\tkernel\tcase\tstage\tinstructions\n",
            self.measured_with
        );
        for (name, instructions) in &self.figures {
            text += &format!("{}\t{instructions}\n", name.join("\t"));
        }
        text
    }

    /// Compiler of the counted images.
    pub(super) fn compiler(&self) -> &str {
        self.measured_with.split(", ").next().unwrap_or_default()
    }

    /// Adds another table's figures of processors that this one lacks.
    pub(super) fn complete(&mut self, other: &Self) {
        let own: BTreeSet<String> =
            self.figures.iter().map(|([processor, ..], _)| processor.clone()).collect();
        let missing = other.figures.iter().filter(|([processor, ..], _)| !own.contains(processor));
        self.figures.extend(missing.cloned());
    }

    pub(super) fn get(
        &self,
        processor: &str,
        kernel: &str,
        case: &str,
        stage: &str,
    ) -> Option<u64> {
        let wanted = [processor, kernel, case, stage];
        self.figures.iter().find(|(name, _)| *name == wanted).map(|(_, instructions)| *instructions)
    }
}

/// Figures that grew by more than the tolerance, appeared or disappeared; then those that shrank by
/// more.
pub(super) fn compare(committed: &Table, counted: &Table) -> (Vec<String>, Vec<String>) {
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
        assert_eq!(Table::from_text(&written.to_text()).unwrap(), written);
    }

    #[test]
    fn two_percent_more_passes_and_a_little_above_fails_by_name() {
        let before = table(&[("filter", 1000), ("report", 0)]);
        assert_eq!(compare(&before, &table(&[("filter", 1020), ("report", 2)])), (vec![], vec![]));
        let (grown, _) = compare(&before, &table(&[("filter", 1021), ("report", 0)]));
        assert_eq!(grown, ["filter of scalar on m4, 8x2: 1000 -> 1021 (+2.1 %)"]);
    }

    #[test]
    fn a_processor_that_was_not_counted_stays_as_committed_and_a_figure_of_one_that_was_is_missed()
    {
        let mut committed = table(&[("filter", 1000), ("report", 0)]);
        let other = ["rv32", "scalar", "8x2", "filter"].map(str::to_owned);
        committed.figures.push((other, 7));
        let mut counted = table(&[("filter", 1000)]);
        counted.complete(&committed);
        let (grown, _) = compare(&committed, &counted);
        assert_eq!(grown, ["report of scalar on m4, 8x2: 0 -> not counted"]);
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
