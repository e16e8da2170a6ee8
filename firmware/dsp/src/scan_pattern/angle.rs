//! Unit vectors from angles.

/// Unit vector at an azimuth (from x towards y) and an elevation (towards z), radians.
pub(super) fn unit(azimuth_rad: f32, elevation_rad: f32) -> [f32; 3] {
    // The same bits on every machine, unlike the standard library's.
    let (sin_azimuth, cos_azimuth) = libm::sincosf(azimuth_rad);
    let (sin_elevation, cos_elevation) = libm::sincosf(elevation_rad);
    [cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation]
}
