//! One thing switched: the rows of the second table.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::axes::{Scene, name_of};
use echoloop_closed_loop::config::{Override, RunConfig};

/// What is switched in a cell, and nothing else.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ablation {
    /// The sensor is searched as in the paper: its eight parameters, no power below 5 W.
    SensorRanges,
    /// Registration starts and is searched within the paper's ranges, made for indoors.
    RegistrationRanges,
    /// Rain of 25 mm an hour.
    Rain,
    /// The sensor drives 10 m/s and turns 20°/s during scans of 0.1 s.
    Motion,
    /// Both.
    RainAndMotion,
    /// Tuned in as many other towns of the same kind.
    OtherTown,
    /// Tuned in the next kind of country: town, suburb, wild, town.
    OtherKind,
    /// A quarter of the beams.
    QuarterDensity,
    /// Four times the beams.
    FourfoldDensity,
    /// An OS1-64's beams.
    #[value(name = "os1-64")]
    #[serde(rename = "os1-64")]
    Os164,
    /// A tenth of the energy: 7.5 W at the start, no pulse above 37.5 nJ.
    TenthEnergy,
    /// Maximum likelihood in floating point finds the echoes, not the sensor's program.
    IdealDetector,
}

/// The towns' numbers grow by a multiple of this where others are trained in.
const OTHER_TOWN: u64 = 100;

impl Ablation {
    /// What it sets, over a configuration without it.
    pub fn overrides(self, base: &RunConfig) -> Vec<Override> {
        let set = |key: &str, value: toml::Value| Override::flag(key, value);
        let number = |key: &str, value: f64| set(key, value.into());
        match self {
            Self::SensorRanges => vec![set("tune.lidar", "paper".into())],
            Self::RegistrationRanges => vec![set("registration.preset", "paper".into())],
            Self::Rain => {
                vec![set("weather.kind", "rain".into()), number("weather.rate_mm_h", 25.0)]
            }
            Self::Motion => vec![
                number("motion.duration_s", 0.1),
                set("motion.linear_m_s", vec![10.0, 0.0, 0.0].into()),
                set("motion.angular_deg_s", vec![0.0, 0.0, 20.0].into()),
            ],
            Self::RainAndMotion => {
                [Self::Rain, Self::Motion].iter().flat_map(|each| each.overrides(base)).collect()
            }
            Self::OtherTown | Self::OtherKind => Vec::new(),
            Self::QuarterDensity => beams(base, |beams| beams.div_ceil(2)),
            Self::FourfoldDensity => beams(base, |beams| beams.saturating_mul(2)),
            Self::Os164 => vec![set("scanner.pattern", "os1-64".into())],
            Self::TenthEnergy => {
                vec![number("lidar.power", 7.5), number("emitter.energy_limit_nj", 37.5)]
            }
            Self::IdealDetector => vec![set("detector.kind", "ideal".into())],
        }
    }

    /// Where it is trained, when that is not where it is tested: a configuration whose training
    /// pairs are taken. Its held-out pairs are as few as leave it its towns.
    pub(super) fn trained_in(self, config: &RunConfig, scene: Scene) -> Option<RunConfig> {
        let mut other = config.clone();
        match self {
            Self::OtherTown => {
                // Beyond the greatest, so that none is judged in.
                let greatest = config.scene.towns.iter().max().copied().unwrap_or_default();
                let further = OTHER_TOWN * (greatest / OTHER_TOWN + 1);
                let towns = other.scene.towns.iter_mut();
                towns.for_each(|town| *town = town.saturating_add(further));
            }
            Self::OtherKind => other.scene.source = name_of(scene.next()),
            _ => return None,
        }
        other.data.test_pairs = other.scene.towns.len();
        Some(other)
    }
}

/// As many beams along each axis of a grid as `of` makes of those there are.
fn beams(base: &RunConfig, of: fn(u16) -> u16) -> Vec<Override> {
    let along = [("scanner.columns", base.scanner.columns), ("scanner.rows", base.scanner.rows)];
    let changed = along.into_iter().filter_map(|(key, beams)| Some((key, of(beams?))));
    changed.map(|(key, beams)| Override::flag(key, i64::from(beams))).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::super::axes::TableMethod;
    use super::super::cell::{Base, Cell};
    use super::super::plan::Plan;
    use super::*;
    use echoloop_closed_loop::config::preset::{Preset, Protocol, Strategy};

    fn settings(ablation: Option<Ablation>) -> BTreeMap<String, String> {
        let cell = Cell::start(Preset::Outdoor, TableMethod::Icp, Scene::Structured);
        let cell = Cell { ablation, ..cell.searched(Strategy::Fast, Protocol::Joint) };
        let config = cell.config(&Base::paper(Vec::new())).expect("a configuration");
        Plan::new(&config, false).settings
    }

    #[test]
    fn other_towns_are_as_many_and_none_that_is_judged_in() {
        for (towns, expected) in
            [(vec![1, 2, 3], vec![101, 102, 103]), (vec![1, 101], vec![201, 301])]
        {
            let mut config = RunConfig::default();
            config.scene.towns = towns;
            let other = Ablation::OtherTown.trained_in(&config, Scene::Structured).unwrap();
            assert_eq!(other.scene.towns, expected);
            assert_eq!(other.scene.source, config.scene.source);
        }
    }

    #[test]
    fn a_switch_changes_what_it_is_named_for_and_nothing_else() {
        let plain = settings(None);
        for &ablation in Ablation::value_variants() {
            let expected: &[&str] = match ablation {
                Ablation::SensorRanges => &["tune.lidar"],
                Ablation::RegistrationRanges => &["registration.preset"],
                Ablation::Rain => &["weather.kind", "weather.rate_mm_h"],
                Ablation::Motion => {
                    &["motion.angular_deg_s", "motion.duration_s", "motion.linear_m_s"]
                }
                Ablation::RainAndMotion => &[
                    "motion.angular_deg_s",
                    "motion.duration_s",
                    "motion.linear_m_s",
                    "weather.kind",
                    "weather.rate_mm_h",
                ],
                Ablation::OtherTown | Ablation::OtherKind => &[],
                Ablation::QuarterDensity | Ablation::FourfoldDensity => {
                    &["scanner.columns", "scanner.rows"]
                }
                // A pattern brings its own beams.
                Ablation::Os164 => &[
                    "scanner.azimuth_deg",
                    "scanner.columns",
                    "scanner.elevation_deg",
                    "scanner.pattern",
                    "scanner.rows",
                ],
                Ablation::TenthEnergy => &["emitter.energy_limit_nj", "lidar.power"],
                Ablation::IdealDetector => &["detector.kind"],
            };
            let switched = settings(Some(ablation));
            let keys: BTreeSet<&str> =
                plain.keys().chain(switched.keys()).map(String::as_str).collect();
            let is_changed = |key: &&str| plain.get(*key) != switched.get(*key);
            let changed: Vec<&str> = keys.into_iter().filter(is_changed).collect();
            assert_eq!(changed, expected, "{ablation:?}");
        }
    }
}
