//! Directions in which a motion may slide without the scans noticing.
//!
//! Eigenvalues of the information alone do not tell a tunnel from a street: in a smooth tube the
//! errors of normals and ranges make as much of it as a few niches do, and most of all where both
//! scans stand on the same spot, since a sensor errs alike in both. So they only choose the
//! directions to ask about; then the motion is slid along, and the scans are asked what is worse.

use std::collections::{HashMap, HashSet};

use nalgebra::{Isometry3, Matrix6, Point3, Vector3, Vector6};
use rayon::prelude::*;

use super::Scene;
use crate::icp::centred::Centred;
use crate::{Covariance, Outcome, Pose, StopReason};

/// Distance between the points of a scan that the other is asked about, over the unit.
const PROBE_UNITS: f32 = 0.3;

/// Most points of a scan that the other is asked about.
const MOST_PROBES: usize = 8_000;

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

/// Distance within which a point lies on a plane: over the unit, and over its range; three standard
/// deviations of the plane's tilt are added.
const ON: [f32; 2] = [0.08, 0.004];

/// Largest such distance, over the unit: farther from its points a plane tells nothing.
const MOST_ON_UNITS: f32 = 0.4;

/// Distance in front of all that was seen at which a point was seen through: over the unit, and
/// over its range.
const THROUGH: [f32; 2] = [0.15, 0.01];

/// Size of a cluster: over the unit, and over its range. Errors within it are not independent.
const CLUSTER: [f32; 2] = [0.5, 0.1];

/// Information, as a share of what pairs hold about all directions, below which a direction is
/// asked about. In tunnels, on highways and in fields the least is below 0.001 in 9 of 10 scans; to
/// ask about more directions costs right motions of narrow fields of view.
const WEAK: f64 = 0.002;

/// Mean displacements at which a direction is asked about, over the unit.
const SLIDES: [f64; 2] = [1.0, 2.0];

/// Least lead, in standard deviations of chance, of a motion over both of those it can slide to.
const LEAST_LEAD: f64 = 1.0;

/// Standard deviation of the motion along an open direction, over the unit.
const OPEN_UNITS: f64 = 5.0;

/// A small motion in the target's frame that the scans do not notice: a turn about the axes of its
/// origin, then a shift. It moves the points that both scans see by 1 m in the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenDirection {
    /// Turn about x, y and z, rad.
    pub turn_rad: [f64; 3],
    /// Shift along x, y and z, m.
    pub shift_m: [f64; 3],
}

/// Evidence of one scan for the place of a point of the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    /// It lies on a surface.
    On,
    /// It lies off a surface that is known there, or the sensor saw through it.
    Contradicted,
    /// Its place is hidden, out of view, or too rough to say.
    Unknown,
}

/// A point of a scan that the other is asked about.
#[derive(Clone, Copy, Debug)]
pub(super) struct Probe {
    at: Point3<f32>,
    cluster: u32,
}

/// Points of a scan at least some distance apart, in its order.
pub(super) fn probes(echoes: impl Iterator<Item = Point3<f32>>, unit_m: f32) -> Vec<Probe> {
    let cell = |p: &Point3<f32>, edge_m: f32| [p.x, p.y, p.z].map(|x| (x / edge_m).floor() as i32);
    let mut taken = HashSet::new();
    let apart: Vec<Point3<f32>> =
        echoes.filter(|p| taken.insert(cell(p, PROBE_UNITS * unit_m))).collect();
    let mut clusters = HashMap::new();
    let stride = apart.len().div_ceil(MOST_PROBES).max(1);
    let numbered = apart.into_iter().step_by(stride).map(|at| {
        let least_m = CLUSTER[0] * unit_m;
        let doublings = (CLUSTER[1] * at.coords.norm() / least_m).max(1.0).log2().floor() as i32;
        let next = clusters.len() as u32;
        let edge_m = least_m * 2f32.powi(doublings);
        Probe { at, cluster: *clusters.entry((doublings, cell(&at, edge_m))).or_insert(next) }
    });
    numbered.collect()
}

impl Scene {
    /// Directions that this scan, the target, and a source leave open at a motion.
    pub fn open_directions(&self, source: &Self, target_from_source: &Pose) -> Vec<OpenDirection> {
        let (centred, weak) = self.weak_directions(source, target_from_source);
        if weak.is_empty() {
            return Vec::new();
        }
        let here = self.verdicts(source, target_from_source);
        let lead = |way: Vector6<f64>| {
            let slid = centred.step(&way).motion * target_from_source;
            self.lead(source, &here, &self.verdicts(source, &slid))
        };
        let is_open = |direction: &&Vector6<f64>| {
            SLIDES.iter().all(|units| {
                let way = *direction * (units * f64::from(self.unit_m()));
                lead(way).min(lead(-way)) < LEAST_LEAD
            })
        };
        let open = weak.iter().filter(is_open);
        open.map(|direction| OpenDirection::from(centred.about_origin(direction))).collect()
    }

    /// Directions of little information, weakest first, about the centroid of the pairs.
    ///
    /// `I = Σ (j kᵀ + k jᵀ) / 2 pairs`, as of [`crate::Observability`], but with `j` from the
    /// target's normal and `k` from the source's: errors that the two do not share add nothing.
    fn weak_directions(&self, source: &Self, motion: &Pose) -> (Centred, Vec<Vector6<f64>>) {
        let stride = source.probes.len().div_ceil(MOST_COMPARED).max(1);
        let pairs: Vec<(Vector3<f64>, [Vector3<f64>; 2])> = source
            .probes
            .iter()
            .step_by(stride)
            .filter_map(|p| self.pair(source, p, motion))
            .collect();
        let sum: Vector3<f64> = pairs.iter().map(|(at, _)| at).sum();
        let few = pairs.len() < LEAST_PAIRS;
        let squares = pairs.iter().map(|(at, _)| at.norm_squared()).sum();
        let mut information = Matrix6::zeros();
        for (at, normals) in &pairs {
            let [j, k] = normals.map(|normal| {
                let turn = at.cross(&normal);
                Vector6::new(turn.x, turn.y, turn.z, normal.x, normal.y, normal.z)
            });
            information += j * k.transpose() + k * j.transpose();
        }
        let centred = Centred::new(pairs.len(), &sum, squares);
        let shares = centred.square(&information) / (2 * pairs.len().max(1)) as f64;
        let eigen = shares.symmetric_eigen();
        let is_weak = |i: &usize| !few && eigen.eigenvalues[*i] < WEAK;
        let mut order: Vec<usize> = (0..6).filter(is_weak).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let column = |i: &usize| eigen.eigenvectors.column(*i).into_owned();
        (centred, order.iter().map(column).collect())
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
        let nearest = self.near(&at.cast())?;
        let normal = self.normals[nearest].cast::<f64>();
        let cosine = normal.dot(&own);
        let is_pair = self.tilts_rad2[nearest] < MOST_TILT_RAD2 && cosine.abs() >= LEAST_COSINE;
        is_pair.then(|| (at.coords, [normal, own * cosine.signum()]))
    }

    /// The normal at one of the scan's points, if the ranges around it are those of such a plane:
    /// the points of one turn around the inside of a tube lie in a plane, too, that is no surface.
    fn trusted_normal(&self, at: &Point3<f32>) -> Option<Vector3<f32>> {
        let nearest = self.tree.nearest(at, 2.0 * self.voxel_m)? as usize;
        let normal = self.normals[nearest];
        let range_m = at.coords.norm();
        let cosine = (normal.dot(&at.coords) / range_m).abs();
        let tangent = (1.0 - cosine * cosine).max(0.0).sqrt() / cosine.max(0.02);
        let expected_m = 4.0 * self.sight.spacing_rad() * range_m * tangent + 0.1 * self.unit_m();
        let [nearest_m, farthest_m] = self.sight.bounds_m(at)?;
        let is_trusted = normal != Vector3::zeros()
            && self.tilts_rad2[nearest] < MOST_TILT_RAD2
            && farthest_m - nearest_m < 3.0 * expected_m;
        is_trusted.then_some(normal)
    }

    /// The nearest point, as far as the scan's directions are apart there.
    fn near(&self, at: &Point3<f32>) -> Option<usize> {
        let apart_m = 3.0 * at.coords.norm() * self.sight.spacing_rad();
        self.tree.nearest(at, (1.5 * self.voxel_m).max(apart_m)).map(|index| index as usize)
    }

    /// Verdicts on the source's probes, then on the target's.
    fn verdicts(&self, source: &Self, motion: &Pose) -> Vec<Verdict> {
        let (there, back) = (motion.cast(), motion.inverse().cast());
        let (mut forth, again) = rayon::join(
            || self.verdicts_on(&source.probes, &there),
            || source.verdicts_on(&self.probes, &back),
        );
        forth.extend(again);
        forth
    }

    fn verdicts_on(&self, probes: &[Probe], here_from_there: &Isometry3<f32>) -> Vec<Verdict> {
        probes.par_iter().map(|probe| self.verdict(&(here_from_there * probe.at))).collect()
    }

    fn verdict(&self, at: &Point3<f32>) -> Verdict {
        let (range_m, unit_m) = (at.coords.norm(), self.unit_m());
        let mut off_m = 0.0; // along the beam
        if let Some(nearest) = self.near(at) {
            let normal = self.normals[nearest];
            let from = at - self.points[nearest];
            let across_m = normal.dot(&from).abs();
            let along_m = (from.norm_squared() - across_m * across_m).max(0.0).sqrt();
            let tilt_m = 3.0 * self.tilts_rad2[nearest].sqrt() * along_m;
            let tolerance_m = ON[0] * unit_m + ON[1] * range_m + tilt_m;
            if normal != Vector3::zeros() && tolerance_m < MOST_ON_UNITS * unit_m {
                if across_m <= tolerance_m {
                    return Verdict::On;
                }
                off_m = across_m / (normal.dot(&at.coords) / range_m).abs().max(0.05);
            }
        }
        let Some([nearest_m, farthest_m]) = self.sight.bounds_m(at) else {
            return Verdict::Unknown;
        };
        let tolerance_m = THROUGH[0] * unit_m + THROUGH[1] * range_m;
        let is_hidden = range_m > farthest_m + tolerance_m;
        match range_m < nearest_m - tolerance_m || !is_hidden && off_m > farthest_m - nearest_m {
            true => Verdict::Contradicted,
            false => Verdict::Unknown,
        }
    }

    /// Lead of some verdicts over others on the same probes, in standard deviations of chance:
    /// McNemar's test ("Note on the sampling error of the difference between correlated
    /// proportions", 1947), with the differences summed by cluster.
    fn lead(&self, source: &Self, verdicts: &[Verdict], others: &[Verdict]) -> f64 {
        let of = |scene: &Self, number: usize, verdicts: &[Verdict], others: &[Verdict]| {
            let mut net = vec![0.0; number];
            for (probe, pair) in scene.probes.iter().zip(verdicts.iter().zip(others)) {
                net[probe.cluster as usize] += match pair {
                    (Verdict::On, Verdict::Contradicted) => 1.0,
                    (Verdict::Contradicted, Verdict::On) => -1.0,
                    _ => 0.0,
                };
            }
            net
        };
        let clusters = |scene: &Self| {
            scene.probes.iter().map(|probe| probe.cluster as usize + 1).max().unwrap_or(0)
        };
        let split = source.probes.len();
        let mut net = of(source, clusters(source), &verdicts[..split], &others[..split]);
        net.extend(of(self, clusters(self), &verdicts[split..], &others[split..]));
        let (sum, squares) =
            net.iter().fold((0.0, 0.0), |(s, q): (f64, f64), d| (s + d, q + d * d));
        sum / (squares + 1.0).sqrt()
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

impl Outcome {
    /// The same; [`StopReason::Degenerate`] if the scans leave directions open at its motion, with
    /// the covariance wide along them. A motion that its pairs left open is asked about, too.
    pub(crate) fn with_open_directions(mut self, target: &Scene, source: &Scene) -> Self {
        use StopReason::{Converged, Degenerate, MaxIterations};
        if !matches!(self.stop, Converged | MaxIterations | Degenerate) {
            return self;
        }
        self.open = target.open_directions(source, &self.target_from_source);
        if self.open.is_empty() {
            return self;
        }
        self.stop = Degenerate;
        let open_m = OPEN_UNITS * f64::from(target.unit_m());
        for OpenDirection { turn_rad: [a, b, c], shift_m: [x, y, z] } in &self.open {
            let wide = Vector6::new(*a, *b, *c, *x, *y, *z) * open_m;
            self.covariance = self.covariance.map(|c| Covariance(c.0 + wide * wide.transpose()));
        }
        self
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

    fn seen(x_m: f32, end_m: f32) -> Scene {
        Scene::new(&tunnel(x_m, end_m), 0.8).unwrap()
    }

    fn shift(x_m: f64) -> Pose {
        Pose::translation(x_m, 0.0, 0.0)
    }

    #[test]
    fn a_tunnel_lets_a_motion_slide_along_it_wherever_it_stands() {
        let (target, source) = (seen(0.0, 500.0), seen(2.0, 500.0));
        for x_m in [2.0, 0.0] {
            let open = target.open_directions(&source, &shift(x_m));
            assert_eq!(open.len(), 1, "{x_m} m: {open:?}");
            let [x, y, z] = open[0].shift_m.map(f64::abs);
            assert!(x > 0.95 && y < 0.1 && z < 0.1, "{x_m} m: {open:?}");
        }
    }

    #[test]
    fn the_end_of_a_tunnel_stops_the_slide() {
        let (target, source) = (seen(0.0, 12.0), seen(2.0, 12.0));
        assert_eq!(target.open_directions(&source, &shift(2.0)), []);
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
        assert_eq!(scene(0.0).open_directions(&scene(5.0), &shift(5.0)), []);
    }

    #[test]
    fn a_motion_that_may_slide_is_degenerate_and_its_covariance_wide_along_the_slide() {
        let (target, source) = (seen(0.0, 500.0), seen(2.0, 500.0));
        let covariance = Some(Covariance(Matrix6::identity() * 1e-4));
        let at = |stop| Outcome { covariance, ..Outcome::nothing(&shift(0.0), stop) };
        let said = at(StopReason::Converged).with_open_directions(&target, &source);
        assert_eq!(said.stop, StopReason::Degenerate);
        let [x, y, z] = said.covariance.unwrap().translation_sd_m();
        assert!(x > 4.0 && y < 1.0 && z < 1.0, "{x} {y} {z}");
        // Nothing is added to a worse reason.
        let unconfirmed = at(StopReason::Unconfirmed).with_open_directions(&target, &source);
        assert_eq!((unconfirmed.stop, unconfirmed.open), (StopReason::Unconfirmed, Vec::new()));
    }
}
