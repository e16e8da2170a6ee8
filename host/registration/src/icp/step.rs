//! The step that solves a least squares.

use echoloop_clouds::Pose;

/// A small motion in the target's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    /// The motion of the source points.
    pub(crate) motion: Pose,
    /// The angle it turns, rad.
    pub(crate) angle_rad: f64,
    /// The way the centroid of the pairs goes, m.
    pub(crate) shift_m: f64,
}
