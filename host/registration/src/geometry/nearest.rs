//! The nearest neighbours of every point of a tree.

#[cfg(target_arch = "x86_64")]
use echoloop_dispatch::V3;
use echoloop_dispatch::dispatch;
use nalgebra::Point3;

use super::box_tree::{BoxTree, Corners, LaneKernel, Portable, WIDE, box_around};

/// First reach of a search, in halves of the diagonal of the box around the queries. On a surface
/// that holds some twenty points if they are those of a leaf.
const FIRST_REACH: f32 = 1.5;

/// Factor by which a search that found too few is widened.
const GROWTH: f32 = 1.5;

/// Least first reach, over the radius: if all neighbours are at distance 0, those of the next
/// leaf may not be.
const LEAST_REACH: f32 = 1e-3;

/// First reach of the next queries, over the mean distance of the farthest neighbours of the last.
const ROOM: f32 = 1.15;

/// The nearest `max` points strictly within a radius of each query, of equally near ones those of
/// lower index; eight queries at a time.
///
/// Queries that lie together, as the eight points of a leaf, have much the same neighbours: the
/// tree is walked once for all of them, to the reach that those before needed, and farther for
/// those that found too few.
/// Neither the neighbours nor their order, the tree's, depend on that reach.
pub(super) struct Nearest<'a> {
    tree: &'a BoxTree,
    radius_m: f32,
    max: usize,
    /// First reach of the next queries, m.
    reach_m: Option<f32>,
    leaves: Vec<u32>,
    spare: Vec<u32>,
    near: Near,
    rows: Rows,
}

impl<'a> Nearest<'a> {
    pub(super) fn new(tree: &'a BoxTree, radius_m: f64, max: usize) -> Self {
        let (leaves, spare) = (Vec::new(), Vec::new());
        let (near, rows) = (Near::default(), Rows::default());
        // A radius of NaN becomes 0, which holds no point.
        let radius_m = (radius_m as f32).max(0.0);
        Self { tree, radius_m, max, reach_m: None, leaves, spare, near, rows }
    }

    /// The neighbours of each query, in the tree's order; of the first eight.
    pub(super) fn of(&mut self, queries: &[Point3<f32>]) -> impl Iterator<Item = &[u32]> {
        search(self, queries);
        let Rows { indices, ranges, queries, .. } = &self.rows;
        ranges[..*queries].iter().map(|&(from, to)| &indices[from..to])
    }

    #[inline(always)]
    fn search(&mut self, queries: &[Point3<f32>], kernel: impl LaneKernel) {
        let queries = &queries[..queries.len().min(WIDE)];
        self.rows.clear(queries.len());
        let around = box_around(queries);
        let first_m = self.reach_m.unwrap_or_else(|| first_reach_m(&around));
        let mut reach_m = first_m.max(LEAST_REACH * self.radius_m);
        loop {
            let last = reach_m >= self.radius_m;
            reach_m = reach_m.min(self.radius_m);
            // Neighbours lie strictly within the radius.
            let limit = if last { (reach_m * reach_m).next_down() } else { reach_m * reach_m };
            self.tree.leaves_near(kernel, &around, limit, &mut self.leaves, &mut self.spare);
            for (lane, query) in queries.iter().enumerate() {
                if self.rows.has(lane) {
                    continue;
                }
                self.near.scan(self.tree, &self.leaves, &[query.x, query.y, query.z], limit);
                if last || self.near.count >= self.max {
                    let farthest = self.near.keep_nearest(self.max, limit);
                    self.rows.set(lane, self.near.kept(), farthest.sqrt());
                }
            }
            if self.rows.done() {
                break;
            }
            reach_m *= GROWTH;
        }
        self.reach_m = Some(ROOM * self.rows.farthest_m / queries.len().max(1) as f32);
    }
}

fn first_reach_m((low, high): &Corners) -> f32 {
    let diagonal = (0..3).map(|axis| (high[axis] - low[axis]).powi(2)).sum::<f32>().sqrt();
    FIRST_REACH * diagonal / 2.0
}

/// The points near a query.
#[derive(Default)]
struct Near {
    /// Squared distances of all points of the leaves, m².
    all_m2: Vec<[f32; WIDE]>,
    indices: Vec<u32>,
    squared_m2: Vec<f32>,
    count: usize,
    order: Vec<u32>,
}

impl Near {
    /// Collects the points of some leaves within a squared distance, in their order.
    #[inline(always)]
    fn scan(&mut self, tree: &BoxTree, leaves: &[u32], query: &[f32; 3], limit: f32) {
        // One more is written but not kept.
        let room = leaves.len() * WIDE + 1;
        if self.indices.len() < room {
            self.indices.resize(room, 0);
            self.squared_m2.resize(room, 0.0);
        }
        // All distances first: eight at a time, which a loop that keeps some of them hinders.
        self.all_m2.clear();
        self.all_m2.extend(leaves.iter().map(|leaf| tree.squared_to_leaf(*leaf as usize, query)));
        let (indices, squares) = (&mut self.indices[..room], &mut self.squared_m2[..room]);
        let mut count = 0;
        for (&leaf, squared) in leaves.iter().zip(&self.all_m2) {
            for (lane, &d) in (0..).zip(squared) {
                // Written in any case, kept only when near: no branch to guess.
                indices[count] = leaf * WIDE as u32 + lane;
                squares[count] = d;
                count += usize::from(d <= limit);
            }
        }
        self.count = count;
    }

    /// Keeps the nearest `max`; returns the squared distance of the farthest of them, or the limit
    /// if there are fewer.
    #[inline(always)]
    fn keep_nearest(&mut self, max: usize, limit: f32) -> f32 {
        let Some(last) = max.checked_sub(1).filter(|last| *last < self.count) else {
            self.count = self.count.min(max);
            return limit;
        };
        // The bits of numbers from 0 on are ordered as they are.
        self.order.clear();
        self.order.extend(self.squared_m2[..self.count].iter().map(|d| d.to_bits()));
        let (nearer, &mut farthest, _) = self.order.select_nth_unstable(last);
        let farthest = f32::from_bits(farthest);
        let nearer = nearer.iter().filter(|d| f32::from_bits(**d) < farthest).count();
        let mut ties = max - nearer;
        let mut kept = 0;
        for i in 0..self.count {
            let d = self.squared_m2[i];
            let tie = d == farthest && ties > 0;
            ties -= usize::from(tie);
            self.indices[kept] = self.indices[i];
            kept += usize::from(d < farthest || tie);
        }
        self.count = kept;
        farthest
    }

    fn kept(&self) -> &[u32] {
        &self.indices[..self.count]
    }
}

/// Neighbours of at most eight queries.
#[derive(Default)]
struct Rows {
    indices: Vec<u32>,
    ranges: [(usize, usize); WIDE],
    queries: usize,
    missing: u32,
    /// Sum of the distances of their farthest neighbours, m.
    farthest_m: f32,
}

impl Rows {
    fn clear(&mut self, queries: usize) {
        self.indices.clear();
        (self.queries, self.farthest_m) = (queries, 0.0);
        self.missing = (1 << queries) - 1;
    }

    fn has(&self, lane: usize) -> bool {
        self.missing >> lane & 1 == 0
    }

    fn done(&self) -> bool {
        self.missing == 0
    }

    fn set(&mut self, lane: usize, found: &[u32], farthest_m: f32) {
        let from = self.indices.len();
        self.indices.extend_from_slice(found);
        self.ranges[lane] = (from, self.indices.len());
        self.missing &= !(1 << lane);
        self.farthest_m += farthest_m;
    }
}

dispatch! {
    /// Finds the neighbours of some queries.
    fn search(nearest: &mut Nearest, queries: &[Point3<f32>])
        = Nearest::search, with: Portable, v3_with: V3::here();
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::super::tests::scanned::{nearest_first, tree};
    use super::*;

    /// Coordinates on a coarse lattice (many ties and duplicates), anywhere, on a line, and a few
    /// far from the rest.
    fn points() -> impl Strategy<Value = Vec<[f32; 3]>> {
        let lattice = prop::array::uniform3((-8i8..8).prop_map(|v| f32::from(v) * 0.5));
        let near = prop::array::uniform3(-1.0f32..1.0);
        let far = prop::array::uniform3(-900.0f32..900.0);
        prop_oneof![
            prop::collection::vec(lattice, 0..300),
            prop::collection::vec(near.clone(), 0..300),
            prop::collection::vec((-900.0f32..900.0).prop_map(|x| [x, 1.0, -2.0]), 0..300),
            prop::collection::vec(prop_oneof![9 => near, 1 => far], 0..300),
        ]
    }

    fn found(tree: &BoxTree, radius_m: f64, max: usize) -> Vec<Vec<u32>> {
        let mut nearest = Nearest::new(tree, radius_m, max);
        let leaves = tree.points().chunks(WIDE);
        leaves.flat_map(|leaf| nearest.of(leaf).map(<[u32]>::to_vec).collect::<Vec<_>>()).collect()
    }

    /// The neighbours by a full scan.
    fn scanned(tree: &BoxTree, query: &Point3<f32>, radius_m: f32, max: usize) -> Vec<u32> {
        let all = nearest_first(tree.points(), query, radius_m);
        let mut indices: Vec<u32> = all.iter().take(max).map(|near| near.1).collect();
        indices.sort_unstable();
        indices
    }

    proptest! {
        #[test]
        fn the_nearest_are_a_full_scan_s_in_the_order_of_the_tree(
            raw in points(),
            radius in 0.1f32..30.0,
            max in 0usize..60,
        ) {
            let tree = tree(&raw);
            let found = found(&tree, f64::from(radius), max);
            prop_assert_eq!(found.len(), raw.len());
            for (query, found) in tree.points().iter().zip(found) {
                prop_assert_eq!(found, scanned(&tree, query, radius, max));
            }
        }

        #[test]
        fn both_builds_find_the_same(raw in points(), radius in 0.1f32..30.0, max in 1usize..60) {
            let tree = tree(&raw);
            let mut nearest = Nearest::new(&tree, f64::from(radius), max);
            let mut plain = Nearest::new(&tree, f64::from(radius), max);
            for leaf in tree.points().chunks(WIDE) {
                search(&mut nearest, leaf);
                plain.search(leaf, Portable);
                prop_assert_eq!(&nearest.rows.indices, &plain.rows.indices);
                prop_assert_eq!(nearest.rows.ranges, plain.rows.ranges);
            }
        }
    }

    #[test]
    fn equal_points_among_others_are_no_trouble() {
        let raw: Vec<[f32; 3]> = (0..400)
            .map(|i| if i < 200 { [1.0, 2.0, 3.0] } else { [1.0 + i as f32 * 0.1, 2.0, 3.0] })
            .collect();
        let tree = tree(&raw);
        for (query, found) in tree.points().iter().zip(found(&tree, 90.0, 20)) {
            assert_eq!(found, scanned(&tree, query, 90.0, 20));
        }
    }

    #[test]
    fn within_no_radius_lies_nothing() {
        let tree = tree(&[[1.0; 3], [2.0; 3]]);
        for radius_m in [0.0, -1.0, f64::NAN] {
            assert_eq!(found(&tree, radius_m, 5), [[0; 0]; 2], "{radius_m}");
        }
    }

    #[test]
    fn without_queries_nothing_is_found_and_only_eight_are_asked() {
        let tree = tree(&[[1.0; 3]]);
        let mut nearest = Nearest::new(&tree, 1.0, 5);
        for (queries, found) in [(0, 0), (3, 3), (9, 8)] {
            assert_eq!(nearest.of(&vec![Point3::from([1.5; 3]); queries]).count(), found);
        }
    }
}
