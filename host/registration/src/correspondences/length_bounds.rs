//! Length consistency: two matches of one rigid motion keep the distance between their points.

use crate::features::PointPair;

/// Bounds for the consistency of two matches: a rigid motion keeps every length.
///
/// ```text
/// a = |xᵢ - xⱼ|    b = |yᵢ - yⱼ|      x in the source, y in the target, m
/// consistent:  |a - b| < tolerance   and   a, b > least_length
/// ```
///
/// A motion that lays both matches within ε keeps `|a - b|` below 2ε. The bound is absolute: the
/// ratio of FGR's published tuple test, 0.95, asks for 5 cm at 1 m, less than a voxel, and grants
/// 2.5 m at 50 m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LengthBounds {
    /// Largest difference of the lengths, m.
    pub(crate) tolerance_m: f64,
    /// Least length of a consistent pair, m: shorter ones occur on any two surfaces. 0: no limit,
    /// not even for two matches at one place.
    pub(crate) least_length_m: f64,
}

impl LengthBounds {
    /// True when two matches are consistent, in `f64`. NaN is consistent with nothing.
    pub(crate) fn hold(&self, i: &PointPair, j: &PointPair) -> bool {
        let [a, b] = lengths_m(i, j);
        let long = self.least_length_m <= 0.0 || a.min(b) > self.least_length_m;
        long && (a - b).abs() < self.tolerance_m
    }

    /// The bounds for lengths in `f32`, the difference wider by `slack_m`.
    pub(super) fn squared(&self, slack_m: f32) -> SquaredBounds {
        let tolerance_m = self.tolerance_m as f32 + slack_m;
        let length_m = self.least_length_m as f32;
        SquaredBounds {
            difference: tolerance_m * tolerance_m,
            length: if length_m > 0.0 { length_m * length_m } else { f32::NEG_INFINITY },
        }
    }
}

/// `|a - b|` of [`LengthBounds`], m.
pub(crate) fn length_difference_m(i: &PointPair, j: &PointPair) -> f64 {
    let [a, b] = lengths_m(i, j);
    (a - b).abs()
}

fn lengths_m(i: &PointPair, j: &PointPair) -> [f64; 2] {
    [(i.source - j.source).norm(), (i.target - j.target).norm()]
}

/// [`LengthBounds`] in squares, so that no root is taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct SquaredBounds {
    difference: f32,
    /// Minus infinity where no edge is too short.
    length: f32,
}

impl SquaredBounds {
    /// True when two matches `x y z u v w` break the bounds, from `A = a²`, `B = b²` and the
    /// tolerance `s`:
    ///
    /// ```text
    /// |a - b| < s   ⇔   A + B < s²   or   (A - B)² < s² (2 (A + B) - s²)
    /// ```
    ///
    /// Near the bound `A - B` is about `2 a s`, so `f32` cancels nothing that matters. What is not
    /// a number breaks nothing: every comparison with it is false.
    #[inline(always)]
    pub(super) fn broken(&self, p: &[f32; 6], q: &[f32; 6]) -> bool {
        let d: [f32; 6] = std::array::from_fn(|k| p[k] - q[k]);
        let a = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        let b = d[3] * d[3] + d[4] * d[4] + d[5] * d[5];
        let (sum, difference) = (a + b, a - b);
        let far = difference * difference >= self.difference * (2.0 * sum - self.difference);
        // No short-circuit: a branch would keep the compiler from using vectors.
        (far & (sum >= self.difference)) | (a <= self.length) | (b <= self.length)
    }
}
