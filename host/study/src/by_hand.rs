//! Settings tuned by hand: the three cases of the paper's Fig. 1.
//!
//! For each case the paper says which settings are high, low, small or large (Sec. 1), without
//! values. These are our values, fixed before any was evaluated. High power is the most that the
//! pulse's energy limit allows, low power the least of the paper's range; small and large lie near
//! the ends of registration's ranges. Everything else stays at the default. Our detector has a
//! threshold on σ beside the noise floor, so a dense cloud needs both to be low.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::axes::TableMethod;
use echoloop_closed_loop::config::Override;
use echoloop_closed_loop::config::preset::Preset;

/// A case of Fig. 1, of the method [`Self::METHOD`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ByHand {
    /// Case 1: much light, much gain, low thresholds, so dense and noisy; narrow neighbourhoods.
    Dense,
    /// Case 2: little light, a high threshold, so sparse and clean; narrow neighbourhoods, far
    /// pairs.
    Sparse,
    /// Case 3: much light, a high threshold; wide neighbourhoods, near pairs.
    Careful,
}

/// Settings of a case.
struct Case {
    lidar: &'static [(&'static str, f64)],
    normal_neighbours: i64,
    /// With ranges for outdoors, and with the paper's.
    normal_radius_m: [f64; 2],
    max_pair_distance_m: [f64; 2],
}

/// The cases, in the paper's order.
const CASES: [Case; 3] = [
    Case {
        lidar: &[
            ("lidar.power", 80.0),
            ("lidar.gain", 20.0),
            ("lidar.noise_floor", 5e-4),
            ("lidar.snr_threshold", 3.0),
        ],
        normal_neighbours: 10,
        normal_radius_m: [0.3, 0.02],
        max_pair_distance_m: [0.1, 0.1],
    },
    Case {
        lidar: &[("lidar.power", 5.0), ("lidar.noise_floor", 0.05)],
        normal_neighbours: 10,
        normal_radius_m: [0.3, 0.02],
        max_pair_distance_m: [3.0, 2.0],
    },
    Case {
        lidar: &[("lidar.power", 80.0), ("lidar.noise_floor", 0.02)],
        normal_neighbours: 50,
        normal_radius_m: [5.0, 0.1],
        max_pair_distance_m: [0.3, 0.5],
    },
];

impl ByHand {
    /// Method of all cases.
    pub const METHOD: TableMethod = TableMethod::Icp;

    /// The cases, in the paper's order.
    pub const ALL: [Self; 3] = [Self::Dense, Self::Sparse, Self::Careful];

    /// Number of the case in the paper.
    pub fn number(self) -> usize {
        self as usize + 1
    }

    /// Settings of the case, over the defaults.
    pub fn overrides(self, ranges: Preset) -> Vec<Override> {
        let case = &CASES[self as usize];
        let lengths = [
            ("registration.normal_radius_m", case.normal_radius_m),
            ("registration.max_pair_distance_m", case.max_pair_distance_m),
        ];
        let lengths = lengths.map(|(key, of)| Override::flag(key, of[ranges as usize]));
        let lidar = case.lidar.iter().map(|&(key, value)| Override::flag(key, value));
        let count = Override::flag("registration.normal_neighbours", case.normal_neighbours);
        lidar.chain(lengths).chain([count]).collect()
    }

    /// Settings of the case in words.
    pub fn in_words(self, ranges: Preset) -> String {
        let case = &CASES[self as usize];
        let [radius, distance] =
            [case.normal_radius_m, case.max_pair_distance_m].map(|of| of[ranges as usize]);
        let sensor = case.lidar.iter().map(|&(key, value)| match key {
            "lidar.power" => format!("{value} W"),
            "lidar.gain" => format!("gain {value} dB"),
            "lidar.noise_floor" => format!("noise floor {value} of full scale"),
            "lidar.snr_threshold" => format!("threshold {value} σ"),
            _ => format!("{key} {value}"),
        });
        format!(
            "{}; normals of {} points within {radius} m, pairs up to {distance} m",
            sensor.collect::<Vec<_>>().join(", "),
            case.normal_neighbours
        )
    }
}
