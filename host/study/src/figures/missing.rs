//! Sentences about missing cells, with the command that runs them.

use clap::ValueEnum;

use super::super::axes::name_of;
use super::super::cell::{Base, Cell};
use super::super::folder_plan::FolderPlan;

/// Wording for missing cells of a folder.
#[derive(Clone, Debug)]
pub(super) struct Missing {
    /// Command of the folder, without the flags that select cells.
    command: String,
}

impl Missing {
    /// Wording for a folder of this plan, whose unusual settings the command repeats.
    pub(super) fn of(plan: &FolderPlan) -> Self {
        let usual =
            Base::usual(plan.quick).config().map(|config| FolderPlan::new(&config, plan.quick));
        let usual = usual.map(|plan| plan.settings).unwrap_or_default();
        let differs = |(key, value): &(&String, &String)| usual.get(*key) != Some(value);
        let set = plan.settings.iter().filter(differs).map(|(key, value)| match key.as_str() {
            "seed" => format!(" --seed {value}"),
            "data.test_pairs" => format!(" --pairs {value}"),
            "data.train_pairs" => format!(" --train-pairs {value}"),
            "tune.generations" => format!(" --generations {value}"),
            key => format!(" --set {}", quoted(&format!("{key}={value}"))),
        });
        let quick = if plan.quick { " --quick" } else { "" };
        Self { command: format!("echoloop reproduce{quick}{}", set.collect::<String>()) }
    }

    /// Sentence about the missing cells of a figure; empty where none is missing.
    pub(super) fn of_some(&self, all: usize, missing: &[Cell]) -> String {
        match missing.len() {
            0 => String::new(),
            1 => format!("One of {all} cells is missing; {}", self.runs(missing)),
            some => format!("{some} of {all} cells are missing; {}", self.runs(missing)),
        }
    }

    /// Sentence about a figure without any cell.
    pub(super) fn of_all(&self, figure: &str, missing: &[Cell]) -> String {
        format!("Left out: {figure}. No cell for it is done; {}", self.runs(missing))
    }

    fn runs(&self, missing: &[Cell]) -> String {
        format!("`{}{}` runs them, with the folder's --runs.", self.command, axes(missing))
    }
}

/// Flags that select some cells: along each axis the values that they have.
fn axes(cells: &[Cell]) -> String {
    let by_hand = cells.iter().any(|cell| cell.by_hand.is_some());
    let flag = |name: &str, values: Vec<String>| match values.is_empty() {
        true => String::new(),
        false => format!(" --{name} {}", values.join(",")),
    };
    [
        if by_hand { " --by-hand".to_owned() } else { String::new() },
        flag("protocol", values(cells, |cell| Some(cell.protocol))),
        flag("method", values(cells, |cell| Some(cell.method))),
        flag("scene", values(cells, |cell| Some(cell.scene))),
        flag("ranges", values(cells, |cell| Some(cell.ranges))),
        flag("strategy", values(cells, |cell| cell.strategy)),
    ]
    .concat()
}

/// Names of the values that cells have along an axis, in the axis' order.
fn values<T: ValueEnum + PartialEq>(cells: &[Cell], of: fn(&Cell) -> Option<T>) -> Vec<String> {
    let has = |value: &&T| cells.iter().any(|cell| of(cell).as_ref() == Some(*value));
    T::value_variants().iter().filter(has).map(|value| name_of(value.clone())).collect()
}

/// Text quoted for a shell.
fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-=/,".contains(c);
    if text.chars().all(is_plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}
