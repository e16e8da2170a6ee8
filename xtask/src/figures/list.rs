//! The list of figures.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};
use serde::Deserialize;
use serde_json::Value;

use super::page::prints;
use crate::record::with_commas;

/// `benches/record/figures.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct List {
    pub(super) run: Vec<Run>,
    pub(super) figure: Vec<Figure>,
}

/// A run, made once for all its figures.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Run {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// Day, commit and compiler of the recorded values. A line of the file, which `--update`
    /// rewrites.
    pub(super) measured: String,
    /// Arguments of `echoloop`, without `--json`. `$ECHOLOOP_DATA` stands for that folder.
    #[serde(default)]
    pub(super) arguments: Vec<String>,
    /// True when it takes more than two minutes: then only with `--all`.
    #[serde(default)]
    pub(super) slow: bool,
}

/// Kind of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Kind {
    /// The release build of `echoloop`, with `--json`.
    Echoloop,
    /// The sensor's images: `/TARGET/flash`, `statics` or `stack`, bytes.
    Images,
    /// Counts of `cargo xtask cost`, instructions a waveform: `/PROCESSOR/KERNEL/CASE/STAGE`.
    Cost,
}

/// Values that are printed together.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Figure {
    pub(super) name: String,
    /// Name of their run.
    pub(super) run: String,
    pub(super) values: BTreeMap<String, Place>,
    /// Each as it is printed. A line of the file, which `--update` rewrites.
    pub(super) recorded: BTreeMap<String, String>,
    pub(super) printed: Vec<Printed>,
}

/// Place of a value in a run's output, and its printed form.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Place {
    /// JSON pointer (RFC 6901).
    at: String,
    /// Factor from the output's number to the printed one.
    #[serde(default = "one")]
    scale: f64,
    #[serde(default)]
    decimals: usize,
}

/// A text of a page that prints figures.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Printed {
    pub(super) page: String,
    /// Text of the page, with `{name}` for values.
    pub(super) text: String,
}

fn one() -> f64 {
    1.0
}

impl List {
    pub(super) fn from_text(text: &str) -> Result<Self> {
        toml::from_str(text).map_err(Into::into)
    }

    /// Texts that pages lack: page, figure and text. `read` gives a page's text.
    pub(super) fn missing(&self, read: impl Fn(&str) -> Result<String>) -> Result<Vec<String>> {
        let mut missing = Vec::new();
        for figure in &self.figure {
            for Printed { page, text } in &figure.printed {
                let line = figure.line(text);
                if !prints(&read(page)?, &line) {
                    missing.push(format!("{page}: {}: {line}", figure.name));
                }
            }
        }
        Ok(missing)
    }
}

impl Figure {
    /// A text with the recorded values in it.
    pub(super) fn line(&self, text: &str) -> String {
        fill(text, &self.recorded)
    }
}

/// A text with values in it.
pub(super) fn fill(text: &str, values: &BTreeMap<String, String>) -> String {
    let put = |text: String, (name, value): (&String, &String)| {
        text.replace(&format!("{{{name}}}"), value)
    };
    values.iter().fold(text.to_owned(), put)
}

impl Place {
    /// The value in a run's output, as it is printed.
    pub(super) fn read(&self, output: &Value) -> Result<String> {
        match output.pointer(&self.at) {
            Some(Value::Null) => Ok("–".to_owned()),
            Some(Value::Number(number)) => {
                let number = number.as_f64().context("a number")?;
                Ok(with_commas(number * self.scale, self.decimals))
            }
            found => bail!("no number at {}: {found:?}", self.at),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn place(at: &str, scale: f64, decimals: usize) -> Place {
        Place { at: at.to_owned(), scale, decimals }
    }

    #[test]
    fn a_value_is_read_scaled_and_printed_with_commas() {
        let output = json!({"a": {"b": 0.051_63, "c": 8280.4, "none": null}});
        let read = |place: Place| place.read(&output).unwrap();
        assert_eq!(read(place("/a/b", 100.0, 2)), "5.16");
        assert_eq!(read(place("/a/c", 1.0, 0)), "8,280");
        assert_eq!(read(place("/a/c", -1e3, 1)), "-8,280,400.0");
        assert_eq!(read(place("/a/none", 1.0, 0)), "–");
        assert!(place("/a/z", 1.0, 0).read(&output).is_err());
    }

    #[test]
    fn a_text_is_filled_with_values_by_their_names() {
        let values = [("a", "1"), ("ab", "2")].map(|(k, v)| (k.to_owned(), v.to_owned()));
        assert_eq!(fill("{a} of {ab}: {c}", &values.into()), "1 of 2: {c}");
    }

    #[test]
    fn a_page_without_the_recorded_number_is_named_with_its_figure() {
        let list = List::from_text(
            "run = []\n[[figure]]\nname = \"f\"\nrun = \"r\"\nvalues = {}\n\
             recorded = { x = \"5.0\" }\nprinted = [{ page = \"p.md\", text = \"{x} % by\" }]\n",
        )
        .unwrap();
        let missing = |page: &str| list.missing(|_| Ok(page.to_owned())).unwrap();
        assert_eq!(missing("5.0 % by"), [""; 0]);
        assert_eq!(missing("25.0 % by"), ["p.md: f: 5.0 % by"]);
    }
}
