//! Plan of a folder: the settings that all its cells share.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::cell::Cell;
use super::record::Record;
use echoloop_closed_loop::checksum::Checksum;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::fingerprint::build;
use echoloop_report::finished_runs::flatten;

/// Settings that all cells of a folder share. Cells of two plans never stand in one table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FolderPlan {
    /// Version of this format.
    pub format: u32,
    /// Version of the program.
    pub version: String,
    /// Checksum of the program's file; none where it cannot be read.
    pub build: Option<String>,
    /// The seed.
    pub seed: u64,
    /// True for the small table of `--quick`, which proves nothing.
    pub quick: bool,
    /// Checksum of the settings.
    pub configuration: String,
    /// The shared settings by key.
    pub settings: BTreeMap<String, String>,
}

impl FolderPlan {
    /// Version of the format that is written.
    pub const FORMAT: u32 = 1;

    /// Plan of the configuration that all cells vary.
    pub fn new(config: &RunConfig, quick: bool) -> Self {
        let mut settings = BTreeMap::new();
        flatten("", &toml::Table::try_from(config).unwrap_or_default(), &mut settings);
        Self {
            format: Self::FORMAT,
            version: env!("CARGO_PKG_VERSION").into(),
            build: build(),
            seed: config.seed,
            quick,
            configuration: configuration(config),
            settings,
        }
    }

    /// First difference between a record and the one expected of a cell: name, value in the record,
    /// value expected.
    pub(super) fn mismatch(
        &self,
        record: &Record,
        cell: &Cell,
    ) -> Option<(&'static str, String, String)> {
        let facts = [
            ("format", record.format.to_string(), Record::FORMAT.to_string()),
            ("cell", record.cell.to_string(), cell.to_string()),
            ("seed", record.seed.to_string(), self.seed.to_string()),
            ("version", record.version.clone(), self.version.clone()),
            ("build", text(&record.build), text(&self.build)),
        ];
        facts.into_iter().find(|(_, was, is)| was != is)
    }

    /// First difference from another plan: name, value here, value in the other.
    pub fn difference(&self, other: &Self) -> Option<(String, String, String)> {
        let facts = |plan: &Self| {
            [
                ("format", plan.format.to_string()),
                ("seed", plan.seed.to_string()),
                ("version", plan.version.clone()),
                ("build", text(&plan.build)),
                ("--quick", plan.quick.to_string()),
            ]
        };
        let facts = facts(self).into_iter().zip(facts(other));
        let facts = facts.map(|((name, was), (_, is))| (name.to_owned(), was, is));
        let at = |plan: &Self, key: &String| plan.settings.get(key).cloned();
        let value = |plan: &Self, key| at(plan, key).unwrap_or_else(|| "not set".to_owned());
        let keys = self.settings.keys().chain(other.settings.keys());
        let keys = keys.filter(|key| at(self, key) != at(other, key));
        let settings = keys.map(|key| (key.clone(), value(self, key), value(other, key)));
        facts.filter(|(_, was, is)| was != is).chain(settings).next()
    }
}

fn text(value: &Option<String>) -> String {
    value.clone().unwrap_or_else(|| "unknown".into())
}

/// Checksum of every value of a configuration.
pub fn configuration(config: &RunConfig) -> String {
    Checksum::of(&[toml::to_string(config).unwrap_or_default().as_bytes()]).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_of_two_plans_is_named_with_both_values() {
        let config = RunConfig::default();
        let plan = FolderPlan::new(&config, false);
        assert_eq!(plan.difference(&FolderPlan::new(&config, false)), None);
        let mut other = config.clone();
        other.data.test_pairs = 7;
        let named = |a: &str, b: &str, c: &str| Some((a.into(), b.into(), c.into()));
        assert_eq!(
            plan.difference(&FolderPlan::new(&other, false)),
            named("data.test_pairs", "40", "7")
        );
        other.seed = 9;
        assert_eq!(plan.difference(&FolderPlan::new(&other, false)), named("seed", "1", "9"));
        assert_eq!(
            plan.difference(&FolderPlan::new(&config, true)),
            named("--quick", "false", "true")
        );
        let older = FolderPlan { version: "0.0.1".into(), ..plan.clone() };
        assert_eq!(older.difference(&plan).unwrap().0, "version");
    }
}
