//! From a scan's echoes to a cloud.

use std::f32::consts::PI;

use echoloop_dsp::{Echo, Echoes, ScanPattern};
use echoloop_registration::cloud::Cloud;
use nalgebra::{Point3, Vector3};

/// The points of a scan, sensor frame, m, with their σ_R: one for each echo of each beam.
/// `directions` are the beams' unit vectors.
pub fn cloud_from_scan(scan: &[Echoes], directions: &[Vector3<f32>]) -> Cloud {
    let beams = || scan.iter().zip(directions);
    let points = beams().flat_map(|(echoes, d)| echoes.iter().map(move |echo| point_m(d, echo)));
    let range_sd_m = beams().flat_map(|(echoes, _)| echoes.iter().map(range_sd_m)).collect();
    Cloud { range_sd_m: Some(range_sd_m), ..Cloud::new(points.collect()) }
}

/// What the sensor tells of an echo's range, m.
fn range_sd_m(echo: &Echo) -> f32 {
    f32::from(echo.deviation) / 256e3
}

/// Unit vectors of a pattern's beams, in their order, sensor frame: x ahead, y left, z up.
pub fn directions(pattern: &ScanPattern) -> Vec<Vector3<f32>> {
    (0..pattern.beams()).map(|beam| direction(pattern, beam)).collect()
}

fn direction(pattern: &ScanPattern, beam: u32) -> Vector3<f32> {
    let rows = u32::from(pattern.rows).max(1);
    let azimuth = angle_rad(beam / rows, pattern.columns, pattern.azimuth_cdeg);
    let elevation = angle_rad(beam % rows, pattern.rows, pattern.elevation_cdeg);
    // The same bits on every machine, unlike the standard library's.
    let (sin_azimuth, cos_azimuth) = libm::sincosf(azimuth);
    let (sin_elevation, cos_elevation) = libm::sincosf(elevation);
    Vector3::new(cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation)
}

/// Middle of cell `index` of `count` over a full range centred on 0.
fn angle_rad(index: u32, count: u16, full_cdeg: u16) -> f32 {
    let full_rad = f32::from(full_cdeg) * (PI / 18_000.0);
    ((index as f32 + 0.5) / f32::from(count.max(1)) - 0.5) * full_rad
}

/// The point an echo comes from along a beam's unit vector, m.
fn point_m(direction: &Vector3<f32>, echo: &Echo) -> Point3<f32> {
    Point3::from(direction * (echo.range as f32 / 256e3))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATTERN: ScanPattern =
        ScanPattern { columns: 4, rows: 2, azimuth_cdeg: 18_000, elevation_cdeg: 9_000 };

    #[test]
    fn beams_are_unit_vectors_and_symmetric_about_the_axis() {
        let directions = directions(&PATTERN);
        assert!(directions.iter().all(|direction| (direction.norm() - 1.0).abs() < 1e-6));
        let sum: Vector3<f32> = directions.iter().sum();
        assert!(sum.y.abs() < 1e-5 && sum.z.abs() < 1e-5 && sum.x > 0.0);
    }

    #[test]
    fn a_cloud_has_the_deviation_of_each_echo_in_metres() {
        let mut beam = Echoes::new();
        for deviation in [256 * 20, 128] {
            let _ = beam.push(Echo { range: 256_000, deviation, ..Default::default() });
        }
        let scan = [Echoes::new(), beam];
        let cloud = cloud_from_scan(&scan, &directions(&PATTERN));
        assert_eq!(cloud.range_sd_m, Some(vec![0.02, 0.0005]));
        assert_eq!(cloud_from_scan(&scan, &[]).range_sd_m, Some(vec![]), "no beam, no echo");
    }

    #[test]
    fn a_point_lies_at_the_echo_s_range() {
        let echo = Echo { range: 256_000 * 7, ..Default::default() };
        assert!((point_m(&directions(&PATTERN)[3], &echo).coords.norm() - 7.0).abs() < 1e-5);
    }
}
