//! Full scans, with which tests of searches compare.

use nalgebra::Point3;

use crate::geometry::box_tree::{BoxTree, order, ordered};

/// The tree of some points.
pub(in crate::geometry) fn tree(raw: &[[f32; 3]]) -> BoxTree {
    let points: Vec<Point3<f32>> = raw.iter().map(|&p| p.into()).collect();
    BoxTree::new(ordered(&points, &order(&points)))
}

/// Squared distance, m², and index of each point strictly within a radius, the nearest first, of
/// equally near ones the first.
pub(in crate::geometry) fn nearest_first(
    points: &[Point3<f32>],
    query: &Point3<f32>,
    radius_m: f32,
) -> Vec<(f32, u32)> {
    let squared = |p: &Point3<f32>| {
        let d = p - query;
        d.x * d.x + d.y * d.y + d.z * d.z
    };
    let mut all: Vec<(f32, u32)> = points.iter().map(squared).zip(0..).collect();
    all.retain(|near| near.0 < radius_m * radius_m);
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all
}
