//! The points nearest to any place, among points that do not change.

#[cfg(target_arch = "x86_64")]
use echoloop_dispatch::V3;
use echoloop_dispatch::dispatch;
use nalgebra::Point3;

use super::box_tree::{BoxTree, LaneKernel, Nearer, Portable, WIDE, order, ordered};

/// A k-d tree over points that do not change. The index of a point is its place in the input.
///
/// On a tie, the point with the lower index counts as nearer.
#[derive(Clone, Debug)]
pub struct KdTree {
    tree: BoxTree,
    /// Index in the input of each point of the tree.
    order: Vec<u32>,
    points: Vec<Point3<f32>>,
}

impl KdTree {
    /// Builds the tree. Points must be finite and fewer than 2³².
    pub fn new(points: &[Point3<f32>]) -> Self {
        let order = order(points);
        Self { tree: BoxTree::new(ordered(points, &order)), order, points: points.to_vec() }
    }

    /// The points, in the order of the input.
    pub fn points(&self) -> &[Point3<f32>] {
        &self.points
    }

    /// Count of the points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// True when there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Index of the nearest point strictly within `radius_m`.
    pub fn nearest(&self, query: &Point3<f32>, radius_m: f32) -> Option<u32> {
        let mut nearest = Nearest { order: &self.order, near: None, limit: squared(radius_m) };
        search_nearest(&self.tree, query, &mut nearest);
        nearest.near.map(|near| near.1)
    }

    /// The nearest points strictly within `radius_m`, at most `max`, nearest first: pairs of
    /// squared distance, m², and index. A point of the tree finds itself. `found` is emptied first.
    pub fn within(
        &self,
        query: &Point3<f32>,
        radius_m: f32,
        max: usize,
        found: &mut Vec<(f32, u32)>,
    ) {
        found.clear();
        if max > 0 {
            let limit = squared(radius_m);
            let mut nearest = NearestSome { order: &self.order, found, max, limit };
            search_some(&self.tree, query, &mut nearest);
        }
    }
}

/// The greatest squared distance strictly within a radius; negative for none.
fn squared(radius_m: f32) -> f32 {
    if radius_m > 0.0 { (radius_m * radius_m).next_down() } else { -1.0 }
}

/// The nearest point so far.
struct Nearest<'a> {
    order: &'a [u32],
    /// Squared distance and index.
    near: Option<(f32, u32)>,
    limit: f32,
}

impl Nearer for Nearest<'_> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn scan(&mut self, kernel: impl LaneKernel, leaf: usize, squared: &[f32; WIDE]) {
        for near in within(kernel, self.order, leaf, squared, self.limit) {
            if self.near.is_none_or(|best| near < best) {
                (self.near, self.limit) = (Some(near), near.0);
            }
        }
    }
}

/// The `max` nearest points so far, nearest first.
struct NearestSome<'a> {
    order: &'a [u32],
    found: &'a mut Vec<(f32, u32)>,
    max: usize,
    limit: f32,
}

impl Nearer for NearestSome<'_> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn scan(&mut self, kernel: impl LaneKernel, leaf: usize, squared: &[f32; WIDE]) {
        for near in within(kernel, self.order, leaf, squared, self.limit) {
            let place = self.found.partition_point(|other| *other < near);
            self.found.insert(place, near);
            self.found.truncate(self.max);
            if let Some(farthest) = self.found.get(self.max - 1) {
                self.limit = farthest.0;
            }
        }
    }
}

/// Squared distance and index of the points of a leaf that are within a limit.
#[inline(always)]
fn within(
    kernel: impl LaneKernel,
    order: &[u32],
    leaf: usize,
    squared: &[f32; WIDE],
    limit: f32,
) -> impl Iterator<Item = (f32, u32)> {
    let mut near = kernel.at_most(squared, limit);
    std::iter::from_fn(move || {
        let lane = (near != 0).then(|| near.trailing_zeros() as usize)?;
        near &= near - 1;
        // Lanes without a point are at infinity, which no limit reaches.
        Some((*squared.get(lane)?, *order.get(leaf * WIDE + lane)?))
    })
}

dispatch! {
    fn search_nearest(tree: &BoxTree, query: &Point3<f32>, found: &mut Nearest)
        = BoxTree::search, with: Portable, v3_with: V3::here();
    fn search_some(tree: &BoxTree, query: &Point3<f32>, found: &mut NearestSome)
        = BoxTree::search, with: Portable, v3_with: V3::here();
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::tests::scanned::nearest_first;

    fn points(raw: &[[f32; 3]]) -> Vec<Point3<f32>> {
        raw.iter().map(|&p| p.into()).collect()
    }

    /// Coordinates on a coarse lattice: many ties and duplicates.
    fn lattice() -> impl Strategy<Value = Vec<[f32; 3]>> {
        prop::collection::vec(
            prop::array::uniform3((-8i8..8).prop_map(|v| f32::from(v) * 0.5)),
            0..400,
        )
    }

    proptest! {
        #[test]
        fn neighbours_are_those_of_a_full_scan(
            raw in prop_oneof![
                lattice(), prop::collection::vec(prop::array::uniform3(-9.0f32..9.0), 0..400)
            ],
            query in prop::array::uniform3(-4i8..4),
            radius in 0.1f32..20.0,
            max in 0usize..40,
        ) {
            let tree = KdTree::new(&points(&raw));
            let query = query.map(|v| f32::from(v) + 0.125).into();
            let mut expected = nearest_first(tree.points(), &query, radius);
            prop_assert_eq!(tree.nearest(&query, radius), expected.first().map(|near| near.1));
            expected.truncate(max);
            let mut found = Vec::new();
            tree.within(&query, radius, max, &mut found);
            prop_assert_eq!(&found, &expected);
        }

        #[test]
        fn both_builds_find_the_same(raw in lattice(), max in 1usize..40) {
            let tree = KdTree::new(&points(&raw));
            let query = Point3::new(0.125, 0.0, -0.25);
            let (mut some, mut plain) = (Vec::new(), Vec::new());
            tree.within(&query, 3.0, max, &mut some);
            let limit = squared(3.0);
            let mut found = NearestSome { order: &tree.order, found: &mut plain, max, limit };
            tree.tree.search(&query, &mut found, Portable);
            prop_assert_eq!(&some, &plain);
            let mut found = Nearest { order: &tree.order, near: None, limit };
            tree.tree.search(&query, &mut found, Portable);
            prop_assert_eq!(tree.nearest(&query, 3.0), found.near.map(|near| near.1));
        }
    }

    #[test]
    fn the_radius_itself_is_outside() {
        let tree = KdTree::new(&points(&[[0.0; 3], [1.0, 0.0, 0.0]]));
        let mut found = Vec::new();
        tree.within(&Point3::origin(), 1.0, 10, &mut found);
        assert_eq!(found, [(0.0, 0)]);
    }

    #[test]
    fn thousands_of_equal_collinear_and_coplanar_points_are_no_trouble() {
        let shapes: [fn(usize) -> [f32; 3]; 4] = [
            |_| [1.0, 2.0, 3.0],
            |i| [i as f32 * 1e-3, 0.0, 0.0],
            |i| [(i % 100) as f32, (i / 100) as f32, 0.0],
            |i| [(i % 3) as f32, 0.0, 5.0],
        ];
        for shape in shapes {
            let raw: Vec<[f32; 3]> = (0..10_000).map(shape).collect();
            let tree = KdTree::new(&points(&raw));
            let mut found = Vec::new();
            tree.within(&raw[77].into(), 0.5, 30, &mut found);
            assert!(!found.is_empty() && found[0].0 == 0.0);
        }
    }

    #[test]
    fn all_neighbours_may_be_asked_for_and_take_no_more_room_than_there_are_points() {
        let tree = KdTree::new(&points(&[[0.0; 3], [1.0, 0.0, 0.0]]));
        let mut found = Vec::new();
        tree.within(&Point3::origin(), 2.0, usize::MAX, &mut found);
        assert_eq!(found, [(0.0, 0), (1.0, 1)]);
    }

    #[test]
    fn no_points_have_no_neighbours() {
        let tree = KdTree::new(&[]);
        let mut found = vec![(1.0, 7)];
        tree.within(&Point3::origin(), 1.0, 3, &mut found);
        assert_eq!(found, []);
        assert_eq!(tree.nearest(&Point3::origin(), 1.0), None);
    }
}
