//! Checking a motion on two scans: points that lie on each other, and points seen through.
//!
//! ```
//! use echoloop_registration::overlap::Scene;
//! use echoloop_registration::{Cloud, Pose};
//!
//! let field = |x: f32, y: f32| [x, y, (0.7 * x).sin() + (0.5 * y + 0.2 * x).cos() - 3.0].into();
//! let at = |i: i32| field((i % 100 - 50) as f32 * 0.2, (i / 100 - 50) as f32 * 0.2);
//! let scan = Scene::new(&Cloud::new((0..10_000).map(at).collect()), 0.4)?;
//! let found = scan.judge(&scan, &Pose::identity());
//! assert!(found.confirms() && found.overlap.supported() > 0.9);
//! assert!(!scan.judge(&scan, &Pose::translation(0.0, 0.0, 2.0)).confirms());
//! # Ok::<(), echoloop_registration::PrepareError>(())
//! ```

mod cells;
mod confirmed;
mod judgement;
mod open;
mod probes;
mod range_image;
mod score;
mod sight;

use echoloop_clouds::{Cloud, is_finite};
use nalgebra::{Point3, Vector3};

use self::cells::Seen;
pub use self::confirmed::Confirmed;
pub(crate) use self::confirmed::{asked, settled};
pub use self::judgement::{Judgement, Rival};
pub(crate) use self::judgement::{Looked, is_within};
pub use self::open::OpenDirection;
use self::probes::Probe;
use self::range_image::RangeImage;
use self::sight::Sight;
use crate::geometry::normals::Plane;
use crate::prepared::Surface;
use crate::{PrepareError, Target};

/// Radius of the neighbourhood of a normal, in voxels.
const NORMAL_VOXELS: f64 = 4.0;

/// Largest number of neighbours of a normal.
const NORMAL_NEIGHBOURS: usize = 12;

/// Resolution of the range image, degrees.
const DIRECTION_DEG: f32 = 2.5;

/// Standard deviations of a point's range within which it lies. A point is precise if they are no
/// more than the distance within which a point lies on a plane.
const RANGE_SDS: f32 = 3.0;

/// If a smaller share of a cloud's points than this is precise, all of its points are used.
const LEAST_PRECISE: f64 = 0.03;

/// Voxel of outdoor scans, m: lengths that do not depend on the voxel are shares of 1 m there, and
/// smaller in smaller scenes.
const OUTDOOR_VOXEL_M: f32 = 0.8;

/// A scan, or a map, prepared for checking motions: its surface, what its sensor saw in each
/// direction, and points to ask the other about.
///
/// A cloud whose points hide each other from its origin has no sensor there: of a map, a model or a
/// part of a scan only the surface is evidence.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The thinned points that are precise, and their normals.
    surface: Target,
    /// Variance of each normal's tilt, rad².
    tilts_rad2: Vec<f32>,
    image: RangeImage,
    sight: Sight,
    probes: Vec<Probe>,
    voxel_m: f32,
}

/// Evidence of two scans for or against a motion: counts of the points of both that each was asked
/// about.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlap {
    /// Points on a surface of the other scan.
    pub on: usize,
    /// Points off the surface that is known there, or in space through which the other sensor saw.
    pub contradicted: usize,
    /// Points whose place is hidden, out of view, or too rough to say.
    pub unknown: usize,
    /// Share of a cloud's points whose place the other knows, 0 to 1: of the cloud where it is
    /// larger. A scan covers little of a map, the map most of the scan.
    pub covered: f64,
}

impl Overlap {
    /// Least number of points on a surface.
    pub const LEAST_ON: usize = 60;

    /// Least share, of the points whose place is known, on a surface.
    pub const LEAST_SUPPORTED: f64 = 0.96;

    /// Least share covered. Among candidates that share so little some agree by chance.
    pub const LEAST_COVERED: f64 = 0.2;

    /// Share on a surface, of the points whose place the other scan knows, 0 to 1; 0 if none is.
    pub fn supported(&self) -> f64 {
        self.on as f64 / (self.on + self.contradicted).max(1) as f64
    }

    /// Share contradicted of the same points; 0 if none is.
    pub fn refuted(&self) -> f64 {
        self.contradicted as f64 / (self.on + self.contradicted).max(1) as f64
    }

    /// Share of the points whose place the other scan knows, 0 to 1.
    pub fn known(&self) -> f64 {
        let known = self.on + self.contradicted;
        known as f64 / (known + self.unknown).max(1) as f64
    }

    /// True when the points agree with the motion.
    ///
    /// The number on a surface says little: ground lies on any ground, a scan covers little of a
    /// map. But a wall in the wrong place stands where the other sensor saw open space, which no
    /// right motion of a rigid scene does.
    pub fn agrees(&self) -> bool {
        self.on >= Self::LEAST_ON
            && self.covered >= Self::LEAST_COVERED
            && self.supported() >= Self::LEAST_SUPPORTED
    }
}

impl Scene {
    /// Thins a scan to `voxel_m`, and works out its surface. The sensor is at the origin. Points
    /// whose range it reports to be imprecise are no surface, and are not asked about.
    ///
    /// # Errors
    ///
    /// [`PrepareError`] when there is no point, or the voxel is too small for the cloud.
    pub fn new(cloud: &Cloud, voxel_m: f64) -> Result<Self, PrepareError> {
        let unit_m = unit_m(voxel_m as f32);
        let seen = Seen::all(&cloud.points);
        let sight = Sight::new(&seen, cloud.range_sd_m.as_deref(), unit_m);
        let image = RangeImage::new(&seen, DIRECTION_DEG);
        let precise = precise(cloud, unit_m, sight.is_scan());
        let cloud = precise.as_ref().unwrap_or(cloud);
        let (surface, planes) = Target::with_planes(cloud, &surface(voxel_m))?;
        let voxel_m = voxel_m as f32;
        let tilt_rad2 = |plane: &Plane| Self::tilt_rad2(plane.tilt_rad2, plane.spread_m2, unit_m);
        let echoes = cloud.points.iter().filter(|p| is_echo(p));
        Ok(Self {
            surface,
            tilts_rad2: planes.iter().map(tilt_rad2).collect(),
            probes: probes::probes(echoes.copied(), unit_m, sight.is_scan()),
            sight,
            image,
            voxel_m,
        })
    }

    /// The thinned points, in the order of a tree.
    pub(crate) fn points(&self) -> &[Point3<f32>] {
        self.surface.tree.points()
    }

    /// Their normals.
    fn normals(&self) -> &[Vector3<f32>] {
        &self.surface.normals
    }

    /// Unit of the lengths that do not depend on the voxel, m: 1 outdoors.
    pub(crate) fn unit_m(&self) -> f32 {
        unit_m(self.voxel_m)
    }
}

fn surface(voxel_m: f64) -> Surface {
    Surface {
        voxel_m,
        normal_radius_m: NORMAL_VOXELS * voxel_m,
        normal_neighbours: NORMAL_NEIGHBOURS,
        shares_normals: false,
        source_normals: true,
    }
}

fn unit_m(voxel_m: f32) -> f32 {
    (voxel_m / OUTDOOR_VOXEL_M).min(1.0)
}

/// True for a point that has a direction and a range.
fn is_echo(point: &Point3<f32>) -> bool {
    is_finite(point) && point.coords.norm() > 0.0
}

/// The points precise enough to tell whether they lie on a plane. None if the cloud has no
/// `range_sd`, or too few such points.
///
/// Errors of saturated echoes are the same in both scans, which then agree that nothing moved.
fn precise(cloud: &Cloud, unit_m: f32, is_scan: bool) -> Option<Cloud> {
    let sds_m = cloud.range_sd_m.as_ref()?;
    let is_precise = |(point, sd_m): &(&Point3<f32>, &f32)| {
        RANGE_SDS * **sd_m <= probes::on_m(unit_m, probes::range_m(point, unit_m, is_scan))
    };
    let points = cloud.points.iter().zip(sds_m).filter(is_precise).map(|(point, _)| *point);
    let points: Vec<Point3<f32>> = points.collect();
    let is_enough = points.len() as f64 >= LEAST_PRECISE * cloud.points.len() as f64;
    is_enough.then(|| Cloud::new(points))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::open::tests::tunnel;
    use super::*;
    use crate::Pose;

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

    pub(super) fn scenes() -> (Scene, Scene) {
        (Scene::new(&yard(0.0), 0.8).unwrap(), Scene::new(&yard(5.0), 0.8).unwrap())
    }

    #[test]
    fn the_right_motion_is_confirmed_and_nothing_contradicts_it() {
        let (target, source) = scenes();
        let found = target.judge(&source, &Pose::translation(5.0, 0.0, 0.0));
        assert!(found.confirms(), "{found:?}");
        assert!(found.overlap.supported() > 0.99 && found.overlap.known() > 0.5, "{found:?}");
    }

    #[test]
    fn walls_in_the_open_refuse_a_motion_that_lays_floor_on_floor() {
        let (target, source) = scenes();
        let found = target.judge(&source, &Pose::translation(-3.0, 0.0, 0.0));
        assert!(found.overlap.on > 1_000, "the floors lie on each other: {found:?}");
        assert!(!found.overlap.agrees() && !found.confirms(), "{found:?}");
    }

    #[test]
    fn an_overlap_agrees_from_each_of_its_bounds_on() {
        let least = Overlap { on: 960, contradicted: 40, unknown: 4_000, covered: 0.2 };
        assert!(least.agrees() && Overlap { on: 60, contradicted: 0, ..least }.agrees());
        for overlap in [
            Overlap { on: 59, contradicted: 0, ..least },
            Overlap { contradicted: 41, ..least },
            Overlap { covered: 0.19, ..least },
        ] {
            assert!(!overlap.agrees(), "{overlap:?}");
        }
    }

    #[test]
    fn points_that_the_sensor_calls_imprecise_are_no_evidence() {
        // Walls nearer than 5 m recede by 0.4 m, as saturated echoes do, seen from anywhere.
        let seen = |x_m: f32, near_sd_m: f32| {
            let exact = tunnel(x_m, 500.0).points;
            let is_near = |p: &Point3<f32>| p.coords.norm() < 5.0;
            let sds_m = exact.iter().map(|p| if is_near(p) { near_sd_m } else { 0.01 }).collect();
            let receded = |p: Point3<f32>| p * (1.0 + 0.4 / p.coords.norm());
            let points = exact.iter().map(|p| if is_near(p) { receded(*p) } else { *p }).collect();
            Scene::new(&Cloud { range_sd_m: Some(sds_m), ..Cloud::new(points) }, 0.8).unwrap()
        };
        let open_where_nothing_moved = |near_sd_m: f32| {
            let (target, source) = (seen(0.0, near_sd_m), seen(2.0, near_sd_m));
            target.judge(&source, &Pose::identity()).open.len()
        };
        assert_eq!([0.01, 0.4].map(open_where_nothing_moved), [0, 1]);
    }

    #[test]
    fn all_points_of_a_sensor_without_a_precise_one_are_asked_about() {
        let points = yard(0.0).points;
        let vague = Cloud { range_sd_m: Some(vec![1.0; points.len()]), ..Cloud::new(points) };
        let probes = |cloud: &Cloud| Scene::new(cloud, 0.8).unwrap().probes.len();
        assert_eq!(probes(&vague), probes(&yard(0.0)));
    }

    #[test]
    fn scans_that_share_nothing_confirm_nothing() {
        let (target, source) = scenes();
        let found = target.judge(&source, &Pose::translation(900.0, 0.0, 0.0));
        assert_eq!((found.overlap.on, found.confirms()), (0, false));
        assert_eq!((found.overlap.supported(), found.overlap.refuted()), (0.0, 0.0));
    }
}
