//! Normals of the surface at each point.

use echoloop_clouds::{Cloud, is_finite};
use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::box_tree::{self, BoxTree, HALF, WIDE};
use super::eigen::{eberly, eigenvalues, eigenvector};
use super::nearest::Nearest;
use super::neighbours::Neighbours;

/// Neighbours on a line have no normal: the middle eigenvalue must exceed the largest times this (1
/// % in length).
const FLAT_OVER_LONG: f64 = 1e-4;

/// Least count of neighbours that span a plane, the point included.
const LEAST_NEIGHBOURS: usize = 3;

/// Points that a thread takes at a time: whole leaves.
const CHUNK: usize = 64 * WIDE;

/// Sets the normals of a cloud, one per point; zero where the surface has no direction. See
/// [`from_points`].
pub fn estimate(cloud: &mut Cloud, radius_m: f64, max_neighbours: usize) {
    // A search needs finite points: the others get no normal.
    let valid: Vec<u32> =
        (0..).zip(&cloud.points).filter(|(_, p)| is_finite(p)).map(|(i, _)| i).collect();
    let points: Vec<Point3<f32>> = valid.iter().map(|&i| cloud.points[i as usize]).collect();
    let mut normals = vec![Vector3::zeros(); cloud.points.len()];
    for (normal, &index) in from_points(&points, radius_m, max_neighbours).iter().zip(&valid) {
        normals[index as usize] = *normal;
    }
    cloud.normals = Some(normals);
}

/// Unit normals of `n` finite points, `[n]`; zero where a point has none.
///
/// Neighbours are the nearest `max_neighbours` strictly within `radius_m`, the point itself
/// included (Open3D's hybrid search). The normal is the eigenvector of the least eigenvalue of
///
/// ```text
/// C = Σ (p - q)(p - q)ᵀ / n - m mᵀ      m = Σ (p - q) / n, q the point
/// ```
///
/// turned towards the sensor at the origin: without that its sign depends on the frame. Fewer than
/// 3 neighbours, or neighbours on a line, give no normal. The same input gives the same bytes on
/// any number of threads.
pub fn from_points(
    points: &[Point3<f32>],
    radius_m: f64,
    max_neighbours: usize,
) -> Vec<Vector3<f32>> {
    let order = box_tree::order(points);
    let tree = BoxTree::new(box_tree::ordered(points, &order));
    let mut normals = vec![Vector3::zeros(); points.len()];
    for (plane, &index) in of_tree(&tree, radius_m, max_neighbours).iter().zip(&order) {
        normals[index as usize] = plane.normal;
    }
    normals
}

/// The plane through the neighbours of a point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Plane {
    /// Unit normal; zero where the surface has no direction.
    pub(crate) normal: Vector3<f32>,
    /// Variance of the normal's tilt, rad²: that of a least-squares plane towards the direction in
    /// which the neighbours spread less, `λ₀ / λ₁ (n - 2.5)` of the eigenvalues of C.
    pub(crate) tilt_rad2: f32,
    /// Variance of the neighbours in that direction, λ₁, m².
    pub(crate) spread_m2: f32,
}

/// The planes of the points of a tree.
pub(crate) fn of_tree(tree: &BoxTree, radius_m: f64, max_neighbours: usize) -> Vec<Plane> {
    let points = tree.points();
    in_chunks(points, |points_here, planes| {
        let mut nearest = Nearest::new(tree, radius_m, max_neighbours);
        for (planes, leaf) in planes.chunks_mut(WIDE).zip(points_here.chunks(WIDE)) {
            for ((plane, found), point) in planes.iter_mut().zip(nearest.of(leaf)).zip(leaf) {
                *plane = plane_at(points, point, found).unwrap_or_default();
            }
        }
    })
}

/// The same with one plane for each half of a leaf, through the neighbours of its middle: a quarter
/// of the searches.
pub(crate) fn of_halves(tree: &BoxTree, radius_m: f64, max_neighbours: usize) -> Vec<Plane> {
    let points = tree.points();
    in_chunks(points, |points_here, planes| {
        let mut nearest = Nearest::new(tree, radius_m, max_neighbours);
        // Middles of two leaves at a time: a walk through the tree for each takes longer.
        for (planes, leaves) in planes.chunks_mut(2 * WIDE).zip(points_here.chunks(2 * WIDE)) {
            let mut middles = [Point3::origin(); 4];
            let halves = leaves.chunks(HALF).zip(&mut middles);
            let count = halves.map(|(half, middle)| *middle = middle_of(half)).count();
            let found = nearest.of(&middles[..count]).zip(&middles);
            for (planes, (found, middle)) in planes.chunks_mut(HALF).zip(found) {
                planes.fill(plane_at(points, middle, found).unwrap_or_default());
            }
        }
    })
}

fn middle_of(points: &[Point3<f32>]) -> Point3<f32> {
    let sum = points.iter().map(|point| point.coords).sum::<Vector3<f32>>();
    Point3::from(sum / points.len() as f32)
}

/// The planes of points, of which `set` sets those of some whole leaves.
fn in_chunks(
    points: &[Point3<f32>],
    set: impl Fn(&[Point3<f32>], &mut [Plane]) + Sync,
) -> Vec<Plane> {
    let mut planes = vec![Plane::default(); points.len()];
    let chunks = planes.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK));
    chunks.for_each(|(planes, points)| set(points, planes));
    planes
}

/// [`from_points`] with neighbours found already: within at least `radius_m`, and at least
/// `max_neighbours` of them where there are so many.
pub fn from_neighbours(
    points: &[Point3<f32>],
    neighbours: &Neighbours,
    radius_m: f64,
    max_neighbours: usize,
) -> Vec<Vector3<f32>> {
    each(points, neighbours, radius_m, max_neighbours, |query, found| {
        sensor_normal(points, query, found)
    })
}

/// Normals as Open3D 0.20 estimates them: with the sign that its solver leaves, (0, 0, 1) where
/// there are too few neighbours or none has a direction.
pub fn from_neighbours_open3d(
    points: &[Point3<f32>],
    neighbours: &Neighbours,
    radius_m: f64,
    max_neighbours: usize,
) -> Vec<Vector3<f32>> {
    each(points, neighbours, radius_m, max_neighbours, |query, found| {
        let normal = match found.len() < LEAST_NEIGHBOURS {
            true => Vector3::z(),
            false => eberly::least(&covariance(points, query, found)),
        };
        if normal == Vector3::zeros() { Vector3::z() } else { normal.cast() }
    })
}

/// Computes a value for every point from its nearest neighbours.
fn each(
    points: &[Point3<f32>],
    neighbours: &Neighbours,
    radius_m: f64,
    max_neighbours: usize,
    normal_of: impl Fn(&Point3<f32>, &[u32]) -> Vector3<f32> + Sync,
) -> Vec<Vector3<f32>> {
    let mut normals = vec![Vector3::zeros(); points.len()];
    let squared = (radius_m as f32) * (radius_m as f32);
    normals.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, normals)| {
        let mut nearest = NearestBuffer::default();
        for (i, normal) in (chunk * CHUNK..).zip(normals) {
            *normal =
                normal_of(&points[i], nearest.take(neighbours.row(i), squared, max_neighbours));
        }
    });
    normals
}

/// The nearest of a neighbourhood.
#[derive(Default)]
struct NearestBuffer {
    order: Vec<(f32, u32)>,
    indices: Vec<u32>,
}

impl NearestBuffer {
    /// The nearest `max` strictly within a radius, in the order of the neighbourhood unless there
    /// are more.
    fn take(&mut self, (indices, squares): (&[u32], &[f32]), squared: f32, max: usize) -> &[u32] {
        self.order.clear();
        self.order.extend(
            squares.iter().copied().zip(indices.iter().copied()).filter(|(d, _)| *d < squared),
        );
        if self.order.len() > max {
            self.order.select_nth_unstable_by(max, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            self.order.truncate(max);
        }
        self.indices.clear();
        self.indices.extend(self.order.iter().map(|(_, index)| index));
        &self.indices
    }
}

fn sensor_normal(points: &[Point3<f32>], query: &Point3<f32>, found: &[u32]) -> Vector3<f32> {
    plane_at(points, query, found).unwrap_or_default().normal
}

fn plane_at(points: &[Point3<f32>], query: &Point3<f32>, found: &[u32]) -> Option<Plane> {
    if found.len() < LEAST_NEIGHBOURS {
        return None;
    }
    let covariance = covariance(points, query, found);
    let [low, middle, high] = eigenvalues(&covariance);
    if middle <= high * FLAT_OVER_LONG {
        return None;
    }
    let normal = eigenvector(&covariance, low)?.cast::<f32>();
    Some(Plane {
        normal: if normal.dot(&query.coords) > 0.0 { -normal } else { normal },
        tilt_rad2: (low.max(0.0) / (middle * (found.len() as f64 - 2.5))) as f32,
        spread_m2: middle as f32,
    })
}

/// Centred on the query, so that `f32` coordinates far from the origin lose nothing.
fn covariance(points: &[Point3<f32>], query: &Point3<f32>, found: &[u32]) -> Matrix3<f64> {
    let (mut sum, mut xx, mut xy, mut xz, mut yy, mut yz, mut zz) =
        (Vector3::zeros(), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for &index in found {
        let d = (points[index as usize] - query).cast::<f64>();
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
    use crate::tests::on_threads;

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
    fn four_points_share_the_plane_of_their_middle() {
        // A bent sheet: the normal turns from point to point.
        let at = |i: usize| {
            let (x, y) = ((i % 40) as f32 * 0.1, (i / 40) as f32 * 0.1);
            Point3::new(x, y, -2.0 - (0.7 * x).sin())
        };
        let points: Vec<_> = (0..1_003).map(at).collect();
        let tree = BoxTree::new(box_tree::ordered(&points, &box_tree::order(&points)));
        let planes = of_halves(&tree, 1.0, 12);
        let mut nearest = Nearest::new(&tree, 1.0, 12);
        for (half, planes) in tree.points().chunks(4).zip(planes.chunks(4)) {
            let sum = half.iter().map(|p| p.coords).sum::<Vector3<f32>>();
            let middle = Point3::from(sum / half.len() as f32);
            let found = nearest.of(&[middle]).next().unwrap().to_vec();
            let own = plane_at(tree.points(), &middle, &found).unwrap();
            assert!(planes.iter().all(|plane| plane.normal == own.normal));
        }
        let differ = planes.chunks(4).filter(|four| four[0].normal != planes[0].normal).count();
        assert!(differ > 200, "{differ}");
    }

    // Literals of Open3D (MIT), cpp/tests/geometry/PointCloud.cpp, EstimateNormals: the corners of
    // a cube, 4 neighbours.
    #[test]
    fn open3ds_normals_of_a_cube_come_with_its_signs() {
        let corner = |i: usize| Point3::new((i / 4) as f32, (i / 2 % 2) as f32, (i % 2) as f32);
        let points: Vec<_> = (0..8).map(corner).collect();
        let signs = [
            [1.0, 1.0, 1.0],
            [-1.0, -1.0, 1.0],
            [1.0, -1.0, 1.0],
            [-1.0, 1.0, 1.0],
            [-1.0, 1.0, 1.0],
            [1.0, -1.0, 1.0],
            [-1.0, -1.0, 1.0],
            [1.0, 1.0, 1.0],
        ];
        let found = from_neighbours_open3d(&points, &Neighbours::within(&points, 1.2, 4), 1.2, 4);
        for (normal, sign) in found.iter().zip(signs) {
            assert!(
                (normal - Vector3::from(sign) / 3f32.sqrt()).norm() < 1e-6,
                "{normal} {sign:?}"
            );
        }
        assert_eq!(
            from_neighbours_open3d(&points[..2], &Neighbours::within(&points[..2], 1.2, 4), 1.2, 4),
            [Vector3::z(); 2]
        );
    }

    #[test]
    fn lines_pairs_duplicates_and_lone_points_have_no_normal() {
        let line: Vec<_> =
            (0..20).map(|i| Point3::new(i as f32 * 0.1, 5.0, i as f32 * 0.2)).collect();
        let pair = vec![Point3::new(1.0, 2.0, 3.0), Point3::new(1.1, 2.0, 3.0)];
        for points in [
            line,
            pair,
            vec![Point3::new(1.0, 1.0, 1.0); 40],
            vec![Point3::new(1.0, 1.0, 1.0)],
            vec![],
        ] {
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
        let on = |threads| on_threads(threads, || normals(points(), 0.8, 20));
        assert_eq!(on(1), on(2));
    }
}
