//! Curves and marks of the tuned parts, distinct by colour and, without colour, by dashes.

use super::plot::{Key, Sample};

/// Tuned parts of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Series {
    /// None.
    Default,
    /// The sensor.
    Lidar,
    /// Registration.
    Registration,
    /// Both together.
    Joint,
}

impl Series {
    /// Class of the curve.
    pub(super) fn curve(self) -> &'static str {
        self.key().0
    }

    /// Name in a legend.
    pub(super) fn title(self) -> &'static str {
        self.key().2
    }

    fn key(self) -> Key<'static> {
        CURVES[self as usize]
    }

    /// Class of the mark.
    pub(super) fn mark(self) -> &'static str {
        match self {
            Self::Default => "dot-default",
            Self::Lidar => "ring-lidar",
            Self::Registration => "ring-registration",
            Self::Joint => "dot-tuned",
        }
    }
}

/// Legend of the curves, in the order of [`Series`].
pub(super) const CURVES: [Key<'static>; 4] = [
    ("curve-default", Sample::Line, "default"),
    ("curve-lidar", Sample::Line, "LiDAR tuned"),
    ("curve-registration", Sample::Line, "registration tuned"),
    ("curve-tuned", Sample::Line, "both tuned"),
];
