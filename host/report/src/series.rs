//! What was tuned, as curves and marks tell it apart: by colour, and by dashes where there is none.

use super::plot::{Key, Sample};

/// A way of tuning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Series {
    /// Nothing.
    Default,
    /// The sensor.
    Lidar,
    /// Registration.
    Registration,
    /// Both together.
    Joint,
}

impl Series {
    /// The class of its curve.
    pub(super) fn curve(self) -> &'static str {
        self.key().0
    }

    /// What it is called.
    pub(super) fn title(self) -> &'static str {
        self.key().2
    }

    fn key(self) -> Key<'static> {
        CURVES[self as usize]
    }

    /// The class of its mark, where both together have a dot of their own.
    pub(super) fn mark(self) -> &'static str {
        match self {
            Self::Default => "dot-default",
            Self::Lidar => "ring-lidar",
            Self::Registration => "ring-registration",
            Self::Joint => "dot-tuned",
        }
    }
}

/// Their curves, in order.
pub(super) const CURVES: [Key<'static>; 4] = [
    ("curve-default", Sample::Line, "default"),
    ("curve-lidar", Sample::Line, "LiDAR tuned"),
    ("curve-registration", Sample::Line, "registration tuned"),
    ("curve-tuned", Sample::Line, "both tuned"),
];
