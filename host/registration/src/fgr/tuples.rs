//! The tuple test: matches that form triples which keep all their lengths.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::bits::members;
use crate::correspondences::{Columns, LengthBounds};
use crate::features::PointPair;

/// Matches that each match is first compared with, at most: drawn by the seed when there are more.
const SAMPLE: usize = 2048;

/// Matches whose triples are counted, at most: those consistent with most of the sample.
const CANDIDATES: usize = 1024;

/// A match in fewer triples than this share of the most is dropped.
const LEAST_SHARE: f64 = 0.02;

/// A match that passed the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Passed {
    /// Its index.
    pub(super) index: usize,
    /// The triples it takes part in, over the most of any match.
    pub(super) weight: f64,
}

/// The matches that take part in triples which pass, with their shares; at most `most`, ordered by
/// index.
///
/// Published, 100 triples a match are drawn and those kept that pass, so a match comes out as often
/// as its triples are drawn. With 3 % of the matches right, one draw in 37 000 holds three right
/// ones, and as many wrong ones pass by chance. Counting instead of drawing gives what the drawing
/// estimates: a match takes part in
///
/// ```text
/// T_i = #{ j < k : i~j, j~k, k~i }
/// ```
///
/// triples, which goes with the square of the number of matches that are right, and separates those
/// from the others by some hundreds. Counted among the [`CANDIDATES`] that are consistent with most
/// of a random [`SAMPLE`].
pub(super) fn passed(
    pairs: &[PointPair],
    bounds: &LengthBounds,
    most: usize,
    seed: u64,
) -> Vec<Passed> {
    let (columns, _) = Columns::new(pairs);
    let candidates = candidates(&columns, bounds, seed);
    let triples = triples(&columns.select(&candidates).graph(bounds));
    let top = triples.iter().copied().max().unwrap_or(0) as f64;
    let weighted = |(&index, &count): (&usize, &u64)| Passed { index, weight: count as f64 / top };
    let mut passed: Vec<Passed> = candidates.iter().zip(&triples).map(weighted).collect();
    // Without a triple the weights are 0 / 0, and none is kept.
    passed.retain(|passed| passed.weight >= LEAST_SHARE);
    passed.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.index.cmp(&b.index)));
    passed.truncate(most);
    passed.sort_by_key(|passed| passed.index);
    passed
}

/// The matches that are consistent with most others, ordered by index.
fn candidates(columns: &Columns, bounds: &LengthBounds, seed: u64) -> Vec<usize> {
    let n = columns.len();
    if n <= CANDIDATES {
        return (0..n).collect();
    }
    let counts = columns.counts(&columns.select(&random_sample(n, seed)), bounds);
    let mut order: Vec<usize> = (0..n).collect();
    order.select_nth_unstable_by_key(CANDIDATES, |&i| (std::cmp::Reverse(counts[i]), i));
    order.truncate(CANDIDATES);
    order.sort_unstable();
    order
}

/// Distinct indices below `n`, ascending.
fn random_sample(n: usize, seed: u64) -> Vec<usize> {
    let mut all: Vec<usize> = (0..n).collect();
    let mut drawn = all.partial_shuffle(&mut ChaCha8Rng::seed_from_u64(seed), SAMPLE).0.to_vec();
    drawn.sort_unstable();
    drawn
}

/// The triples that each candidate takes part in, from a row of bits for each.
fn triples(rows: &[Vec<u64>]) -> Vec<u64> {
    let common = |a: &[u64], b: &[u64]| -> u64 {
        a.iter().zip(b).map(|(a, b)| u64::from((a & b).count_ones())).sum()
    };
    // Each triple is met twice, once from either other corner.
    let of = |row: &Vec<u64>| members(row).map(|j| common(row, &rows[j])).sum::<u64>() / 2;
    rows.par_iter().map(of).collect()
}
