//! Settings that fit the clouds at hand.

use nalgebra::Point3;

use super::IcpConfig;
use crate::cloud::{Cloud, is_finite};

/// Voxels across the radius of a cloud.
const VOXELS_A_RADIUS: f64 = 80.0;

/// Settings for `register` when its user gives none: scaled to the clouds, coarse to fine.
///
/// The radius of a cloud is that of the ball around its median point that holds 9 of 10 points; of two clouds, the
/// larger. On four outdoor pairs (radii 10 to 37 m, motions up to 3.4 m and 10°) this comes about 1 cm and 0.2° from the
/// truth in both directions from the identity; plain ICP with pairs within 1 m fails one of those eight by 2.6 m. It
/// also came there from 24 starts up to 2 m and 11° off on three of the pairs; on the fourth (radius 10 m) from 12.
///
/// | setting | of the radius | at 24 m |
/// |---|---|---|
/// | voxel | 1/80 | 0.3 m |
/// | normal radius | 3 voxels | 0.9 m |
/// | pair distance, first | 1/4 | 6 m |
/// | pair distance, last | 2 voxels | 0.6 m |
pub fn suggest(target: &Cloud, source: &Cloud) -> IcpConfig {
    let radius_m = radius_m(target).max(radius_m(source));
    let config = scaled(radius_m);
    if config.check().is_ok() { config } else { IcpConfig::outdoor() }
}

fn scaled(radius_m: f64) -> IcpConfig {
    let voxel_m = radius_m / VOXELS_A_RADIUS;
    IcpConfig {
        voxel_m,
        normal_radius_m: 3.0 * voxel_m,
        max_pair_distance_m: 2.0 * voxel_m,
        first_pair_distance_m: Some(radius_m / 4.0),
        still_m: voxel_m / 600.0,
        ..IcpConfig::outdoor()
    }
}

/// Of the ball around the median point that holds 9 of 10 points; 0 for a cloud without points.
fn radius_m(cloud: &Cloud) -> f64 {
    let echoes: Vec<&Point3<f32>> = cloud.points.iter().filter(|p| is_finite(p) && p.coords.norm() > 0.0).collect();
    let middle = Point3::from([0, 1, 2].map(|axis| quantile(echoes.iter().map(|p| p[axis]), 0.5)));
    f64::from(quantile(echoes.iter().map(|p| (*p - middle).norm()), 0.9))
}

fn quantile(values: impl Iterator<Item = f32>, share: f64) -> f32 {
    let mut values: Vec<f32> = values.collect();
    let at = ((values.len() as f64 * share) as usize).min(values.len().saturating_sub(1));
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(at, f32::total_cmp).1 }
}
