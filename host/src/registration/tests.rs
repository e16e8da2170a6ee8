//! Registration recovers known motions, and says why when it cannot.

use std::path::PathBuf;

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::cloud::read_cloud;
use crate::pose::{read_pose, relative, rotation_error_deg, translation_error_m};

fn pose(shift: [f64; 3], turn: [f64; 3]) -> Pose {
    Pose::new(shift.into(), turn.into())
}

/// Uniform points on a parallelogram.
fn patch(rng: &mut ChaCha8Rng, n: usize, corner: [f64; 3], a: [f64; 3], b: [f64; 3]) -> Vec<Point3<f64>> {
    let (corner, a, b) = (Point3::from(corner), Vector3::from(a), Vector3::from(b));
    (0..n).map(|_| corner + a * rng.random::<f64>() + b * rng.random::<f64>()).collect()
}

/// A yard 20 m wide seen from 1.8 m above its floor: floor, two walls, a box and three poles, sampled anew per seed.
fn yard(seed: u64) -> Vec<Point3<f64>> {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut points = patch(rng, 16_000, [-10.0, -10.0, -1.8], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0]);
    points.extend(patch(rng, 4000, [-10.0, 10.0, -1.8], [20.0, 0.0, 0.0], [0.0, 0.0, 4.0]));
    points.extend(patch(rng, 3000, [9.0, -10.0, -1.8], [1.0, 15.0, 0.0], [0.0, 0.0, 4.0]));
    points.extend(patch(rng, 800, [-6.0, -5.0, -1.8], [3.0, 0.5, 0.0], [0.0, 0.0, 1.5]));
    points.extend(patch(rng, 800, [-6.0, -5.0, -1.8], [-0.5, 3.0, 0.0], [0.0, 0.0, 1.5]));
    for (x, y) in [(4.0, 3.0), (-4.0, 5.0), (2.0, -7.0)] {
        points.extend((0..500).map(|_| {
            let angle = rng.random::<f64>() * std::f64::consts::TAU;
            Point3::new(x + 0.2 * angle.cos(), y + 0.2 * angle.sin(), rng.random::<f64>() * 4.0 - 1.8)
        }));
    }
    points
}

/// The points as a sensor at `world_from_sensor` has them.
fn seen(points: &[Point3<f64>], world_from_sensor: &Pose) -> Cloud {
    Cloud::new(points.iter().map(|p| world_from_sensor.inverse_transform_point(p).cast()).collect())
}

fn cloud(points: &[[f32; 3]]) -> Cloud {
    Cloud::new(points.iter().map(|&p| p.into()).collect())
}

fn icp() -> Icp {
    Icp::new(IcpConfig::outdoor()).unwrap()
}

fn on_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run)
}

#[test]
fn known_motions_are_recovered_in_both_directions_from_several_starts() {
    let first = Pose::identity();
    let second = pose([0.4, -0.2, 0.05], [0.01, -0.01, 0.06]);
    let (a, b) = (seen(&yard(1), &first), seen(&yard(2), &second));
    let starts = [
        Pose::identity(),
        pose([0.3, 0.3, -0.1], [0.0, 0.02, -0.05]),
        pose([-0.3, 0.2, 0.1], [0.02, 0.0, 0.08]),
        pose([0.4, -0.2, 0.05], [0.01, -0.01, 0.06]),
    ];
    for (target, source, truth) in [(&a, &b, relative(&first, &second)), (&b, &a, relative(&second, &first))] {
        for start in &starts {
            let outcome = icp().register(target, source, start);
            assert_eq!(outcome.stop, StopReason::Still, "{outcome:?}");
            let found = outcome.target_from_source;
            let errors = (translation_error_m(&found, &truth), rotation_error_deg(&found, &truth));
            assert!(errors.0 < 0.01 && errors.1 < 0.05, "{errors:?} from {start}");
        }
    }
}

#[test]
fn a_coarse_start_recovers_a_motion_beyond_the_pair_distance() {
    let second = pose([2.5, -1.0, 0.1], [0.0, 0.02, 0.2]);
    let (a, b) = (seen(&yard(1), &Pose::identity()), seen(&yard(2), &second));
    let outcome = Icp::new(suggest(&a, &b)).unwrap().register(&a, &b, &Pose::identity());
    assert_eq!(outcome.stop, StopReason::Still);
    assert!(translation_error_m(&outcome.target_from_source, &second) < 0.02, "{outcome:?}");
}

#[test]
fn planes_leave_directions_open_and_say_so() {
    let floor = |seed| {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        patch(rng, 20_000, [-10.0, -10.0, -1.8], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0])
    };
    let corridor = |seed| {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let mut points = patch(rng, 9000, [-10.0, -2.0, -1.8], [20.0, 0.0, 0.0], [0.0, 0.0, 4.0]);
        points.extend(patch(rng, 9000, [-10.0, 2.0, -1.8], [20.0, 0.0, 0.0], [0.0, 0.0, 4.0]));
        points.extend(patch(rng, 9000, [-10.0, -2.0, -1.8], [20.0, 0.0, 0.0], [0.0, 4.0, 0.0]));
        points
    };
    let start = pose([0.1, 0.1, 0.1], [0.01, 0.01, 0.01]);
    for (target, source, open) in [(floor(1), floor(2), 3), (corridor(3), corridor(4), 1)] {
        let (target, source) = (seen(&target, &Pose::identity()), seen(&source, &Pose::identity()));
        let outcome = icp().register(&target, &source, &start);
        assert_eq!(outcome.stop, StopReason::Degenerate, "{outcome:?}");
        assert_eq!(outcome.observability.unwrap().unobservable, open);
        let found = outcome.target_from_source.translation.vector;
        assert!(found.z.abs() < 0.01, "the floor gives the height: {found}");
        assert!((found.x - 0.1).abs() < 0.05, "nothing gives x, so the start stands: {found}");
    }
}

#[test]
fn clouds_that_cannot_be_registered_return_the_start_and_a_reason() {
    let good = seen(&yard(1), &Pose::identity());
    let line: Vec<[f32; 3]> = (0..500).map(|i| [i as f32 * 0.1, 1.0, 0.0]).collect();
    let table: [(&str, Cloud, StopReason); 8] = [
        ("empty", cloud(&[]), StopReason::EmptyCloud),
        ("not a number", cloud(&[[f32::NAN; 3]; 100]), StopReason::EmptyCloud),
        ("infinite", cloud(&[[f32::INFINITY, 0.0, 0.0]; 100]), StopReason::EmptyCloud),
        ("at range 0", cloud(&[[0.0; 3]; 100]), StopReason::EmptyCloud),
        ("one point", cloud(&[[1.0; 3]]), StopReason::TooFewPairs),
        ("two points", cloud(&[[1.0; 3], [2.0; 3]]), StopReason::TooFewPairs),
        ("duplicates", cloud(&[[1.0; 3]; 500]), StopReason::TooFewPairs),
        ("far too wide", cloud(&[[f32::MAX; 3], [f32::MIN; 3]]), StopReason::BadSettings),
    ];
    let start = pose([0.1, 0.2, 0.3], [0.0, 0.0, 0.1]);
    for (name, bad, reason) in table {
        for (target, source) in [(&good, &bad), (&bad, &good), (&bad, &bad)] {
            let outcome = icp().register(target, source, &start);
            assert_eq!(outcome.stop, reason, "{name}");
            assert_eq!(outcome.target_from_source, start, "{name}");
            let _ = Icp::new(suggest(target, source)).unwrap().register(target, source, &start);
        }
    }
    let line = cloud(&line);
    assert_eq!(icp().register(&line, &line, &start).stop, StopReason::TooFewPairs, "a line has no normals");
    assert!(!icp().register(&good, &line, &start).stop.is_success(), "a line on a yard");
    let far = pose([1e4, 0.0, 0.0], [0.0; 3]);
    assert_eq!(icp().register(&good, &good, &far), Outcome::nothing(&far, StopReason::TooFewPairs));
    let nowhere = pose([f64::NAN; 3], [0.0; 3]);
    assert_eq!(icp().register(&good, &good, &nowhere).stop, StopReason::TooFewPairs);
}

#[test]
fn one_thread_and_two_give_the_same_bytes() {
    let (a, b) = (seen(&yard(1), &Pose::identity()), seen(&yard(2), &pose([0.3, 0.1, 0.0], [0.0, 0.0, 0.05])));
    let run = || icp().register(&a, &b, &Pose::identity());
    let (one, two) = (on_threads(1, run), on_threads(2, run));
    assert_eq!(one, two);
    let bits = |outcome: &Outcome| crate::pose::to_rows(&outcome.target_from_source).map(f64::to_bits);
    assert_eq!(bits(&one), bits(&two));
}

#[test]
fn the_order_of_the_points_does_not_matter() {
    let (mut a, mut b) = (seen(&yard(1), &Pose::identity()), seen(&yard(2), &pose([0.3, 0.1, 0.0], [0.0, 0.0, 0.05])));
    let before = icp().register(&a, &b, &Pose::identity());
    let rng = &mut ChaCha8Rng::seed_from_u64(5);
    a.points.shuffle(rng);
    b.points.shuffle(rng);
    let after = icp().register(&a, &b, &Pose::identity());
    assert!(translation_error_m(&before.target_from_source, &after.target_from_source) < 1e-4);
    assert_eq!(before.stop, after.stop);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_small_motion_of_the_same_points_is_undone_exactly(
        shift in prop::array::uniform3(-0.2f64..0.2), turn in prop::array::uniform3(-0.04f64..0.04), seed in 0u64..4,
    ) {
        // A voxel so small that it thins nothing: then source and target are the same points and the truth is exact.
        let config = IcpConfig { voxel_m: 1e-3, max_iterations: 100, ..IcpConfig::outdoor() };
        let points: Vec<_> = yard(seed).into_iter().step_by(8).collect();
        let truth = pose(shift, turn);
        let (a, b) = (seen(&points, &Pose::identity()), seen(&points, &truth));
        let outcome = Icp::new(config).unwrap().register(&a, &b, &Pose::identity());
        prop_assert_eq!(outcome.stop, StopReason::Still);
        prop_assert!(translation_error_m(&outcome.target_from_source, &truth) < 1e-3, "{:?}", outcome);
    }

    #[test]
    fn no_cloud_makes_it_panic(
        a in prop::collection::vec(prop::array::uniform3(any::<f32>()), 0..60),
        b in prop::collection::vec(prop::array::uniform3(-2.0f32..2.0), 0..60),
        shift in prop::array::uniform3(any::<f64>()),
    ) {
        for (target, source) in [(&a, &b), (&b, &a), (&b, &b)] {
            let outcome = icp().register(&cloud(target), &cloud(source), &pose(shift, [0.0; 3]));
            prop_assert!(outcome.inlier_fraction <= 1.0);
        }
    }
}

#[test]
fn real_pairs_come_within_the_tolerance_of_their_truth_from_the_identity() {
    let Some(data) = std::env::var_os("ECHOLOOP_DATA").map(PathBuf::from) else {
        eprintln!("skipped: ECHOLOOP_DATA is unset, so no real pair is registered");
        return;
    };
    let truth = |file: &str| read_pose(&data.join(file)).unwrap();
    let ouster = relative(&truth("pair_ouster/T_world_0.txt"), &truth("pair_ouster/T_world_2.txt"));
    let table = [
        (
            "pair_small_gicp/target.ply",
            "pair_small_gicp/source.ply",
            truth("pair_small_gicp/T_target_source.txt"),
            0.05,
            0.5,
        ),
        ("pair_ouster/scan_0.ply", "pair_ouster/scan_2.ply", ouster, 0.05, 0.2),
        (
            "pairs_carla/scan_4188.ply",
            "pairs_carla/scan_4255.ply",
            truth("pairs_carla/T_4188_from_4255.txt"),
            0.02,
            0.1,
        ),
        (
            "pairs_carla/scan_4255.ply",
            "pairs_carla/scan_4325.ply",
            truth("pairs_carla/T_4255_from_4325.txt"),
            0.02,
            0.1,
        ),
    ];
    for (target, source, truth, most_m, most_deg) in table {
        let (a, b) = (read_cloud(&data.join(target)).unwrap().0, read_cloud(&data.join(source)).unwrap().0);
        for (target, source, truth) in [(&a, &b, truth), (&b, &a, truth.inverse())] {
            let outcome = Icp::new(suggest(target, source)).unwrap().register(target, source, &Pose::identity());
            let found = outcome.target_from_source;
            let errors = (translation_error_m(&found, &truth), rotation_error_deg(&found, &truth));
            assert!(outcome.stop.is_success() && errors.0 < most_m && errors.1 < most_deg, "{errors:?} {outcome:?}");
        }
    }
}
