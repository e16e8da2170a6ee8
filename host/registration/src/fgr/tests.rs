//! Matches with known motions, and matches that hold none.

use echoloop_clouds::pose::{rotation_error_deg, to_rows, translation_error_m};
use nalgebra::Point3;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::Consensus;
use crate::tests::on_threads;

fn fgr() -> Fgr {
    Fgr::new(FgrConfig::outdoor()).unwrap()
}

fn open3d() -> Fgr {
    Fgr::new(FgrConfig { mode: FgrMode::Open3d, ..FgrConfig::outdoor() }).unwrap()
}

fn pose(shift: [f64; 3], turn: [f64; 3]) -> Pose {
    Pose::new(shift.into(), turn.into())
}

fn point(rng: &mut ChaCha8Rng) -> Point3<f64> {
    Point3::from([80.0, 80.0, 10.0].map(|side: f64| (rng.random::<f64>() - 0.5) * side))
}

/// `right` matches moved by `truth` with up to 0.1 m of error along each axis, and `wrong` ones
/// between any two points.
fn matches(right: usize, wrong: usize, truth: &Pose, seed: u64) -> Vec<PointPair> {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut pairs: Vec<PointPair> = (0..right)
        .map(|_| {
            let source = point(rng);
            let error = nalgebra::Vector3::from([0; 3].map(|_| rng.random::<f64>() * 0.2 - 0.1));
            PointPair { source, target: truth * source + error }
        })
        .collect();
    pairs.extend((0..wrong).map(|_| PointPair { source: point(rng), target: truth * point(rng) }));
    pairs.shuffle(rng);
    pairs
}

fn errors(outcome: &Outcome, truth: &Pose) -> (f64, f64) {
    let found = &outcome.target_from_source;
    (translation_error_m(found, truth), rotation_error_deg(found, truth))
}

fn is_near(outcome: &Outcome, truth: &Pose) -> bool {
    let (shift_m, turn_deg) = errors(outcome, truth);
    shift_m < 0.06 && turn_deg < 0.3
}

#[test]
fn any_yaw_is_found_in_both_directions_among_95_wrong_matches_of_100() {
    for step in 0..12 {
        let truth =
            pose([12.0, -7.0, 0.5], [0.02, -0.01, f64::from(step) * std::f64::consts::PI / 6.0]);
        for (right, wrong) in [(200, 0), (150, 350), (150, 2850)] {
            let forward = matches(right, wrong, &truth, step as u64);
            let swap = |pair: &PointPair| PointPair { source: pair.target, target: pair.source };
            let backward: Vec<PointPair> = forward.iter().map(swap).collect();
            for (pairs, truth) in [(&forward, truth), (&backward, truth.inverse())] {
                let outcome = fgr().solve(pairs);
                assert_eq!(
                    outcome.stop,
                    StopReason::Converged,
                    "{right} + {wrong}, yaw {step}: {outcome:?}"
                );
                assert!(
                    is_near(&outcome, &truth),
                    "{right} + {wrong}, yaw {step}: {:?}",
                    errors(&outcome, &truth)
                );
                assert!(
                    outcome.pairs >= right && outcome.pairs < right + wrong / 50 + 1,
                    "{outcome:?}"
                );
                assert_eq!(
                    outcome.consensus.map(|c| (c.matches, c.inliers)),
                    Some((pairs.len(), outcome.pairs))
                );
            }
        }
    }
}

#[test]
fn annealing_to_the_pair_distance_finds_what_open3ds_schedule_does_not() {
    let found = |fgr: &Fgr| {
        let near = |&seed: &u64| {
            let truth = pose([10.0, 3.0, 0.2], [0.0, 0.0, seed as f64 * 0.7]);
            is_near(&fgr.solve(&matches(120, 1400, &truth, seed)), &truth)
        };
        (0..8).filter(near).count()
    };
    assert_eq!(found(&fgr()), 8);
    assert!(found(&open3d()) < 4);
}

#[test]
fn open3ds_mode_comes_near_when_most_matches_are_right() {
    let truth = pose([4.0, -2.0, 0.3], [0.0, 0.0, 0.4]);
    let outcome = open3d().solve(&matches(300, 60, &truth, 2));
    let (shift_m, turn_deg) = errors(&outcome, &truth);
    assert!(shift_m < 1.0 && turn_deg < 3.0, "{outcome:?}");
}

#[test]
fn matches_that_hold_no_motion_return_the_identity_and_a_reason() {
    let broken = PointPair { source: [f64::NAN, 0.0, 0.0].into(), target: [0.0; 3].into() };
    let far = PointPair { source: [f64::MAX; 3].into(), target: [f64::INFINITY; 3].into() };
    let same = PointPair { source: [1.0; 3].into(), target: [2.0; 3].into() };
    let line = |i: i32| PointPair {
        source: [f64::from(i), 0.0, 1.0].into(),
        target: [0.0, f64::from(i), 2.0].into(),
    };
    let table: [(&str, Vec<PointPair>, StopReason); 6] = [
        ("none", vec![], StopReason::TooFewMatches),
        ("two", matches(2, 0, &Pose::identity(), 1), StopReason::TooFewMatches),
        ("not a number", vec![broken; 50], StopReason::TooFewMatches),
        ("beyond f64's squares", vec![far; 50], StopReason::TooFewMatches),
        ("one place", vec![same; 50], StopReason::NoConsensus),
        ("a line", (0..50).map(line).collect(), StopReason::NoConsensus),
    ];
    for (name, pairs, stop) in table {
        let outcome = fgr().solve(&pairs);
        let searched =
            if ["not a number", "beyond f64's squares"].contains(&name) { 0 } else { pairs.len() };
        let consensus =
            Some(Consensus { matches: pairs.len(), searched, inliers: 0, margin: None });
        assert_eq!(
            outcome,
            Outcome { consensus, ..Outcome::nothing(&Pose::identity(), stop) },
            "{name}"
        );
        assert!(!open3d().solve(&pairs).stop.is_success(), "{name}");
    }
}

#[test]
fn unrelated_matches_are_refused_with_the_best_motion_found() {
    for (seed, n) in [(1, 60), (2, 500), (3, 3000), (4, 6000)] {
        let outcome = fgr().solve(&matches(0, n, &Pose::identity(), seed));
        assert_eq!(outcome.stop, StopReason::NoConsensus, "{outcome:?}");
    }
}

#[test]
fn matches_of_a_plane_and_repeated_ones_and_broken_ones_do_no_harm() {
    let truth = pose([5.0, 1.0, -0.3], [0.0, 0.0, 2.5]);
    let mut pairs = matches(150, 600, &truth, 9);
    for pair in &mut pairs {
        let flat = Point3::new(pair.source.x, pair.source.y, 0.0);
        pair.target += truth * flat - truth * pair.source;
        pair.source = flat;
    }
    assert!(is_near(&fgr().solve(&pairs), &truth), "a plane");
    pairs.extend_from_within(..300);
    assert!(is_near(&fgr().solve(&pairs), &truth), "repeated");
    pairs.extend(
        [PointPair { source: [f64::NAN; 3].into(), target: [f64::NEG_INFINITY; 3].into() }; 100],
    );
    let outcome = fgr().solve(&pairs);
    assert!(is_near(&outcome, &truth), "broken");
    assert_eq!(outcome.consensus.unwrap().matches, pairs.len());
}

#[test]
fn seeds_and_threads_and_order_give_the_same_motion() {
    let truth = pose([9.0, 8.0, 0.1], [0.0, 0.1, -2.0]);
    let mut pairs = matches(120, 2900, &truth, 3);
    let on = |threads, fgr: Fgr| on_threads(threads, || fgr.solve(&pairs));
    let bits = |outcome: &Outcome| to_rows(&outcome.target_from_source).map(f64::to_bits);
    for method in [fgr(), open3d()] {
        let (one, two) = (on(1, method.clone()), on(2, method));
        assert_eq!(one, two);
        assert_eq!(bits(&one), bits(&two));
    }
    let before = fgr().solve(&pairs);
    let other = Fgr::new(FgrConfig { seed: 7, ..FgrConfig::outdoor() }).unwrap().solve(&pairs);
    pairs.reverse();
    for after in [other, fgr().solve(&pairs)] {
        let (shift_m, turn_deg) = errors(&after, &before.target_from_source);
        assert!(shift_m < 0.01 && turn_deg < 0.05, "{shift_m} m, {turn_deg}°");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn no_matches_make_it_panic(
        rows in prop::collection::vec(
            prop::array::uniform6(prop_oneof![any::<f64>(), -20.0f64..20.0]), 0..40
        ),
        max_iterations in 1usize..40,
    ) {
        let pair = |v: &[f64; 6]| PointPair {
            source: [v[0], v[1], v[2]].into(),
            target: [v[3], v[4], v[5]].into(),
        };
        let pairs: Vec<PointPair> = rows.iter().map(pair).collect();
        for mode in [FgrMode::Annealed, FgrMode::Open3d] {
            let outcome = Fgr::new(FgrConfig { mode, max_iterations, ..FgrConfig::outdoor() })
                .unwrap()
                .solve(&pairs);
            prop_assert!(to_rows(&outcome.target_from_source).iter().all(|v| v.is_finite()));
            prop_assert!(outcome.inlier_fraction <= 1.0 && outcome.rmse_m.is_finite());
        }
    }
}

/// Two groups of the same points: `right` matches that stay, `wrong` ones 5 δ to the side. By
/// symmetry the motion is a shift along x, and a fixed point t of
///
/// ```text
/// right w(t) t = wrong w(5δ - t) (5δ - t)      w(r) = (μ / (r² + μ))²
/// ```
fn two_groups(right: usize, wrong: usize, delta_m: f64) -> Vec<PointPair> {
    let rng = &mut ChaCha8Rng::seed_from_u64(3);
    let points: Vec<Point3<f64>> = (0..40).map(|_| point(rng)).collect();
    let moved = |source: &Point3<f64>, shift_m: f64| PointPair {
        source: *source,
        target: source + nalgebra::Vector3::new(shift_m, 0.0, 0.0),
    };
    let shifts = std::iter::repeat_n(0.0, right).chain(std::iter::repeat_n(5.0 * delta_m, wrong));
    shifts.flat_map(|shift_m| points.iter().map(move |p| moved(p, shift_m))).collect()
}

fn fixed_point_m(right: f64, wrong: f64, delta_m: f64, mu: f64) -> f64 {
    let w = |r: f64| (mu / (r * r + mu)) * (mu / (r * r + mu));
    (0..10_000).fold(0.0, |t: f64, _| {
        let (here, there) = (right * w(t), wrong * w(5.0 * delta_m - t));
        5.0 * delta_m * there / (here + there)
    })
}

#[test]
fn the_annealing_ends_at_the_square_of_the_pair_distance() {
    for (delta_m, iterations) in [(0.5, 64), (0.5, 400), (0.2, 128), (2.0, 16)] {
        let pairs = two_groups(3, 2, delta_m);
        let passed: Vec<tuples::Passed> =
            (0..pairs.len()).map(|index| tuples::Passed { index, weight: 1.0 }).collect();
        let run = annealed::anneal(&pairs, &passed, delta_m, iterations).unwrap();
        let shift_m = run.target_from_source.translation.vector.x;
        let at = |mu: f64| fixed_point_m(3.0, 2.0, delta_m, mu);
        let expected = at(delta_m * delta_m);
        assert!(
            (shift_m - expected).abs() < 2e-3 * delta_m,
            "{delta_m} m, {iterations}: {shift_m} m, not {expected} m"
        );
        // Where a kernel twice as wide, or half, would end is told apart.
        for other in [0.25, 4.0] {
            assert!((at(other * delta_m * delta_m) - expected).abs() > 4e-3 * delta_m);
        }
    }
}
