//! Neighbours in space.
//!
//! A k-d tree of our own, and not `kiddo` (which the tests compare it with): registration asks for *the nearest within
//! a radius, and how far the next one is*, which lets it skip most searches, and wants no allocation per query.

use nalgebra::Point3;

/// Points in a leaf: scanned whole, so that the compiler can use wide instructions.
const LEAF: usize = 16;

/// A balanced k-d tree over points. Indices are places in tree order, which keeps neighbours near in memory.
#[derive(Clone, Debug, Default)]
pub struct KdTree {
    /// Coordinates in tree order, an array an axis.
    axes: [Vec<f32>; 3],
    /// Place in the input of each point in tree order.
    ids: Vec<u32>,
    /// Inner nodes in preorder: the left child follows its parent.
    nodes: Vec<Node>,
}

/// Splits a range of points at its middle. Between the halves lies a gap, which bounds the search better than a plane.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    axis: u32,
    right: u32,
    left_max: f32,
    right_min: f32,
}

/// The nearest point, and a bound on all others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The nearest point, in tree order; absent when there is none within the radius.
    pub index: Option<u32>,
    /// Its squared distance, or the squared radius, m².
    pub squared_m2: f32,
    /// No other point is nearer than this: the squared distance of the second, or the squared radius, m².
    pub others_squared_m2: f32,
}

/// What a walk through the tree collects.
trait Collect {
    /// Points farther than this squared distance are of no interest.
    fn bound(&self) -> f32;
    /// Called for points within the bound.
    fn offer(&mut self, squared: f32, index: u32);
}

impl KdTree {
    /// Builds the tree. Points must be finite and fewer than 2³².
    pub fn new(points: &[Point3<f32>]) -> Self {
        let mut items: Vec<([f32; 3], u32)> = points.iter().zip(0..).map(|(p, id)| (p.coords.into(), id)).collect();
        let mut nodes = Vec::new();
        build(&mut items, &mut nodes);
        let axes = [0, 1, 2].map(|axis| items.iter().map(|(p, _)| p[axis]).collect());
        Self { axes, ids: items.iter().map(|(_, id)| *id).collect(), nodes }
    }

    /// How many points there are.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// A point, by its place in tree order.
    pub fn point(&self, index: usize) -> Point3<f32> {
        Point3::new(self.axes[0][index], self.axes[1][index], self.axes[2][index])
    }

    /// The place in the input of each point in tree order.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// The nearest point strictly within `radius_m`, and how near any other can be.
    pub fn nearest(&self, query: &Point3<f32>, radius_m: f32) -> Nearest {
        self.nearest_beside(query, radius_m, f32::INFINITY, None)
    }

    /// As [`KdTree::nearest`], but of the others it only tells that they are at least `slack_m` farther: with little
    /// slack it looks at fewer points. A `hint`, a place in tree order, spares more the nearer it is.
    pub fn nearest_beside(&self, query: &Point3<f32>, radius_m: f32, slack_m: f32, hint: Option<u32>) -> Nearest {
        let squared = radius_m * radius_m;
        let nearest = Nearest { index: None, squared_m2: squared, others_squared_m2: squared };
        let mut beside = Beside { nearest, slack_m };
        if let Some(index) = hint {
            let squared = squared_norm((self.point(index as usize) - query).into());
            beside.offer(squared, index);
        }
        self.walk(query, &mut beside);
        beside.nearest
    }

    /// The nearest points strictly within `radius_m`, `max` at most, in no order: pairs of squared distance and place
    /// in tree order. Of equally far points the one with the lower place counts as nearer. A point of the tree finds
    /// itself. `found` is emptied first.
    pub fn within(&self, query: &Point3<f32>, radius_m: f32, max: usize, found: &mut Vec<(f32, u32)>) {
        found.clear();
        if max > 0 && radius_m > 0.0 {
            let mut best = Best { found, max, bound: (radius_m * radius_m).next_down() };
            self.walk(query, &mut best);
            best.cut();
        }
    }

    fn walk(&self, query: &Point3<f32>, collect: &mut impl Collect) {
        self.visit(&query.coords.into(), collect, 0, 0..self.len(), [0.0; 3]);
    }

    /// `gap` is how far the range's box is from the query, an axis each.
    fn visit<C: Collect>(
        &self,
        query: &[f32; 3],
        collect: &mut C,
        node: usize,
        range: std::ops::Range<usize>,
        gap: [f32; 3],
    ) {
        if range.len() <= LEAF {
            return self.scan(query, collect, range);
        }
        let Node { axis, right, left_max, right_min } = self.nodes[node];
        let axis = axis as usize;
        let middle = range.start + range.len() / 2;
        let (mut left_gap, mut right_gap) = (gap, gap);
        left_gap[axis] = gap[axis].max(query[axis] - left_max);
        right_gap[axis] = gap[axis].max(right_min - query[axis]);
        let left = (node + 1, range.start..middle, left_gap);
        let right = (right as usize, middle..range.end, right_gap);
        let (near, far) = if left_gap[axis] <= right_gap[axis] { (left, right) } else { (right, left) };
        for (node, range, gap) in [near, far] {
            if squared_norm(gap) <= collect.bound() {
                self.visit(query, collect, node, range, gap);
            }
        }
    }

    fn scan<C: Collect>(&self, query: &[f32; 3], collect: &mut C, range: std::ops::Range<usize>) {
        let mut squared = [0.0; LEAF];
        let [x, y, z] = [0, 1, 2].map(|axis| &self.axes[axis][range.clone()]);
        for (((squared, x), y), z) in squared.iter_mut().zip(x).zip(y).zip(z) {
            *squared = squared_norm([x - query[0], y - query[1], z - query[2]]);
        }
        for (index, &squared) in range.zip(&squared) {
            if squared <= collect.bound() {
                collect.offer(squared, index as u32);
            }
        }
    }
}

/// In this order everywhere: then rounding cannot prune a point that a scan would find.
fn squared_norm([x, y, z]: [f32; 3]) -> f32 {
    x * x + y * y + z * z
}

fn build(items: &mut [([f32; 3], u32)], nodes: &mut Vec<Node>) {
    if items.len() <= LEAF {
        return;
    }
    let axis = widest_axis(items);
    let middle = items.len() / 2;
    let (left, pivot, _) =
        items.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let left_max = left.iter().map(|(p, _)| p[axis]).fold(f32::NEG_INFINITY, f32::max);
    let node = nodes.len();
    nodes.push(Node { axis: axis as u32, right: 0, left_max, right_min: pivot.0[axis] });
    let (left, right) = items.split_at_mut(middle);
    build(left, nodes);
    nodes[node].right = nodes.len() as u32;
    build(right, nodes);
}

fn widest_axis(items: &[([f32; 3], u32)]) -> usize {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (point, _) in items {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let width = |axis: &usize| high[*axis] - low[*axis];
    (0..3).max_by(|a, b| width(a).total_cmp(&width(b))).unwrap_or(0)
}

/// The nearest, and others up to a slack beyond it.
struct Beside {
    nearest: Nearest,
    slack_m: f32,
}

impl Collect for Beside {
    fn bound(&self) -> f32 {
        self.nearest.others_squared_m2
    }

    fn offer(&mut self, squared: f32, index: u32) {
        let nearest = &mut self.nearest;
        if nearest.index == Some(index) {
            return; // the hint, met on the way
        }
        if squared < nearest.squared_m2 {
            let reach_m = squared.sqrt() + self.slack_m;
            nearest.others_squared_m2 = nearest.squared_m2.min(reach_m * reach_m);
            nearest.squared_m2 = squared;
            nearest.index = Some(index);
        } else {
            nearest.others_squared_m2 = nearest.others_squared_m2.min(squared);
        }
    }
}

/// Keeps up to `4 · max` candidates before it cuts them to the best `max`: constant work a candidate.
struct Best<'a> {
    found: &'a mut Vec<(f32, u32)>,
    max: usize,
    bound: f32,
}

impl Best<'_> {
    fn cut(&mut self) {
        if self.found.len() > self.max {
            let order = |a: &(f32, u32), b: &(f32, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
            let (_, last, _) = self.found.select_nth_unstable_by(self.max - 1, order);
            self.bound = last.0;
            self.found.truncate(self.max);
        }
    }
}

impl Collect for Best<'_> {
    fn bound(&self) -> f32 {
        self.bound
    }

    fn offer(&mut self, squared: f32, index: u32) {
        self.found.push((squared, index));
        if self.found.len() >= self.max.saturating_mul(4) {
            self.cut();
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use kiddo::{SquaredEuclidean, immutable::float::kdtree::ImmutableKdTree};
    use proptest::prelude::*;

    use super::*;

    fn points(raw: &[[f32; 3]]) -> Vec<Point3<f32>> {
        raw.iter().map(|&p| p.into()).collect()
    }

    /// Coordinates on a coarse lattice: many ties and duplicates.
    fn lattice() -> impl Strategy<Value = Vec<[f32; 3]>> {
        prop::collection::vec(prop::array::uniform3((-8i8..8).prop_map(|v| f32::from(v) * 0.5)), 0..400)
    }

    fn brute(tree: &KdTree, query: &Point3<f32>, radius: f32) -> Vec<(f32, u32)> {
        let squared = |i: u32| squared_norm((tree.point(i as usize) - query).into());
        let mut all: Vec<_> =
            (0..tree.len() as u32).map(|i| (squared(i), i)).filter(|p| p.0 < radius * radius).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        all
    }

    proptest! {
        #[test]
        fn the_nearest_and_the_bound_equal_a_full_scan(
            raw in prop_oneof![lattice(), prop::collection::vec(prop::array::uniform3(-9.0f32..9.0), 0..400)],
            query in prop::array::uniform3(-10.0f32..10.0), radius in 0.1f32..20.0,
        ) {
            let tree = KdTree::new(&points(&raw));
            let all = brute(&tree, &query.into(), radius);
            let found = tree.nearest(&query.into(), radius);
            prop_assert_eq!(found.index.is_some(), !all.is_empty());
            prop_assert_eq!(found.squared_m2, all.first().map_or(radius * radius, |p| p.0));
            prop_assert_eq!(found.others_squared_m2, all.get(1).map_or(radius * radius, |p| p.0));
        }

        #[test]
        fn slack_and_hint_change_only_what_is_known_of_the_others(
            raw in prop::collection::vec(prop::array::uniform3(-9.0f32..9.0), 1..400),
            query in prop::array::uniform3(-10.0f32..10.0), radius in 0.1f32..20.0, slack in 0.0f32..3.0, hint in 0u32..400,
        ) {
            let tree = KdTree::new(&points(&raw));
            let (full, hint) = (tree.nearest(&query.into(), radius), hint % raw.len() as u32);
            let beside = tree.nearest_beside(&query.into(), radius, slack, Some(hint));
            prop_assert_eq!((beside.index, beside.squared_m2), (full.index, full.squared_m2));
            let reach = full.squared_m2.sqrt() + slack;
            let expected = if full.index.is_some() { full.others_squared_m2.min(reach * reach) } else { radius * radius };
            prop_assert_eq!(beside.others_squared_m2, expected);
        }

        #[test]
        fn the_neighbours_within_equal_a_full_scan(
            raw in prop_oneof![lattice(), prop::collection::vec(prop::array::uniform3(-9.0f32..9.0), 0..400)],
            query in prop::array::uniform3(-4i8..4), radius in 0.1f32..20.0, max in 1usize..40,
        ) {
            let tree = KdTree::new(&points(&raw));
            let query = query.map(f32::from).into();
            let mut expected = brute(&tree, &query, radius);
            expected.truncate(max);
            let mut found = Vec::new();
            tree.within(&query, radius, max, &mut found);
            found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            prop_assert_eq!(found, expected);
        }

        #[test]
        fn the_nearest_is_as_near_as_kiddos(
            raw in prop::collection::vec(prop::array::uniform3(-50.0f32..50.0), 1..2000),
            query in prop::array::uniform3(-60.0f32..60.0),
        ) {
            let theirs = ImmutableKdTree::<f32, u32, 3, 32>::new_from_slice(&raw).nearest_one::<SquaredEuclidean>(&query);
            let ours = KdTree::new(&points(&raw)).nearest(&query.into(), f32::MAX.sqrt());
            prop_assert!((ours.squared_m2 - theirs.distance).abs() <= 1e-5 * theirs.distance);
        }
    }

    #[test]
    fn the_radius_itself_is_outside() {
        let tree = KdTree::new(&points(&[[0.0; 3], [1.0, 0.0, 0.0]]));
        let mut found = Vec::new();
        tree.within(&Point3::origin(), 1.0, 9, &mut found);
        assert_eq!(found, [(0.0, 0)]);
        assert_eq!(tree.nearest(&Point3::new(2.0, 0.0, 0.0), 1.0).index, None);
    }

    #[test]
    fn ids_lead_back_to_the_input() {
        let raw: Vec<[f32; 3]> = (0..100).map(|i| [(i * 37 % 100) as f32, 0.0, 0.0]).collect();
        let tree = KdTree::new(&points(&raw));
        for (place, &id) in tree.ids().iter().enumerate() {
            assert_eq!(tree.point(place), Point3::from(raw[id as usize]));
        }
    }

    #[test]
    fn a_query_that_is_not_a_number_finds_nothing() {
        let tree = KdTree::new(&points(&[[1.0; 3]; 50]));
        assert_eq!(tree.nearest(&Point3::new(f32::NAN, 0.0, 0.0), 10.0).index, None);
    }
}
