//! The k-d tree of `kiddo`, with which tests compare the searches here.

use std::num::NonZero;

use kiddo::SquaredEuclidean;
use kiddo::immutable::float::kdtree::ImmutableKdTree;
use nalgebra::Point3;

/// Points in a leaf of the tree.
const LEAF: usize = 32;

pub(in crate::geometry) struct KiddoTree {
    /// None for no points, which `kiddo` does not accept.
    tree: Option<ImmutableKdTree<f32, u32, 3, LEAF>>,
    points: usize,
}

impl KiddoTree {
    pub(in crate::geometry) fn new(points: &[Point3<f32>]) -> Self {
        let coordinates: Vec<[f32; 3]> = points.iter().map(|p| p.coords.into()).collect();
        let tree = (!points.is_empty()).then(|| ImmutableKdTree::new_from_slice(&coordinates));
        Self { tree, points: points.len() }
    }

    /// The nearest point strictly within `radius_m`.
    pub(in crate::geometry) fn nearest(&self, query: &Point3<f32>, radius_m: f32) -> Option<u32> {
        let mut found = Vec::new();
        self.within(query, radius_m, 1, &mut found);
        found.first().map(|near| near.1)
    }

    /// The nearest points strictly within `radius_m`, at most `max`, nearest first: pairs of
    /// squared distance and index.
    pub(in crate::geometry) fn within(
        &self,
        query: &Point3<f32>,
        radius_m: f32,
        max: usize,
        found: &mut Vec<(f32, u32)>,
    ) {
        found.clear();
        let (Some(tree), Some(max)) = (&self.tree, NonZero::new(max.min(self.points))) else {
            return;
        };
        if radius_m > 0.0 {
            let (query, squared): ([f32; 3], _) = (query.coords.into(), radius_m * radius_m);
            let near = tree
                .nearest_n_within_exclusive::<SquaredEuclidean>(&query, squared, max, true, false);
            found.extend(near.into_iter().map(|neighbour| (neighbour.distance, neighbour.item)));
        }
    }
}
