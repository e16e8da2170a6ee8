//! Matches, as indices and as positions.

use nalgebra::Point3;

use super::Described;

/// A match: two points whose features are each other's nearest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Index into the source's points.
    pub source: u32,
    /// Index into the target's points.
    pub target: u32,
    /// Squared distance of the features.
    pub squared: f32,
}

/// The positions of a match, each in its own frame, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointPair {
    /// The point in the source.
    pub source: Point3<f64>,
    /// The point in the target.
    pub target: Point3<f64>,
}

/// The positions of matches.
pub fn pairs(matches: &[Match], source: &Described, target: &Described) -> Vec<PointPair> {
    let pair = |m: &Match| PointPair {
        source: source.points[m.source as usize].cast(),
        target: target.points[m.target as usize].cast(),
    };
    matches.iter().map(pair).collect()
}
