//! The step that solves a least squares.

use echoloop_clouds::Pose;

/// A small motion in the target's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The motion of the source points.
    pub motion: Pose,
    /// The angle it turns, rad.
    pub angle_rad: f64,
    /// The way the centroid of the pairs goes, m.
    pub shift_m: f64,
}
