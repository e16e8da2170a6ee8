//! The trait of least squares over pairs.

use nalgebra::{Matrix6, Vector6};

use super::centred::Centred;
use super::kernel::Kernel;
use super::normals::Normals;
use super::pairs::Pairs;
use super::step::Step;
use crate::Observability;

/// Sums over pairs from which a step is solved.
pub(crate) trait Equations: Default + Send + Sync {
    /// The normals it needs of pairs, for this largest angle between them.
    fn normals(max_normal_angle_rad: Option<f64>) -> Normals;

    /// Adds pairs, each with the weight of its residual. Empty lanes hold zeros.
    fn add_all(&mut self, pairs: &Pairs, kernel: Kernel);

    /// Adds the sums of other pairs.
    fn merge(self, other: &Self) -> Self;

    /// The step to the least squares, and the directions that the pairs determine.
    fn solve(&self, degeneracy_threshold: f64) -> (Step, Observability);

    /// Σ w J Jᵀ: the curvature of what is minimised, about the target's origin.
    fn information(&self) -> Matrix6<f64>;

    /// Σ w J r: its slope, 0 where a run has come to its end.
    fn score(&self) -> Vector6<f64>;

    /// The frame that steps are solved in.
    fn centred(&self) -> Centred;

    /// Count of the pairs.
    fn pairs(&self) -> usize;

    /// Root mean square distance of the pairs, m.
    fn rmse_m(&self) -> f64;

    /// Root mean square distance to the target's planes, m.
    fn plane_rmse_m(&self) -> f64;
}
