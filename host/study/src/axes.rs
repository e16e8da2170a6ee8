//! Axes of the table: methods and kinds of country.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use echoloop_closed_loop::config::Override;

/// A method of the table. FGR has two rows, as Open3D does not run it as published.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TableMethod {
    /// Point-to-plane ICP.
    Icp,
    /// FGR as Open3D 0.20 runs it from Python, most likely the paper's.
    #[value(name = "fgr-open3d")]
    #[serde(rename = "fgr-open3d")]
    FgrOpen3d,
    /// FGR as published.
    Fgr,
    /// Maximal cliques.
    Mac,
}

/// Name in the table, name in the configuration, and FGR's mode, by [`TableMethod`].
const METHODS: [(&str, &str, Option<&str>); 4] = [
    ("ICP", "icp", None),
    ("FGR (Open3D)", "fgr", Some("open3d")),
    ("FGR (published)", "fgr", Some("annealed")),
    ("MAC", "mac", None),
];

impl TableMethod {
    /// Name in the table.
    pub fn title(self) -> &'static str {
        METHODS[self as usize].0
    }

    /// Settings of a run of the method.
    pub(super) fn overrides(self) -> impl Iterator<Item = Override> {
        let (_, method, mode) = METHODS[self as usize];
        let mode = mode.map(|mode| Override::flag("registration.mode", mode));
        [Override::flag("registration.method", method)].into_iter().chain(mode)
    }
}

/// A kind of country.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scene {
    /// Streets, facades, cars.
    Structured,
    /// Houses, gardens, trees.
    SemiStructured,
    /// Trees, bushes, rocks.
    Unstructured,
}

impl Scene {
    /// The next kind; after the last the first.
    pub fn next(self) -> Self {
        let all = Self::value_variants();
        all[(self as usize + 1) % all.len()]
    }
}

/// Name of a choice on the command line and in files.
pub fn name_of(value: impl ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

/// The values, each once, in the order of their first occurrence.
pub(super) fn distinct<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for value in values {
        if !found.contains(&value) {
            found.push(value);
        }
    }
    found
}
