//! Points described by what surrounds them, and matched by that: what global methods start from.

pub mod fpfh;
pub mod matching;

use nalgebra::{Point3, Vector3};

use super::prepared::thinned;
use super::{Convention, FeatureConfig, PrepareError};
use crate::cloud::neighbours::Neighbours;
use crate::cloud::{Cloud, normals};

/// Numbers of a feature: three histograms of eleven bins.
pub const DIMENSIONS: usize = 33;

/// One feature a point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Features {
    /// `[n][33]`. All zero for a point that has none: such a point matches nothing.
    pub rows: Vec<[f32; DIMENSIONS]>,
}

/// A thinned cloud, with a normal and a feature a point.
#[derive(Clone, Debug)]
pub struct Described {
    /// `[n]`, m, sensor frame.
    pub points: Vec<Point3<f32>>,
    /// `[n]`; zero where there is none.
    pub normals: Vec<Vector3<f32>>,
    /// `[n]`.
    pub features: Features,
}

impl Described {
    /// Thins a cloud and describes its points.
    ///
    /// # Errors
    ///
    /// [`PrepareError`] when there is no point, or the voxel is too small for the cloud.
    pub fn prepare(cloud: &Cloud, config: &FeatureConfig) -> Result<Self, PrepareError> {
        let points = thinned(cloud, config.voxel_m, config.convention)?;
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
        Convention::Sensor => normals::of_neighbours(points, neighbours, radius_m, most),
        Convention::Open3d => normals::as_open3d(points, neighbours, radius_m, most),
    }
}

/// Two points that found each other: each one's feature is the nearest to the other's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Index into the source's points.
    pub source: u32,
    /// Index into the target's points.
    pub target: u32,
    /// Squared distance of the features.
    pub squared: f32,
}

/// A match as positions, each in its own frame, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointPair {
    /// Where the source has the point.
    pub source: Point3<f64>,
    /// Where the target has it.
    pub target: Point3<f64>,
}

/// The positions of matches.
pub fn pairs(matches: &[Match], source: &Described, target: &Described) -> Vec<PointPair> {
    let pair = |m: &Match| PointPair {
        source: source.points[m.source as usize].cast(),
        target: target.points[m.target as usize].cast(),
    };
    matches.iter().map(pair).collect()
}
