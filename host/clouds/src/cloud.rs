//! A point cloud, and which of its points are echoes.

use nalgebra::{Point3, Vector3};

/// A point cloud in the frame of its sensor, which is at the origin. Lengths in metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// Coordinates of the echoes, `[n]`.
    pub points: Vec<Point3<f32>>,
    /// Normal of each point, `[n]`: of length 1, or zero where the surface has no direction. None
    /// until estimated.
    pub normals: Option<Vec<Vector3<f32>>>,
    /// Standard deviation σ_R of each point's range, m, `[n]`: finite, 0 or more. None when the
    /// sensor does not report it.
    pub range_sd_m: Option<Vec<f32>>,
}

impl Cloud {
    /// A cloud without normals.
    pub fn new(points: Vec<Point3<f32>>) -> Self {
        Self { points, normals: None, range_sd_m: None }
    }

    /// Removes points that are no echo, and counts them.
    pub fn drop_invalid(&mut self) -> Dropped {
        let mut dropped = Dropped::default();
        if self.is_surely_valid() {
            return dropped;
        }
        self.points.iter().for_each(|point| dropped.count(point));
        if dropped.total() > 0 {
            let keep = self.valid();
            retain(&mut self.points, &keep);
            self.normals.iter_mut().for_each(|normals| retain(normals, &keep));
            self.range_sd_m.iter_mut().for_each(|sds| retain(sds, &keep));
        }
        dropped
    }

    /// True only if all points are echoes, at a fraction of the time of asking each.
    pub(crate) fn is_surely_valid(&self) -> bool {
        self.is_surely_within(f32::MAX)
    }

    /// True only if all points are echoes and none has a coordinate beyond `most_m`.
    pub(crate) fn is_surely_within(&self, most_m: f32) -> bool {
        // Above 0 where one is not 0; infinite or no number where one is. No branch: in vectors.
        let sum = |p: &Point3<f32>| p.x.abs() + p.y.abs() + p.z.abs();
        let is_within = |sum: f32| (sum > 0.0) & (sum <= most_m);
        let all =
            |points: &[Point3<f32>]| points.iter().fold(true, |all, p| all & is_within(sum(p)));
        self.points.chunks(1024).all(all)
    }

    /// True for each point that is an echo.
    pub(crate) fn valid(&self) -> Vec<bool> {
        self.points.iter().map(|point| is_finite(point) && !is_at_origin(point)).collect()
    }
}

pub(crate) fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut kept = keep.iter().copied();
    values.retain(|_| kept.next().unwrap_or(true));
}

/// Counts of the points left out because they are no echo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Points with a coordinate that is infinite or not a number.
    pub non_finite: usize,
    /// Points at range zero, which sensors write where no echo came back.
    pub at_origin: usize,
}

impl Dropped {
    /// Count of all points left out.
    pub fn total(&self) -> usize {
        self.non_finite + self.at_origin
    }

    /// Counts a point that is no echo.
    fn count(&mut self, point: &Point3<f32>) {
        self.non_finite += usize::from(!is_finite(point));
        self.at_origin += usize::from(is_at_origin(point));
    }
}

impl std::fmt::Display for Dropped {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} non-finite and {} at range 0 left out", self.non_finite, self.at_origin)
    }
}

/// True when all coordinates are finite.
pub fn is_finite(point: &Point3<f32>) -> bool {
    point.coords.iter().all(|v| v.is_finite())
}

/// True when the range is zero.
fn is_at_origin(point: &Point3<f32>) -> bool {
    point.coords == Vector3::zeros()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_are_no_echo_are_counted_and_removed_with_their_normals_and_deviations() {
        let points = vec![
            Point3::new(1.0, 2.0, 3.0),
            Point3::new(f32::NAN, 0.0, 0.0),
            Point3::new(0.0, -0.0, 0.0),
            Point3::new(0.0, f32::INFINITY, 0.0),
            Point3::new(0.0, 0.0, 4.0),
        ];
        let normals = (0..5).map(|i| Vector3::new(i as f32, 0.0, 0.0)).collect();
        let range_sd_m = Some(vec![0.0, 0.1, 0.2, 0.3, 0.4]);
        let mut cloud = Cloud { points, normals: Some(normals), range_sd_m };
        assert_eq!(cloud.drop_invalid(), Dropped { non_finite: 2, at_origin: 1 });
        assert_eq!(cloud.points, [Point3::new(1.0, 2.0, 3.0), Point3::new(0.0, 0.0, 4.0)]);
        assert_eq!(cloud.normals, Some(vec![Vector3::zeros(), Vector3::new(4.0, 0.0, 0.0)]));
        assert_eq!(cloud.range_sd_m, Some(vec![0.0, 0.4]));
    }
}
