//! Points of a scan that the other is asked about, and its answers.

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::{Overlap, Scene};
use crate::Pose;

/// Distance between the points of a scan that the other is asked about, over the unit.
const PROBE_UNITS: f32 = 0.3;

/// Most points of a scan that the other is asked about.
const MOST_PROBES: usize = 8_000;

/// Most of them for a first look.
pub(super) const FIRST_LOOK: usize = 2_000;

/// Distance from its sensor, over the unit and at most in m, below which a scan is not asked.
/// Ranges so near are the least sure, and their errors are the same in both scans, which then agree
/// that nothing moved.
const NEAR_UNITS: f32 = 4.0;
const MOST_NEAR_M: f32 = 2.0;

/// Distance within which a point lies on a plane: over the unit, and over its range; three standard
/// deviations of the plane's tilt are added.
const ON: [f32; 2] = [0.06, 0.003];

/// Largest such distance, over the unit: farther from its points a plane tells nothing.
const MOST_ON_UNITS: f32 = 0.4;

/// Distance in front of all that was seen at which a point was seen through: over the unit, and
/// over its range.
const THROUGH: [f32; 2] = [0.15, 0.01];

/// Size of a cluster: over the unit, and over its range. Errors within it are not independent.
const CLUSTER: [f32; 2] = [0.5, 0.05];

/// Range of the points of a cloud without a sensor at its origin, such as a map, over the unit: for
/// tolerances only.
const MAP_RANGE_UNITS: f32 = 15.0;

/// Weight of a point on a surface, over one that is contradicted: ground lies on any ground.
const ON_WEIGHT: f64 = 0.2;

/// Two clouds without a sensor contradict nothing: the lead by all probes over this stands for that
/// by the disputed ones.
const BLIND: f64 = 7.0;

/// Evidence of one scan for the place of a point of the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
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
    pub(super) at: Point3<f32>,
    cluster: u32,
}

/// Verdicts of two scans on each other's probes at a motion.
#[derive(Clone, Debug)]
pub(super) struct Answers {
    /// Those of the target on the source's probes.
    of_target: Vec<Verdict>,
    /// Those of the source on the target's probes.
    of_source: Vec<Verdict>,
}

/// Lead of a motion over another on the same probes, in standard deviations of chance: McNemar's
/// test ("Note on the sampling error of the difference between correlated proportions", 1947), with
/// the differences summed by cluster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lead {
    /// By the probes that lie on a surface at one motion and are contradicted at the other. Of two
    /// clouds without a sensor, a share of the other lead.
    pub(super) disputed: f64,
    /// By all probes; those on a surface count [`ON_WEIGHT`], the contradicted -1.
    pub(super) explained: f64,
}

/// Points of a scan at least some distance apart: [`FIRST_LOOK`] of all parts of it, then the
/// others.
pub(super) fn probes(
    echoes: impl Iterator<Item = Point3<f32>>,
    unit_m: f32,
    is_scan: bool,
) -> Vec<Probe> {
    let cell = |p: &Point3<f32>, edge_m: f32| [p.x, p.y, p.z].map(|x| (x / edge_m).floor() as i32);
    let mut taken = FxHashSet::default();
    let least_m = if is_scan { near_m(unit_m) } else { 0.0 };
    let apart: Vec<Point3<f32>> = echoes
        .filter(|p| p.coords.norm() >= least_m && taken.insert(cell(p, PROBE_UNITS * unit_m)))
        .collect();
    let mut clusters = FxHashMap::default();
    let stride = apart.len().div_ceil(MOST_PROBES).max(1);
    let numbered = apart.into_iter().step_by(stride).map(|at| {
        let range_m = range_m(&at, unit_m, is_scan);
        let least_m = CLUSTER[0] * unit_m;
        let doublings = (CLUSTER[1] * range_m / least_m).max(1.0).log2().floor() as i32;
        let next = clusters.len() as u32;
        let edge_m = least_m * 2f32.powi(doublings);
        Probe { at, cluster: *clusters.entry((doublings, cell(&at, edge_m))).or_insert(next) }
    });
    let numbered: Vec<Probe> = numbered.collect();
    let stride = numbered.len().div_ceil(FIRST_LOOK).max(1);
    let rest = (0..numbered.len()).filter(|i| i % stride != 0);
    (0..numbered.len()).step_by(stride).chain(rest).map(|i| numbered[i]).collect()
}

impl Scene {
    /// Verdicts on the first probes of both scans.
    pub(super) fn answers(&self, source: &Self, motion: &Pose, most: usize) -> Answers {
        let (there, back) = (motion.cast(), motion.inverse().cast());
        let (of_target, of_source) = rayon::join(
            || self.verdicts(first(&source.probes, most), &there),
            || source.verdicts(first(&self.probes, most), &back),
        );
        Answers { of_target, of_source }
    }

    fn verdicts(&self, probes: &[Probe], here_from_there: &Isometry3<f32>) -> Vec<Verdict> {
        probes.par_iter().map(|probe| self.verdict(&(here_from_there * probe.at))).collect()
    }

    fn verdict(&self, at: &Point3<f32>) -> Verdict {
        let unit_m = self.unit_m();
        let is_scan = self.sight.is_scan();
        let range_m = range_m(at, unit_m, is_scan);
        if is_scan && range_m < near_m(unit_m) {
            return Verdict::Unknown;
        }
        let mut off_m = 0.0; // along the beam
        if let Some(nearest) = self.near(at) {
            let normal = self.normals()[nearest];
            let from = at - self.points()[nearest];
            let across_m = normal.dot(&from).abs();
            let along_m = (from.norm_squared() - across_m * across_m).max(0.0).sqrt();
            let tilt_m = 3.0 * self.tilts_rad2[nearest].sqrt() * along_m;
            let tolerance_m = on_m(unit_m, range_m) + tilt_m;
            if normal != Vector3::zeros() && tolerance_m < MOST_ON_UNITS * unit_m {
                if across_m <= tolerance_m {
                    return Verdict::On;
                }
                off_m = across_m / (normal.dot(&at.coords) / range_m).abs();
                // A beam nearly along a wall meets its plane far from the points measured on it.
                if off_m > self.reach_m(at) {
                    off_m = 0.0;
                }
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

    /// The nearest point within reach.
    pub(super) fn near(&self, at: &Point3<f32>) -> Option<usize> {
        self.surface.nearest(at, self.reach_m(at))
    }

    /// Distance over which a point of the surface tells of it: as far as the scan's directions are
    /// apart there.
    fn reach_m(&self, at: &Point3<f32>) -> f32 {
        let apart_m = match self.sight.is_scan() {
            true => 3.0 * at.coords.norm() * self.sight.spacing_rad(),
            false => 0.0,
        };
        (1.5 * self.voxel_m).max(apart_m)
    }

    /// Lead of a motion's answers over another's on the same probes.
    pub(super) fn lead(&self, source: &Self, here: &Answers, there: &Answers) -> Lead {
        let mut nets = net(&source.probes, &here.of_target, &there.of_target);
        nets.extend(net(&self.probes, &here.of_source, &there.of_source));
        let [disputed, explained] = [0, 1].map(|kind| {
            let sum = |(sum, squares): (f64, f64), net: &[f64; 2]| {
                (sum + net[kind], squares + net[kind] * net[kind])
            };
            let (sum, squares) = nets.iter().fold((0.0, 0.0), sum);
            sum / (squares + 1.0).sqrt()
        });
        let is_blind = !self.sight.is_scan() && !source.sight.is_scan();
        Lead { disputed: if is_blind { explained / BLIND } else { disputed }, explained }
    }
}

impl Answers {
    /// Counts of the verdicts.
    pub(super) fn overlap(&self) -> Overlap {
        let count = |wanted: Verdict| {
            self.of_target.iter().chain(&self.of_source).filter(|v| **v == wanted).count()
        };
        let covered = [&self.of_target, &self.of_source].map(|verdicts| {
            let known = verdicts.iter().filter(|v| **v != Verdict::Unknown).count();
            known as f64 / verdicts.len().max(1) as f64
        });
        Overlap {
            covered: covered[0].max(covered[1]),
            on: count(Verdict::On),
            contradicted: count(Verdict::Contradicted),
            unknown: count(Verdict::Unknown),
        }
    }
}

/// Differences of verdicts by cluster: of the disputed probes, and of all.
fn net(probes: &[Probe], here: &[Verdict], there: &[Verdict]) -> Vec<[f64; 2]> {
    let clusters = probes.iter().map(|probe| probe.cluster as usize + 1).max().unwrap_or(0);
    let mut nets = vec![[0.0; 2]; clusters];
    let value = |verdict: &Verdict| match verdict {
        Verdict::On => ON_WEIGHT,
        Verdict::Contradicted => -1.0,
        Verdict::Unknown => 0.0,
    };
    for (probe, (here, there)) in probes.iter().zip(here.iter().zip(there)) {
        let [disputed, explained] = &mut nets[probe.cluster as usize];
        *disputed += match (here, there) {
            (Verdict::On, Verdict::Contradicted) => 1.0,
            (Verdict::Contradicted, Verdict::On) => -1.0,
            _ => 0.0,
        };
        *explained += value(here) - value(there);
    }
    nets
}

fn first(probes: &[Probe], most: usize) -> &[Probe] {
    &probes[..most.min(probes.len())]
}

/// Range of a point, m; in a cloud without a sensor at its origin that of all.
pub(super) fn range_m(at: &Point3<f32>, unit_m: f32, is_scan: bool) -> f32 {
    if is_scan { at.coords.norm() } else { MAP_RANGE_UNITS * unit_m }
}

/// Distance within which a point of some range lies on a plane that is well known.
pub(super) fn on_m(unit_m: f32, range_m: f32) -> f32 {
    ON[0] * unit_m + ON[1] * range_m
}

fn near_m(unit_m: f32) -> f32 {
    (NEAR_UNITS * unit_m).min(MOST_NEAR_M)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use echoloop_clouds::Cloud;

    use super::super::tests::scenes;
    use super::*;

    #[test]
    fn points_near_the_sensor_are_not_asked_about_and_those_of_a_map_are() {
        let points = [1.5, 2.5, 30.0].map(|x_m| Point3::new(x_m, 0.0, 0.0));
        let asked = |unit_m: f32, is_scan: bool| {
            let probes = probes(points.into_iter(), unit_m, is_scan);
            probes.iter().map(|probe| probe.at.x).collect::<Vec<_>>()
        };
        assert_eq!(asked(1.0, true), [2.5, 30.0]);
        assert_eq!(asked(0.25, true), [1.5, 2.5, 30.0], "a small scene has small distances");
        assert_eq!(asked(1.0, false), [1.5, 2.5, 30.0]);
    }

    #[test]
    fn a_map_has_the_tolerances_of_one_range() {
        let near_and_far = [20.0, 200.0].map(|x_m| Point3::new(x_m, 0.0, 0.0));
        assert_eq!(near_and_far.map(|p| range_m(&p, 0.5, true)), [20.0, 200.0]);
        assert_eq!(near_and_far.map(|p| range_m(&p, 0.5, false)), [7.5; 2]);
        assert!((on_m(0.5, 200.0) - 0.63).abs() < 1e-6);
    }

    #[test]
    fn a_scan_answers_for_floor_wall_and_open_space_and_not_near_itself() {
        let (target, _) = scenes();
        // The floor is 2 m below the sensor, a wall 20 m away.
        for (x_m, z_m, expected) in [
            (8.0, -2.0, Verdict::On),
            (20.0, 1.0, Verdict::On),
            (15.0, 1.0, Verdict::Contradicted),
            (30.0, 1.0, Verdict::Unknown),
            (1.0, 0.3, Verdict::Unknown),
        ] {
            let verdict = target.verdict(&Point3::new(x_m, 0.0, z_m));
            assert_eq!(verdict, expected, "{x_m} m, {z_m} m");
        }
    }

    #[test]
    fn a_wall_tells_nothing_of_a_beam_that_passes_far_beyond_its_points() {
        // A wall along x, 1 m beside the sensor, and another across 20 m away.
        let grid = |from: i32, to: i32| move |a: i32| (from..to).map(move |b| (a, b));
        let beside = (80..120).flat_map(grid(-10, 10));
        let beside = beside.map(|(x, z)| Point3::new(x as f32 * 0.1, 1.0, z as f32 * 0.1));
        let across = (-10..10).flat_map(grid(-10, 10));
        let across = across.map(|(y, z)| Point3::new(20.0, y as f32 * 0.8, z as f32 * 0.8));
        let cloud = Cloud::new(beside.chain(across).collect());
        let scan = Scene::new(&cloud, 0.8).unwrap();
        assert_eq!(scan.verdict(&Point3::new(11.9, 1.02, 0.0)), Verdict::On);
        assert_eq!(scan.verdict(&Point3::new(11.9, 0.5, 0.0)), Verdict::Unknown);
    }
}
