//! Pairing of each source point with the nearest target point. It searches only if the last answer
//! may have changed.

use echoloop_clouds::Pose;
#[cfg(target_arch = "x86_64")]
use echoloop_dispatch::V3;
use echoloop_dispatch::dispatch;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::equations::Equations;
use super::kernel::Kernel;
use super::normals::Normals;
use super::pairs::{CHUNK, Pairs};
use crate::Target;
use crate::geometry::box_tree::{BoxTree, LaneKernel, Portable};
use crate::prepared::RangeNoise;

/// Rounding of `f32` distances, relative, with room: a match within this of a tie is searched anew.
const ROUNDING: f32 = 1e-6;

/// Extra reach of a search, as a share of the pair distance: its result then stays valid over
/// small steps.
const SLACK: f32 = 0.125;

/// The points to be moved, and their normals if the method needs them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moving<'a> {
    /// Sensor frame, m; neighbours in the list should be neighbours in space.
    pub(crate) points: &'a [Point3<f32>],
    /// Normal of each point, or empty.
    pub(crate) normals: &'a [Vector3<f32>],
    pub(crate) noise: &'a RangeNoise,
}

/// Result of the last search for a source point. It holds until the point has moved far enough for
/// another target point to be nearer, by the triangle inequality, without a search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LastSearch {
    /// The nearest target point.
    index: Option<u32>,
    /// Distance below which there was no other target point, m.
    others_m: f32,
    /// The point at the last search.
    at: Point3<f32>,
}

/// Longest distance of a pair, and the extra reach of a search, m.
#[derive(Clone, Copy, Debug)]
struct Reach {
    pair_m: f32,
    slack_m: f32,
}

impl Reach {
    fn new(pair_m: f64) -> Self {
        Self { pair_m: pair_m as f32, slack_m: SLACK * pair_m as f32 }
    }
}

impl LastSearch {
    /// A result that never holds.
    const UNKNOWN: Self =
        Self { index: None, others_m: f32::NEG_INFINITY, at: Point3::new(0.0, 0.0, 0.0) };

    /// Searches from here, no farther than needed when some target point is known to be `near_m`
    /// away.
    #[inline(always)]
    fn search(
        kernel: impl LaneKernel,
        tree: &BoxTree,
        at: Point3<f32>,
        reach: Reach,
        near_m: f32,
    ) -> Self {
        let radius_m = reach.pair_m.min(near_m) + reach.slack_m;
        let found = tree.nearest(kernel, &at, radius_m, reach.slack_m);
        Self { index: found.index, others_m: found.others_squared_m2.sqrt(), at }
    }

    /// The nearest target point strictly within reach of `at`: the same as a full scan would find.
    /// `guess` is a target point that may be near.
    #[inline(always)]
    fn update(
        &mut self,
        kernel: impl LaneKernel,
        tree: &BoxTree,
        at: Point3<f32>,
        reach: Reach,
        guess: Option<u32>,
    ) -> Option<u32> {
        let distance_m = |index: Option<u32>| {
            index
                .and_then(|index| tree.points().get(index as usize))
                .map_or(f32::INFINITY, |point| (point - at).norm())
        };
        let mut now_m = distance_m(self.index);
        let others_m = self.others_m * (1.0 - ROUNDING) - (at - self.at).norm();
        let holds = now_m.min(reach.pair_m) * (1.0 + ROUNDING) < others_m;
        if !holds {
            *self = Self::search(kernel, tree, at, reach, now_m.min(distance_m(guess)));
            now_m = distance_m(self.index);
        }
        self.index.filter(|_| now_m < reach.pair_m)
    }
}

/// Pairs each source point with the nearest target point within reach. Returns the sums of the
/// least squares, and, if `residuals`, the distance of each pair from its plane, m, in the points'
/// order.
pub(crate) fn sum_pairs<E: Equations>(
    placed: &Placed,
    kernel: Kernel,
    residuals: bool,
    found: &mut Found,
) -> (E, Vec<f32>) {
    let parts: Vec<(E, Vec<f32>)> =
        placed.in_chunks(found, |chunk, matches| chunk.sum(matches, kernel, residuals));
    parts.into_iter().fold((E::default(), Vec::new()), |(all, mut residuals_m), (sums, more)| {
        residuals_m.extend(more);
        (all.merge(&sums), residuals_m)
    })
}

/// Two clouds, and the pose of the source.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed<'a> {
    pub(crate) target: &'a Target,
    pub(crate) source: &'a Moving<'a>,
    /// `target_from_source`.
    pub(crate) pose: &'a Pose,
    /// Points farther apart are no pair, m.
    pub(crate) reach_m: f64,
    pub(crate) normals: Normals,
}

impl Placed<'_> {
    /// Median variance of the residuals due to the errors of the ranges, m²;
    /// None when neither sensor reports them.
    pub(crate) fn noise_m2(&self) -> Option<f64> {
        let of = [&self.target.noise, self.source.noise];
        let reported = of.iter().any(|noise| !noise.variances_m2.is_empty());
        reported.then(|| of.iter().map(|noise| noise.median_m2).sum())
    }

    /// Results of `of` for each chunk of source points and their last searches, in the points'
    /// order, on any number of threads.
    pub(crate) fn in_chunks<T: Send>(
        &self,
        found: &mut Found,
        of: impl Fn(&Chunk, &mut [LastSearch]) -> T + Sync,
    ) -> Vec<T> {
        let chunk = |(number, matches): (usize, &mut [LastSearch])| {
            of(&Chunk { placed: self, first: number * CHUNK }, matches)
        };
        found.0.par_chunks_mut(CHUNK).enumerate().map(chunk).collect()
    }
}

/// Results of the last search for pairs, one per source point, for the next search.
#[derive(Clone, Debug)]
pub(crate) struct Found(Vec<LastSearch>);

impl Found {
    /// Empty results for `points` source points.
    pub(crate) fn nothing(points: usize) -> Self {
        Self(vec![LastSearch::UNKNOWN; points])
    }
}

/// Consecutive source points, and their pose.
#[derive(Clone, Copy)]
pub(crate) struct Chunk<'a> {
    placed: &'a Placed<'a>,
    first: usize,
}

impl Chunk<'_> {
    fn sum<E: Equations>(
        &self,
        matches: &mut [LastSearch],
        kernel: Kernel,
        residuals: bool,
    ) -> (E, Vec<f32>) {
        let pairs = self.pairs(matches);
        let (mut sums, mut residuals_m) = (E::default(), Vec::new());
        sums.add_all(&pairs, kernel);
        if residuals {
            pairs.residuals(&mut residuals_m);
        }
        (sums, residuals_m)
    }

    /// The pairs of these points.
    pub(crate) fn pairs(&self, matches: &mut [LastSearch]) -> Pairs {
        let mut pairs = Pairs::default();
        pair(self, matches, &mut pairs);
        pairs
    }

    /// The part of it that begins `points` later.
    pub(crate) fn from(self, points: usize) -> Self {
        Self { first: self.first + points, ..self }
    }

    #[inline(always)]
    fn pair_with(&self, matches: &mut [LastSearch], pairs: &mut Pairs, kernel: impl LaneKernel) {
        let &Placed { target, source, pose, reach_m, normals } = self.placed;
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        let translation = pose.translation.vector;
        let reach = Reach::new(reach_m);
        let Some(points) = source.points.get(self.first..) else { return };
        let mut guess = None;
        for (i, (point, found)) in points.iter().zip(matches).enumerate() {
            let moved = rotation * point.coords.cast::<f64>() + translation;
            let at = Point3::from(moved.cast());
            let index = found.update(kernel, &target.tree, at, reach, guess);
            guess = found.index;
            let Some(index) = index.map(|index| index as usize) else { continue };
            let own = || {
                let own = source.normals.get(self.first + i);
                own.map_or_else(Vector3::zeros, |own| rotation * own.cast())
            };
            if let Some([n, m]) = normals.of(&target.normals[index].cast(), own) {
                let known = |noise: &RangeNoise, i: usize| noise.variances_m2.get(i).copied();
                let of_target = known(&target.noise, index).unwrap_or_default();
                let noise_m2 = of_target + known(source.noise, self.first + i).unwrap_or_default();
                pairs.push(&moved, &target.tree.points()[index], &n, &m, noise_m2);
            }
        }
    }
}

dispatch! {
    /// Finds the pairs of a chunk.
    fn pair(chunk: &Chunk, matches: &mut [LastSearch], pairs: &mut Pairs)
        = Chunk::pair_with, with: Portable, v3_with: V3::here();
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{IcpConfig, Source};
    use echoloop_clouds::Cloud;

    fn nearest(tree: &BoxTree, at: &Point3<f32>, reach_m: f32) -> Option<u32> {
        tree.nearest(Portable, at, reach_m, 0.0).index
    }

    fn points() -> impl Strategy<Value = Vec<[f32; 3]>> {
        prop::collection::vec(prop::array::uniform3(-5.0f32..5.0), 1..200)
    }

    fn target(points: &[[f32; 3]]) -> Target {
        let cloud = Cloud::new(points.iter().map(|&p| p.into()).collect());
        Target::prepare(&cloud, &IcpConfig { voxel_m: 1e-3, ..IcpConfig::outdoor() }).unwrap()
    }

    proptest! {
        #[test]
        fn a_kept_match_is_the_one_a_search_finds(
            points in points(),
            start in prop::array::uniform3(-6.0f32..6.0),
            guess in prop::option::of(0u32..400),
            steps in prop::collection::vec(
                (prop::array::uniform3(-1.0f32..1.0), 0.0f32..1.0, 0.2f32..4.0), 1..40
            ),
        ) {
            let target = target(&points);
            let (mut kept, mut at) = (LastSearch::UNKNOWN, Point3::from(start));
            for (direction, length, reach_m) in steps {
                at += Vector3::from(direction) * length.powi(3);
                let found =
                    kept.update(Portable, &target.tree, at, Reach::new(f64::from(reach_m)), guess);
                prop_assert_eq!(found, nearest(&target.tree, &at, reach_m));
            }
        }

        #[test]
        fn both_builds_give_the_same_bytes(
            to in points(),
            from in points(),
            reach_m in 0.2f64..4.0,
            seed in 0u64..9,
        ) {
            let target = target(&to);
            let from = Cloud::new(from.iter().map(|&p| p.into()).collect());
            let source =
                Source::prepare(&from, &IcpConfig { voxel_m: 1e-3, ..IcpConfig::outdoor() })
                    .unwrap();
            let pose = Pose::new(
                Vector3::repeat(seed as f64 * 0.1),
                Vector3::new(0.0, 0.1, seed as f64 * 0.05),
            );
            let Source { points, normals, noise } = &source;
            let moving = Moving { points, normals, noise };
            for normals in [Normals::Target, Normals::Both(0.5), Normals::Mean(0.5)] {
                let placed =
                    Placed { target: &target, source: &moving, pose: &pose, reach_m, normals };
                let chunk = Chunk { placed: &placed, first: 0 };
                let pairs = |pair: fn(&Chunk, &mut [LastSearch], &mut Pairs)| {
                    let mut pairs = Pairs::default();
                    pair(&chunk, &mut vec![LastSearch::UNKNOWN; source.len()], &mut pairs);
                    pairs
                };
                let plain = |chunk: &Chunk, matches: &mut [LastSearch], pairs: &mut Pairs| {
                    chunk.pair_with(matches, pairs, Portable);
                };
                prop_assert!(pairs(plain) == pairs(pair));
            }
        }
    }
}
