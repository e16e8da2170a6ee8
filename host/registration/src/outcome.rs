//! What a registration found, how good it is, and why it ended.

use crate::overlap::Overlap;
use crate::{Covariance, Observability, PrepareError};
use echoloop_clouds::Pose;

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
    /// How far off the motion may be. Absent where no pairs were found, and of global methods: a
    /// local one after them has it.
    pub covariance: Option<Covariance>,
    /// What speaks for the motion that a global method found; absent for local ones.
    pub consensus: Option<Consensus>,
    /// What the points of both clouds say of the motion; absent where nobody asked them.
    pub overlap: Option<Overlap>,
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

impl From<PrepareError> for StopReason {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::Empty => Self::EmptyCloud,
            PrepareError::Voxel(_) => Self::BadSettings,
        }
    }
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
    /// The clouds do not bear the motion out: too little of one lies on the other, or stands where
    /// the other's sensor saw the open. See [`Overlap::confirms`].
    Unconfirmed,
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
            Self::Unconfirmed => "Unconfirmed",
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
                "unconfirmed: too little of the clouds lies on each other, or was seen through"
            }
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
            covariance: None,
            consensus: None,
            overlap: None,
        }
    }

    /// Nothing found, since a cloud could not be prepared. An empty one is named first.
    pub(crate) fn unprepared(
        initial: &Pose,
        errors: impl IntoIterator<Item = PrepareError>,
    ) -> Self {
        let empty = errors.into_iter().any(|error| error == PrepareError::Empty);
        Self::nothing(initial, if empty { StopReason::EmptyCloud } else { StopReason::BadSettings })
    }
}
