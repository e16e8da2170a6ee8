//! Features against Open3D's, and on clouds that have none.

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;

use super::*;
use crate::geometry::normals;
use crate::tests::on_threads;

fn unit(v: [f32; 3]) -> Vector3<f32> {
    Vector3::from(v).try_normalize(1e-3).unwrap_or_default()
}

fn search(points: &[Point3<f32>], radius_m: f64, max: usize) -> Neighbours {
    Neighbours::within(points, radius_m, max)
}

/// Sums of the three histograms.
fn totals(row: &[f32; DIMENSIONS]) -> [f32; 3] {
    [0, 1, 2].map(|h| row[h * BINS..(h + 1) * BINS].iter().sum())
}

#[test]
fn a_plane_s_pairs_fall_in_the_middle_of_all_three_histograms() {
    let points: Vec<_> =
        (0..25).map(|i| Point3::new((i % 5) as f32, (i / 5) as f32, -2.0)).collect();
    let features = describe(&points, &[Vector3::z(); 25], &search(&points, 1.6, 100));
    for row in features.rows {
        for (i, value) in row.iter().enumerate() {
            assert!((value - if i % BINS == 5 { 200.0 } else { 0.0 }).abs() < 1e-3, "{i}: {value}");
        }
    }
}

#[test]
fn without_a_normal_a_point_has_no_feature_and_is_nobody_s_neighbour() {
    let mut points: Vec<_> =
        (0..25).map(|i| Point3::new((i % 5) as f32, (i / 5) as f32, -2.0)).collect();
    let mut normals: Vec<_> =
        (0..25).map(|i| unit([(i as f32).sin(), (i as f32).cos(), 2.0])).collect();
    let expected = describe(&points, &normals, &search(&points, 1.6, 100));
    points.push(Point3::new(1.5, 1.5, -2.0));
    normals.push(Vector3::zeros());
    let with = describe(&points, &normals, &search(&points, 1.6, 100));
    assert_eq!(with.rows[25], [0.0; DIMENSIONS]);
    assert_eq!(with.rows[..25], expected.rows);
}

#[test]
fn nobody_near_means_no_feature() {
    let points = [Point3::new(0.0, 0.0, 1.0), Point3::new(9.0, 0.0, 1.0)];
    for count in 0..=2 {
        let points = &points[..count];
        let features = describe(points, &vec![Vector3::z(); count], &search(points, 1.0, 10));
        assert_eq!(features.rows, vec![[0.0; DIMENSIONS]; count]);
    }
}

#[test]
fn open3d_computes_the_same_features() {
    let text = include_str!("../../../tests/data/fpfh_open3d.txt");
    let table: Vec<Vec<f32>> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split_whitespace().map(|word| word.parse().unwrap()).collect())
        .collect();
    assert_eq!(table.len(), 120);
    let points: Vec<_> = table.iter().map(|v| Point3::new(v[0], v[1], v[2])).collect();
    let normals: Vec<_> = table.iter().map(|v| Vector3::new(v[3], v[4], v[5])).collect();
    let features = describe(&points, &normals, &search(&points, 1.5, 40));
    for (i, (ours, line)) in features.rows.iter().zip(&table).enumerate() {
        for (bin, (ours, theirs)) in ours.iter().zip(&line[6..]).enumerate() {
            assert!((ours - theirs).abs() < 1e-3, "point {i}, bin {bin}: {ours} against {theirs}");
        }
    }
}

proptest! {
    #[test]
    fn both_builds_and_any_threads_give_the_same_bytes_and_whole_histograms(
        raw in prop::collection::vec(
            (
                prop::array::uniform3((-8i8..8).prop_map(|v| f32::from(v) * 0.37)),
                prop::array::uniform3(-1.0f32..1.0),
            ),
            0..700
        ),
        radius_m in 0.3f64..4.0,
        max in 3usize..120,
        own_normals: bool,
    ) {
        let points: Vec<_> = raw.iter().map(|(p, _)| Point3::from(*p)).collect();
        let neighbours = search(&points, radius_m, max);
        let normals = if own_normals {
            normals::from_neighbours(&points, &neighbours, radius_m, max)
        } else {
            raw.iter().map(|(_, n)| unit(*n)).collect()
        };
        let on = |threads| on_threads(threads, || describe(&points, &normals, &neighbours));
        let ours = on(1);
        prop_assert_eq!(&ours, &on(2));
        prop_assert_eq!(&ours, &describe_baseline(&points, &normals, &neighbours));
        for row in &ours.rows {
            prop_assert!(row.iter().all(|v| v.is_finite() && *v >= 0.0));
            let whole = totals(row);
            prop_assert!(
                [0.0, 100.0, 200.0].iter().any(|sum| whole.iter().all(|v| (v - sum).abs() < 0.01)),
                "{whole:?}"
            );
        }
    }

    #[test]
    fn distances_at_the_end_of_the_range_of_f32_give_finite_features(
        scale in prop_oneof![Just(1e-18f32), Just(1e4)],
    ) {
        let points: Vec<_> = (0..30)
            .map(|i| Point3::new((i % 5) as f32, (i / 5) as f32, (i % 3) as f32) * scale)
            .collect();
        let normals = vec![unit([0.1, 0.2, 1.0]); 30];
        let features = describe(&points, &normals, &search(&points, 2.0 * f64::from(scale), 30));
        prop_assert!(features.rows.iter().flatten().all(|v| v.is_finite()));
    }
}
