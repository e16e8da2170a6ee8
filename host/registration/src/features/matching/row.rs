//! A feature, and the distance of two features.

use crate::features::DIMENSIONS;

/// One feature.
pub(super) type Row = [f32; DIMENSIONS];

/// Rows that are worked on together: the lanes of one AVX2 register.
pub(super) const WIDTH: usize = 8;

/// `Σ (a_i − b_i)²` in the one order of sums that decides: lane l = 0..7 adds i = l, l + 8, l + 16,
/// l + 24; the lanes add as halves, `l + (l + 4)`, then `l + (l + 2)`, then `0 + 1`; then i = 32.
/// No multiply-add is fused.
#[inline(always)]
pub(super) fn squared_distance(a: &Row, b: &Row) -> f32 {
    let mut lanes = [0.0; WIDTH];
    let ((a, a_last), (b, b_last)) = (a.as_chunks::<WIDTH>(), b.as_chunks::<WIDTH>());
    for (a, b) in a.iter().zip(b) {
        for lane in 0..WIDTH {
            let difference = a[lane] - b[lane];
            lanes[lane] += difference * difference;
        }
    }
    let four: [f32; 4] = std::array::from_fn(|lane| lanes[lane] + lanes[lane + 4]);
    let two = [four[0] + four[2], four[1] + four[3]];
    let rest = a_last.iter().zip(b_last).map(|(a, b)| (a - b) * (a - b));
    rest.fold(two[0] + two[1], |sum, square| sum + square)
}
