//! Thinning of matches when all would take too long.

use std::cmp::Reverse;

use rayon::prelude::*;

use super::graph::Compatible;
use crate::correspondences::LengthBounds;
use crate::features::PointPair;

/// Sample of the matches by which degrees are estimated.
const SAMPLE: usize = 1024;

/// Steps that weighing and searching a graph may take: Σ degree². Some tenths of a second on one
/// core.
const MAX_STEPS: u64 = 200_000_000;

/// The `max` matches that are compatible with most of a sample of the others, ascending; ties go to
/// the earlier.
///
/// The sample is every `n/1024`-th match, so the time is linear in `n`. Of `n` matches with a share
/// `p` of inliers and a share `q` of pairs compatible by chance, an inlier counts about
/// `1024 (p + q)`, an outlier `1024 q`.
pub(super) fn by_sampled_degree(
    pairs: &[PointPair],
    bounds: &LengthBounds,
    max: usize,
) -> Vec<u32> {
    let step = pairs.len().div_ceil(SAMPLE);
    let sample: Vec<PointPair> = pairs.iter().step_by(step).copied().collect();
    let degree =
        |pair: &PointPair| sample.iter().filter(|other| bounds.hold(pair, other)).count() as u32;
    let degrees: Vec<u32> = pairs.par_iter().map(degree).collect();
    highest(&degrees, max)
}

/// The matches to keep of a graph that would take too many steps: those of the highest degree, as
/// many as may be. Absent when all may stay.
pub(super) fn by_density(compatible: &Compatible) -> Option<Vec<u32>> {
    let steps = |kept: usize, degrees: &[u32]| -> u64 {
        degrees[..kept].iter().map(|&degree| u64::from(degree).min(kept as u64).pow(2)).sum()
    };
    let mut degrees = compatible.degrees.clone();
    degrees.sort_unstable_by_key(|&degree| Reverse(degree));
    if steps(degrees.len(), &degrees) <= MAX_STEPS {
        return None;
    }
    let (mut fits, mut exceeds) = (0, degrees.len());
    while exceeds - fits > 1 {
        let middle = fits.midpoint(exceeds);
        if steps(middle, &degrees) <= MAX_STEPS { fits = middle } else { exceeds = middle }
    }
    Some(highest(&compatible.degrees, fits))
}

fn highest(degrees: &[u32], max: usize) -> Vec<u32> {
    let mut order: Vec<u32> = (0..degrees.len() as u32).collect();
    order.sort_by_key(|&i| Reverse(degrees[i as usize]));
    order.truncate(max);
    order.sort_unstable();
    order
}
