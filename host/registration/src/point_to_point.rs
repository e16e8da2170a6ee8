//! Point-to-point ICP: nearest pairs, the rigid motion of least squares between them, again.

use echoloop_clouds::{Cloud, Pose};
use nalgebra::Point3;

use crate::features::PointPair;
use crate::geometry::kdtree::KdTree;
use crate::geometry::voxel::downsample;
use crate::rigid::rigid;
use crate::{Outcome, PointToPointConfig, Registration, StopReason};

/// Point-to-point ICP (Besl and McKay 1992): no normals, no kernel, one pair distance.
#[derive(Clone, Debug)]
pub struct PointToPoint {
    pub(crate) config: PointToPointConfig,
}

impl PointToPoint {
    /// Pairs of moved source points with the nearest target points within the distance.
    fn pairs(&self, tree: &KdTree, source: &Cloud, target_from_source: &Pose) -> Vec<PointPair> {
        let most_m = self.config.max_pair_distance_m as f32;
        let pair = |point: &Point3<f32>| {
            let source = target_from_source * point.cast::<f64>();
            let index = tree.nearest(&source.cast(), most_m)?;
            Some(PointPair { source, target: tree.points()[index as usize].cast() })
        };
        source.points.iter().filter_map(pair).collect()
    }
}

impl Registration for PointToPoint {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        let thin = |cloud| downsample(cloud, self.config.voxel_m);
        let (Ok(target), Ok(source)) = (thin(target), thin(source)) else {
            return Outcome::nothing(initial, StopReason::BadSettings);
        };
        if target.points.is_empty() || source.points.is_empty() {
            return Outcome::nothing(initial, StopReason::EmptyCloud);
        }
        let tree = KdTree::new(&target.points);
        let mut outcome = Outcome::nothing(initial, StopReason::MaxIterations);
        while outcome.iterations < self.config.max_iterations {
            let pairs = self.pairs(&tree, &source, &outcome.target_from_source);
            let Some(step) = rigid(pairs.iter().map(|pair| (*pair, 1.0))) else {
                return Outcome::nothing(initial, StopReason::TooFewPairs);
            };
            outcome.target_from_source = step * outcome.target_from_source;
            outcome.iterations += 1;
            outcome.pairs = pairs.len();
            outcome.inlier_fraction = pairs.len() as f64 / source.points.len() as f64;
            let squares: f64 = pairs.iter().map(|p| (p.source - p.target).norm_squared()).sum();
            outcome.rmse_m = (squares / pairs.len() as f64).sqrt();
            if step.translation.vector.norm() < self.config.translation_tolerance_m
                && step.rotation.angle() < self.config.rotation_tolerance_rad
            {
                outcome.stop = StopReason::Converged;
                break;
            }
        }
        outcome
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_clouds::pose::translation_error_m;

    #[test]
    fn a_small_motion_of_a_bumpy_field_is_found_both_ways() {
        let field =
            |x: f32, y: f32| Point3::new(x, y, (0.7 * x).sin() + (0.5 * y + 0.2 * x).cos() - 3.0);
        let at = |i: i32| field((i % 80) as f32 * 0.2, (i / 80) as f32 * 0.2);
        let target = Cloud::new((0..6_400).map(at).collect());
        let truth = Pose::translation(0.1, -0.05, 0.04);
        let source = Cloud::new(
            target
                .points
                .iter()
                .map(|p| truth.inverse() * p.cast::<f64>())
                .map(|p| p.cast())
                .collect(),
        );
        let method = PointToPoint::new(PointToPointConfig::outdoor()).unwrap();
        for (target, source, truth) in
            [(&target, &source, truth), (&source, &target, truth.inverse())]
        {
            let outcome = method.register(target, source, &Pose::identity());
            assert_eq!(outcome.stop, StopReason::Converged, "{outcome:?}");
            assert!(translation_error_m(&outcome.target_from_source, &truth) < 0.03);
        }
        let nothing = method.register(&target, &Cloud::default(), &Pose::identity());
        assert_eq!(nothing.stop, StopReason::EmptyCloud);
    }
}
