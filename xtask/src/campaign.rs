//! Campaigns: many runs of `echoloop`, one for each cell of a plan, kept as lines of a record.
//!
//! A plan is a file of `benches/plans`: axes, their values, and the arguments of each value. A cell
//! has one value of each axis. The record has a line for each finished run, so that a campaign
//! resumes where it was left, on any machine, and pages are written from the lines alone.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use clap::builder::{PossibleValue, PossibleValuesParser};
use echoloop_statistics::{Estimate, mean_of_groups};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value};

use crate::record::{append, lines, printed, stamp};
use crate::shell::{build_release, built, commit, echoloop, workspace};

/// Plan of a campaign.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Plan {
    /// Command of `echoloop` that runs a cell.
    command: String,
    /// Arguments of every run.
    arguments: Vec<String>,
    /// File with a line for each finished run.
    record: String,
    /// Axes; the last varies fastest.
    axis: Vec<Axis>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Axis {
    name: String,
    /// Arguments that every value adds; {} stands for the value.
    #[serde(default)]
    each: Vec<String>,
    /// Empty where any value is allowed, as of seeds.
    #[serde(default)]
    values: Vec<Choice>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Choice {
    name: String,
    #[serde(default)]
    help: String,
    /// Arguments that this value adds.
    #[serde(default)]
    arguments: Vec<String>,
}

/// One value of each axis, by the axis' name. A record has numbers as numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(from = "BTreeMap<String, Value>")]
pub(crate) struct Cell(BTreeMap<String, String>);

/// A finished run: a line of a record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Line<T> {
    pub(crate) cell: Cell,
    /// Day and commit.
    pub(crate) made: String,
    #[serde(flatten)]
    pub(crate) result: T,
}

/// Written by hand: derived `flatten` cannot read floats where another crate of the build enables
/// serde_json's `arbitrary_precision`.
impl<'de, T: DeserializeOwned> Deserialize<'de> for Line<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut members = Map::deserialize(deserializer)?;
        let asked = members.remove("asked"); // name of the cell in lines of earlier versions
        let mut own = |name| members.remove(name).ok_or_else(|| D::Error::missing_field(name));
        let cell = asked.map_or_else(|| own("cell"), Ok)?;
        Ok(Self {
            cell: serde_json::from_value(cell).map_err(D::Error::custom)?,
            made: serde_json::from_value(own("made")?).map_err(D::Error::custom)?,
            result: serde_json::from_value(Value::Object(members)).map_err(D::Error::custom)?,
        })
    }
}

impl Plan {
    /// Reads a plan that is part of this program.
    pub(crate) fn read(text: &str) -> Self {
        toml::from_str(text).unwrap_or_else(|error| panic!("a plan is broken: {error}"))
    }

    fn axis(&self, name: &str) -> &Axis {
        let axis = self.axis.iter().find(|axis| axis.name == name);
        axis.unwrap_or_else(|| panic!("no axis {name} in the plan of {}", self.record))
    }

    /// Names of an axis' values, in the plan's order.
    pub(crate) fn values(&self, axis: &str) -> impl Iterator<Item = &str> {
        self.axis(axis).values.iter().map(|value| &*value.name)
    }

    /// Index of a cell's value among those of an axis.
    pub(crate) fn place(&self, axis: &str, cell: &Cell) -> usize {
        self.values(axis).position(|value| value == cell.of(axis)).unwrap_or(usize::MAX)
    }

    /// Parser of a flag that selects values of an axis.
    pub(crate) fn choices(&'static self, axis: &str) -> PossibleValuesParser {
        let values = self.axis(axis).values.iter();
        PossibleValuesParser::new(values.map(|value| match &*value.help {
            "" => PossibleValue::new(&*value.name),
            help => PossibleValue::new(&*value.name).help(help),
        }))
    }

    /// Cells with the values selected by axis; without any, all values of the axis.
    pub(crate) fn cells(&self, selection: &[(&str, &[String])]) -> Vec<Cell> {
        let mut cells = vec![Cell::default()];
        for Axis { name, values, .. } in &self.axis {
            let selected = selection.iter().find(|(axis, some)| axis == name && !some.is_empty());
            let values: Vec<String> = match selected {
                Some((_, some)) => some.to_vec(),
                None => values.iter().map(|value| value.name.clone()).collect(),
            };
            let all = cells.iter().flat_map(|cell| values.iter().map(|v| cell.with(name, v)));
            cells = all.collect();
        }
        cells
    }

    /// Arguments of a cell's run.
    fn arguments(&self, cell: &Cell) -> Vec<String> {
        let mut arguments = self.arguments.clone();
        for Axis { name, each, values } in &self.axis {
            let value = cell.of(name);
            arguments.extend(each.iter().map(|argument| argument.replace("{}", value)));
            let own = values.iter().find(|choice| choice.name == value);
            arguments.extend(own.into_iter().flat_map(|choice| choice.arguments.clone()));
        }
        arguments
    }

    /// The record's lines.
    pub(crate) fn lines<T: DeserializeOwned>(&self) -> Result<Vec<Line<T>>> {
        lines(&workspace()?.join(&self.record))
    }

    /// Runs the cells that the record lacks, and adds their lines. `more` gives further arguments
    /// of a cell from the lines so far, or `None` where it has no run; `read` reads the JSON that
    /// the run printed.
    ///
    /// # Errors
    ///
    /// When the record cannot be read or written, and in the end when runs failed.
    pub(crate) fn run<T: Serialize + DeserializeOwned>(
        &self,
        cells: &[Cell],
        more: impl Fn(&Cell, &[Line<T>]) -> Result<Option<Vec<String>>>,
        read: impl Fn(&Value) -> Result<T>,
    ) -> Result<()> {
        build_release()?;
        let record = workspace()?.join(&self.record);
        let mut recorded: Vec<Line<T>> = lines(&record)?;
        let mut failed = Vec::new();
        for (number, cell) in cells.iter().enumerate() {
            if recorded.iter().any(|line| line.cell == *cell) {
                continue;
            }
            let run = || -> Result<Option<Line<T>>> {
                let Some(more) = more(cell, &recorded)? else { return Ok(None) };
                eprintln!("{} of {}: {cell}", number + 1, cells.len());
                let arguments = [self.arguments(cell), more].concat();
                let result = self.finished(cell, arguments, &read)?;
                Ok(Some(Line { cell: cell.clone(), made: stamp()?, result }))
            };
            match run() {
                Ok(None) => {}
                Ok(Some(line)) => {
                    append(&record, &line)?;
                    recorded.push(line);
                }
                Err(error) => failed.push(format!("{cell}: {error:#}")),
            }
        }
        ensure!(failed.is_empty(), "failed runs:\n{}", failed.join("\n"));
        Ok(())
    }

    /// Result of a run. An interrupted `tune` of the same commit is resumed; its folder is removed
    /// when the result is read.
    fn finished<T>(
        &self,
        cell: &Cell,
        arguments: Vec<String>,
        read: impl Fn(&Value) -> Result<T>,
    ) -> Result<T> {
        let mut command = echoloop()?;
        command.args([&*self.command, "--json"]);
        if self.command != "tune" {
            return read(&printed(command.args(arguments))?);
        }
        let folder = self.runs()?.join(cell.to_string().replace(' ', "-"));
        let latest = folder.join("latest");
        match latest.join("history.jsonl").exists() {
            true => command.arg("--resume").arg(&latest),
            false => command.arg("--runs").arg(&folder).args(arguments),
        };
        let result = read(&printed(&mut command)?)?;
        fs::remove_dir_all(&folder)
            .with_context(|| format!("cannot remove {}", folder.display()))?;
        Ok(result)
    }

    /// Folder of runs that this commit began.
    fn runs(&self) -> Result<PathBuf> {
        let name = self.record.rsplit('/').next().unwrap_or(&self.record);
        Ok(built(&workspace()?).join(name.replace(".jsonl", "")).join(commit()?))
    }
}

impl Cell {
    /// The cell's value of an axis; empty where it has none.
    pub(crate) fn of(&self, axis: &str) -> &str {
        self.0.get(axis).map_or("", String::as_str)
    }

    /// The cell with another value of an axis.
    pub(crate) fn with(&self, axis: &str, value: &str) -> Self {
        let mut cell = self.clone();
        cell.0.insert(axis.to_owned(), value.to_owned());
        cell
    }
}

impl From<BTreeMap<String, Value>> for Cell {
    fn from(values: BTreeMap<String, Value>) -> Self {
        let text = |value: Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        Self(values.into_iter().map(|(axis, value)| (axis, text(value))).collect())
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let value = |text: &str| text.parse::<u64>().map_or_else(|_| text.into(), Value::from);
        serializer.collect_map(self.0.iter().map(|(axis, text)| (axis, value(text))))
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = |(axis, value): (&String, &String)| match value.parse::<u64>() {
            Ok(_) => format!("{axis} {value}"),
            Err(_) => value.clone(),
        };
        f.write_str(&self.0.iter().map(word).collect::<Vec<_>>().join(" "))
    }
}

/// Mean over runs, each a group of pairs, with its interval. Seeded: the same on every machine.
pub(crate) fn mean(groups: &[Vec<f64>]) -> Option<Estimate> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    mean_of_groups(groups, &mut |count| random.random_range(0..count))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: &str = r#"
        command = "tune"
        arguments = ["--set=data.test_pairs=100"]
        record = "benches/record/none.jsonl"
        [[axis]]
        name = "seed"
        each = ["--seed={}", "--set=scene.towns=[{}01]"]
        [[axis]]
        name = "weather"
        values = [{ name = "clear" }, { name = "fog", arguments = ["--set=weather.kind=fog"] }]
    "#;

    #[test]
    fn cells_are_every_combination_and_the_last_axis_varies_fastest() {
        let plan = Plan::read(PLAN);
        let seeds = ["1", "2"].map(String::from);
        let cells = plan.cells(&[("seed", &seeds), ("weather", &[])]);
        let names: Vec<String> = cells.iter().map(Cell::to_string).collect();
        assert_eq!(names, ["seed 1 clear", "seed 1 fog", "seed 2 clear", "seed 2 fog"]);
        let [all, seed, towns, fog] =
            ["data.test_pairs=100", "--seed=2", "scene.towns=[201]", "weather.kind=fog"];
        let set = |text: &str| format!("--set={text}");
        assert_eq!(plan.arguments(&cells[3]), [set(all), seed.into(), set(towns), set(fog)]);
    }

    #[test]
    fn a_line_has_numbers_as_numbers_and_reads_back() {
        let cell = Cell::default().with("seed", "3").with("scene", "structured");
        let result = BTreeMap::from([("pairs".to_owned(), 12)]);
        let line = Line { cell, made: "today".into(), result };
        let text = serde_json::to_string(&line).unwrap();
        let expected = r#"{"cell":{"scene":"structured","seed":3},"made":"today","pairs":12}"#;
        assert_eq!(text, expected);
        let older = text.replace("cell", "asked");
        assert_eq!(serde_json::from_str::<Line<_>>(&older).unwrap(), line);
        assert_eq!(serde_json::from_str::<Line<_>>(&text).unwrap(), line);
    }
}
