//! What records have of a run, and the pages written from them.

use std::fs;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use echoloop_statistics::{Estimate, mean_of_groups};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use crate::shell::{commit, today, workspace};

const END: &str = "<!-- end -->\n";

/// JSON that a command of `echoloop` prints; its progress is shown.
pub(crate) fn printed(command: &mut Command) -> Result<Value> {
    eprintln!("+ {command:?}");
    let output = command.stderr(Stdio::inherit()).output().context("cannot run echoloop")?;
    ensure!(output.status.success(), "failed: {command:?}");
    serde_json::from_slice(&output.stdout).context("echoloop prints JSON")
}

/// Day and commit of this code.
pub(crate) fn stamp() -> Result<String> {
    Ok(format!("{}, {}", today(), commit()?))
}

/// Writes a text into a page of the workspace, between the marks of a command.
pub(crate) fn write_page(page: &str, command: &str, text: &str) -> Result<()> {
    let path = workspace()?.join(page);
    let old = fs::read_to_string(&path).with_context(|| format!("cannot read {page}"))?;
    let new = written_into(&old, command, text)?;
    fs::write(&path, new).with_context(|| format!("cannot write {page}"))
}

/// The page with another text between the mark of a command and the end's.
fn written_into(page: &str, command: &str, text: &str) -> Result<String> {
    let begin = format!("<!-- written by `{command}` -->\n");
    let parted = page.split_once(&begin);
    let (before, rest) = parted.context("the page has no mark to write after")?;
    let (_, after) = rest.split_once(END).context("the page has no mark to write up to")?;
    Ok(format!("{before}{begin}{text}{END}{after}"))
}

/// A number with commas between thousands.
pub(crate) fn with_commas(number: f64, decimals: usize) -> String {
    let plain = format!("{number:.decimals$}");
    let (whole, fraction) = plain.split_at(plain.find('.').unwrap_or(plain.len()));
    let mut text = String::new();
    for (index, digit) in whole.chars().enumerate() {
        if index > 0 && (whole.len() - index) % 3 == 0 && !text.ends_with('-') {
            text.push(',');
        }
        text.push(digit);
    }
    text + fraction
}

/// Mean over runs, each a group of pairs, with its interval. Seeded: the same on every machine.
pub(crate) fn mean(groups: &[Vec<f64>]) -> Option<Estimate> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    mean_of_groups(groups, &mut |count| random.random_range(0..count))
}

/// To three significant digits: records are read by people too.
pub(crate) fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_between_the_marks_of_a_command_is_replaced() {
        let mark = "<!-- written by `it` -->\n";
        let page = format!("# A\n\n{mark}old\n{END}\nmore\n");
        let new = written_into(&page, "it", "new\n").unwrap();
        assert_eq!(new, format!("# A\n\n{mark}new\n{END}\nmore\n"));
        assert_eq!(written_into(&new, "it", "new\n").unwrap(), new);
        assert!(written_into("no marks", "it", "new").is_err());
        assert_eq!(three_digits(4.6084), 4.61);
    }

    #[test]
    fn thousands_are_parted_by_commas() {
        let texts = [(5.16, 1), (8280.4, 0), (-8_280_400.0, 1), (28_928.0, 0)];
        let expected = ["5.2", "8,280", "-8,280,400.0", "28,928"];
        assert_eq!(texts.map(|(number, decimals)| with_commas(number, decimals)), expected);
    }
}
