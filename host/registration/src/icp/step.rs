//! What a least squares comes to.

use echoloop_clouds::Pose;

/// A small motion in the target's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// What moves the source points nearer.
    pub motion: Pose,
    /// The angle it turns, rad.
    pub angle_rad: f64,
    /// The way the centroid of the pairs goes, m.
    pub shift_m: f64,
}
