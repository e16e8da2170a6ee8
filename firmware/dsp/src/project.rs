//! Where beams point, and where an echo lies in space.

use core::num::NonZero;

use nalgebra::{Point3, Vector3};
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

    /// Unit vector of a beam, sensor frame. Beams past the last wrap in azimuth.
    pub fn direction(&self, beam: u32) -> Vector3<f32> {
        let rows = NonZero::new(u32::from(self.rows)).unwrap_or(NonZero::<u32>::MIN);
        let azimuth = angle_rad(beam / rows, self.columns, self.azimuth_cdeg);
        let elevation = angle_rad(beam % rows, self.rows, self.elevation_cdeg);
        let (sin_azimuth, cos_azimuth) = libm::sincosf(azimuth);
        let (sin_elevation, cos_elevation) = libm::sincosf(elevation);
        Vector3::new(cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation)
    }

    /// The point an echo comes from, sensor frame, metres.
    pub fn point_m(&self, beam: u32, echo: &crate::Echo) -> Point3<f32> {
        point_m(&self.direction(beam), echo)
    }
}

/// The point an echo comes from along a beam's unit vector, metres.
#[expect(clippy::arithmetic_side_effects, reason = "floats")]
pub fn point_m(direction: &Vector3<f32>, echo: &crate::Echo) -> Point3<f32> {
    Point3::from(direction * (echo.range as f32 / 256e3))
}

/// Middle of cell `index` of `count` over a full range centred on 0.
fn angle_rad(index: u32, count: u16, full_cdeg: u16) -> f32 {
    let full_rad = f32::from(full_cdeg) * (core::f32::consts::PI / 18_000.0);
    ((index as f32 + 0.5) / f32::from(count.max(1)) - 0.5) * full_rad
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATTERN: ScanPattern =
        ScanPattern { columns: 4, rows: 2, azimuth_cdeg: 18_000, elevation_cdeg: 9_000 };

    #[test]
    fn beams_are_unit_vectors_and_symmetric_about_the_axis() {
        for beam in 0..PATTERN.beams() {
            assert!((PATTERN.direction(beam).norm() - 1.0).abs() < 1e-6);
        }
        let sum: Vector3<f32> = (0..PATTERN.beams()).map(|b| PATTERN.direction(b)).sum();
        assert!(sum.y.abs() < 1e-5 && sum.z.abs() < 1e-5 && sum.x > 0.0);
    }

    #[test]
    fn a_point_lies_at_the_echo_s_range() {
        let echo = crate::Echo { range: 256_000 * 7, ..Default::default() };
        assert!((PATTERN.point_m(3, &echo).coords.norm() - 7.0).abs() < 1e-5);
    }
}
