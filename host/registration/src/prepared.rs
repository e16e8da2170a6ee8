//! Clouds prepared for registration: thinned, with normals and a tree.

use echoloop_clouds::Cloud;
use nalgebra::{Point3, Vector3};

use super::{Convention, GicpConfig, IcpConfig};
use crate::geometry::box_tree::{self, BoxTree, nearest};
use crate::geometry::normals::Plane;
use crate::geometry::quantile::quantile;
use crate::geometry::voxel::VoxelError;
use crate::geometry::{normals, voxel};

/// Reason why a cloud cannot be prepared.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PrepareError {
    /// The cloud holds no echo.
    #[error("the cloud holds no point")]
    Empty,
    /// The cloud cannot be cut into voxels.
    #[error(transparent)]
    Voxel(#[from] VoxelError),
}

/// Settings of voxels and normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Edge of the voxels, m.
    pub voxel_m: f64,
    /// Radius of the neighbourhood of a normal, m.
    pub normal_radius_m: f64,
    /// Most neighbours of a normal, the point included.
    pub normal_neighbours: usize,
    /// True when four points that lie together share a normal. It costs a quarter of the time, and
    /// suits methods that take a mean over all points.
    pub shares_normals: bool,
    /// True when the source needs normals, too.
    pub source_normals: bool,
}

impl From<&IcpConfig> for Surface {
    fn from(config: &IcpConfig) -> Self {
        let IcpConfig { voxel_m, normal_radius_m, normal_neighbours, .. } = *config;
        let source_normals = config.max_normal_angle_rad.is_some();
        let shares_normals = false;
        Self { voxel_m, normal_radius_m, normal_neighbours, shares_normals, source_normals }
    }
}

impl From<&GicpConfig> for Surface {
    fn from(config: &GicpConfig) -> Self {
        let GicpConfig { voxel_m, normal_radius_m, normal_neighbours, .. } = *config;
        let (shares_normals, source_normals) = (false, true);
        Self { voxel_m, normal_radius_m, normal_neighbours, shares_normals, source_normals }
    }
}

/// A cloud to register to: thinned, with normals and a tree. Preparing it is half the work of a
/// registration, so keep it while its [`Surface`] stays the same. Generalised ICP takes its source
/// in this form too.
#[derive(Clone, Debug)]
pub struct Target {
    pub(super) tree: BoxTree,
    /// Normal of each point of the tree; zero where the surface has no direction.
    pub(super) normals: Vec<Vector3<f32>>,
    pub(super) noise: RangeNoise,
}

impl Target {
    /// Thins the cloud, estimates its normals and builds its tree.
    ///
    /// # Errors
    ///
    /// [`PrepareError`] when there is no point, or the voxel is too small for the cloud.
    pub fn prepare(cloud: &Cloud, surface: impl Into<Surface>) -> Result<Self, PrepareError> {
        Self::with_planes(cloud, &surface.into()).map(|(target, _)| target)
    }

    /// The same, with the plane through the neighbours of each point.
    pub(crate) fn with_planes(
        cloud: &Cloud,
        surface: &Surface,
    ) -> Result<(Self, Vec<Plane>), PrepareError> {
        Ok(Self::of_thinned(thin(cloud, surface.voxel_m)?, surface))
    }

    /// The same of points in the order of a tree, which stay as they are.
    pub(crate) fn of_thinned(thinned: Cloud, surface: &Surface) -> (Self, Vec<Plane>) {
        let tree = BoxTree::new(thinned.points);
        let planes_of = if surface.shares_normals { normals::of_halves } else { normals::of_tree };
        let planes = planes_of(&tree, surface.normal_radius_m, surface.normal_neighbours);
        let normals: Vec<Vector3<f32>> = planes.iter().map(|plane| plane.normal).collect();
        let noise = RangeNoise::of(tree.points(), &normals, thinned.range_sd_m.as_deref());
        (Self { tree, normals, noise }, planes)
    }

    /// Index of the nearest point strictly within `radius_m`.
    pub(crate) fn nearest(&self, at: &Point3<f32>, radius_m: f32) -> Option<usize> {
        nearest(&self.tree, at, radius_m).map(|index| index as usize)
    }

    /// Count of the points left.
    pub fn len(&self) -> usize {
        self.tree.points().len()
    }

    /// True without points, which [`Target::prepare`] never returns.
    pub fn is_empty(&self) -> bool {
        self.tree.points().is_empty()
    }
}

/// A cloud to be moved: thinned, with normals if the settings compare them. It needs no tree.
#[derive(Clone, Debug)]
pub struct Source {
    pub(super) points: Vec<Point3<f32>>,
    /// Normal of each point, zero where the surface has no direction; empty when not needed.
    pub(super) normals: Vec<Vector3<f32>>,
    pub(super) noise: RangeNoise,
}

impl Source {
    /// Thins the cloud, and estimates its normals if they are wanted.
    ///
    /// # Errors
    ///
    /// As for [`Target::prepare`].
    pub fn prepare(cloud: &Cloud, surface: impl Into<Surface>) -> Result<Self, PrepareError> {
        let surface = surface.into();
        Ok(Self::of_thinned(thin(cloud, surface.voxel_m)?, &surface))
    }

    /// Points in the order of a tree as they are, with normals if they are wanted.
    pub(crate) fn of_thinned(thinned: Cloud, surface: &Surface) -> Self {
        if !surface.source_normals {
            let (normals, noise) = (Vec::new(), RangeNoise::default());
            return Self { points: thinned.points, normals, noise };
        }
        let (Target { tree, normals, noise }, _) = Target::of_thinned(thinned, surface);
        Self { points: tree.into_points(), normals, noise }
    }

    /// Count of the points left.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// True without points, which [`Source::prepare`] never returns.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// Variance of each point's distance from a plane due to the error of its range.
#[derive(Clone, Debug, Default)]
pub(super) struct RangeNoise {
    /// Variance along the point's own normal, m²; empty when the sensor reports no σ_R.
    pub(super) variances_m2: Vec<f32>,
    /// Their median, m², as the residuals' scale is a median.
    pub(super) median_m2: f64,
}

impl RangeNoise {
    /// Noise of points in the frame of their sensor: `(σ_R cos θ)²`, θ between
    /// beam and normal.
    fn of(points: &[Point3<f32>], normals: &[Vector3<f32>], range_sd_m: Option<&[f32]>) -> Self {
        let along = |((point, normal), sd): ((&Point3<f32>, &Vector3<f32>), &f32)| {
            let range_m = point.coords.norm().max(f32::MIN_POSITIVE);
            (sd * point.coords.dot(normal) / range_m).powi(2)
        };
        let of_points = points.iter().zip(normals).zip(range_sd_m.unwrap_or_default());
        let variances_m2: Vec<f32> = of_points.map(along).collect();
        let median_m2 = f64::from(quantile(variances_m2.iter().copied(), 0.5));
        Self { variances_m2, median_m2 }
    }
}

/// The means of the voxels in the order of a tree, without points that are no echo.
///
/// # Errors
///
/// As for [`thinned`].
pub(crate) fn thin(cloud: &Cloud, voxel_m: f64) -> Result<Cloud, PrepareError> {
    let thinned = thinned(cloud, voxel_m, Convention::Sensor)?;
    let order = box_tree::order(&thinned.points);
    let range_sd_m = thinned.range_sd_m.map(|sds| box_tree::ordered(&sds, &order));
    Ok(Cloud { range_sd_m, ..Cloud::new(box_tree::ordered(&thinned.points, &order)) })
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
) -> Result<Cloud, PrepareError> {
    let downsample = match convention {
        Convention::Sensor => voxel::downsample,
        Convention::Open3d => voxel::downsample_open3d,
    };
    // Voxels skip what is not finite; only points at the origin are worth a copy without them.
    let thinned = if cloud.points.iter().any(|p| p.coords == Vector3::zeros()) {
        let range_sd_m = cloud.range_sd_m.clone();
        let mut echoes = Cloud { range_sd_m, ..Cloud::new(cloud.points.clone()) };
        echoes.drop_invalid();
        downsample(&echoes, voxel_m)?
    } else {
        downsample(cloud, voxel_m)?
    };
    if thinned.points.is_empty() { Err(PrepareError::Empty) } else { Ok(thinned) }
}
