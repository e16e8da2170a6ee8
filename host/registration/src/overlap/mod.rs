//! Checking a motion on two scans: points that lie on each other, and points seen through.
//!
//! ```
//! use echoloop_registration::overlap::Scene;
//! use echoloop_registration::{Cloud, Pose};
//!
//! let field = |x: f32, y: f32| [x, y, (0.7 * x).sin() + (0.5 * y + 0.2 * x).cos() - 3.0].into();
//! let at = |i: i32| field((i % 100 - 50) as f32 * 0.2, (i / 100 - 50) as f32 * 0.2);
//! let scan = Scene::new(&Cloud::new((0..10_000).map(at).collect()), 0.4)?;
//! let found = scan.overlap(&scan, &Pose::identity());
//! assert!(found.confirms() && found.supported > 0.9);
//! assert!(!scan.overlap(&scan, &Pose::translation(0.0, 0.0, 2.0)).confirms());
//! # Ok::<(), echoloop_registration::PrepareError>(())
//! ```

mod cells;
mod confirmed;
mod open;
mod range_image;
mod sight;

use echoloop_clouds::{Cloud, Pose, is_finite};
use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

pub use self::confirmed::Confirmed;
pub use self::open::OpenDirection;
use self::open::Probe;
use self::range_image::RangeImage;
use self::sight::Sight;
use crate::geometry::kdtree::KdTree;
use crate::geometry::normals;
use crate::prepared::thinned;
use crate::{Convention, PrepareError};

/// Radius of the neighbourhood of a normal, in voxels.
const NORMAL_VOXELS: f64 = 4.0;

/// Largest number of neighbours of a normal.
const NORMAL_NEIGHBOURS: usize = 12;

/// Largest distance of a point from the surface that it lies on, in voxels.
const REACH_VOXELS: f32 = 1.25;

/// Distance from a surface at which a point counts half, over the voxel.
const HALF_VOXELS: f32 = 0.375;

/// Resolution of the range image, degrees.
const DIRECTION_DEG: f32 = 2.5;

/// A point was seen through if everything seen around it is farther by this share of its range …
const BEHIND_SHARE: f32 = 0.05;

/// … and by this distance, over the voxel.
const BEHIND_VOXELS: f32 = 1.25;

/// Points a thread takes at a time.
const CHUNK: usize = 512;

/// Weight of a point that was seen through, over one that lies on a surface.
const CONTRADICTION: f64 = 3.0;

/// Voxel of outdoor scans, m: lengths that do not depend on the voxel are shares of 1 m there, and
/// smaller in smaller scenes.
const OUTDOOR_VOXEL_M: f32 = 0.8;

/// A scan prepared for checking motions: its surface, what its sensor saw in each direction, and
/// points to ask the other scan about.
#[derive(Clone, Debug)]
pub struct Scene {
    points: Vec<Point3<f32>>,
    normals: Vec<Vector3<f32>>,
    /// Variance of each normal's tilt, rad².
    tilts_rad2: Vec<f32>,
    tree: KdTree,
    image: RangeImage,
    sight: Sight,
    probes: Vec<Probe>,
    voxel_m: f32,
}

/// Evidence of two scans for or against a motion. Shares are of the thinned points of both, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlap {
    /// Share of the points on a surface of the other scan that faces the same way, weighted by
    /// distance.
    pub supported: f64,
    /// Share of the points through which the other sensor saw: its echoes in that direction are
    /// farther away.
    pub seen_through: f64,
}

impl Overlap {
    /// Least share of the points on the other scan's surface.
    pub const LEAST_SUPPORTED: f64 = 0.1;

    /// Most points seen through, over those on a surface.
    pub const MOST_SEEN_THROUGH: f64 = 0.02;

    /// True when the scans confirm the motion.
    ///
    /// Streets look alike, and ground lies on ground: the share of points that lie on each other
    /// separates unrelated scans from right motions badly. But a wall in the wrong place stands
    /// where the other sensor saw open space, which no right motion of a rigid scene does.
    pub fn confirms(&self) -> bool {
        self.supported >= Self::LEAST_SUPPORTED
            && self.seen_through <= Self::MOST_SEEN_THROUGH * self.supported
    }

    /// Score by which motions are ranked; higher is better.
    pub fn score(&self) -> f64 {
        self.supported - CONTRADICTION * self.seen_through
    }
}

impl Scene {
    /// Thins a scan to `voxel_m`, and works out its surface. The sensor is at the origin.
    ///
    /// # Errors
    ///
    /// [`PrepareError`] when there is no point, or the voxel is too small for the cloud.
    pub fn new(cloud: &Cloud, voxel_m: f64) -> Result<Self, PrepareError> {
        let points = thinned(cloud, voxel_m, Convention::Sensor)?.points;
        let planes = normals::planes(&points, NORMAL_VOXELS * voxel_m, NORMAL_NEIGHBOURS);
        let (tree, image) = (KdTree::new(&points), RangeImage::new(&cloud.points, DIRECTION_DEG));
        let (voxel_m, unit_m) = (voxel_m as f32, unit_m(voxel_m as f32));
        let echoes = cloud.points.iter().filter(|p| is_finite(p) && p.coords != Vector3::zeros());
        Ok(Self {
            normals: planes.iter().map(|plane| plane.normal).collect(),
            tilts_rad2: planes
                .iter()
                .map(|plane| Self::tilt_rad2(plane.tilt_rad2, plane.spread_m2, unit_m))
                .collect(),
            sight: Sight::new(&cloud.points),
            probes: open::probes(echoes.copied(), unit_m),
            points,
            tree,
            image,
            voxel_m,
        })
    }

    /// Unit of the lengths that do not depend on the voxel, m: 1 outdoors.
    fn unit_m(&self) -> f32 {
        unit_m(self.voxel_m)
    }

    /// The evidence of this scan, the target, and a source for a motion.
    pub fn overlap(&self, source: &Self, target_from_source: &Pose) -> Overlap {
        let (there, back) = (target_from_source.cast(), target_from_source.inverse().cast());
        let (forth, again) =
            rayon::join(|| source.seen_by(self, &there), || self.seen_by(source, &back));
        let points = (source.points.len() + self.points.len()).max(1) as f64;
        Overlap {
            supported: (forth.0 + again.0) / points,
            seen_through: (forth.1 + again.1) / points,
        }
    }

    /// Weighted count of these points on the other's surface, and count of those it saw through.
    fn seen_by(&self, other: &Self, other_from_self: &Isometry3<f32>) -> (f64, f64) {
        let chunk = |(points, normals): (&[Point3<f32>], &[Vector3<f32>])| {
            points.iter().zip(normals).fold((0.0, 0.0), |(on, through), (point, normal)| {
                let (point, normal) = (other_from_self * point, other_from_self * normal);
                match other.support(&point, &normal) {
                    Some(share) => (on + f64::from(share), through),
                    None => (on, through + f64::from(u8::from(other.saw_through(&point)))),
                }
            })
        };
        let chunks = self.points.par_chunks(CHUNK).zip(self.normals.par_chunks(CHUNK));
        // In order: the same sum on any number of threads.
        let sums: Vec<(f64, f64)> = chunks.map(chunk).collect();
        sums.iter().fold((0.0, 0.0), |sum, next| (sum.0 + next.0, sum.1 + next.1))
    }

    /// Fit of a point and its normal to the surface, 0 to 1; None when nothing is near.
    ///
    /// ```text
    /// max(0, n · m) / (1 + (n · d / h)²)       d to the nearest point, n its normal, m the point's
    /// ```
    fn support(&self, point: &Point3<f32>, normal: &Vector3<f32>) -> Option<f32> {
        let nearest = self.tree.nearest(point, REACH_VOXELS * self.voxel_m)? as usize;
        let (to, own) = (self.points.get(nearest)?, self.normals.get(nearest)?);
        let off_m = match *own == Vector3::zeros() {
            true => (point - to).norm(),
            false => own.dot(&(point - to)).abs(),
        };
        let known = *own != Vector3::zeros() && *normal != Vector3::zeros();
        let agree = if known { own.dot(normal).max(0.0) } else { 0.5 };
        let halves = off_m / (HALF_VOXELS * self.voxel_m);
        Some(agree / (1.0 + halves * halves))
    }

    fn saw_through(&self, point: &Point3<f32>) -> bool {
        let range_m = point.coords.norm();
        let least_m = range_m * (1.0 + BEHIND_SHARE) + BEHIND_VOXELS * self.voxel_m;
        self.image.nearest_m(point).is_some_and(|seen_m| seen_m > least_m)
    }
}

fn unit_m(voxel_m: f32) -> f32 {
    (voxel_m / OUTDOOR_VOXEL_M).min(1.0)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::tests::on_threads;

    /// A yard 40 m square as a sensor sees it from `x_m`: floor, and walls that end the view.
    pub(super) fn yard(x_m: f32) -> Cloud {
        let ray = |i: i32| {
            let azimuth = (i % 360) as f32 * std::f32::consts::TAU / 360.0;
            let elevation = ((i / 360) as f32 - 30.0).to_radians();
            let way = Vector3::new(
                azimuth.cos() * elevation.cos(),
                azimuth.sin() * elevation.cos(),
                elevation.sin(),
            );
            let floor = if way.z < 0.0 { -2.0 / way.z } else { f32::INFINITY };
            let wall = |at: f32, along: f32| match along {
                0.0 => f32::INFINITY,
                along => ((20.0 * along.signum() - at) / along).max(0.0),
            };
            Point3::from(way * floor.min(wall(x_m, way.x)).min(wall(0.0, way.y)))
        };
        Cloud::new((0..360 * 40).map(ray).collect())
    }

    fn scenes() -> (Scene, Scene) {
        (Scene::new(&yard(0.0), 0.8).unwrap(), Scene::new(&yard(5.0), 0.8).unwrap())
    }

    #[test]
    fn the_right_motion_is_confirmed_and_nothing_was_seen_through() {
        let (target, source) = scenes();
        let found = target.overlap(&source, &Pose::translation(5.0, 0.0, 0.0));
        assert!(found.confirms() && found.supported > 0.6, "{found:?}");
        assert!(found.seen_through < 1e-3, "{found:?}");
    }

    #[test]
    fn walls_in_the_open_refuse_a_motion_that_lays_floor_on_floor() {
        let (target, source) = scenes();
        let found = target.overlap(&source, &Pose::translation(-3.0, 0.0, 0.0));
        assert!(found.supported > 0.3, "the floors lie on each other: {found:?}");
        assert!(!found.confirms(), "{found:?}");
    }

    #[test]
    fn scans_that_share_nothing_confirm_nothing() {
        let (target, source) = scenes();
        let found = target.overlap(&source, &Pose::translation(900.0, 0.0, 0.0));
        assert_eq!((found, found.confirms()), (Overlap::default(), false));
    }

    #[test]
    fn the_right_motion_scores_above_its_neighbours() {
        let (target, source) = scenes();
        let score = |x_m: f64, turn: f64| {
            let pose = Pose::new([x_m, 0.0, 0.0].into(), [0.0, 0.0, turn].into());
            target.overlap(&source, &pose).score()
        };
        let right = score(5.0, 0.0);
        for (x_m, turn) in [(3.5, 0.0), (6.5, 0.0), (5.0, 0.2), (5.0, -0.2), (0.0, 0.0)] {
            assert!(right > score(x_m, turn), "{x_m} m, {turn}");
        }
    }

    #[test]
    fn one_thread_and_two_give_the_same_bytes() {
        let on = |threads| {
            on_threads(threads, || {
                let (target, source) = scenes();
                target.overlap(&source, &Pose::translation(4.7, 0.1, 0.0))
            })
        };
        assert_eq!(on(1), on(2));
    }
}
