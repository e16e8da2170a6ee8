//! Registration recovers known motions, and says why when it cannot.

use echoloop_clouds::{Cloud, read_cloud};
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::*;
use echoloop_clouds::pose::{
    Pose, read_pose, relative, rotation_error_deg, to_rows, translation_error_m,
};

fn pose(shift: [f64; 3], turn: [f64; 3]) -> Pose {
    Pose::new(shift.into(), turn.into())
}

/// Uniform points on a parallelogram.
fn patch(
    rng: &mut ChaCha8Rng,
    n: usize,
    corner: [f64; 3],
    a: [f64; 3],
    b: [f64; 3],
) -> Vec<Point3<f64>> {
    let (corner, a, b) = (Point3::from(corner), Vector3::from(a), Vector3::from(b));
    (0..n).map(|_| corner + a * rng.random::<f64>() + b * rng.random::<f64>()).collect()
}

/// A yard 20 m wide seen from 1.8 m above its floor: floor, two walls, a box and three poles,
/// sampled anew per seed.
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
            Point3::new(
                x + 0.2 * angle.cos(),
                y + 0.2 * angle.sin(),
                rng.random::<f64>() * 4.0 - 1.8,
            )
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

/// A registration method, and what it can do.
struct Method {
    name: &'static str,
    /// With settings for a yard, or its own for outdoor scans.
    outdoor: Box<dyn Registration>,
    /// With the settings it suggests for two clouds.
    suggested: fn(&Cloud, &Cloud) -> Box<dyn Registration>,
    /// True when it searches the whole space: it finds any turn and needs no start.
    global: bool,
}

/// Every method: all tests below run for each.
fn methods() -> Vec<Method> {
    let local = |name, outdoor, suggested| Method { name, outdoor, suggested, global: false };
    let global = |name, outdoor, suggested| Method { name, outdoor, suggested, global: true };
    // The yard is 20 m wide: voxels of 0.5 m, for scans of a town, would leave little of it.
    let yard = FeatureConfig::from_voxel(0.3);
    vec![
        global("FGR", Box::new(Fgr::new(FgrConfig::from_features(yard)).unwrap()), |a, b| {
            Box::new(Fgr::new(FgrConfig::from_features(suggest_features(a, b))).unwrap())
        }),
        global("MAC", Box::new(Mac::new(MacConfig::from_features(yard)).unwrap()), |a, b| {
            Box::new(Mac::new(MacConfig::from_features(suggest_features(a, b))).unwrap())
        }),
        local("ICP", Box::new(icp()), |a, b| Box::new(Icp::new(suggest(a, b)).unwrap())),
        local("GICP", Box::new(Gicp::new(GicpConfig::outdoor()).unwrap()), |a, b| {
            Box::new(Gicp::new(GicpConfig::from(&suggest(a, b))).unwrap())
        }),
    ]
}

/// The local ones, which a plane leaves undetermined rather than unmatched.
fn local_methods() -> impl Iterator<Item = Method> {
    methods().into_iter().filter(|method| !method.global)
}

/// Result on so many threads.
pub(crate) fn on_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run)
}

/// A yard seen from `world_from_sensor`, with errors of the range: 8 cm where the sensor sees it by
/// little light (a quarter of the azimuths), else 4 mm; and the cloud told so.
fn seen_dimly(seed: u64, world_from_sensor: &Pose) -> Cloud {
    let mut cloud = seen(&yard(seed), world_from_sensor);
    let rng = &mut ChaCha8Rng::seed_from_u64(seed + 1000);
    let sd_m = |p: &Point3<f32>| if p.x > 0.0 && p.y > 0.0 { 0.08 } else { 0.004 };
    cloud.range_sd_m = Some(cloud.points.iter().map(sd_m).collect());
    for point in &mut cloud.points {
        // Twelve uniform numbers less six: variance 1.
        let normal: f32 = (0..12).map(|_| rng.random::<f32>()).sum::<f32>() - 6.0;
        *point += point.coords.normalize() * (sd_m(point) * normal);
    }
    cloud
}

#[test]
fn a_sensor_that_tells_how_sure_its_ranges_are_is_registered_nearer_and_surer() {
    let second = pose([0.4, -0.2, 0.05], [0.01, -0.01, 0.06]);
    for method in local_methods() {
        let (mut squared, mut variance, mut normalized) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        for seed in 0..8 {
            let told = [(50 + seed, &Pose::identity()), (70 + seed, &second)]
                .map(|(seed, pose)| seen_dimly(seed, pose));
            let silent = told.clone().map(|cloud| Cloud { range_sd_m: None, ..cloud });
            for (i, [target, source]) in [told, silent].into_iter().enumerate() {
                let outcome = method.outdoor.register(&target, &source, &Pose::identity());
                let covariance = outcome.covariance.unwrap();
                squared[i] += translation_error_m(&outcome.target_from_source, &second).powi(2);
                variance[i] += covariance.0.diagonal().rows(3, 3).sum();
                normalized[i] += covariance
                    .normalized_error_squared(&outcome.target_from_source, &second)
                    .unwrap()
                    / 8.0;
            }
        }
        let name = method.name;
        assert!(squared[0] < 0.6 * squared[1], "{name}: {squared:?} m²");
        assert!(variance[0] < 0.5 * variance[1], "{name}: {variance:?} m²");
        assert!((0.4..2.5).contains(&normalized[0]), "{name}: {normalized:?}");
    }
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
    for (target, source, truth) in
        [(&a, &b, relative(&first, &second)), (&b, &a, relative(&second, &first))]
    {
        for start in &starts {
            for method in methods() {
                let outcome = method.outdoor.register(target, source, start);
                assert_eq!(outcome.stop, StopReason::Converged, "{}: {outcome:?}", method.name);
                let found = outcome.target_from_source;
                let errors =
                    (translation_error_m(&found, &truth), rotation_error_deg(&found, &truth));
                let most = if method.global { (0.1, 0.5) } else { (0.01, 0.05) };
                assert!(
                    errors.0 < most.0 && errors.1 < most.1,
                    "{}: {errors:?} from {start}",
                    method.name
                );
                assert_eq!(outcome.consensus.is_some(), method.global, "{}", method.name);
            }
        }
    }
}

#[test]
fn global_methods_recover_any_yaw() {
    for degrees in [0.0, 45.0, 90.0, 180.0, -120.0f64] {
        let second = pose([3.0, -2.0, 0.1], [0.0, 0.0, degrees.to_radians()]);
        let (a, b) = (seen(&yard(1), &Pose::identity()), seen(&yard(2), &second));
        for method in methods().iter().filter(|method| method.global) {
            let outcome = method.outdoor.register(&a, &b, &Pose::identity());
            assert_eq!(outcome.stop, StopReason::Converged, "{} at {degrees}°", method.name);
            let found = outcome.target_from_source;
            let errors =
                (translation_error_m(&found, &second), rotation_error_deg(&found, &second));
            assert!(errors.0 < 0.3 && errors.1 < 1.0, "{} at {degrees}°: {errors:?}", method.name);
        }
    }
}

#[test]
fn a_coarse_start_recovers_a_motion_beyond_the_pair_distance() {
    let second = pose([2.5, -1.0, 0.1], [0.0, 0.02, 0.2]);
    let (a, b) = (seen(&yard(1), &Pose::identity()), seen(&yard(2), &second));
    for method in methods() {
        let outcome = (method.suggested)(&a, &b).register(&a, &b, &Pose::identity());
        assert_eq!(outcome.stop, StopReason::Converged, "{}", method.name);
        let error_m = translation_error_m(&outcome.target_from_source, &second);
        assert!(
            error_m < if method.global { 0.3 } else { 0.02 },
            "{}: {error_m} m, {outcome:?}",
            method.name
        );
    }
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
        for method in local_methods() {
            let outcome = method.outdoor.register(&target, &source, &start);
            assert_eq!(outcome.stop, StopReason::Degenerate, "{}: {outcome:?}", method.name);
            assert_eq!(
                outcome.observability.unwrap().unobservable,
                open,
                "{}: {outcome:?}",
                method.name
            );
            let covariance = outcome.covariance.unwrap();
            let sd_m = covariance.translation_sd_m();
            assert!(sd_m[0] > 2.0 && sd_m[2] < 0.01, "{}: {sd_m:?}", method.name);
            assert!(covariance.0.cholesky().is_some(), "{}: {covariance:?}", method.name);
            let found = outcome.target_from_source.translation.vector;
            assert!(found.z.abs() < 0.01, "{}: the floor gives the height: {found}", method.name);
            assert!(
                (found.x - 0.1).abs() < 0.05,
                "{}: nothing gives x, so the start stands: {found}",
                method.name
            );
        }
    }
}

#[test]
fn clouds_that_cannot_be_registered_return_the_start_and_a_reason() {
    let good = seen(&yard(1), &Pose::identity());
    let line = cloud(&(0..500).map(|i| [i as f32 * 0.1, 1.0, 0.0]).collect::<Vec<_>>());
    let (empty, few, wide) =
        (StopReason::EmptyCloud, StopReason::TooFewPairs, StopReason::BadSettings);
    let table: [(&str, Cloud, StopReason); 8] = [
        ("empty", cloud(&[]), empty),
        ("not a number", cloud(&[[f32::NAN; 3]; 100]), empty),
        ("infinite", cloud(&[[f32::INFINITY, 0.0, 0.0]; 100]), empty),
        ("at range 0", cloud(&[[0.0; 3]; 100]), empty),
        ("one point", cloud(&[[1.0; 3]]), few),
        ("two points", cloud(&[[1.0; 3], [2.0; 3]]), few),
        ("duplicates", cloud(&[[1.0; 3]; 500]), few),
        ("far too wide", cloud(&[[f32::MAX; 3], [f32::MIN; 3]]), wide),
    ];
    let start = pose([0.1, 0.2, 0.3], [0.0, 0.0, 0.1]);
    for method in methods() {
        for (name, bad, reason) in &table {
            for (target, source) in [(&good, bad), (bad, &good), (bad, bad)] {
                let name = format!("{}: {name}", method.name);
                let outcome = method.outdoor.register(target, source, &start);
                let _ = (method.suggested)(target, source).register(target, source, &start);
                let matched_by_features = method.global && *reason == few;
                let expected =
                    if matched_by_features { StopReason::TooFewMatches } else { *reason };
                assert_eq!(outcome.stop, expected, "{name}");
                assert_eq!(outcome.target_from_source, start, "{name}");
            }
        }
    }
    for method in local_methods() {
        let has_no_normals = method.outdoor.register(&line, &line, &start);
        assert_eq!(has_no_normals.stop, few, "{}: a line", method.name);
        assert!(
            !method.outdoor.register(&good, &line, &start).stop.is_success(),
            "{}: a line on a yard",
            method.name
        );
        let far = pose([1e4, 0.0, 0.0], [0.0; 3]);
        assert_eq!(
            method.outdoor.register(&good, &good, &far),
            Outcome::nothing(&far, few),
            "{}",
            method.name
        );
        let nowhere = pose([f64::NAN; 3], [0.0; 3]);
        assert_eq!(method.outdoor.register(&good, &good, &nowhere).stop, few, "{}", method.name);
    }
}

#[test]
fn errors_are_as_large_as_the_covariance_says() {
    const PAIRS: u64 = 12;
    let noisy = |seed: u64| {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let mut noise =
            || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() * 0.03 - 12.0 * 0.5 * 0.03;
        let points: Vec<_> = yard(seed).into_iter().step_by(3).collect();
        points.iter().map(|p| p + Vector3::new(noise(), noise(), noise())).collect::<Vec<_>>()
    };
    let truth = pose([0.2, -0.1, 0.02], [0.01, -0.01, 0.02]);
    for method in local_methods() {
        let normalized = |pair: u64| {
            let (a, b) = (seen(&noisy(2 * pair), &Pose::identity()), noisy(2 * pair + 1));
            let outcome = method.outdoor.register(&a, &seen(&b, &truth), &Pose::identity());
            let covariance = outcome.covariance.unwrap();
            covariance.normalized_error_squared(&outcome.target_from_source, &truth).unwrap()
        };
        let mean = (0..PAIRS).map(normalized).sum::<f64>() / PAIRS as f64;
        // Below 1: what points of a scan share, besides, is not in this noise.
        assert!((0.15..2.0).contains(&mean), "{}: {mean}", method.name);
    }
}

#[test]
fn global_methods_leave_the_covariance_to_the_local_one_after_them() {
    let points = yard(1);
    let (a, b) =
        (seen(&points, &Pose::identity()), seen(&yard(2), &pose([2.0, 1.0, 0.0], [0.0, 0.0, 0.5])));
    let global = Fgr::new(FgrConfig::from_features(FeatureConfig::from_voxel(0.3))).unwrap();
    assert_eq!(global.register(&a, &b, &Pose::identity()).covariance, None);
    let refined = Refined { global, local: icp() }.register(&a, &b, &Pose::identity());
    assert!(refined.covariance.unwrap().translation_sd_m().iter().all(|sd_m| *sd_m < 0.05));
}

#[test]
fn one_thread_and_two_give_the_same_bytes() {
    let (a, b) = (
        seen(&yard(1), &Pose::identity()),
        seen(&yard(2), &pose([0.3, 0.1, 0.0], [0.0, 0.0, 0.05])),
    );
    let bits = |outcome: &Outcome| to_rows(&outcome.target_from_source).map(f64::to_bits);
    for method in methods() {
        let run = || method.outdoor.register(&a, &b, &Pose::identity());
        let (one, two) = (on_threads(1, run), on_threads(2, run));
        assert_eq!(one, two, "{}", method.name);
        assert_eq!(bits(&one), bits(&two), "{}", method.name);
    }
}

#[test]
fn the_order_of_the_points_does_not_matter() {
    let (a, b) = (
        seen(&yard(1), &Pose::identity()),
        seen(&yard(2), &pose([0.3, 0.1, 0.0], [0.0, 0.0, 0.05])),
    );
    let rng = &mut ChaCha8Rng::seed_from_u64(5);
    let (mut shuffled_a, mut shuffled_b) = (a.clone(), b.clone());
    shuffled_a.points.shuffle(rng);
    shuffled_b.points.shuffle(rng);
    for method in local_methods() {
        let before = method.outdoor.register(&a, &b, &Pose::identity());
        let after = method.outdoor.register(&shuffled_a, &shuffled_b, &Pose::identity());
        let apart_m = translation_error_m(&before.target_from_source, &after.target_from_source);
        assert!(apart_m < 1e-4, "{}: {apart_m} m", method.name);
        assert_eq!(before.stop, after.stop, "{}", method.name);
    }
}

/// Mostly near, often on a lattice (duplicates, planes, lines), sometimes no number or nowhere.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        100 => -20.0f32..20.0,
        100 => (-6i8..6).prop_map(|v| f32::from(v) * 0.5),
        1 => prop::sample::select(vec![
            f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1e30, -1e30,
        ]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_small_motion_of_the_same_points_is_undone_exactly(
        shift in prop::array::uniform3(-0.2f64..0.2),
        turn in prop::array::uniform3(-0.04f64..0.04),
        seed in 0u64..4,
    ) {
        // A voxel so small that it thins nothing: then source and target are the same points and
        // the truth is exact.
        let icp =
            Icp::new(IcpConfig { voxel_m: 1e-3, max_iterations: 100, ..IcpConfig::outdoor() })
                .unwrap();
        let gicp =
            Gicp::new(GicpConfig { voxel_m: 1e-3, max_iterations: 100, ..GicpConfig::outdoor() })
                .unwrap();
        let points: Vec<_> = yard(seed).into_iter().step_by(8).collect();
        let truth = pose(shift, turn);
        let (a, b) = (seen(&points, &Pose::identity()), seen(&points, &truth));
        for method in [&icp as &dyn Registration, &gicp] {
            let outcome = method.register(&a, &b, &Pose::identity());
            prop_assert_eq!(outcome.stop, StopReason::Converged);
            prop_assert!(
                translation_error_m(&outcome.target_from_source, &truth) < 1e-3,
                "{:?}",
                outcome
            );
        }
    }

    #[test]
    fn no_cloud_makes_it_panic(
        a in prop::collection::vec(prop::array::uniform3(coordinate()), 0..200),
        b in prop::collection::vec(prop::array::uniform3(-2.0f32..2.0), 0..200),
        shift in prop::array::uniform3(prop_oneof![9 => -2.0f64..2.0, 1 => any::<f64>()]),
    ) {
        for (target, source) in [(&a, &b), (&b, &a), (&b, &b)] {
            for method in methods() {
                let outcome =
                    method.outdoor.register(&cloud(target), &cloud(source), &pose(shift, [0.0; 3]));
                prop_assert!(outcome.inlier_fraction <= 1.0);
                let finite = |c: &Covariance| c.0.iter().all(|v| v.is_finite());
                prop_assert!(outcome.covariance.as_ref().is_none_or(finite), "{:?}", outcome);
            }
        }
    }
}

/// Two clouds, the motion that lays the second on the first, and the largest error of a local
/// method, m and degrees.
struct RealPair {
    name: &'static str,
    clouds: [Cloud; 2],
    truth: Pose,
    most: (f64, f64),
    /// True when local methods reach it from the identity.
    near: bool,
}

/// The real pairs below ECHOLOOP_DATA; none, with a message, where that is unset.
fn real_pairs() -> Vec<RealPair> {
    let Some(data) = echoloop_needs::data_folder("registration of real pairs") else {
        return Vec::new();
    };
    let truth = |file: &str| read_pose(&data.join(file)).unwrap();
    let pair = |name, files: [&str; 2], truth, most| {
        let clouds = files.map(|file| read_cloud(&data.join(file)).unwrap().0);
        RealPair { name, clouds, truth, most, near: true }
    };
    let ouster = relative(&truth("pair_ouster/T_world_0.txt"), &truth("pair_ouster/T_world_2.txt"));
    let carla =
        ["pairs_carla/scan_4188.ply", "pairs_carla/scan_4255.ply", "pairs_carla/scan_4325.ply"];
    let small_gicp = ["pair_small_gicp/target.ply", "pair_small_gicp/source.ply"];
    let libpointmatcher =
        ["pair_libpointmatcher/cloud.00000.vtk", "pair_libpointmatcher/cloud.00001.vtk"];
    let (first, second) =
        (truth("pairs_carla/T_4188_from_4255.txt"), truth("pairs_carla/T_4255_from_4325.txt"));
    vec![
        RealPair {
            near: false,
            ..pair("carla 1 and 3", [carla[0], carla[2]], first * second, (0.02, 0.1))
        },
        pair(
            "libpointmatcher",
            libpointmatcher,
            truth("pair_libpointmatcher/T_cloud0_from_cloud1.txt"),
            (0.05, 0.5),
        ),
        pair("small_gicp", small_gicp, truth("pair_small_gicp/T_target_source.txt"), (0.05, 0.5)),
        pair("ouster", ["pair_ouster/scan_0.ply", "pair_ouster/scan_2.ply"], ouster, (0.05, 0.2)),
        pair("carla 1", [carla[0], carla[1]], first, (0.02, 0.1)),
        pair("carla 2", [carla[1], carla[2]], second, (0.02, 0.1)),
    ]
}

impl RealPair {
    /// Target, source and truth, both ways.
    fn directions(&self) -> [(&Cloud, &Cloud, Pose); 2] {
        let [a, b] = &self.clouds;
        [(a, b, self.truth), (b, a, self.truth.inverse())]
    }

    /// Fails unless the outcome is a success near the truth.
    fn holds(&self, method: &str, outcome: &Outcome, truth: &Pose, most: (f64, f64)) {
        let found = outcome.target_from_source;
        let errors = (translation_error_m(&found, truth), rotation_error_deg(&found, truth));
        eprintln!("{method} on {}: {errors:.4?}", self.name);
        let near = errors.0 < most.0 && errors.1 < most.1;
        assert!(
            outcome.stop.is_success() && near,
            "{method} on {}: {errors:?} {outcome:?}",
            self.name
        );
    }
}

#[test]
fn real_pairs_come_within_the_tolerance_of_their_truth_from_the_identity() {
    for pair in real_pairs() {
        for (target, source, truth) in pair.directions() {
            for method in methods().iter().filter(|method| method.global || pair.near) {
                let outcome =
                    (method.suggested)(target, source).register(target, source, &Pose::identity());
                pair.holds(
                    method.name,
                    &outcome,
                    &truth,
                    if method.global { (0.3, 1.5) } else { pair.most },
                );
                if method.global {
                    let refinement = Icp::new(refinement(target, source)).unwrap();
                    let outcome = refinement.register(target, source, &outcome.target_from_source);
                    pair.holds(&format!("{} refined", method.name), &outcome, &truth, pair.most);
                }
            }
        }
    }
}

/// Errors of a global method: half a voxel to two, and up to 2°.
#[test]
fn a_rough_motion_is_refined_within_the_tolerance() {
    let rough = [
        pose([0.3, -0.2, 0.1], [0.005, -0.01, 0.02]),
        pose([-0.4, 0.3, -0.1], [-0.01, 0.005, -0.03]),
        pose([0.0, 0.6, 0.0], [0.0, 0.0, 0.035]),
    ];
    for pair in real_pairs() {
        for (target, source, truth) in pair.directions() {
            for error in &rough {
                let icp = Icp::new(refinement(target, source)).unwrap();
                let outcome = icp.register(target, source, &(truth * error));
                pair.holds("refinement", &outcome, &truth, pair.most);
            }
        }
    }
}

/// Settings that refine the motion that a method of suggested features found.
fn refinement(target: &Cloud, source: &Cloud) -> IcpConfig {
    Suggestions::new(target, source).refinement(suggest_features(target, source).voxel_m)
}

/// Every scale and guess, then the scans' own verdict, as `register` runs it.
fn auto(target: &Cloud, source: &Cloud) -> Box<dyn Registration> {
    let suggestions = Suggestions::new(target, source);
    build(&suggestions.method(crate::Method::Auto, FgrMode::Annealed, None), None).unwrap()
}

#[test]
fn auto_finds_the_real_pairs_and_the_scans_confirm_them() {
    for pair in real_pairs() {
        for (target, source, truth) in pair.directions() {
            let outcome = auto(target, source).register(target, source, &Pose::identity());
            pair.holds("auto", &outcome, &truth, pair.most);
            eprintln!("{:?}", outcome.overlap);
        }
    }
}

#[test]
fn auto_keeps_no_guess_that_lays_nothing_on_anything() {
    let truth = pose([2.0, 1.0, 0.1], [0.0, 0.0, 0.3]);
    let (target, source) = (seen(&yard(3), &Pose::identity()), seen(&yard(4), &truth));
    let guess = pose([900.0, 0.0, 0.0], [0.0; 3]);
    let outcome = auto(&target, &source).register(&target, &source, &guess);
    assert_eq!(outcome.stop, StopReason::Converged, "{outcome:?}");
    assert!(translation_error_m(&outcome.target_from_source, &truth) < 0.05, "{outcome:?}");
}

/// No motion lays one of these scans on another that is of another place.
#[test]
fn scans_of_different_places_are_confirmed_by_no_method() {
    let pairs = real_pairs();
    for (i, a) in pairs.iter().enumerate() {
        for b in pairs[i + 1..].iter().filter(|b| !same_place(a.name, b.name)) {
            let (target, source) = (&a.clouds[0], &b.clouds[1]);
            let suggestions = Suggestions::new(target, source);
            let voxel_m = suggestions.scene_voxel_m();
            for method in [crate::Method::Icp, crate::Method::Auto] {
                let config = suggestions.method(method, FgrMode::Annealed, None);
                let method = Confirmed { method: build(&config, None).unwrap(), voxel_m };
                let outcome = method.register(target, source, &Pose::identity());
                eprintln!("{} and {}: {} {:?}", a.name, b.name, outcome.stop, outcome.overlap);
                assert!(!outcome.stop.is_success(), "{} and {}: {outcome:?}", a.name, b.name);
            }
        }
    }
}

fn same_place(a: &str, b: &str) -> bool {
    a.starts_with("carla") && b.starts_with("carla")
}
