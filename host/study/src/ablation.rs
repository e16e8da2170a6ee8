//! Ablations, the rows of the second table: each changes one thing. `switches.toml` lists them.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use clap::ValueEnum;
use clap::builder::PossibleValue;
use serde::{Deserialize, Serialize};

use super::axes::{Scene, name_of};
use echoloop_closed_loop::config::{Override, RunConfig};

/// An ablation: the index of its switch in the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Ablation(usize);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    switch: Vec<Switch>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Switch {
    name: String,
    help: String,
    #[serde(default)]
    set: BTreeMap<String, toml::Value>,
    #[serde(default = "unchanged")]
    beams_times: f64,
    trained_in: Option<TrainedIn>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum TrainedIn {
    OtherTown,
    OtherKind,
}

fn unchanged() -> f64 {
    1.0
}

/// The list; a test checks that it can be read.
static LIST: LazyLock<Vec<Switch>> = LazyLock::new(|| {
    let list: Result<List, _> = toml::from_str(include_str!("switches.toml"));
    list.map(|list| list.switch).unwrap_or_default()
});

static ALL: LazyLock<Vec<Ablation>> = LazyLock::new(|| (0..LIST.len()).map(Ablation).collect());

/// Training in other towns adds a multiple of this to the towns' numbers.
const OTHER_TOWN: u64 = 100;

impl Ablation {
    /// The ablation of a name.
    pub fn named(name: &str) -> Option<Self> {
        LIST.iter().position(|switch| switch.name == name).map(Self)
    }

    fn switch(self) -> &'static Switch {
        &LIST[self.0]
    }

    /// True when it sets a key of the configuration.
    pub fn sets(self, key: &str) -> bool {
        self.switch().set.contains_key(key)
    }

    /// Settings of the switch; `base` is the configuration without it.
    pub fn overrides(self, base: &RunConfig) -> Vec<Override> {
        let Switch { set, beams_times, .. } = self.switch();
        let set = set.iter().map(|(key, value)| Override::flag(key, value.clone()));
        let (columns, rows) = (base.scanner.columns, base.scanner.rows);
        let along = [("scanner.columns", columns), ("scanner.rows", rows)].into_iter();
        let beams = along.filter(|_| *beams_times != 1.0).filter_map(|(key, beams)| {
            let beams = (f64::from(beams?) * beams_times).ceil() as u16;
            Some(Override::flag(key, i64::from(beams)))
        });
        set.chain(beams).collect()
    }

    /// Configuration whose training pairs are taken, where the switch trains elsewhere. It has the
    /// fewest held-out pairs that its towns allow, as none is used.
    pub(super) fn trained_in(self, config: &RunConfig, scene: Scene) -> Option<RunConfig> {
        let mut other = config.clone();
        match self.switch().trained_in? {
            TrainedIn::OtherTown => {
                // Beyond the greatest number, so that no town is one of the held-out pairs.
                let greatest = config.scene.towns.iter().max().copied().unwrap_or_default();
                let offset = OTHER_TOWN * (greatest / OTHER_TOWN + 1);
                let towns = other.scene.towns.iter_mut();
                towns.for_each(|town| *town = town.saturating_add(offset));
            }
            TrainedIn::OtherKind => other.scene.source = name_of(scene.next()),
        }
        other.data.test_pairs = other.scene.towns.len();
        Some(other)
    }
}

impl ValueEnum for Ablation {
    fn value_variants<'a>() -> &'a [Self] {
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let Switch { name, help, .. } = self.switch();
        Some(PossibleValue::new(name.as_str()).help(help.as_str()))
    }
}

impl TryFrom<String> for Ablation {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        Self::named(&name).ok_or_else(|| format!("no switch is named {name:?}"))
    }
}

impl From<Ablation> for String {
    fn from(ablation: Ablation) -> Self {
        ablation.switch().name.clone()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::axes::TableMethod;
    use super::super::cell::{Base, Cell};
    use super::super::plan::Plan;
    use super::*;
    use echoloop_closed_loop::config::preset::{Preset, Protocol, Strategy};

    fn cell(ablation: Option<Ablation>) -> (Cell, RunConfig) {
        let cell = Cell::start(Preset::Outdoor, TableMethod::Icp, Scene::Unstructured);
        let cell = Cell { ablation, ..cell.searched(Strategy::Fast, Protocol::Joint) };
        (cell, cell.config(&Base::paper(Vec::new())).expect("a configuration"))
    }

    #[test]
    fn other_towns_are_as_many_and_none_is_evaluated() {
        for (towns, expected) in
            [(vec![1, 2, 3], vec![101, 102, 103]), (vec![1, 101], vec![201, 301])]
        {
            let mut config = RunConfig::default();
            config.scene.towns = towns;
            let other_town = Ablation::named("other-town").unwrap();
            let other = other_town.trained_in(&config, Scene::Structured).unwrap();
            assert_eq!(other.scene.towns, expected);
            assert_eq!(other.scene.source, config.scene.source);
        }
    }

    #[test]
    fn a_switch_changes_its_own_settings_alone() {
        let motion = ["motion.angular_deg_s", "motion.duration_s", "motion.linear_m_s"];
        let rain = ["weather.kind", "weather.rate_mm_h"];
        let expected: [(&str, &[&str]); 12] = [
            ("sensor-ranges", &["tune.lidar"]),
            ("registration-ranges", &["registration.preset"]),
            ("rain", &rain),
            ("motion", &motion),
            ("rain-and-motion", &[&motion[..], &rain[..]].concat()),
            ("other-town", &[]),
            ("other-kind", &[]),
            ("quarter-density", &["scanner.columns", "scanner.rows"]),
            ("fourfold-density", &["scanner.columns", "scanner.rows"]),
            // A pattern brings its own beams.
            (
                "os1-64",
                &[
                    "scanner.azimuth_deg",
                    "scanner.columns",
                    "scanner.elevation_deg",
                    "scanner.pattern",
                    "scanner.rows",
                ],
            ),
            ("tenth-energy", &["emitter.energy_limit_nj", "lidar.power"]),
            ("ideal-detector", &["detector.kind"]),
        ];
        assert_eq!(ALL.len(), expected.len());
        let settings = |config: &RunConfig| Plan::new(config, false).settings;
        let (plain_cell, plain) = cell(None);
        let plain = settings(&plain);
        for (&ablation, (name, expected)) in ALL.iter().zip(expected) {
            assert_eq!(Ablation::named(name), Some(ablation));
            let (cell, config) = cell(Some(ablation));
            let switched = settings(&config);
            let keys: BTreeSet<&str> =
                plain.keys().chain(switched.keys()).map(String::as_str).collect();
            let is_changed = |key: &&str| plain.get(*key) != switched.get(*key);
            let changed: Vec<&str> = keys.into_iter().filter(is_changed).collect();
            assert_eq!(changed, expected, "{name}");
            let trained_in = cell.trained_in(&config);
            assert_eq!(trained_in.is_some(), expected.is_empty(), "{name} switches nothing");
            assert_eq!(cell.untuned().trained_in(&config), None, "it has no search");
            assert_eq!(cell.plain(), plain_cell);
            if name == "other-kind" {
                assert_eq!(trained_in.unwrap().scene.source, "structured");
            }
        }
    }

    #[test]
    fn a_record_has_a_switch_by_its_name() {
        let rain = Ablation::named("rain");
        assert_eq!(serde_json::to_string(&rain).unwrap(), "\"rain\"");
        assert_eq!(serde_json::from_str::<Option<Ablation>>("\"rain\"").unwrap(), rain);
        assert!(serde_json::from_str::<Ablation>("\"snow\"").is_err());
    }
}
