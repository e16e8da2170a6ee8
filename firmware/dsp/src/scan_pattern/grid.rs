//! Grid of beams, uniform in azimuth and elevation.

use core::f32::consts::PI;
use core::fmt;

use super::angle::{exact_unit, unit};

/// Grid of beams, uniform in azimuth and elevation, in the sensor's frame: x ahead, y left, z up.
///
/// The beam of a column and a row points to azimuth `(column + ½) · Δaz − az/2` (towards y
/// positive) and elevation `(row + ½) · Δel − el/2`. The paper's sensor sees ±90° in both
/// (Sec. 4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Grid {
    /// Number of beams along azimuth.
    pub columns: u16,
    /// Number of beams along elevation.
    pub rows: u16,
    /// Full azimuth range, 0.01°.
    pub azimuth_cdeg: u16,
    /// Full elevation range, 0.01°.
    pub elevation_cdeg: u16,
}

impl Default for Grid {
    /// The paper's field of view (Sec. 4.1), 192 × 64 beams.
    fn default() -> Self {
        Self { columns: 192, rows: 64, azimuth_cdeg: 18_000, elevation_cdeg: 18_000 }
    }
}

impl Grid {
    /// Number of beams of a scan.
    pub fn beams(&self) -> u32 {
        u32::from(self.columns).saturating_mul(self.rows.into())
    }

    /// Column and row of a beam, column after column, each from the lowest row up.
    pub fn by_columns(&self, beam: u32) -> [u32; 2] {
        let rows = u32::from(self.rows).max(1);
        [beam.checked_div(rows).unwrap_or(0), beam.checked_rem(rows).unwrap_or(0)]
    }

    /// Column and row of a beam, line after line from the lowest up: even ones from right to left,
    /// odd ones back.
    pub fn by_lines(&self, beam: u32) -> [u32; 2] {
        let columns = u32::from(self.columns).max(1);
        let row = beam.checked_div(columns).unwrap_or(0);
        let along = beam.checked_rem(columns).unwrap_or(0);
        let back = columns.saturating_sub(along).saturating_sub(1);
        [if row & 1 == 0 { along } else { back }, row]
    }

    /// Unit vector of the beam in a column and a row. In f32, within 10⁻⁶ of the exact one.
    pub fn direction(&self, [column, row]: [u32; 2]) -> [f32; 3] {
        let azimuth = angle_rad(column, self.columns, self.azimuth_cdeg);
        let elevation = angle_rad(row, self.rows, self.elevation_cdeg);
        unit(azimuth, elevation)
    }

    /// Unit vector of the beam in a column and a row, by its definition.
    pub fn exact_direction(&self, [column, row]: [u32; 2]) -> [f64; 3] {
        let angle_deg = |index: u32, count: u16, full_cdeg: u16| {
            ((f64::from(index) + 0.5) / f64::from(count) - 0.5) * f64::from(full_cdeg) / 100.0
        };
        exact_unit(
            angle_deg(column, self.columns, self.azimuth_cdeg),
            angle_deg(row, self.rows, self.elevation_cdeg),
        )
    }
}

impl fmt::Display for Grid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [azimuth, elevation] =
            [self.azimuth_cdeg, self.elevation_cdeg].map(|c| f64::from(c) / 100.0);
        write!(f, "{} × {} over {azimuth}° × {elevation}°", self.columns, self.rows)
    }
}

/// Middle of cell `index` of `count` over a full range centred on 0.
fn angle_rad(index: u32, count: u16, full_cdeg: u16) -> f32 {
    let full_rad = f32::from(full_cdeg) * (PI / 18_000.0);
    ((index as f32 + 0.5) / f32::from(count.max(1)) - 0.5) * full_rad
}
