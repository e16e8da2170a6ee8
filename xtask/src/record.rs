//! What records have of a run, and the pages written from them.

use std::fs;
use std::io::Read;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use wait4::Wait4;

use crate::shell::{commit, today, workspace};

const END: &str = "<!-- end -->\n";

/// What a command of `echoloop` printed, and the time it took.
#[derive(Clone, Debug, Default)]
pub(crate) struct Printed {
    /// Its JSON.
    pub(crate) json: Value,
    /// Processor time, s.
    pub(crate) cpu_s: f64,
}

/// Runs a command of `echoloop` that prints JSON; its progress is shown.
pub(crate) fn printed(command: &mut Command) -> Result<Printed> {
    eprintln!("+ {command:?}");
    let mut child = command.stdout(Stdio::piped()).spawn().context("cannot run echoloop")?;
    let mut text = Vec::new();
    if let Some(mut stdout) = child.stdout.take() {
        stdout.read_to_end(&mut text).context("cannot read what echoloop prints")?;
    }
    let ended = child.wait4().context("cannot wait for echoloop")?;
    ensure!(ended.status.success(), "failed: {command:?}");
    let cpu = ended.rusage.utime + ended.rusage.stime;
    let json = serde_json::from_slice(&text).context("echoloop prints JSON")?;
    Ok(Printed { json, cpu_s: cpu.as_secs_f64() })
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
