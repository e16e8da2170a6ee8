//! The outcome of a registration: motion, quality, and reason of its end.

use echoloop_clouds::Pose;

use crate::correspondences::Inliers;
use crate::overlap::{OpenDirection, Overlap, Rival};
use crate::{Covariance, Observability, PrepareError};

/// The outcome of a registration.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The motion; the initial guess if nothing was found.
    pub target_from_source: Pose,
    /// Reason of the end.
    pub stop: StopReason,
    /// Steps taken.
    pub iterations: usize,
    /// Pairs in the last step; of a global method, the matches that agree with the motion.
    pub pairs: usize,
    /// Share of the thinned source points, or of a global method's matches, in those pairs, 0 to 1.
    pub inlier_fraction: f64,
    /// Root mean square distance of those pairs, m: Open3D's inlier RMSE.
    pub rmse_m: f64,
    /// Root mean square distance from point to plane, m.
    pub plane_rmse_m: f64,
    /// Motions that the pairs of the last step determine; None without a step.
    pub observability: Option<Observability>,
    /// Covariance of the motion. None if no pairs were found, and for global methods: a
    /// local one after them has it.
    pub covariance: Option<Covariance>,
    /// Agreement of the matches of a global method; None for local methods.
    pub consensus: Option<Consensus>,
    /// Evidence of both clouds for the motion; None when not checked.
    pub overlap: Option<Overlap>,
    /// Lead of the motion over the same slid by a little, in standard deviations of chance: see
    /// [`crate::overlap::Judgement::lead`].
    pub lead: Option<f64>,
    /// Of other motions that fit the clouds, the best, where a method compares several.
    pub rival: Option<Rival>,
    /// Directions in which the clouds do not notice that the motion slides; empty when not checked.
    pub open: Vec<OpenDirection>,
}

/// Agreement of the matches of a global method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consensus {
    /// Mutual matches of features, before any was left out.
    pub matches: usize,
    /// Matches searched: fewer if some are not finite, or if all would take too much
    /// time and memory.
    pub searched: usize,
    /// Matches whose points the motion brings within the pair distance.
    pub inliers: usize,
    /// The best score over that of the best motion that is clearly another, 1 or more: near 1, the
    /// scene repeats itself. None if the method follows only one motion, or found no other.
    pub margin: Option<f64>,
}

impl From<PrepareError> for StopReason {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::Empty => Self::EmptyCloud,
            PrepareError::Voxel(_) => Self::BadSettings,
        }
    }
}

/// Reason why a registration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StopReason {
    /// The step, or the change of fitness and RMSE, fell below the tolerances: the only success.
    Converged,
    /// The source still moved in the last allowed iteration.
    MaxIterations,
    /// Fewer pairs than a motion has unknowns: the clouds are too far apart, or too small.
    TooFewPairs,
    /// Fewer matches of features than the global method can start from.
    TooFewMatches,
    /// No more matches agree than would by chance: the motion is the best one found, and not to be
    /// trusted.
    NoConsensus,
    /// The clouds do not confirm the motion: too little of one lies on the other, too much lies off
    /// it or in space that the other's sensor saw empty, or the same motion slid by a little fits
    /// them as well. See [`crate::overlap::Judgement::confirms`].
    Unconfirmed,
    /// Another motion fits the clouds as well: see [`Outcome::rival`].
    Ambiguous,
    /// The pairs leave a direction open, along which the initial guess stands, or the clouds do: a
    /// tunnel looks the same a metre on. See [`Outcome::open`].
    Degenerate,
    /// A cloud holds no echo.
    EmptyCloud,
    /// The settings cannot run on these clouds: `check` or `prepare` says why.
    BadSettings,
}

impl StopReason {
    /// True when the pose can be trusted, as far as the method knows.
    pub fn is_success(self) -> bool {
        self == Self::Converged
    }

    /// Its name in files and documents. [`StopReason::Converged`] keeps its former name `Still`,
    /// for readers of earlier versions.
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "Still",
            Self::MaxIterations => "MaxIterations",
            Self::TooFewPairs => "TooFewPairs",
            Self::TooFewMatches => "TooFewMatches",
            Self::NoConsensus => "NoConsensus",
            Self::Unconfirmed => "Unconfirmed",
            Self::Ambiguous => "Ambiguous",
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
            Self::Unconfirmed => {
                "unconfirmed: too little of the clouds lies on each other, or too much beside it"
            }
            Self::Ambiguous => "ambiguous: another motion fits the clouds as well",
            Self::Degenerate => "degenerate: the clouds leave a direction open",
            Self::EmptyCloud => "a cloud holds no point",
            Self::BadSettings => "the settings cannot run on these clouds",
        })
    }
}

impl Outcome {
    /// The outcome when nothing was found: the initial guess and the reason.
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
            covariance: None,
            consensus: None,
            overlap: None,
            lead: None,
            rival: None,
            open: Vec::new(),
        }
    }

    /// The same, with the inliers of its motion among `searched` of `matches` matches.
    pub(crate) fn agreeing(
        self,
        inliers: Inliers,
        (matches, searched): (usize, usize),
        margin: Option<f64>,
    ) -> Self {
        Self {
            pairs: inliers.count,
            inlier_fraction: inliers.count as f64 / matches.max(1) as f64,
            rmse_m: inliers.rmse_m,
            consensus: Some(Consensus { matches, searched, inliers: inliers.count, margin }),
            ..self
        }
    }

    /// The outcome of `align` for two prepared clouds; the reason when one could not be prepared.
    /// An empty cloud is reported first.
    pub(crate) fn of_prepared<T, S>(
        target: Result<T, PrepareError>,
        source: Result<S, PrepareError>,
        initial: &Pose,
        align: impl FnOnce(&T, &S) -> Self,
    ) -> Self {
        match (target, source) {
            (Ok(target), Ok(source)) => align(&target, &source),
            (Err(PrepareError::Empty), _) | (_, Err(PrepareError::Empty)) => {
                Self::nothing(initial, StopReason::EmptyCloud)
            }
            _ => Self::nothing(initial, StopReason::BadSettings),
        }
    }
}
