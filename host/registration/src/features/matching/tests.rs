//! Against the double loop.

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::row::Row;
use super::{Features, Match, mutual, mutual_baseline};
use crate::features::DIMENSIONS;
use crate::tests::on_threads;

/// The distance as its documentation says, term by term.
fn distance(a: &Row, b: &Row) -> f32 {
    let mut lanes = [0.0_f32; 8];
    for i in 0..32 {
        lanes[i % 8] += (a[i] - b[i]) * (a[i] - b[i]);
    }
    let halves = ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6]))
        + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
    halves + (a[32] - b[32]) * (a[32] - b[32])
}

fn nearest(row: &Row, rows: &[Row]) -> Option<(u32, f32)> {
    let valid = |row: &Row| row.iter().all(|x| x.is_finite()) && row.iter().any(|&x| x != 0.0);
    if !valid(row) {
        return None;
    }
    let others = (0..)
        .zip(rows)
        .filter(|(_, other)| valid(other))
        .map(|(index, other)| (index, distance(row, other)));
    let first = |best: Option<(u32, f32)>, other: (u32, f32)| match best {
        Some(best) if best.1 <= other.1 => Some(best),
        _ => Some(other),
    };
    others.filter(|other| other.1.is_finite()).fold(None, first)
}

fn naive(source: &Features, target: &Features) -> Vec<Match> {
    let pair = |(source_index, row): (u32, &Row)| {
        let (target_index, squared) = nearest(row, &target.rows)?;
        let back = nearest(&target.rows[target_index as usize], &source.rows)?;
        (back.0 == source_index).then_some(Match {
            source: source_index,
            target: target_index,
            squared,
        })
    };
    (0..).zip(&source.rows).filter_map(pair).collect()
}

/// Mixtures of a few shapes with noise, eleven bins that sum to 200, some rows empty or twice: as
/// FPFH is.
fn histograms(seed: u64, rows: usize) -> Features {
    let shapes = &mut ChaCha8Rng::seed_from_u64(7);
    let shapes: Vec<Row> =
        (0..40).map(|_| std::array::from_fn(|_| shapes.random::<f32>().powi(4))).collect();
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut row = |index: usize| {
        if index % 97 == 5 {
            return [0.0; DIMENSIONS];
        }
        let (a, b) = (shapes[rng.random_range(0..40)], shapes[rng.random_range(0..40)]);
        let (share, noise) = (rng.random::<f32>(), if index.is_multiple_of(5) { 0.0 } else { 0.1 });
        let share = if index.is_multiple_of(5) { (share * 8.0).floor() / 8.0 } else { share };
        let mut row: Row = std::array::from_fn(|i| {
            (a[i] * share + b[i] * (1.0 - share)) * (1.0 + noise * (rng.random::<f32>() - 0.5))
        });
        for block in row.chunks_mut(11) {
            let scale = 200.0 / block.iter().sum::<f32>();
            block.iter_mut().for_each(|x| *x *= scale);
        }
        row
    };
    Features { rows: (0..rows).map(&mut row).collect() }
}

fn uniform(seed: u64, rows: usize) -> Features {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    Features {
        rows: (0..rows).map(|_| std::array::from_fn(|_| rng.random::<f32>() * 100.0)).collect(),
    }
}

#[test]
fn histograms_match_as_the_double_loop_says() {
    for (sources, targets) in [(1, 700), (900, 1), (700, 900), (1500, 1100)] {
        let (source, target) = (histograms(1, sources), histograms(2, targets));
        assert_eq!(mutual(&source, &target), naive(&source, &target), "{sources} × {targets}");
    }
}

#[test]
fn uniform_rows_match_as_the_double_loop_says() {
    for rows in [7, 8, 9, 15, 16, 17, 31, 33, 127, 129, 600] {
        let (source, target) = (uniform(1, rows), uniform(2, rows + 3));
        assert_eq!(mutual(&source, &target), naive(&source, &target), "{rows}");
    }
}

#[test]
fn every_build_and_any_number_of_threads_give_the_same_bytes() {
    let (source, target) = (histograms(3, 6000), histograms(4, 7000));
    let on = |threads| on_threads(threads, || mutual(&source, &target));
    let matches = on(1);
    assert!(matches.len() > 500, "{} matches", matches.len());
    assert_eq!(matches, on(2));
    assert_eq!(matches, on(3));
    assert_eq!(matches, mutual_baseline(&source, &target));
}

#[test]
fn the_roles_can_be_swapped_where_no_distances_are_equal() {
    let (source, target) = (uniform(5, 400), uniform(6, 500));
    let mut swapped: Vec<_> = mutual(&target, &source)
        .iter()
        .map(|m| Match { source: m.target, target: m.source, ..*m })
        .collect();
    swapped.sort_by_key(|m| m.source);
    assert_eq!(mutual(&source, &target), swapped);
}

#[test]
fn distances_beyond_f32_match_nothing_and_tiny_ones_do() {
    for scale in [1e-30, 1e-20, 1e15, 1e17, 1e25, 3e36] {
        let scaled = |features: Features| Features {
            rows: features.rows.iter().map(|r| r.map(|x| x * scale)).collect(),
        };
        let (source, target) = (scaled(uniform(1, 60)), scaled(uniform(2, 70)));
        assert_eq!(mutual(&source, &target), naive(&source, &target), "{scale}");
    }
    let far = |x: f32| Features { rows: vec![[x; DIMENSIONS]] };
    assert_eq!(mutual(&far(3e38), &far(-3e38)), []);
}

#[test]
fn without_rows_there_are_no_matches() {
    let (none, empty, some) =
        (Features::default(), Features { rows: vec![[0.0; DIMENSIONS]; 20] }, uniform(1, 20));
    for nothing in [&none, &empty] {
        assert_eq!(mutual(nothing, &some), []);
        assert_eq!(mutual(&some, nothing), []);
        assert_eq!(mutual(nothing, nothing), []);
    }
}

/// Rows on a coarse lattice of few axes, so that most distances are equal to others; some zero,
/// some not finite.
fn lattice() -> impl Strategy<Value = Features> {
    let value = prop_oneof![8 => Just(0.0_f32), 4 => Just(1.0), 2 => Just(2.0)];
    let row = (prop::collection::vec(value, DIMENSIONS), 0..40_u8).prop_map(|(values, kind)| {
        let mut row: Row = std::array::from_fn(|i| if i % 8 == 0 { values[i] } else { 0.0 });
        match kind {
            0 => row[5] = f32::NAN,
            1 => row[32] = f32::INFINITY,
            2 => row = [0.0; DIMENSIONS],
            _ => {}
        }
        row
    });
    prop::collection::vec(row, 0..150).prop_map(|rows| Features { rows })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn of_equal_distances_the_lower_index_wins(source in lattice(), target in lattice()) {
        let expected = naive(&source, &target);
        prop_assert_eq!(mutual(&source, &target), expected.clone());
        prop_assert_eq!(mutual_baseline(&source, &target), expected);
    }
}
