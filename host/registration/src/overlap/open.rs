//! Directions in which a motion may slide without the scans noticing.
//!
//! Eigenvalues of the information alone do not tell a tunnel from a street: in a smooth tube the
//! errors of normals and ranges make as much of it as a few niches do, and most of all where both
//! scans stand on the same spot, since a sensor errs alike in both. So they only choose the
//! directions to ask about, besides the weakest shift. Then the motion is slid along each, along a
//! weak one fitted to the surface, and the scans are asked what is worse.

use nalgebra::{Matrix6, Point3, Vector3, Vector6};

use super::Scene;
use super::probes::Probe;
use crate::Pose;
use crate::icp::centred::Centred;

/// Most points whose normals are compared for the information.
const MOST_COMPARED: usize = 2_000;

/// Least number of pairs of normals: fewer say nothing about what is weak.
const LEAST_PAIRS: usize = 6;

/// Range error that neighbours share, over the unit: it tilts their plane by as much over their
/// spread.
const SHARED_ERROR_UNITS: f32 = 0.02;

/// Largest variance of the tilt of a normal that counts for information, rad².
const MOST_TILT_RAD2: f32 = 0.01;

/// Least cosine between the normals of a pair.
const LEAST_COSINE: f64 = 0.7;

/// Information, as a share of what pairs hold about all directions, below which a direction may be
/// open. In tunnels, on highways and in fields the least is below 0.001 in 9 of 10 scans.
pub(super) const WEAK: f64 = 0.002;

/// Number of further directions that are asked about, besides the weakest shift. Where several are
/// weak, noise mixes the eigenvectors, and none of them is the tunnel's axis.
const DIRECTIONS: usize = 2;

/// Largest distance of a point from the plane that it is fitted to, over the unit.
const FITTED_UNITS: f64 = 0.3;

/// Information about every direction, as a share, that keeps a fit from following noise.
const DAMPED: f64 = 1e-4;

/// Information, as a share, that keeps a fit from sliding back.
const HELD: f64 = 1e3;

/// Mean displacements at which a direction is searched, over the unit.
const SEARCHED_SLIDES: [f64; 3] = [2.0, 4.0, 6.0];

/// A small motion in the target's frame that the scans do not notice: a turn about the axes of its
/// origin, then a shift. It moves the points that both scans see by 1 m in the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenDirection {
    /// Turn about x, y and z, rad.
    pub turn_rad: [f64; 3],
    /// Shift along x, y and z, m.
    pub shift_m: [f64; 3],
}

/// A direction of little information: see [`OpenDirection`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    centred: Centred,
    /// About the centroid of the pairs.
    way: Vector6<f64>,
    /// Information, as a share of what the pairs hold about all directions.
    pub(super) share: f64,
}

/// Derivative of a point's distance from a plane by a turn about the origin and a shift.
fn row(at: &Vector3<f64>, normal: &Vector3<f64>) -> Vector6<f64> {
    let turn = at.cross(normal);
    Vector6::new(turn.x, turn.y, turn.z, normal.x, normal.y, normal.z)
}

impl Direction {
    /// The shift of least information.
    fn shift(centred: Centred, shares: &Matrix6<f64>) -> Self {
        let eigen = shares.fixed_view::<3, 3>(3, 3).symmetric_eigen();
        let (weakest, share) = eigen.eigenvalues.argmin();
        let mut way = Vector6::zeros();
        way.fixed_rows_mut::<3>(3).copy_from(&eigen.eigenvectors.column(weakest));
        Self { centred, way, share }
    }

    /// A motion, slid by a mean displacement, m.
    pub(super) fn slid(&self, motion: &Pose, by_m: f64) -> Pose {
        self.centred.step(&(self.way * by_m)).motion * motion
    }

    /// A motion, slid by a mean displacement, m. If the direction may be open, it is then fitted to
    /// the surface without sliding back: a few degrees beside a tunnel's axis it runs into a wall.
    pub(super) fn fitted(&self, target: &Scene, source: &Scene, motion: &Pose, by_m: f64) -> Pose {
        let slid = self.slid(motion, by_m);
        match self.share < WEAK {
            true => self.fit(target, source, &slid).map_or(slid, |fit| fit * slid),
            false => slid,
        }
    }

    /// The small motion of a point-to-plane step in all other directions; `None` if too few points
    /// lie near a plane.
    fn fit(&self, target: &Scene, source: &Scene, motion: &Pose) -> Option<Pose> {
        let rows: Vec<(Vector6<f64>, f64)> =
            source.compared().filter_map(|probe| target.row(probe, motion)).collect();
        if rows.len() < LEAST_PAIRS {
            return None;
        }
        let information = rows.iter().map(|(j, _)| j * j.transpose()).sum();
        let right = rows.iter().map(|(j, off_m)| j * -off_m).sum();
        let shares = self.centred.square(&information) / rows.len() as f64;
        let held = self.way * self.way.transpose() * HELD + Matrix6::identity() * DAMPED;
        let right = self.centred.right(&right) / rows.len() as f64;
        let step = (shares + held).cholesky()?.solve(&right);
        Some(self.centred.step(&step).motion)
    }

    /// The direction about the origin of the target.
    pub(super) fn about_origin(&self) -> OpenDirection {
        self.centred.about_origin(&self.way).into()
    }
}

impl Scene {
    /// The motion, slid both ways along the first of the weakest directions that may be open.
    pub(crate) fn slides(&self, source: &Self, motion: &Pose) -> Vec<Pose> {
        let weakest = self.weakest_directions(source, motion);
        let open = weakest.into_iter().find(|direction| direction.share < WEAK);
        let unit_m = f64::from(self.unit_m());
        let both = |direction: Direction| {
            let slides = SEARCHED_SLIDES.into_iter().flat_map(|units| [units, -units]);
            slides.map(move |units| direction.slid(motion, units * unit_m))
        };
        open.into_iter().flat_map(both).collect()
    }

    /// The shift of least information, then further directions, weakest first; none if too few
    /// points have partners.
    ///
    /// `I = Σ (j kᵀ + k jᵀ) / 2 pairs`, as of [`crate::Observability`], but with `j` from the
    /// target's normal and `k` from the source's: errors that the two do not share add nothing.
    pub(super) fn weakest_directions(&self, source: &Self, motion: &Pose) -> Vec<Direction> {
        let pairs: Vec<(Vector3<f64>, [Vector3<f64>; 2])> =
            source.compared().filter_map(|probe| self.pair(source, probe, motion)).collect();
        let sum: Vector3<f64> = pairs.iter().map(|(at, _)| at).sum();
        if pairs.len() < LEAST_PAIRS {
            return Vec::new();
        }
        let squares = pairs.iter().map(|(at, _)| at.norm_squared()).sum();
        let mut information = Matrix6::zeros();
        for (at, normals) in &pairs {
            let [j, k] = normals.map(|normal| row(at, &normal));
            information += j * k.transpose() + k * j.transpose();
        }
        let centred = Centred::new(pairs.len(), &sum, squares);
        let shares = centred.square(&information) / (2 * pairs.len()) as f64;
        let shift = Direction::shift(centred, &shares);
        // What is left of the information beside the shift, along which it has none.
        let beside = Matrix6::identity() - shift.way * shift.way.transpose();
        let eigen = (beside * shares * beside).symmetric_eigen();
        let mut order: Vec<usize> = (0..6).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let direction = |i: &usize| {
            let way = eigen.eigenvectors.column(*i).into_owned();
            Direction { centred, way, share: eigen.eigenvalues[*i] }
        };
        let others = order.iter().map(direction);
        let others = others.filter(|other| other.way.dot(&shift.way).abs() < 0.5); // not itself
        std::iter::once(shift).chain(others.take(DIRECTIONS)).collect()
    }

    /// Points whose surfaces are compared.
    fn compared(&self) -> impl Iterator<Item = &Probe> {
        self.probes.iter().step_by(self.probes.len().div_ceil(MOST_COMPARED).max(1))
    }

    /// Derivative by a small motion of the distance of a probe from the surface, and that distance,
    /// m; `None` where there is none near.
    fn row(&self, probe: &Probe, motion: &Pose) -> Option<(Vector6<f64>, f64)> {
        let at: Point3<f64> = motion * probe.at.cast::<f64>();
        let (point, normal) = self.plane(&at)?;
        let off_m = normal.dot(&(at - point));
        let is_near = off_m.abs() <= FITTED_UNITS * f64::from(self.unit_m());
        is_near.then(|| (row(&at.coords, &normal), off_m))
    }

    /// A point and the normal of the surface near a place; `None` where it is not well known.
    fn plane(&self, at: &Point3<f64>) -> Option<(Point3<f64>, Vector3<f64>)> {
        let nearest = self.near(&at.cast())?;
        let plane = || (self.points()[nearest].cast(), self.normals()[nearest].cast());
        self.is_plane(nearest).then(plane)
    }

    /// True when the normal of a point of the surface is well known.
    fn is_plane(&self, point: usize) -> bool {
        self.normals()[point] != Vector3::zeros() && self.tilts_rad2[point] < MOST_TILT_RAD2
    }

    /// A probe of the source in the target's frame, the target's normal there and its own, which
    /// agree; `None` where one is not to be trusted.
    fn pair(
        &self,
        source: &Self,
        probe: &Probe,
        motion: &Pose,
    ) -> Option<(Vector3<f64>, [Vector3<f64>; 2])> {
        let own = motion.rotation * source.trusted_normal(&probe.at)?.cast::<f64>();
        let at: Point3<f64> = motion * probe.at.cast::<f64>();
        let (_, normal) = self.plane(&at)?;
        let cosine = normal.dot(&own);
        (cosine.abs() >= LEAST_COSINE).then(|| (at.coords, [normal, own * cosine.signum()]))
    }

    /// The normal at one of the scan's points, if the ranges around it are those of such a plane:
    /// the points of one turn around the inside of a tube lie in a plane, too, that is no surface.
    fn trusted_normal(&self, at: &Point3<f32>) -> Option<Vector3<f32>> {
        let nearest = self.surface.nearest(at, 2.0 * self.voxel_m)?;
        let normal = self.normals()[nearest];
        let range_m = at.coords.norm();
        let cosine = (normal.dot(&at.coords) / range_m).abs();
        let tangent = (1.0 - cosine * cosine).max(0.0).sqrt() / cosine.max(0.02);
        let expected_m = 4.0 * self.sight.spacing_rad() * range_m * tangent + 0.1 * self.unit_m();
        let is_level = match self.sight.bounds_m(at) {
            Some([nearest_m, farthest_m]) => farthest_m - nearest_m < 3.0 * expected_m,
            None => !self.sight.is_scan(),
        };
        (is_level && self.is_plane(nearest)).then_some(normal)
    }

    /// Variance of the tilt of planes, rad², with what their points' errors share.
    pub(super) fn tilt_rad2(tilt_rad2: f32, spread_m2: f32, unit_m: f32) -> f32 {
        let shared_m = SHARED_ERROR_UNITS * unit_m;
        tilt_rad2 + shared_m * shared_m / spread_m2.max(f32::MIN_POSITIVE)
    }
}

impl OpenDirection {
    /// The same small motion as a turn about axes through a point, m, and the shift of that point.
    pub fn about(&self, point_m: &Point3<f64>) -> Self {
        let shift_m =
            Vector3::from(self.shift_m) + Vector3::from(self.turn_rad).cross(&point_m.coords);
        Self { shift_m: shift_m.into(), ..*self }
    }
}

impl From<Vector6<f64>> for OpenDirection {
    fn from(direction: Vector6<f64>) -> Self {
        let [a, b, c, x, y, z] = direction.into();
        Self { turn_rad: [a, b, c], shift_m: [x, y, z] }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
pub(super) mod tests {
    use echoloop_clouds::Cloud;

    use super::super::tests::yard;
    use super::*;

    /// A tunnel 6 m wide as a sensor sees it from `x_m`; it ends at `end_m`.
    pub(in crate::overlap) fn tunnel(x_m: f32, end_m: f32) -> Cloud {
        let ray = |i: i32| {
            let (azimuth, elevation) = ((i % 360) as f32, (i / 360) as f32 * 1.4 - 32.0);
            let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
            let way = Vector3::new(
                azimuth.cos() * elevation.cos(),
                azimuth.sin() * elevation.cos(),
                elevation.sin(),
            );
            let to = |along: f32, low: f32, high: f32| {
                if along < 0.0 { low / along } else { high / along }
            };
            let tube_m = to(way.y, -3.2, 2.8).min(to(way.z, -1.5, 3.0));
            Point3::from(way * tube_m.min(to(way.x, -500.0, end_m - x_m)))
        };
        Cloud::new((0..360 * 45).map(ray).collect())
    }

    pub(in crate::overlap) fn seen(x_m: f32, end_m: f32) -> Scene {
        Scene::new(&tunnel(x_m, end_m), 0.8).unwrap()
    }

    pub(in crate::overlap) fn shift(x_m: f64) -> Pose {
        Pose::translation(x_m, 0.0, 0.0)
    }

    #[test]
    fn a_tunnel_lets_a_motion_slide_along_it_wherever_it_stands() {
        let (target, source) = (seen(0.0, 500.0), seen(2.0, 500.0));
        for x_m in [2.0, 0.0] {
            let open = target.judge(&source, &shift(x_m)).open;
            assert_eq!(open.len(), 1, "{x_m} m: {open:?}");
            let [x, y, z] = open[0].shift_m.map(f64::abs);
            assert!(x > 0.95 && y < 0.1 && z < 0.1, "{x_m} m: {open:?}");
        }
    }

    #[test]
    fn the_axis_of_a_tunnel_is_asked_about_by_itself_and_once() {
        let (target, source) = (seen(0.0, 500.0), seen(2.0, 500.0));
        let directions = target.weakest_directions(&source, &shift(2.0));
        let OpenDirection { turn_rad, shift_m } = directions[0].about_origin();
        assert!(turn_rad == [0.0; 3] && shift_m[0].abs() > 0.999, "{turn_rad:?} {shift_m:?}");
        assert_eq!(directions.len(), 3);
        let cosine = |other: &Direction| other.way.dot(&directions[0].way).abs();
        assert!(directions[1..].iter().map(cosine).all(|cosine| cosine < 1e-9));
    }

    #[test]
    fn a_slide_beside_the_axis_of_a_tunnel_is_fitted_to_its_walls() {
        let (target, source) = (seen(0.0, 500.0), seen(2.0, 500.0));
        let axis = target.weakest_directions(&source, &shift(2.0))[0];
        let way = Vector6::new(0.0, 0.01, 0.0, 1.0, 0.08, -0.05).normalize();
        let off_m = |share: f64| {
            let beside = Direction { way, share, ..axis };
            let slid = beside.fitted(&target, &source, &shift(2.0), 2.0);
            let along_m = (beside.slid(&shift(2.0), 2.0).translation.x - 2.0).abs();
            assert!(along_m > 1.9 && (slid.translation.x - 2.0).abs() > 1.9, "{slid}");
            slid.translation.y.hypot(slid.translation.z)
        };
        assert!(off_m(0.0) < 0.02 && off_m(WEAK) > 0.15, "{} {}", off_m(0.0), off_m(WEAK));
    }

    #[test]
    fn the_end_of_a_tunnel_stops_the_slide() {
        let (target, source) = (seen(0.0, 12.0), seen(2.0, 12.0));
        let judgement = target.judge(&source, &shift(2.0));
        assert!(judgement.open.is_empty() && judgement.confirms(), "{judgement:?}");
    }

    #[test]
    fn an_open_turn_shifts_a_point_beside_its_axis() {
        let turn = OpenDirection { turn_rad: [0.0, 0.0, 0.1], shift_m: [1.0, 0.0, 0.0] };
        let beside = turn.about(&Point3::new(5.0, 0.0, 2.0));
        assert_eq!((beside.turn_rad, beside.shift_m), (turn.turn_rad, [1.0, 0.5, 0.0]));
    }

    #[test]
    fn four_walls_leave_nothing_open() {
        let scene = |x_m| Scene::new(&yard(x_m), 0.8).unwrap();
        assert_eq!(scene(0.0).judge(&scene(5.0), &shift(5.0)).open, []);
    }

    #[test]
    fn a_tunnel_is_searched_both_ways_along_it() {
        let (target, source) = (seen(0.0, 500.0), seen(2.0, 500.0));
        let slides = target.slides(&source, &shift(0.0));
        let along_m: Vec<f64> = slides.iter().map(|slid| slid.translation.x.abs()).collect();
        for (found, expected) in along_m.iter().zip([2.0, 2.0, 4.0, 4.0, 6.0, 6.0]) {
            assert!((found - expected).abs() < 0.3, "{along_m:?}");
        }
        assert_eq!(along_m.len(), 6);
    }
}
