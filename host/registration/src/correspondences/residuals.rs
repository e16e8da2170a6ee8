//! Distances that a motion leaves between the points of matches.

use echoloop_clouds::Pose;
use nalgebra::{Rotation3, Vector3};

use crate::features::PointPair;

/// A motion prepared for residuals of many matches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Residuals {
    rotation: Rotation3<f64>,
    shift: Vector3<f64>,
}

impl Residuals {
    /// The residuals of a motion `target_from_source`.
    pub(crate) fn new(target_from_source: &Pose) -> Self {
        Self {
            rotation: target_from_source.rotation.to_rotation_matrix(),
            shift: target_from_source.translation.vector,
        }
    }

    /// `|q - R p - t|²`, m².
    pub(crate) fn squared_m2(&self, pair: &PointPair) -> f64 {
        (pair.target.coords - self.rotation * pair.source.coords - self.shift).norm_squared()
    }
}

/// Count of the matches that agree with a motion, and their distances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Inliers {
    pub(crate) count: usize,
    /// Root mean square distance of those, m.
    pub(crate) rmse_m: f64,
}

impl Inliers {
    /// The matches that a motion leaves less than `max_m` apart.
    pub(crate) fn count(pairs: &[PointPair], target_from_source: &Pose, max_m: f64) -> Self {
        let residuals = Residuals::new(target_from_source);
        let (mut count, mut squares) = (0, 0.0);
        for squared in pairs.iter().map(|pair| residuals.squared_m2(pair)) {
            if squared < max_m * max_m {
                count += 1;
                squares += squared;
            }
        }
        Self { count, rmse_m: (squares / count.max(1) as f64).sqrt() }
    }
}

/// The matches that a motion leaves less than `max_m` apart.
pub(crate) fn within(pairs: &[PointPair], target_from_source: &Pose, max_m: f64) -> Vec<PointPair> {
    let residuals = Residuals::new(target_from_source);
    let near = |pair: &PointPair| residuals.squared_m2(pair) < max_m * max_m;
    pairs.iter().copied().filter(near).collect()
}
