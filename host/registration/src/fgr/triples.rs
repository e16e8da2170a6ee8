//! The tuple test: which matches form triples that keep all their lengths.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::agreement::{Columns, Rule};
use crate::features::PointPair;

/// Matches that each match is first compared with, at most: drawn by the seed when there are more.
const WITNESSES: usize = 2048;

/// Matches whose triples are counted, at most: those that agree with the most witnesses.
const CANDIDATES: usize = 1024;

/// A match in fewer triples than this share of the most is dropped.
const LEAST_SHARE: f64 = 0.02;

/// A match that passed the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kept {
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
/// from the others by some hundreds. Counted among the [`CANDIDATES`] that agree with most of
/// [`WITNESSES`].
pub(super) fn kept(pairs: &[PointPair], rule: Rule, most: usize, seed: u64) -> Vec<Kept> {
    let columns = Columns::of(pairs);
    let candidates = candidates(&columns, rule, seed);
    let graph = Graph { rows: columns.select(&candidates).graph(rule) };
    let triples = graph.triples();
    let top = triples.iter().copied().max().unwrap_or(0) as f64;
    let mut kept: Vec<Kept> = candidates
        .iter()
        .zip(&triples)
        .map(|(&index, &count)| Kept { index, weight: count as f64 / top })
        .filter(|kept| kept.weight >= LEAST_SHARE)
        .collect();
    kept.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.index.cmp(&b.index)));
    kept.truncate(most);
    kept.sort_by_key(|kept| kept.index);
    kept
}

/// The matches that agree with most others, ordered by index.
fn candidates(columns: &Columns, rule: Rule, seed: u64) -> Vec<usize> {
    let n = columns.len();
    if n <= CANDIDATES {
        return (0..n).collect();
    }
    let counts = columns.counts(&columns.select(&witnesses(n, seed)), rule);
    let mut order: Vec<usize> = (0..n).collect();
    order.select_nth_unstable_by_key(CANDIDATES, |&i| (std::cmp::Reverse(counts[i]), i));
    order.truncate(CANDIDATES);
    order.sort_unstable();
    order
}

/// Distinct indices below `n`, ascending.
fn witnesses(n: usize, seed: u64) -> Vec<usize> {
    let mut all: Vec<usize> = (0..n).collect();
    let mut drawn = all.partial_shuffle(&mut ChaCha8Rng::seed_from_u64(seed), WITNESSES).0.to_vec();
    drawn.sort_unstable();
    drawn
}

/// Which candidates agree: a row of bits each.
struct Graph {
    rows: Vec<Vec<u64>>,
}

impl Graph {
    /// Triples each candidate takes part in.
    fn triples(&self) -> Vec<u64> {
        (0..self.rows.len()).into_par_iter().map(|i| self.triples_of(i)).collect()
    }

    /// Each triple is met twice, once from either other corner.
    fn triples_of(&self, i: usize) -> u64 {
        ones(&self.rows[i]).map(|j| common(&self.rows[i], &self.rows[j])).sum::<u64>() / 2
    }
}

fn common(a: &[u64], b: &[u64]) -> u64 {
    a.iter().zip(b).map(|(a, b)| u64::from((a & b).count_ones())).sum()
}

/// Indices of the set bits, ascending.
fn ones(words: &[u64]) -> impl Iterator<Item = usize> {
    words.iter().enumerate().flat_map(|(at, &word)| {
        std::iter::successors((word != 0).then_some(word), |rest| {
            Some(rest & (rest - 1)).filter(|rest| *rest != 0)
        })
        .map(move |rest| at * 64 + rest.trailing_zeros() as usize)
    })
}
