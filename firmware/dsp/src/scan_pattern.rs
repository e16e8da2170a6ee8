//! Where beams point.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A grid of beams, uniform in azimuth and elevation, in the sensor's frame: x ahead, y left, z up.
///
/// Beam `column · rows + row` points to azimuth `(column + ½) · Δaz − az/2` (towards y positive)
/// and elevation `(row + ½) · Δel − el/2`. The paper's sensor sees ±90° in both (Sec. 4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ScanPattern {
    /// Beams along azimuth.
    pub columns: u16,
    /// Beams along elevation.
    pub rows: u16,
    /// Full azimuth range, 0.01°.
    pub azimuth_cdeg: u16,
    /// Full elevation range, 0.01°.
    pub elevation_cdeg: u16,
}

impl Default for ScanPattern {
    /// The paper's field of view (Sec. 4.1), 192 × 64 beams.
    fn default() -> Self {
        Self { columns: 192, rows: 64, azimuth_cdeg: 18_000, elevation_cdeg: 18_000 }
    }
}

impl ScanPattern {
    /// Number of beams of a scan.
    pub fn beams(&self) -> u32 {
        u32::from(self.columns).saturating_mul(self.rows.into())
    }
}
