//! What a least squares over pairs can do, whatever it sums.

use super::kernel::Kernel;
use super::pairs::Pairs;
use super::step::Step;
use crate::Observability;

/// Sums over pairs that a step is solved from.
pub(crate) trait Equations: Default + Send + Sync {
    /// Whether it wants the normals of source points.
    const SOURCE_NORMALS: bool;

    /// Adds pairs, each with the weight of its residual. Empty lanes hold zeros.
    fn add_all(&mut self, pairs: &Pairs, kernel: Kernel);

    /// Adds the sums of other pairs.
    fn merge(self, other: &Self) -> Self;

    /// The step to the least squares, and which of its directions the pairs determine.
    fn solve(&self, degeneracy_threshold: f64) -> (Step, Observability);

    /// How many pairs.
    fn pairs(&self) -> usize;

    /// Root mean square distance of the pairs, m.
    fn rmse_m(&self) -> f64;

    /// Root mean square distance to the target's planes, m.
    fn plane_rmse_m(&self) -> f64;
}
