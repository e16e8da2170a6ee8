//! Unit vectors from angles.

use core::f64::consts::PI;

/// Unit vector at an azimuth (from x towards y) and an elevation (towards z), radians.
pub(super) fn unit(azimuth_rad: f32, elevation_rad: f32) -> [f32; 3] {
    // The same bits on every machine, unlike the standard library's.
    let (sin_azimuth, cos_azimuth) = libm::sincosf(azimuth_rad);
    let (sin_elevation, cos_elevation) = libm::sincosf(elevation_rad);
    [cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation]
}

/// Unit vector at an azimuth and an elevation in degrees, in f64.
pub fn exact_unit(azimuth_deg: f64, elevation_deg: f64) -> [f64; 3] {
    let [(sin_azimuth, cos_azimuth), (sin_elevation, cos_elevation)] =
        [azimuth_deg, elevation_deg].map(|degrees| libm::sincos(degrees * (PI / 180.0)));
    [cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation]
}
