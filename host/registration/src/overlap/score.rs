//! A quick score of a motion, to rank candidates by.

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use super::Scene;
use crate::Pose;

/// Largest distance of a point from the surface that it lies on, in voxels.
const REACH_VOXELS: f32 = 1.25;

/// Distance from a surface at which a point counts half, over the voxel.
const HALF_VOXELS: f32 = 0.375;

/// A point was seen through if everything seen around it is farther by this share of its range …
const BEHIND_SHARE: f32 = 0.05;

/// … and by this distance, over the voxel.
const BEHIND_VOXELS: f32 = 1.25;

/// Points a thread takes at a time.
const CHUNK: usize = 512;

/// Weight of a point that was seen through, over one that lies on a surface.
const CONTRADICTION: f64 = 3.0;

impl Scene {
    /// Score by which motions are ranked; higher is better: the share of the thinned points of both
    /// scans on a surface of the other that faces the same way, weighted by distance, less
    /// three times the share that was seen through.
    pub fn score(&self, source: &Self, target_from_source: &Pose) -> f64 {
        let (there, back) = (target_from_source.cast(), target_from_source.inverse().cast());
        let (forth, again) =
            rayon::join(|| source.seen_by(self, &there), || self.seen_by(source, &back));
        let points = (source.points().len() + self.points().len()).max(1) as f64;
        (forth.0 + again.0 - CONTRADICTION * (forth.1 + again.1)) / points
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
        let chunks = self.points().par_chunks(CHUNK).zip(self.normals().par_chunks(CHUNK));
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
        let nearest = self.surface.nearest(point, REACH_VOXELS * self.voxel_m)?;
        let (to, own) = (self.points().get(nearest)?, self.normals().get(nearest)?);
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
        self.sight.is_scan() && self.image.nearest_m(point).is_some_and(|seen_m| seen_m > least_m)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::scenes;
    use super::*;
    use crate::tests::on_threads;

    #[test]
    fn the_right_motion_scores_above_its_neighbours() {
        let (target, source) = scenes();
        let score = |x_m: f64, turn: f64| {
            let pose = Pose::new([x_m, 0.0, 0.0].into(), [0.0, 0.0, turn].into());
            target.score(&source, &pose)
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
                target.score(&source, &Pose::translation(4.7, 0.1, 0.0)).to_bits()
            })
        };
        assert_eq!(on(1), on(2));
    }
}
