//! Registration: the motion that lays one cloud on another.

pub mod cloud;
pub mod config;
pub mod degeneracy;
pub mod features;
pub mod fgr;
pub mod gicp;
pub mod global;
pub mod icp;
pub mod mac;
pub mod normal_equations;
pub mod pose;
pub mod prepared;
pub mod refine;
pub mod rigid;
pub mod suggest;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

pub use config::{
    ConfigError, Convention, FeatureConfig, FgrConfig, FgrMode, GicpConfig, IcpConfig, MacConfig,
    Method, MethodConfig, current_key, former_key,
};
pub use degeneracy::Observability;
pub use fgr::Fgr;
pub use gicp::Gicp;
pub use icp::Icp;
pub use mac::Mac;
pub use prepared::{PrepareError, Source, Target};
pub use refine::Refined;
pub use suggest::{suggest, suggest_features, suggest_gicp, suggest_method, suggest_refinement};

use crate::cloud::Cloud;
use crate::pose::Pose;

/// Finds the motion that lays `source` on `target`: `f_reg` of Eq. 2.
pub trait Registration: Send + Sync {
    /// Never fails: a poor match is an [`Outcome`] that says why it stopped. Both clouds are in the
    /// frames of their sensors. `initial` is where to start, `target_from_source`; methods that
    /// search the whole space ignore it.
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome;
}

/// A method with its settings, ready to run; `finish` goes on from where it ends.
///
/// # Errors
///
/// [`ConfigError`] names the setting that cannot run.
pub fn build(
    method: &MethodConfig,
    finish: Option<IcpConfig>,
) -> Result<Box<dyn Registration>, ConfigError> {
    let global: Box<dyn Registration> = match method {
        MethodConfig::Icp(config) => Box::new(Icp::new(*config)?),
        MethodConfig::Gicp(config) => Box::new(Gicp::new(*config)?),
        MethodConfig::Fgr(config) => Box::new(Fgr::new(*config)?),
        MethodConfig::Mac(config) => Box::new(Mac::new(*config)?),
    };
    Ok(match finish {
        Some(config) => Box::new(Refined { global, local: Icp::new(config)? }),
        None => global,
    })
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
    /// Pairs in the last step; of a global method, the matches that agree with the motion.
    pub pairs: usize,
    /// Those over the points of the thinned source (of a global method: over its matches), 0 to 1.
    pub inlier_fraction: f64,
    /// Root mean square distance of those pairs, m: Open3D's inlier RMSE.
    pub rmse_m: f64,
    /// The same from point to plane, m.
    pub plane_rmse_m: f64,
    /// Which motions the pairs of the last step determine; absent when there was none.
    pub observability: Option<Observability>,
    /// What speaks for the motion that a global method found; absent for local ones.
    pub consensus: Option<Consensus>,
}

/// How far the matches of a global method agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consensus {
    /// Mutual matches of features, before any was left out.
    pub matches: usize,
    /// Those that were searched: fewer where some are not finite, or where all would take too much
    /// time and memory.
    pub searched: usize,
    /// Those of all that the motion lays within the pair distance of each other.
    pub inliers: usize,
    /// The best score over that of the best motion that is clearly another, 1 or more: near 1, the
    /// scene repeats itself. Absent where the method follows one motion only, or found no other.
    pub margin: Option<f64>,
}

/// Why a registration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StopReason {
    /// The step, or what it changed, fell below the tolerances: the one success.
    Converged,
    /// It was still moving after the last iteration allowed.
    MaxIterations,
    /// Fewer pairs than a motion has unknowns: the clouds are too far apart, or too small.
    TooFewPairs,
    /// Fewer matches of features than the global method can start from.
    TooFewMatches,
    /// No more matches agree than would by chance: the motion is the best one found, and not to be
    /// trusted.
    NoConsensus,
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
        self == Self::Converged
    }

    /// Its name in files and in documents. That of [`StopReason::Converged`] is still the one that
    /// readers of earlier versions know.
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "Still",
            Self::MaxIterations => "MaxIterations",
            Self::TooFewPairs => "TooFewPairs",
            Self::TooFewMatches => "TooFewMatches",
            Self::NoConsensus => "NoConsensus",
            Self::Degenerate => "Degenerate",
            Self::EmptyCloud => "EmptyCloud",
            Self::BadSettings => "BadSettings",
        }
    }
}

impl std::fmt::Display for StopReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged: the last step changed nothing",
            Self::MaxIterations => "the iterations ran out while it was moving",
            Self::TooFewPairs => "too few pairs within the pair distance",
            Self::TooFewMatches => "too few matches of features",
            Self::NoConsensus => "no consensus: too few matches agree with the motion",
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
            consensus: None,
        }
    }
}
