//! Which way the surface faces at each point.

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::eigen::{eigenvalues, eigenvector};
use super::kdtree::KdTree;
use super::{Cloud, is_finite};

/// Neighbours on a line have no normal: the middle eigenvalue must exceed the largest times this (1 % in length).
const FLAT_OVER_LONG: f64 = 1e-4;

/// Fewer neighbours than this, the point included, span no plane.
const LEAST_NEIGHBOURS: usize = 3;

/// How many points a thread takes at a time.
const CHUNK: usize = 512;

/// Sets the normals of a cloud, one a point; a zero normal where there is none. Points must be finite.
///
/// Neighbours are the nearest `max_neighbours` strictly within `radius_m`, the point itself included (Open3D's hybrid
/// search). The normal is the eigenvector of the least eigenvalue of
///
/// ```text
/// C = Σ (p - q)(p - q)ᵀ / n - m mᵀ      m = Σ (p - q) / n, q the point
/// ```
///
/// turned towards the sensor at the origin: without that its sign depends on the frame. Fewer than 3 neighbours, or
/// neighbours on a line, give no normal. The same input gives the same bytes on any number of threads.
pub fn estimate(cloud: &mut Cloud, radius_m: f64, max_neighbours: usize) {
    // A tree wants finite points: the others get no normal.
    let valid: Vec<u32> = (0..).zip(&cloud.points).filter(|(_, p)| is_finite(p)).map(|(i, _)| i).collect();
    let tree = KdTree::new(&valid.iter().map(|&i| cloud.points[i as usize]).collect::<Vec<_>>());
    let mut normals = vec![Vector3::zeros(); cloud.points.len()];
    for (normal, &index) in of_tree(&tree, radius_m, max_neighbours).iter().zip(&valid) {
        normals[index as usize] = *normal;
    }
    cloud.normals = Some(normals);
}

/// The normals of a tree's points: see [`estimate`].
pub fn of_tree(tree: &KdTree, radius_m: f64, max_neighbours: usize) -> Vec<Vector3<f32>> {
    let mut normals = vec![Vector3::zeros(); tree.len()];
    normals.par_chunks_mut(CHUNK).zip(tree.points().par_chunks(CHUNK)).for_each(|(normals, points)| {
        let mut found = Vec::new();
        for (normal, point) in normals.iter_mut().zip(points) {
            tree.within(point, radius_m as f32, max_neighbours, &mut found);
            *normal = normal_at(tree, point, &found).unwrap_or_default();
        }
    });
    normals
}

fn normal_at(tree: &KdTree, query: &Point3<f32>, found: &[(f32, u32)]) -> Option<Vector3<f32>> {
    if found.len() < LEAST_NEIGHBOURS {
        return None;
    }
    let covariance = covariance(tree, query, found);
    let [low, middle, high] = eigenvalues(&covariance);
    if middle <= high * FLAT_OVER_LONG {
        return None;
    }
    let normal = eigenvector(&covariance, low)?.cast::<f32>();
    Some(if normal.dot(&query.coords) > 0.0 { -normal } else { normal })
}

/// Centred on the query, so that `f32` coordinates far from the origin lose nothing.
fn covariance(tree: &KdTree, query: &Point3<f32>, found: &[(f32, u32)]) -> Matrix3<f64> {
    let (mut sum, mut xx, mut xy, mut xz, mut yy, mut yz, mut zz) = (Vector3::zeros(), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for &(_, index) in found {
        let d = (tree.points()[index as usize] - query).cast::<f64>();
        sum += d;
        xx += d.x * d.x;
        xy += d.x * d.y;
        xz += d.x * d.z;
        yy += d.y * d.y;
        yz += d.y * d.z;
        zz += d.z * d.z;
    }
    let n = found.len() as f64;
    let mean: Vector3<f64> = sum / n;
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) / n - mean * mean.transpose()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn normals(points: Vec<Point3<f32>>, radius_m: f64, max: usize) -> Vec<Vector3<f32>> {
        let mut cloud = Cloud::new(points);
        estimate(&mut cloud, radius_m, max);
        cloud.normals.unwrap()
    }

    fn patch(point: impl Fn(f32, f32) -> Point3<f32>) -> Vec<Point3<f32>> {
        (0..100).map(|i| point((i % 10) as f32 * 0.1, (i / 10) as f32 * 0.1)).collect()
    }

    #[test]
    fn planes_give_their_normal_turned_towards_the_sensor() {
        let table = [
            (patch(|a, b| Point3::new(a, b, -2.0)), Vector3::z()),
            (patch(|a, b| Point3::new(a, b, 2.0)), -Vector3::z()),
            (patch(|a, b| Point3::new(300.0, a, b)), -Vector3::x()),
            (patch(|a, b| Point3::new(a, a - 3.0, b)), Vector3::new(-1.0, 1.0, 0.0).normalize()),
        ];
        for (points, expected) in table {
            for normal in normals(points, 0.35, 30) {
                assert!((normal - expected).norm() < 1e-4, "{normal} is not {expected}");
            }
        }
    }

    #[test]
    fn lines_pairs_duplicates_and_lone_points_have_no_normal() {
        let line: Vec<_> = (0..20).map(|i| Point3::new(i as f32 * 0.1, 5.0, i as f32 * 0.2)).collect();
        let pair = vec![Point3::new(1.0, 2.0, 3.0), Point3::new(1.1, 2.0, 3.0)];
        for points in [line, pair, vec![Point3::new(1.0, 1.0, 1.0); 40], vec![Point3::new(1.0, 1.0, 1.0)], vec![]] {
            assert!(normals(points, 1.0, 30).iter().all(|n| *n == Vector3::zeros()));
        }
    }

    #[test]
    fn non_finite_points_have_no_normal_and_do_not_disturb_others() {
        let mut points = patch(|a, b| Point3::new(a, b, -2.0));
        points.insert(7, Point3::new(f32::NAN, 0.0, 0.0));
        let normals = normals(points, 0.35, 30);
        assert_eq!(normals[7], Vector3::zeros());
        assert!((normals[8] - Vector3::z()).norm() < 1e-4);
    }

    #[test]
    fn one_thread_and_two_give_the_same_bytes() {
        let points = || {
            (0..5000)
                .map(|i| {
                    let a = i as f32;
                    Point3::new(a.sin() * 9.0, (a * 1.7).cos() * 9.0, (a * 0.01).sin())
                })
                .collect()
        };
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| normals(points(), 0.8, 20))
        };
        assert_eq!(on(1), on(2));
    }
}
