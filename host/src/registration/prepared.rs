//! What registration needs of a cloud, worked out once.

use nalgebra::{Point3, Vector3};

use super::IcpConfig;
use crate::cloud::kdtree::KdTree;
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

/// A cloud to register to: thinned, with normals and a tree. Preparing it is half the work of a registration, so keep
/// it as long as `voxel_m`, `normal_radius_m` and `normal_neighbours` stay.
#[derive(Clone, Debug)]
pub struct Target {
    pub(super) tree: KdTree,
    /// One a point of the tree; zero where there is none.
    pub(super) normals: Vec<Vector3<f32>>,
}

impl Target {
    /// Thins the cloud, estimates its normals and builds its tree.
    ///
    /// # Errors
    ///
    /// [`PrepareError`] when there is no point, or the voxel is too small for the cloud.
    pub fn prepare(cloud: &Cloud, config: &IcpConfig) -> Result<Self, PrepareError> {
        let tree = KdTree::new(&thin(cloud, config)?);
        let normals = normals::of_tree(&tree, config.normal_radius_m, config.normal_neighbours);
        Ok(Self { tree, normals })
    }

    /// How many points are left.
    pub fn len(&self) -> usize {
        self.tree.len()
    }

    /// Whether none is left; [`Target::prepare`] never returns such a one.
    pub fn is_empty(&self) -> bool {
        self.tree.is_empty()
    }
}

/// A cloud to be moved: thinned. It needs neither normals nor a tree.
#[derive(Clone, Debug)]
pub struct Source {
    pub(super) points: Vec<Point3<f32>>,
}

impl Source {
    /// Thins the cloud.
    ///
    /// # Errors
    ///
    /// As [`Target::prepare`].
    pub fn prepare(cloud: &Cloud, config: &IcpConfig) -> Result<Self, PrepareError> {
        Ok(Self { points: thin(cloud, config)? })
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

/// The means of the voxels, without points that are no echo.
fn thin(cloud: &Cloud, config: &IcpConfig) -> Result<Vec<Point3<f32>>, PrepareError> {
    let thinned = if cloud.points.iter().any(|p| p.coords == Vector3::zeros()) {
        let mut echoes = Cloud::new(cloud.points.clone());
        echoes.drop_invalid();
        voxel::downsample(&echoes, config.voxel_m)?
    } else {
        voxel::downsample(cloud, config.voxel_m)?
    };
    if thinned.points.is_empty() { Err(PrepareError::Empty) } else { Ok(thinned.points) }
}
