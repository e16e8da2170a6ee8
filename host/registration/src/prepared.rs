//! What registration needs of a cloud, worked out once.

use nalgebra::{Point3, Vector3};

use super::{Convention, GicpConfig, IcpConfig};
use crate::cloud::box_tree::{self, BoxTree};
use crate::cloud::voxel::VoxelError;
use crate::cloud::{Cloud, normals, voxel};

/// Why a cloud cannot be prepared.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PrepareError {
    /// It holds no echo.
    #[error("the cloud holds no point")]
    Empty,
    /// It cannot be cut into voxels.
    #[error(transparent)]
    Voxel(#[from] VoxelError),
}

/// How a cloud is thinned, and how its normals are estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Edge of the voxels, m.
    pub voxel_m: f64,
    /// Neighbours within this make a normal, m.
    pub normal_radius_m: f64,
    /// At most so many neighbours, the point included.
    pub normal_neighbours: usize,
    /// Whether the points to be moved have normals, too.
    pub source_normals: bool,
}

impl From<&IcpConfig> for Surface {
    fn from(config: &IcpConfig) -> Self {
        let IcpConfig { voxel_m, normal_radius_m, normal_neighbours, .. } = *config;
        let source_normals = config.max_normal_angle_rad.is_some();
        Self { voxel_m, normal_radius_m, normal_neighbours, source_normals }
    }
}

impl From<&GicpConfig> for Surface {
    fn from(config: &GicpConfig) -> Self {
        let GicpConfig { voxel_m, normal_radius_m, normal_neighbours, .. } = *config;
        Self { voxel_m, normal_radius_m, normal_neighbours, source_normals: true }
    }
}

/// A cloud to register to: thinned, with normals and a tree. Preparing it is half the work of a
/// registration, so keep it as long as `voxel_m`, `normal_radius_m` and `normal_neighbours` stay.
/// Generalised ICP wants its source so, too.
#[derive(Clone, Debug)]
pub struct Target {
    pub(super) tree: BoxTree,
    /// One a point of the tree; zero where there is none.
    pub(super) normals: Vec<Vector3<f32>>,
}

impl Target {
    /// Thins the cloud, estimates its normals and builds its tree.
    ///
    /// # Errors
    ///
    /// [`PrepareError`] when there is no point, or the voxel is too small for the cloud.
    pub fn prepare(cloud: &Cloud, surface: impl Into<Surface>) -> Result<Self, PrepareError> {
        let surface = surface.into();
        let tree = BoxTree::new(thin(cloud, surface.voxel_m)?);
        let normals = surface.normals(&tree);
        Ok(Self { tree, normals })
    }

    /// How many points are left.
    pub fn len(&self) -> usize {
        self.tree.points().len()
    }

    /// Whether none is left; [`Target::prepare`] never returns such a one.
    pub fn is_empty(&self) -> bool {
        self.tree.points().is_empty()
    }
}

impl Surface {
    fn normals(&self, tree: &BoxTree) -> Vec<Vector3<f32>> {
        normals::of_tree(tree, self.normal_radius_m, self.normal_neighbours)
    }
}

/// A cloud to be moved: thinned, with normals if the settings compare them. It needs no tree.
#[derive(Clone, Debug)]
pub struct Source {
    pub(super) points: Vec<Point3<f32>>,
    /// One a point, zero where there is none; or none at all.
    pub(super) normals: Vec<Vector3<f32>>,
}

impl Source {
    /// Thins the cloud, and estimates its normals if they are wanted.
    ///
    /// # Errors
    ///
    /// As [`Target::prepare`].
    pub fn prepare(cloud: &Cloud, surface: impl Into<Surface>) -> Result<Self, PrepareError> {
        let surface = surface.into();
        let points = thin(cloud, surface.voxel_m)?;
        if !surface.source_normals {
            return Ok(Self { points, normals: Vec::new() });
        }
        let tree = BoxTree::new(points);
        let normals = surface.normals(&tree);
        Ok(Self { points: tree.into_points(), normals })
    }

    /// How many points are left.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether none is left; [`Source::prepare`] never returns such a one.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// The means of the voxels in the order of a tree, without points that are no echo.
fn thin(cloud: &Cloud, voxel_m: f64) -> Result<Vec<Point3<f32>>, PrepareError> {
    let points = thinned(cloud, voxel_m, Convention::Sensor)?;
    Ok(box_tree::order(&points).iter().map(|&index| points[index as usize]).collect())
}

/// The means of the voxels, without points that are no echo.
///
/// # Errors
///
/// [`PrepareError`] when there is no echo, or the voxel is too small for the cloud.
pub(super) fn thinned(
    cloud: &Cloud,
    voxel_m: f64,
    convention: Convention,
) -> Result<Vec<Point3<f32>>, PrepareError> {
    let downsample = match convention {
        Convention::Sensor => voxel::downsample,
        Convention::Open3d => voxel::downsample_open3d,
    };
    // Voxels skip what is not finite; only points at the origin are worth a copy without them.
    let thinned = if cloud.points.iter().any(|p| p.coords == Vector3::zeros()) {
        let mut echoes = Cloud::new(cloud.points.clone());
        echoes.drop_invalid();
        downsample(&echoes, voxel_m)?
    } else {
        downsample(cloud, voxel_m)?
    };
    if thinned.points.is_empty() { Err(PrepareError::Empty) } else { Ok(thinned.points) }
}
