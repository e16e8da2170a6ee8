//! The subgraph around one root of the search.

use echoloop_dispatch::dispatch;

use super::ranked::RankedGraph;
use crate::bits::{WORD, count, members};

/// A root's neighbours: the later ones (in the degeneracy order) may join its cliques, the earlier
/// ones would have been roots of the same cliques before.
///
/// The later ones have indices of their own, those that weigh most with the root first, so that
/// their sets are short. The earlier ones keep their ranks: their rows are the graph's.
#[derive(Debug, Default)]
pub(super) struct Local {
    /// `[later]`: ranks of the later ones.
    pub(super) later: Vec<u32>,
    /// `[later]`: weights to the root.
    pub(super) root_weights: Vec<f32>,
    /// Words of a row over the later ones.
    pub(super) later_words: usize,
    /// The earlier ones, by rank.
    pub(super) earlier: Vec<u64>,
    /// Words that a set of the earlier ones would take by itself.
    pub(super) packed_earlier_words: usize,
    /// `[later][later_words]`: links between the later ones.
    rows: Vec<u64>,
}

impl Local {
    /// Gathers what the root of a rank sees. All memory is kept for the next root.
    pub(super) fn load(&mut self, graph: &RankedGraph, root: u32) {
        let row = graph.row(root);
        let (word, bit) = (root as usize / WORD, root as usize % WORD);
        self.earlier.clear();
        self.earlier.extend(&row[..=word]);
        self.earlier[word] &= (1 << bit) - 1;
        self.packed_earlier_words = count(&self.earlier).div_ceil(WORD);
        let in_later_words = members(&row[word..]).map(|member| (word * WORD + member) as u32);
        let mut later: Vec<(f32, u32)> = in_later_words
            .filter(|&rank| rank > root)
            .map(|rank| (graph.weight(root, rank), rank))
            .collect();
        let by_node = |a: u32, b: u32| graph.node(a).cmp(&graph.node(b));
        later.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| by_node(a.1, b.1)));
        self.later_words = later.len().div_ceil(WORD);
        self.later.clear();
        self.root_weights.clear();
        for (weight, rank) in later {
            self.later.push(rank);
            self.root_weights.push(weight);
        }
        self.rows.clear();
        link(graph, &self.later, &mut self.rows);
    }

    /// The later ones linked to a later one, as bits.
    pub(super) fn to_later(&self, local: usize) -> &[u64] {
        &self.rows[local * self.later_words..][..self.later_words]
    }

    /// The earlier ones linked to a later one, by rank, among others of the graph.
    pub(super) fn to_earlier<'a>(&self, graph: &'a RankedGraph, local: usize) -> &'a [u64] {
        &graph.row(self.later[local])[..self.earlier.len()]
    }

    /// Weights of a later one with others that are linked to it.
    pub(super) fn weight_with(&self, graph: &RankedGraph, local: usize, others: &[u32]) -> f64 {
        let rank = self.later[local];
        let weight = |&other: &u32| graph.weight(rank, self.later[other as usize]);
        others.iter().map(|other| f64::from(weight(other))).sum()
    }
}

dispatch! {
    /// Adds a row for each of some ranks: its links to all of them, as bits.
    fn link(graph: &RankedGraph, ranks: &[u32], rows: &mut Vec<u64>) = link_inline;
}

#[inline(always)]
fn link_inline(graph: &RankedGraph, ranks: &[u32], rows: &mut Vec<u64>) {
    for &rank in ranks {
        let row = graph.row(rank);
        rows.extend(ranks.chunks(WORD).map(|others| {
            // Without a branch: half of the links are there by chance.
            (0..).zip(others).fold(0, |bits, (lane, &other)| {
                let other = other as usize;
                bits | (row[other / WORD] >> (other % WORD) & 1) << lane
            })
        }));
    }
}
