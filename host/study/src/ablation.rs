//! Ablations, the rows of the second table, as far as they are more than settings of the plan.

use super::axes::{Ablation, Scene, name_of};
use echoloop_closed_loop::config::{Override, RunConfig};

/// Training in other towns adds a multiple of this to the towns' numbers.
const OTHER_TOWN: u64 = 100;

impl Ablation {
    /// Beams along each axis of the grid, where the switch multiplies them; `base` is the
    /// configuration without it.
    pub(super) fn beams(self, base: &RunConfig) -> impl Iterator<Item = Override> {
        let times = match &*self.choice().name {
            "quarter-density" => Some(0.5),
            "fourfold-density" => Some(2.0),
            _ => None,
        };
        let along =
            [("scanner.columns", base.scanner.columns), ("scanner.rows", base.scanner.rows)];
        along.into_iter().filter_map(move |(key, beams)| {
            let beams = (f64::from(beams?) * times?).ceil() as u16;
            Some(Override::flag(key, i64::from(beams)))
        })
    }

    /// Configuration whose training pairs are taken, where the switch trains elsewhere. It has the
    /// fewest held-out pairs that its towns allow, as none is used.
    pub(super) fn trained_in(self, config: &RunConfig, scene: Scene) -> Option<RunConfig> {
        let mut other = config.clone();
        match &*self.choice().name {
            "other-town" => {
                // Beyond the greatest number, so that no town is one of the held-out pairs.
                let greatest = config.scene.towns.iter().max().copied().unwrap_or_default();
                let offset = OTHER_TOWN * (greatest / OTHER_TOWN + 1);
                let towns = other.scene.towns.iter_mut();
                towns.for_each(|town| *town = town.saturating_add(offset));
            }
            "other-kind" => other.scene.source = name_of(scene.next()),
            _ => return None,
        }
        other.data.test_pairs = other.scene.towns.len();
        Some(other)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clap::ValueEnum;

    use super::super::cell::{Base, Cell};
    use super::super::folder_plan::FolderPlan;
    use super::super::record::fixture::start;
    use super::*;
    use echoloop_closed_loop::config::preset::{Protocol, Strategy};

    fn cell(ablation: Option<Ablation>) -> (Cell, RunConfig) {
        let cell = start("icp", "unstructured").searched(Strategy::Fast, Protocol::Joint);
        let cell = Cell { ablation, ..cell };
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
            let other = other_town.trained_in(&config, start("icp", "structured").scene).unwrap();
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
        let all = Ablation::value_variants();
        assert_eq!(all.len(), expected.len());
        let settings = |config: &RunConfig| FolderPlan::new(config, false).settings;
        let (plain_cell, plain) = cell(None);
        let plain = settings(&plain);
        for (&ablation, (name, expected)) in all.iter().zip(expected) {
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
