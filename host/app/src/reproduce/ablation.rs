//! One thing switched: the rows of the second table.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::axes::{Scene, name_of};
use crate::experiment::config::{Override, RunConfig};

/// What is switched in a cell, and nothing else.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ablation {
    /// The sensor is searched as in the paper: its eight parameters, no power below 5 W.
    SensorRanges,
    /// Rain of 25 mm an hour.
    Rain,
    /// The sensor drives 10 m/s and turns 20°/s during scans of 0.1 s.
    Motion,
    /// Tuned in one other town of the same kind.
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

/// Added to a town's number where others are trained in.
const OTHER_TOWN: u64 = 100;

impl Ablation {
    /// What it sets, over a configuration without it.
    pub fn overrides(self, base: &RunConfig) -> Vec<Override> {
        let set = |key: &str, value: toml::Value| Override::flag(key, value);
        let number = |key: &str, value: f64| set(key, value.into());
        match self {
            Self::SensorRanges => vec![set("tune.lidar", "paper".into())],
            Self::Rain => {
                vec![set("weather.kind", "rain".into()), number("weather.rate_mm_h", 25.0)]
            }
            Self::Motion => vec![
                number("motion.duration_s", 0.1),
                set("motion.linear_m_s", vec![10.0, 0.0, 0.0].into()),
                set("motion.angular_deg_s", vec![0.0, 0.0, 20.0].into()),
            ],
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
    pub fn trained_in(self, config: &RunConfig, scene: Scene) -> Option<RunConfig> {
        let mut other = config.clone();
        match self {
            Self::OtherTown => {
                let first = config.scene.towns.first().copied().unwrap_or_default();
                other.scene.towns = vec![first.saturating_add(OTHER_TOWN)];
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
