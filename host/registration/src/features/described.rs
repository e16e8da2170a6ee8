//! A cloud prepared for matching.

use echoloop_clouds::Cloud;
use nalgebra::{Point3, Vector3};

use super::{Features, fpfh};
use crate::geometry::neighbours::Neighbours;
use crate::geometry::normals;
use crate::prepared::thinned;
use crate::{Convention, FeatureConfig, PrepareError};

/// A thinned cloud with a normal and a feature for each point.
#[derive(Clone, Debug)]
pub struct Described {
    /// Points in the frame of the sensor, m, `[n]`.
    pub points: Vec<Point3<f32>>,
    /// Normals, `[n]`; zero where the surface has no direction.
    pub normals: Vec<Vector3<f32>>,
    /// Features, `[n]`.
    pub features: Features,
}

impl Described {
    /// Thins a cloud and describes its points.
    ///
    /// # Errors
    ///
    /// [`PrepareError`] when there is no point, or the voxel is too small for the cloud.
    pub fn prepare(cloud: &Cloud, config: &FeatureConfig) -> Result<Self, PrepareError> {
        let points = thinned(cloud, config.voxel_m, config.convention)?.points;
        let (radius_m, most) = (config.feature_radius_m, config.feature_neighbours);
        let neighbours = Neighbours::within(&points, radius_m, most);
        let normals = normals_of(&points, &neighbours, config);
        let features = fpfh::describe(&points, &normals, &neighbours);
        Ok(Self { points, normals, features })
    }
}

/// Normals from the features' neighbourhoods where these hold the normals', else from a search of
/// their own.
fn normals_of(
    points: &[Point3<f32>],
    neighbours: &Neighbours,
    config: &FeatureConfig,
) -> Vec<Vector3<f32>> {
    let (radius_m, most) = (config.normal_radius_m, config.normal_neighbours);
    let held = radius_m <= config.feature_radius_m && most <= config.feature_neighbours;
    let own = (!held).then(|| Neighbours::within(points, radius_m, most));
    let neighbours = own.as_ref().unwrap_or(neighbours);
    match config.convention {
        Convention::Sensor => normals::from_neighbours(points, neighbours, radius_m, most),
        Convention::Open3d => normals::from_neighbours_open3d(points, neighbours, radius_m, most),
    }
}
