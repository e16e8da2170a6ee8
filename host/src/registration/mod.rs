//! Registration: the motion that lays one cloud on another.

pub mod config;
pub mod degeneracy;
pub mod icp;
pub mod normal_equations;
pub mod prepared;
pub mod suggest;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

pub use config::{ConfigError, IcpConfig};
pub use degeneracy::Observability;
pub use icp::Icp;
pub use prepared::{PrepareError, Source, Target};
pub use suggest::suggest;

use crate::cloud::Cloud;
use crate::pose::Pose;

/// Finds the motion that lays `source` on `target`: `f_reg` of Eq. 2.
pub trait Registration: Send + Sync {
    /// Never fails: a poor match is an [`Outcome`] that says why it stopped. Both clouds are in the frames of their
    /// sensors. `initial` is where to start, `target_from_source`; methods that search the whole space ignore it.
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome;
}

/// What a registration found, and how good it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The motion; the initial guess where nothing was found.
    pub target_from_source: Pose,
    /// Why it ended.
    pub stop: StopReason,
    /// Steps taken.
    pub iterations: usize,
    /// Pairs in the last step.
    pub pairs: usize,
    /// Those over the points of the thinned source, 0 to 1.
    pub inlier_fraction: f64,
    /// Root mean square distance of those pairs, m: Open3D's inlier RMSE.
    pub rmse_m: f64,
    /// The same from point to plane, m.
    pub plane_rmse_m: f64,
    /// Which motions the pairs of the last step determine; absent when there was none.
    pub observability: Option<Observability>,
}

/// Why a registration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StopReason {
    /// The step, or what it changed, fell below the thresholds: the one success.
    Still,
    /// It was still moving after the last iteration allowed.
    MaxIterations,
    /// Fewer pairs than a motion has unknowns: the clouds are too far apart, or too small.
    TooFewPairs,
    /// The pairs leave a direction open; along it the initial guess stands.
    Degenerate,
    /// A cloud holds no echo.
    EmptyCloud,
    /// The settings cannot run on these clouds: `check` or `prepare` says why.
    BadSettings,
}

impl StopReason {
    /// Whether the pose can be trusted as far as the method can tell.
    pub fn is_success(self) -> bool {
        self == Self::Still
    }
}

impl std::fmt::Display for StopReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Still => "still: the last step changed nothing",
            Self::MaxIterations => "the iterations ran out while it was moving",
            Self::TooFewPairs => "too few pairs within the pair distance",
            Self::Degenerate => "degenerate: the pairs leave a direction open",
            Self::EmptyCloud => "a cloud holds no point",
            Self::BadSettings => "the settings cannot run on these clouds",
        })
    }
}

impl Outcome {
    /// Nothing found: the initial guess and the reason.
    pub fn nothing(initial: &Pose, stop: StopReason) -> Self {
        Self {
            target_from_source: *initial,
            stop,
            iterations: 0,
            pairs: 0,
            inlier_fraction: 0.0,
            rmse_m: 0.0,
            plane_rmse_m: 0.0,
            observability: None,
        }
    }
}
