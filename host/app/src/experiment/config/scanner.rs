//! `[scanner]`: how the sensor looks around.

use echoloop_dsp::ScanPattern;
use serde::{Deserialize, Serialize};

use super::error::{RunConfigError, require};
use crate::link::client::MOST_BEAMS;

/// How the sensor looks around.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScannerConfig {
    /// Beams along azimuth.
    pub columns: u16,
    /// Beams along elevation.
    pub rows: u16,
    /// Full azimuth range, degrees.
    pub azimuth_deg: f64,
    /// Full elevation range, degrees.
    pub elevation_deg: f64,
    /// Height above the ground, m.
    pub height_m: f64,
}

impl Default for ScannerConfig {
    fn default() -> Self {
        Self { columns: 192, rows: 64, azimuth_deg: 180.0, elevation_deg: 180.0, height_m: 2.0 }
    }
}

impl ScannerConfig {
    /// The firmware's form.
    pub fn pattern(&self) -> ScanPattern {
        let centi = |degrees: f64| (degrees * 100.0).round() as u16;
        ScanPattern {
            columns: self.columns,
            rows: self.rows,
            azimuth_cdeg: centi(self.azimuth_deg),
            elevation_cdeg: centi(self.elevation_deg),
        }
    }

    pub(super) fn check(&self) -> Result<(), RunConfigError> {
        let [columns, rows] = MOST_BEAMS.map(|most| 1..=most);
        require("scanner.columns", self.columns, columns.contains(&self.columns), "1 to 4096")?;
        require("scanner.rows", self.rows, rows.contains(&self.rows), "1 to 1024")?;
        let full = |v: f64, max: f64| v >= 0.01 && v <= max;
        require(
            "scanner.azimuth_deg",
            self.azimuth_deg,
            full(self.azimuth_deg, 360.0),
            "0.01 to 360",
        )?;
        require(
            "scanner.elevation_deg",
            self.elevation_deg,
            full(self.elevation_deg, 180.0),
            "0.01 to 180",
        )?;
        require(
            "scanner.height_m",
            self.height_m,
            (0.1..=100.0).contains(&self.height_m),
            "0.1 to 100",
        )
    }
}
