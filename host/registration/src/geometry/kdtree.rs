//! Neighbours in space, by `kiddo`.

use std::num::NonZero;

use kiddo::SquaredEuclidean;
use kiddo::immutable::float::kdtree::ImmutableKdTree;
use nalgebra::Point3;

/// Points in a leaf of the tree.
const LEAF: usize = 32;

/// A k-d tree over points that does not change. A point's index is its place in the input.
#[derive(Clone, Debug)]
pub struct KdTree {
    /// Absent over no points, which `kiddo` does not build.
    tree: Option<ImmutableKdTree<f32, u32, 3, LEAF>>,
    points: Vec<Point3<f32>>,
}

impl KdTree {
    /// Builds the tree. Points must be finite and fewer than 2³².
    pub fn new(points: &[Point3<f32>]) -> Self {
        let coordinates: Vec<[f32; 3]> = points.iter().map(|p| p.coords.into()).collect();
        let tree = (!points.is_empty()).then(|| ImmutableKdTree::new_from_slice(&coordinates));
        Self { tree, points: points.to_vec() }
    }

    /// The points, in the order they came.
    pub fn points(&self) -> &[Point3<f32>] {
        &self.points
    }

    /// How many points there are.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The nearest point strictly within `radius_m`; absent when there is none.
    pub fn nearest(&self, query: &Point3<f32>, radius_m: f32) -> Option<u32> {
        let mut found = Vec::new();
        self.within(query, radius_m, 1, &mut found);
        found.first().map(|near| near.1)
    }

    /// The nearest points strictly within `radius_m`, `max` at most, nearest first: pairs of
    /// squared distance and index. A point of the tree finds itself. `found` is emptied first.
    pub fn within(
        &self,
        query: &Point3<f32>,
        radius_m: f32,
        max: usize,
        found: &mut Vec<(f32, u32)>,
    ) {
        found.clear();
        let (Some(tree), Some(max)) = (&self.tree, NonZero::new(max.min(self.len()))) else {
            return;
        };
        if radius_m > 0.0 {
            let (query, squared): ([f32; 3], _) = (query.coords.into(), radius_m * radius_m);
            // Room for `max` is reserved for every query: above, it is no more than there can be.
            let near = tree
                .nearest_n_within_exclusive::<SquaredEuclidean>(&query, squared, max, true, false);
            found.extend(near.into_iter().map(|neighbour| (neighbour.distance, neighbour.item)));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;

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

    /// Squared distances within the radius, ascending.
    fn brute(tree: &KdTree, query: &Point3<f32>, radius: f32) -> Vec<f32> {
        let mut all: Vec<f32> = tree.points().iter().map(|p| (p - query).norm_squared()).collect();
        all.retain(|d| *d < radius * radius);
        all.sort_by(f32::total_cmp);
        all
    }

    fn near(a: f32, b: f32) -> bool {
        (a - b).abs() <= 1e-5 * a.abs().max(1e-6)
    }

    proptest! {
        #[test]
        fn neighbours_are_as_near_as_a_full_scan_s(
            raw in prop_oneof![
                lattice(), prop::collection::vec(prop::array::uniform3(-9.0f32..9.0), 0..400)
            ],
            query in prop::array::uniform3(-4i8..4),
            radius in 0.1f32..20.0,
            max in 1usize..40,
        ) {
            let tree = KdTree::new(&points(&raw));
            let query = query.map(|v| f32::from(v) + 0.125).into();
            let expected = brute(&tree, &query, radius);
            let mut found = Vec::new();
            tree.within(&query, radius, max, &mut found);
            prop_assert_eq!(found.len(), expected.len().min(max));
            prop_assert!(found.iter().zip(&expected).all(|(a, b)| near(a.0, *b)));
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
