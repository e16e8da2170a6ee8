//! A tree of boxes, searched eight boxes at a time.

mod kernel;

#[cfg(target_arch = "x86_64")]
use echoloop_dispatch::V3;
use echoloop_dispatch::dispatch;
use nalgebra::Point3;

pub(super) use self::kernel::WIDE;
pub(crate) use self::kernel::{LaneKernel, Portable};

/// Most levels, the leaves included: 8¹¹ points are more than 2³².
const MOST_LEVELS: usize = 11;

/// Points of half a leaf, which lie together.
pub(super) const HALF: usize = WIDE / 2;

/// Halves longer than this are arranged on two threads.
const PARALLEL: usize = 8192;

/// A tree over points that do not change: boxes around eight points, boxes around eight boxes.
///
/// A complete tree: each leaf but the last holds eight points, each node but the last of its level
/// eight children, so that indices follow from counting and there are no pointers. Points are split
/// at the median of the widest side of their box, again and again, so that neighbours in space are
/// near in memory. The point of index `i` is `points()[i]`: the order is the tree's, not the
/// input's.
#[derive(Clone, Debug)]
pub(crate) struct BoxTree {
    points: Vec<Point3<f32>>,
    leaves: Vec<PointLanes>,
    /// Levels of nodes, from the one above the leaves to the root alone.
    levels: Vec<Vec<Boxes>>,
}

/// Eight points, one a lane; lanes without a point are at infinity.
#[derive(Clone, Copy, Debug)]
struct PointLanes([[f32; WIDE]; 3]);

/// Eight boxes, one a lane; lanes without a box are empty ones at infinity.
#[derive(Clone, Copy, Debug)]
struct Boxes {
    low: PointLanes,
    high: PointLanes,
}

/// The nearest point, and a bound on all others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    /// The nearest point strictly within the radius, of equally near ones the first; None when
    /// there is none.
    pub(crate) index: Option<u32>,
    /// Squared distance, m², below which there is no other point.
    pub(crate) others_squared_m2: f32,
}

/// The order in which a tree holds `points`: a walk through space that stays near itself. Points
/// must be finite.
pub(crate) fn order(points: &[Point3<f32>]) -> Vec<u32> {
    let mut places: Vec<Place> =
        (0..).zip(points).map(|(index, p)| ([p.x, p.y, p.z], index)).collect();
    arrange(&mut places, WIDE.pow(MOST_LEVELS as u32 - 1));
    places.iter().map(|place| place.1).collect()
}

/// The values of points, rearranged to an order of the points.
pub(crate) fn ordered<T: Copy>(values: &[T], order: &[u32]) -> Vec<T> {
    order.iter().map(|&index| values[index as usize]).collect()
}

/// Coordinates of a point, and its index in the input.
type Place = ([f32; 3], u32);

/// Orders points so that those of each node are adjacent, and those of each half of a leaf: all
/// nodes but the last hold `capacity`.
fn arrange(places: &mut [Place], mut capacity: usize) {
    if places.len() <= HALF {
        return;
    }
    // From here on the points of a child of the topmost node.
    while capacity >= places.len() {
        capacity /= WIDE;
    }
    let capacity = capacity.max(HALF);
    // Cut at a whole child, so that every node but the last is full.
    let middle = places.len().div_ceil(capacity) / 2 * capacity;
    let axis = widest(places);
    places
        .select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let (first, last) = places.split_at_mut(middle);
    if first.len() > PARALLEL {
        rayon::join(|| arrange(first, capacity), || arrange(last, capacity));
    } else {
        arrange(first, capacity);
        arrange(last, capacity);
    }
}

/// The axis along which the points extend farthest.
fn widest(places: &[Place]) -> usize {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (at, _) in places {
        for axis in 0..3 {
            low[axis] = low[axis].min(at[axis]);
            high[axis] = high[axis].max(at[axis]);
        }
    }
    let side = |axis: usize| high[axis] - low[axis];
    (1..3).fold(0, |best, axis| if side(axis) > side(best) { axis } else { best })
}

impl BoxTree {
    /// Builds the tree over points in the order of [`order`].
    pub(crate) fn new(points: Vec<Point3<f32>>) -> Self {
        let leaves: Vec<PointLanes> = points.chunks(WIDE).map(PointLanes::new).collect();
        let around: Vec<_> = points.chunks(WIDE).map(box_around).collect();
        let mut levels: Vec<Vec<Boxes>> = Vec::new();
        let mut inner = around;
        while inner.len() > 1 || levels.is_empty() && !inner.is_empty() {
            let nodes: Vec<Boxes> = inner.chunks(WIDE).map(Boxes::new).collect();
            inner = nodes.iter().map(Boxes::around).collect();
            levels.push(nodes);
        }
        Self { points, leaves, levels }
    }

    /// The points, in the tree's order.
    pub(crate) fn points(&self) -> &[Point3<f32>] {
        &self.points
    }

    /// Finds the nearest point strictly within `radius_m`, and a bound that no other point is
    /// nearer than: the least of the second's distance, `radius_m`, and the nearest's distance plus
    /// `slack_m`. The search goes no farther.
    ///
    /// Distances are those of `f32`, `dx² + dy² + dz²` from the left: the same as a full scan's,
    /// bit for bit, since rounding keeps the order of a box's side and the points behind it.
    #[inline(always)]
    pub(crate) fn nearest(
        &self,
        kernel: impl LaneKernel,
        query: &Point3<f32>,
        radius_m: f32,
        slack_m: f32,
    ) -> Found {
        let mut best = Best::within(radius_m, slack_m);
        self.search(query, &mut best, kernel);
        best.found()
    }

    #[inline(always)]
    fn nearest_within(
        &self,
        query: &Point3<f32>,
        radius_m: f32,
        kernel: impl LaneKernel,
    ) -> Option<u32> {
        self.nearest(kernel, query, radius_m, 0.0).index
    }

    /// Visits the leaves within the limit of `found`, the nearest first, and passes it their
    /// points.
    #[inline(always)]
    pub(super) fn search(
        &self,
        query: &Point3<f32>,
        found: &mut impl Nearer,
        kernel: impl LaneKernel,
    ) {
        let query = [query.x, query.y, query.z];
        let root = self.levels.last().and_then(|level| level.first());
        // Every comparison with NaN is false, so a query of NaN would find everything.
        let Some(root) = root.filter(|_| query.iter().all(|v| v.is_finite())) else { return };
        let top = self.levels.len() - 1;
        let mut path = [Node::NONE; MOST_LEVELS];
        path[top] = Node::open(0, root, &query);
        let mut level = top;
        while let Some(node) = path.get_mut(level).filter(|_| level <= top) {
            let Some(lane) = node.next(kernel, found.limit()) else {
                level += 1;
                continue;
            };
            let child = node.index * WIDE + lane;
            if level == 0 {
                if let Some(leaf) = self.leaves.get(child) {
                    found.scan(kernel, child, &leaf.squared_to(&query));
                }
            } else if let Some(boxes) = self.levels[level - 1].get(child) {
                level -= 1;
                path[level] = Node::open(child, boxes, &query);
            }
        }
    }

    /// The points, in the order of the tree.
    pub(crate) fn into_points(self) -> Vec<Point3<f32>> {
        self.points
    }

    /// Squared distances to the points of a leaf, m²; infinity in lanes without a point.
    #[inline(always)]
    pub(super) fn squared_to_leaf(&self, leaf: usize, query: &[f32; 3]) -> [f32; WIDE] {
        self.leaves.get(leaf).unwrap_or(&PointLanes::FAR).squared_to(query)
    }

    /// Finds the leaves whose boxes are within a squared distance of a box, in their order. `spare`
    /// is scratch memory.
    ///
    /// Rounding keeps the order of two boxes' gap and the distances of the points in them: no point
    /// is missed.
    #[inline(always)]
    pub(super) fn leaves_near(
        &self,
        kernel: impl LaneKernel,
        around: &Corners,
        limit: f32,
        leaves: &mut Vec<u32>,
        spare: &mut Vec<u32>,
    ) {
        leaves.clear();
        leaves.push(0);
        for level in self.levels.iter().rev() {
            std::mem::swap(leaves, spare);
            leaves.clear();
            for &index in spare.iter() {
                let Some(boxes) = level.get(index as usize) else { continue };
                let mut near = kernel.at_most(&boxes.squared_to_box(around), limit);
                while near != 0 {
                    leaves.push(index * WIDE as u32 + near.trailing_zeros());
                    near &= near - 1;
                }
            }
        }
    }
}

/// Collector of the points nearest to a query: a search passes it one leaf after the other.
pub(super) trait Nearer {
    /// Points beyond this squared distance, m², are not needed any more.
    fn limit(&self) -> f32;

    /// Takes the points of a leaf, which come as their squared distances, m².
    fn scan(&mut self, kernel: impl LaneKernel, leaf: usize, squared: &[f32; WIDE]);
}

/// A node on the way from the root, and its children that are still to be visited.
#[derive(Clone, Copy)]
struct Node {
    index: usize,
    /// The children's squared distances as bits, which order numbers above 0 as the numbers do; the
    /// last three bits give way to the lane. That rounds down: no child is taken for farther than
    /// it is. [`Node::SEEN`] for a child that has been visited.
    children: [u32; WIDE],
}

/// The bits that number the lanes.
const LANE: u32 = WIDE as u32 - 1;

impl Node {
    /// Not a number, so beyond every limit.
    const SEEN: u32 = u32::MAX;
    const NONE: Self = Self { index: 0, children: [Self::SEEN; WIDE] };

    #[inline(always)]
    fn open(index: usize, boxes: &Boxes, query: &[f32; 3]) -> Self {
        let squared = boxes.squared_to(query);
        Self {
            index,
            children: std::array::from_fn(|lane| squared[lane].to_bits() & !LANE | lane as u32),
        }
    }

    /// The nearest child within the limit that has not been visited, without a branch that depends
    /// on which.
    #[inline(always)]
    fn next(&mut self, kernel: impl LaneKernel, limit: f32) -> Option<usize> {
        let least = kernel.take_least(&mut self.children);
        (f32::from_bits(least & !LANE) <= limit && least != Self::SEEN)
            .then_some((least & LANE) as usize)
    }
}

dispatch! {
    /// Index of the nearest point strictly within `radius_m`.
    pub(crate) fn nearest(tree: &BoxTree, query: &Point3<f32>, radius_m: f32) -> Option<u32>
        = BoxTree::nearest_within, with: Portable, v3_with: V3::here();
}

/// The nearest point so far.
struct Best {
    index: Option<u32>,
    squared: f32,
    /// Points beyond this squared distance, m², change nothing any more.
    limit: f32,
    slack_m: f32,
}

impl Best {
    #[inline(always)]
    fn within(radius_m: f32, slack_m: f32) -> Self {
        let squared = radius_m * radius_m;
        Self { index: None, squared, limit: squared, slack_m }
    }

    #[inline(always)]
    fn take(&mut self, index: u32, squared: f32) {
        let nearer = squared < self.squared
            || squared == self.squared && self.index.is_some_and(|best| index < best);
        let others = if nearer { self.squared } else { squared };
        if nearer {
            (self.index, self.squared) = (Some(index), squared);
        }
        self.limit = smaller(self.limit, others);
    }

    fn found(&self) -> Found {
        Found { index: self.index, others_squared_m2: self.limit }
    }
}

impl Nearer for Best {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn scan(&mut self, kernel: impl LaneKernel, leaf: usize, squared: &[f32; WIDE]) {
        let mut near = kernel.at_most(squared, self.limit);
        let before = self.squared;
        while near != 0 {
            let lane = near.trailing_zeros() as usize % WIDE;
            near &= near - 1;
            self.take((leaf * WIDE + lane) as u32, squared[lane]);
        }
        if self.squared < before {
            let reach = self.squared.sqrt() + self.slack_m;
            self.limit = smaller(self.limit, reach * reach);
        }
    }
}

impl PointLanes {
    const FAR: Self = Self([[f32::INFINITY; WIDE]; 3]);

    /// At most eight points.
    fn new(points: &[Point3<f32>]) -> Self {
        let mut lanes = Self::FAR;
        for (lane, point) in points.iter().enumerate().take(WIDE) {
            lanes.set(lane, (*point).into());
        }
        lanes
    }

    fn set(&mut self, lane: usize, at: [f32; 3]) {
        for (axis, at) in self.0.iter_mut().zip(at) {
            axis[lane] = at;
        }
    }

    #[inline(always)]
    fn squared_to(&self, query: &[f32; 3]) -> [f32; WIDE] {
        let [x, y, z] = &self.0;
        std::array::from_fn(|lane| {
            let (dx, dy, dz) = (x[lane] - query[0], y[lane] - query[1], z[lane] - query[2]);
            dx * dx + dy * dy + dz * dz
        })
    }
}

/// The lowest and the highest corner of a box.
pub(super) type Corners = ([f32; 3], [f32; 3]);

fn join(a: Corners, b: Corners) -> Corners {
    (std::array::from_fn(|k| a.0[k].min(b.0[k])), std::array::from_fn(|k| a.1[k].max(b.1[k])))
}

const EMPTY: Corners = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);

/// The box around points; the empty box without points.
pub(super) fn box_around(points: &[Point3<f32>]) -> Corners {
    points.iter().map(|p| ((*p).into(), (*p).into())).fold(EMPTY, join)
}

impl Boxes {
    /// At most eight boxes.
    fn new(corners: &[Corners]) -> Self {
        let mut boxes =
            Self { low: PointLanes::FAR, high: PointLanes([[f32::NEG_INFINITY; WIDE]; 3]) };
        for (lane, (low, high)) in corners.iter().enumerate().take(WIDE) {
            boxes.low.set(lane, *low);
            boxes.high.set(lane, *high);
        }
        boxes
    }

    fn around(&self) -> Corners {
        let fold = |lanes: &PointLanes, of: fn(f32, f32) -> f32, start: f32| {
            lanes.0.map(|axis| axis.into_iter().fold(start, of))
        };
        (fold(&self.low, f32::min, f32::INFINITY), fold(&self.high, f32::max, f32::NEG_INFINITY))
    }

    /// Squared distance to the nearest point of each box: 0 within.
    #[inline(always)]
    fn squared_to(&self, query: &[f32; 3]) -> [f32; WIDE] {
        self.squared_to_box(&(*query, *query))
    }

    /// Squared distance of a box from each of these: 0 where they meet.
    #[inline(always)]
    fn squared_to_box(&self, (low, high): &Corners) -> [f32; WIDE] {
        let outside = |axis: usize, lane: usize| {
            let (below, above) =
                (self.low.0[axis][lane] - high[axis], low[axis] - self.high.0[axis][lane]);
            larger(larger(below, above), 0.0)
        };
        std::array::from_fn(|lane| {
            let (dx, dy, dz) = (outside(0, lane), outside(1, lane), outside(2, lane));
            dx * dx + dy * dy + dz * dz
        })
    }
}

/// `f32::max` that does not handle NaN: one instruction.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// `f32::min` that does not handle NaN: one instruction.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::tests::scanned::{nearest_first, tree};
    use crate::tests::on_threads;

    /// A full scan: the nearest, of equally near ones the first, and the squared distance of the
    /// second.
    fn scan(tree: &BoxTree, query: &Point3<f32>, radius_m: f32) -> (Option<u32>, f32) {
        let all = nearest_first(tree.points(), query, radius_m);
        (all.first().map(|near| near.1), all.get(1).map_or(radius_m * radius_m, |near| near.0))
    }

    /// Coordinates on a coarse lattice: many ties and duplicates.
    fn lattice() -> impl Strategy<Value = Vec<[f32; 3]>> {
        prop::collection::vec(
            prop::array::uniform3((-8i8..8).prop_map(|v| f32::from(v) * 0.5)),
            0..700,
        )
    }

    fn cloud() -> impl Strategy<Value = Vec<[f32; 3]>> {
        prop_oneof![lattice(), prop::collection::vec(prop::array::uniform3(-9.0f32..9.0), 0..700)]
    }

    /// On the lattice, halfway between its points, and anywhere.
    fn query() -> impl Strategy<Value = [f32; 3]> {
        let near = prop::array::uniform3((-40i8..40).prop_map(|v| f32::from(v) * 0.25));
        prop_oneof![near, prop::array::uniform3(-9.0f32..9.0)]
    }

    proptest! {
        #[test]
        fn the_halves_of_a_leaf_lie_apart(raw in cloud()) {
            let tree = tree(&raw);
            for leaf in tree.points().chunks(WIDE).filter(|leaf| leaf.len() > HALF) {
                let (first, last) = leaf.split_at(HALF);
                let apart = |axis: usize| {
                    first.iter().all(|a| last.iter().all(|b| a[axis] <= b[axis]))
                };
                prop_assert!((0..3).any(apart), "{:?}", leaf);
            }
        }

        #[test]
        fn the_nearest_is_a_full_scan_s_bit_for_bit(
            raw in cloud(),
            query in query(),
            radius_m in 0.1f32..20.0,
            slack_m in 0.0f32..3.0,
        ) {
            let tree = tree(&raw);
            let query = query.into();
            let (index, second) = scan(&tree, &query, radius_m);
            let found = tree.nearest(Portable, &query, radius_m, slack_m);
            prop_assert_eq!(found.index, index);
            prop_assert!(found.others_squared_m2 <= second);
            let nearest = index.map(|index| (tree.points()[index as usize] - query).norm());
            let least = nearest.map_or(radius_m, |m| (m + slack_m).min(radius_m));
            prop_assert!(found.others_squared_m2.sqrt() >= least.min(second.sqrt()) * 0.999_999);
        }

        #[test]
        fn the_order_holds_each_point_once(raw in cloud()) {
            let points: Vec<Point3<f32>> = raw.iter().map(|&p| p.into()).collect();
            let mut order = order(&points);
            order.sort_unstable();
            prop_assert_eq!(order, (0..points.len() as u32).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_query_that_is_not_a_number_finds_nothing() {
        let tree = tree(&[[1.0; 3], [2.0; 3]]);
        for query in [[f32::NAN; 3], [f32::INFINITY; 3], [f32::NAN, 1.0, 1.0]] {
            assert_eq!(tree.nearest(Portable, &query.into(), 5.0, 0.5).index, None);
        }
    }

    #[test]
    fn thousands_of_equal_points_are_no_trouble() {
        let tree = tree(&[[1.0, 2.0, 3.0]; 10_000]);
        let found = tree.nearest(Portable, &Point3::new(1.0, 2.0, 3.0), 1.0, 0.1);
        assert_eq!(found, Found { index: Some(0), others_squared_m2: 0.0 });
    }

    #[test]
    fn the_order_is_the_same_on_any_number_of_threads() {
        let points: Vec<Point3<f32>> = (0..40_000)
            .map(|i| Point3::new((i as f32).sin(), (i as f32 * 0.7).cos(), (i % 7) as f32))
            .collect();
        let on = |threads| on_threads(threads, || order(&points));
        assert_eq!(on(1), on(3));
    }
}
