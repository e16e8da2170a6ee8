//! Plans, and the cells of their axes.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use clap::builder::{PossibleValue, PossibleValuesParser};
use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;

/// Plan of a campaign. Every `set` has settings of the configuration, each as `KEY=VALUE`.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Plan {
    /// Command of `echoloop` that runs a cell; empty where cells are run in process.
    pub command: String,
    /// Settings of every cell.
    pub set: Vec<String>,
    /// File with a line for each finished run; empty where records are kept otherwise.
    pub record: String,
    /// Axes; the last varies fastest.
    axis: Vec<Axis>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Axis {
    name: String,
    /// Settings of every value; {} stands for its name.
    set: Vec<String>,
    /// Empty where others list the values, as those of seeds.
    values: Vec<Choice>,
}

/// A value of an axis.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Choice {
    /// Name on the command line and in records.
    pub name: String,
    /// Name in tables; empty where it is the same.
    title: String,
    help: String,
    set: Vec<String>,
    /// Processor time of a cell by one axis, s, and factors of it by others.
    cost: Option<f64>,
}

/// One value of each axis, by the axis' name. A record has numbers as numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(from = "BTreeMap<String, Value>")]
pub struct Cell(BTreeMap<String, String>);

impl Plan {
    /// Reads a plan that is part of this program.
    ///
    /// # Panics
    ///
    /// When it is broken.
    pub fn read(text: &str) -> Self {
        toml::from_str(text).unwrap_or_else(|error| panic!("a plan is broken: {error}"))
    }

    /// # Panics
    ///
    /// When the plan has no such axis.
    fn axis(&self, name: &str) -> &Axis {
        let axis = self.axis.iter().find(|axis| axis.name == name);
        axis.unwrap_or_else(|| panic!("no axis {name} in a plan"))
    }

    /// Values that the plan lists of an axis, in its order.
    pub fn values(&self, axis: &str) -> &[Choice] {
        &self.axis(axis).values
    }

    /// Names of an axis' values, in the plan's order.
    pub fn names(&self, axis: &str) -> impl Iterator<Item = &str> {
        self.values(axis).iter().map(|value| &*value.name)
    }

    /// Keys of the configuration that an axis sets.
    pub fn keys(&self, axis: &str) -> impl Iterator<Item = &str> {
        let Axis { set, values, .. } = self.axis(axis);
        let all = set.iter().chain(values.iter().flat_map(|value| &value.set));
        all.map(|setting| key(setting))
    }

    /// Parser of a flag that selects values of an axis.
    pub fn choices(&'static self, axis: &str) -> PossibleValuesParser {
        PossibleValuesParser::new(self.values(axis).iter().map(Choice::possible))
    }

    /// Cells with the values selected by axis; without any, all values of the axis.
    pub fn cells(&self, selection: &[(&str, &[String])]) -> Vec<Cell> {
        let mut cells = vec![Cell::default()];
        for Axis { name, values, .. } in &self.axis {
            let selected = selection.iter().find(|(axis, some)| axis == name && !some.is_empty());
            let mut values: Vec<String> = match selected {
                Some((_, some)) => some.to_vec(),
                None => values.iter().map(|value| value.name.clone()).collect(),
            };
            let mut seen = BTreeSet::new();
            values.retain(|value| seen.insert(value.clone())); // a value given twice is one
            let all = cells.iter().flat_map(|cell| values.iter().map(|v| cell.with(name, v)));
            cells = all.collect();
        }
        cells
    }

    /// Processor time of a cell as the plan has it, s: the product of what its values cost; those
    /// without a cost change nothing.
    pub fn cost(&self, cell: &Cell) -> f64 {
        let of_axis = |axis: &Axis| {
            let own = axis.values.iter().find(|choice| choice.name == cell.of(&axis.name));
            own.and_then(|choice| choice.cost).unwrap_or(1.0)
        };
        self.axis.iter().map(of_axis).product()
    }

    /// Settings of a cell's run. Of two that set one key the later does.
    pub fn settings(&self, cell: &Cell) -> Vec<String> {
        let mut settings = self.set.clone();
        for Axis { name, set, values } in &self.axis {
            let Some(value) = cell.0.get(name) else { continue };
            settings.extend(set.iter().map(|setting| setting.replace("{}", value)));
            let own = values.iter().filter(|choice| choice.name == *value);
            settings.extend(own.flat_map(|choice| choice.set.clone()));
        }
        settings
    }
}

impl Choice {
    /// Name in tables.
    pub fn title(&self) -> &str {
        if self.title.is_empty() { &self.name } else { &self.title }
    }

    /// True when it sets a key of the configuration.
    pub fn sets(&self, name: &str) -> bool {
        self.set.iter().any(|setting| key(setting) == name)
    }

    /// The value of a flag, with its help.
    pub fn possible(&'static self) -> PossibleValue {
        let value = PossibleValue::new(&*self.name);
        if self.help.is_empty() { value } else { value.help(&*self.help) }
    }
}

fn key(setting: &str) -> &str {
    setting.split_once('=').map_or(setting, |(key, _)| key)
}

impl Cell {
    /// The cell's value of an axis; empty where it has none.
    pub fn of(&self, axis: &str) -> &str {
        self.0.get(axis).map_or("", String::as_str)
    }

    /// The cell with another value of an axis.
    #[must_use]
    pub fn with(&self, axis: &str, value: &str) -> Self {
        let mut cell = self.clone();
        cell.0.insert(axis.to_owned(), value.to_owned());
        cell
    }

    /// The cell without an axis.
    #[must_use]
    pub fn without(&self, axis: &str) -> Self {
        let mut cell = self.clone();
        cell.0.remove(axis);
        cell
    }
}

impl From<BTreeMap<String, Value>> for Cell {
    fn from(values: BTreeMap<String, Value>) -> Self {
        let text = |value: Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let known = values.into_iter().filter(|(_, value)| !value.is_null());
        Self(known.map(|(axis, value)| (axis, text(value))).collect())
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

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: &str = r#"
        command = "tune"
        set = ["data.test_pairs=100"]
        record = "benches/record/none.jsonl"
        [[axis]]
        name = "seed"
        set = ["seed={}", "scene.towns=[{}01]"]
        [[axis]]
        name = "weather"
        values = [
            { name = "clear", cost = 20.0 },
            { name = "fog", title = "Fog", set = ["weather.kind=fog"], cost = 50.0 },
        ]
        [[axis]]
        name = "method"
        values = [{ name = "icp" }, { name = "fgr", cost = 1.5 }]
    "#;

    #[test]
    fn cells_are_every_combination_and_the_last_axis_varies_fastest() {
        let plan = Plan::read(PLAN);
        let seeds = ["1", "2"].map(String::from);
        let icp = ["icp".to_owned()];
        let cells = plan.cells(&[("seed", &seeds), ("weather", &[]), ("method", &icp)]);
        let cells: Vec<Cell> = cells.into_iter().map(|cell| cell.without("method")).collect();
        let names: Vec<String> = cells.iter().map(Cell::to_string).collect();
        assert_eq!(names, ["seed 1 clear", "seed 1 fog", "seed 2 clear", "seed 2 fog"]);
        let [all, seed, towns, fog] =
            ["data.test_pairs=100", "seed=2", "scene.towns=[201]", "weather.kind=fog"];
        assert_eq!(plan.settings(&cells[3]), [all, seed, towns, fog]);
        let without_seed = Cell::default().with("weather", "fog");
        assert_eq!(plan.settings(&without_seed), [all, fog]);
        assert_eq!(cells[3].without("seed"), without_seed);
        let titles: Vec<&str> = plan.values("weather").iter().map(Choice::title).collect();
        assert_eq!(titles, ["clear", "Fog"]);
        assert!(plan.keys("seed").eq(["seed", "scene.towns"]));
        let costs = ["icp", "fgr"].map(|method| plan.cost(&cells[3].with("method", method)));
        assert_eq!((costs, plan.cost(&cells[0])), ([50.0, 75.0], 20.0));
    }
}
