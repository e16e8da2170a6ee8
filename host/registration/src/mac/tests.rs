//! Registration with maximal cliques on matches whose motion is known.

use echoloop_clouds::pose::{read_pose, rotation_error_deg};
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::correspondences::length_difference_m;
use crate::tests::on_threads;

fn random_point(rng: &mut ChaCha8Rng, half_m: f64) -> Point3<f64> {
    Point3::from([0; 3].map(|_| rng.random_range(-half_m..half_m)))
}

/// Matches in a box 80 m wide: some moved by the truth with noise of ±5 cm an axis, the rest at
/// random.
fn matches(seed: u64, truth: &Pose, inliers: usize, outliers: usize) -> Vec<PointPair> {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut pairs = Vec::new();
    for index in 0..inliers + outliers {
        let source = random_point(rng, 40.0);
        let moved = truth * source + random_point(rng, 0.05).coords;
        let target = if index < inliers { moved } else { random_point(rng, 40.0) };
        pairs.push(PointPair { source, target });
    }
    pairs
}

fn outdoor() -> Mac {
    Mac::new(MacConfig::outdoor()).unwrap()
}

fn error_m(outcome: &Outcome, truth: &Pose) -> f64 {
    (truth.inverse() * outcome.target_from_source).translation.vector.norm()
}

#[test]
fn any_motion_is_found_among_97_of_100_wrong_matches_in_both_directions() {
    for seed in 0..8 {
        let yaw = -3.0 + 0.85 * seed as f64;
        let truth = Pose::new(Vector3::new(12.0, -7.0, 0.5), Vector3::new(0.02, -0.03, yaw));
        let forth = matches(seed, &truth, 45, 1455);
        let back: Vec<PointPair> = forth
            .iter()
            .map(|pair| PointPair { source: pair.target, target: pair.source })
            .collect();
        for (pairs, truth) in [(forth, truth), (back, truth.inverse())] {
            let outcome = outdoor().solve(&pairs);
            assert_eq!(outcome.stop, StopReason::Converged, "seed {seed}");
            assert!(error_m(&outcome, &truth) < 0.03, "seed {seed}: {}", error_m(&outcome, &truth));
            assert!(rotation_error_deg(&outcome.target_from_source, &truth) < 0.1, "seed {seed}");
            let consensus = outcome.consensus.unwrap();
            assert!(consensus.matches == 1500 && (45..60).contains(&consensus.inliers));
            assert!(outcome.rmse_m < 0.15 && consensus.margin.is_none_or(|margin| margin > 1.5));
        }
    }
}

#[test]
fn random_matches_are_no_consensus() {
    for seed in 0..40 {
        let count = 50 + 50 * seed as usize;
        assert_eq!(
            outdoor().solve(&matches(seed, &Pose::identity(), 0, count)).stop,
            StopReason::NoConsensus,
            "{count}"
        );
    }
}

#[test]
fn too_few_matches_are_named_and_leave_the_initial_guess() {
    let start = Pose::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, 0.0, 0.2));
    let two = matches(0, &start, 2, 0);
    let broken = [PointPair { source: Point3::new(f64::NAN, 0.0, 0.0), ..two[0] }; 9];
    for pairs in [&[][..], &two[..1], &two[..], &broken[..]] {
        let report = outdoor().report(pairs, &start);
        assert_eq!(report.outcome.stop, StopReason::TooFewMatches);
        assert_eq!(report.outcome.target_from_source, start);
        assert_eq!(report.outcome.consensus.map(|consensus| consensus.matches), Some(pairs.len()));
    }
}

#[test]
fn matches_that_determine_no_motion_are_no_consensus() {
    let pair = matches(0, &Pose::identity(), 1, 0)[0];
    let line = |i: usize| PointPair {
        source: [i as f64, 0.0, 0.0].into(),
        target: [0.0, i as f64, 1.0].into(),
    };
    let huge = PointPair { source: [1e200, 0.0, 0.0].into(), target: [0.0, -1e200, 1e200].into() };
    let table =
        [vec![pair; 300], (0..300).map(line).collect(), vec![huge; 9], vec![pair, pair, pair]];
    for pairs in table {
        assert_eq!(outdoor().solve(&pairs).stop, StopReason::NoConsensus);
    }
}

#[test]
fn points_of_one_plane_duplicates_and_broken_matches_do_not_mislead() {
    let truth = Pose::new(Vector3::new(-20.0, 3.0, 1.0), Vector3::new(0.0, 0.0, 2.5));
    let mut pairs = matches(5, &truth, 60, 900);
    for pair in &mut pairs[..60] {
        pair.source.z = 0.0;
        pair.target = truth * pair.source;
    }
    pairs.extend_from_within(900..);
    pairs.push(PointPair { source: Point3::new(f64::NAN, 0.0, 0.0), target: Point3::origin() });
    pairs
        .push(PointPair { source: Point3::origin(), target: Point3::new(0.0, f64::INFINITY, 0.0) });
    let outcome = outdoor().solve(&pairs);
    assert_eq!(outcome.stop, StopReason::Converged);
    assert!(error_m(&outcome, &truth) < 0.02);
}

#[test]
fn matches_that_nearly_all_agree_are_thinned_and_searched_in_part_and_still_fitted_to_all() {
    let truth = Pose::new(Vector3::new(5.0, 0.0, 0.0), Vector3::new(0.0, 0.0, 0.3));
    // Exact: one clique. With noise near the tolerance: edges missing at random, more cliques than
    // could be counted.
    for noise_m in [0.0, 0.25] {
        let rng = &mut ChaCha8Rng::seed_from_u64(1);
        let pairs: Vec<PointPair> = (0..2500)
            .map(|_| {
                let source = random_point(rng, 40.0);
                PointPair {
                    source,
                    target: truth * source + random_point(rng, 1.0).coords * noise_m,
                }
            })
            .collect();
        let report = outdoor().report(&pairs, &Pose::identity());
        assert_eq!(report.outcome.stop, StopReason::Converged);
        assert!(report.nodes < 2500 && error_m(&report.outcome, &truth) < 0.02);
        assert_eq!(report.outcome.pairs, 2500);
        assert_eq!(report.cut_searches > 0, noise_m > 0.0, "{noise_m} m");
    }
}

#[test]
fn more_matches_than_the_most_are_thinned_and_the_motion_still_found() {
    let truth = Pose::new(Vector3::new(5.0, 1.0, 0.0), Vector3::new(0.0, 0.0, -2.0));
    let pairs = matches(3, &truth, 150, 2850);
    let mac = Mac::new(MacConfig { max_matches: 500, ..MacConfig::outdoor() }).unwrap();
    let report = mac.report(&pairs, &Pose::identity());
    assert_eq!((report.nodes, report.outcome.stop), (500, StopReason::Converged));
    assert!(report.outcome.pairs >= 150 && error_m(&report.outcome, &truth) < 0.02);
}

#[test]
fn one_thread_and_four_give_the_same_bytes() {
    let pairs = matches(9, &Pose::identity(), 120, 1800);
    let on = |threads| on_threads(threads, || outdoor().report(&pairs, &Pose::identity()));
    assert_eq!(on(1), on(4));
}

proptest! {
    #[test]
    fn degrees_are_those_of_the_lengths_in_f64(
        points in prop::collection::vec(prop::array::uniform6(-9.0f64..9.0), 1..200),
        tolerance_m in 1e-3f64..3.0,
        shift_m in prop_oneof![Just(0.0), Just(1e5)],
    ) {
        let pair = |v: &[f64; 6]| PointPair {
            source: [v[0] + shift_m, v[1], v[2]].into(),
            target: [v[3], v[4] - shift_m, v[5]].into(),
        };
        let pairs: Vec<PointPair> = points.iter().map(pair).collect();
        let compatible =
            Compatible::new(&pairs, &LengthBounds { tolerance_m, least_length_m: 0.0 });
        let near = |a: &PointPair, b: &PointPair| length_difference_m(a, b) < tolerance_m;
        let degrees: Vec<u32> =
            pairs.iter().map(|a| pairs.iter().filter(|b| near(a, b)).count() as u32 - 1).collect();
        prop_assert_eq!(compatible.degrees, degrees);
    }

    #[test]
    fn no_matches_make_it_panic(
        points in prop::collection::vec(prop::array::uniform6(any::<f64>()), 0..40),
    ) {
        let pair = |v: &[f64; 6]| PointPair {
            source: [v[0], v[1], v[2]].into(),
            target: [v[3], v[4], v[5]].into(),
        };
        let pairs: Vec<PointPair> = points.iter().map(pair).collect();
        let outcome = outdoor().solve(&pairs);
        let rows = echoloop_clouds::pose::to_rows(&outcome.target_from_source);
        prop_assert!(rows.iter().all(|v| v.is_finite()));
    }
}

/// Matches on a line, whose lengths a motion would have to stretch by 2, 3 and 5 cm.
#[test]
fn an_edge_weighs_one_less_the_square_of_its_share_and_backs_the_others() {
    let pair = |source: f64, target: f64| PointPair {
        source: [source, 0.0, 0.0].into(),
        target: [target, 0.0, 0.0].into(),
    };
    let pairs = [pair(0.0, 0.0), pair(10.0, 10.02), pair(30.0, 30.05)];
    let bounds = LengthBounds { tolerance_m: 0.09, least_length_m: 0.0 };
    let graph = Graph::new(&pairs, &Compatible::new(&pairs, &bounds), 0.1);
    let same = |got: &[f32], expected: [f32; 2]| {
        assert_eq!(got.len(), 2);
        let near = got.iter().zip(expected).all(|(got, expected)| (got - expected).abs() < 1e-5);
        assert!(near, "{got:?}, not {expected:?}");
    };
    same(graph.weights(0), [0.96, 0.75]); // 1 - 0.2², 1 - 0.5²
    same(graph.weights(1), [0.96, 0.91]); // and 1 - 0.3²
    same(graph.weights(2), [0.75, 0.91]);
    // Each edge times the two that back it: all three the same here.
    let second = graph.second_order();
    (0..3).for_each(|node| same(second.weights(node), [0.6552; 2]));
    // Two edges at one match back none: nothing joins their other ends.
    let edges = [(0, 1, 0.5), (0, 2, 0.25)];
    assert_eq!(Graph::from_edges(3, &edges).second_order().all_weights(), [0.0; 4]);
    // A fourth match that both ends of an edge know backs it with its own two edges.
    let edges = [(0, 1, 0.5), (0, 2, 0.25), (0, 3, 0.75), (1, 2, 1.0), (1, 3, 0.125)];
    let backed = Graph::from_edges(4, &edges).second_order();
    assert_eq!(backed.weights(0)[0], 0.5 * (0.25 * 1.0 + 0.75 * 0.125));
    assert_eq!(backed.weights(2), [0.25 * 0.5 * 1.0, 1.0 * 0.5 * 0.25]);
}

/// The matches that come with MAC's demonstration, and their motion.
fn demonstration() -> Option<(Vec<PointPair>, Pose)> {
    let folder = echoloop_needs::data("mac_correspondences")?;
    let text = std::fs::read_to_string(folder.join("corr_data.txt")).unwrap();
    let numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();
    let pair = |v: &[f64; 6]| PointPair {
        source: [v[0], v[1], v[2]].into(),
        target: [v[3], v[4], v[5]].into(),
    };
    Some((
        numbers.as_chunks().0.iter().map(pair).collect(),
        read_pose(&folder.join("GTmat.txt")).unwrap(),
    ))
}

#[test]
fn the_graphs_of_the_demonstration_are_those_that_numpy_computes_densely() {
    let Some((pairs, _)) = demonstration() else {
        return;
    };
    assert_eq!(pairs.len(), 5678);
    // Threshold of the score, edges in a triangle, and the sum of their second-order weights.
    for (threshold, edges, sum) in [(0.999, 13_418, 1.8608e4), (0.99, 137_600, 5.7023e5)] {
        let tolerance_m = 0.1 * f64::sqrt(1.0 - threshold);
        let bounds = LengthBounds { tolerance_m, least_length_m: 0.0 };
        let compatible = Compatible::new(&pairs, &bounds);
        let graph = Graph::new(&pairs, &compatible, 0.1).second_order();
        let backed = graph.all_weights().iter().filter(|g| **g > 0.0).count() / 2;
        let ours = graph.all_weights().iter().map(|g| f64::from(*g)).sum::<f64>() / 2.0;
        assert_eq!(backed, edges, "{threshold}");
        assert!((ours / sum - 1.0).abs() < 1e-4, "{threshold}: {ours}");
    }
}

#[test]
fn the_demonstration_is_registered_at_least_as_well_as_by_the_published_code() {
    let Some((pairs, truth)) = demonstration() else {
        return;
    };
    // The published code finds 5807 and 100358 cliques, and ends 1.14° and 1.55 cm off.
    for (threshold, cliques) in [(0.999, 5807), (0.99, 100_358)] {
        let length_tolerance_m = 0.1 * f64::sqrt(1.0 - threshold);
        let mac = Mac::new(MacConfig { length_tolerance_m, ..MacConfig::indoor() }).unwrap();
        let report = mac.report(&pairs, &Pose::identity());
        assert_eq!((report.outcome.stop, report.cut_searches), (StopReason::Converged, 0));
        assert!(report.cliques.abs_diff(cliques) <= 2, "{}", report.cliques);
        assert!(error_m(&report.outcome, &truth) < 0.016, "{}", error_m(&report.outcome, &truth));
        let turn_deg = rotation_error_deg(&report.outcome.target_from_source, &truth);
        assert!(turn_deg < 1.2, "{turn_deg}");
    }
}
