//! A graph as bits, its nodes in the order in which they become roots of the search for cliques.

use super::graph::Graph;
use crate::bits::WORD;

/// A graph whose nodes are known by their ranks in its degeneracy order. It is made once for the
/// searches from all roots.
///
/// Memory: `3 n²/16` bytes and 4 bytes a neighbour.
#[derive(Debug)]
pub(super) struct RankedGraph {
    /// Node of each rank.
    nodes: Vec<u32>,
    /// Words of a row.
    words: usize,
    /// `[n][words]`: neighbours of each rank.
    bits: Vec<u64>,
    /// `[n][words]`: index of the weight of the first neighbour in each word.
    firsts: Vec<u32>,
    /// Weights of each rank's edges, in the order of its neighbours' ranks.
    weights: Vec<f32>,
}

impl RankedGraph {
    /// Takes the rank of each node.
    pub(super) fn new(graph: &Graph, ranks: &[u32]) -> Self {
        let words = graph.len().div_ceil(WORD);
        let mut nodes = vec![0; graph.len()];
        (0..).zip(ranks).for_each(|(node, &rank)| nodes[rank as usize] = node);
        let mut bits = vec![0u64; graph.len() * words];
        let mut firsts = Vec::with_capacity(bits.len());
        let mut next = 0u32;
        for (rank, &node) in nodes.iter().enumerate() {
            let row = &mut bits[rank * words..][..words];
            for &other in graph.neighbours(node as usize) {
                let other = ranks[other as usize] as usize;
                row[other / WORD] |= 1 << (other % WORD);
            }
            firsts.extend(row.iter().map(|word| {
                let first = next;
                next += word.count_ones();
                first
            }));
        }
        let mut ranked = Self { nodes, words, bits, firsts, weights: vec![0.0; next as usize] };
        for (node, &rank) in ranks.iter().enumerate() {
            for (&other, &weight) in graph.neighbours(node).iter().zip(graph.weights(node)) {
                let index = ranked.index(rank, ranks[other as usize]);
                ranked.weights[index] = weight;
            }
        }
        ranked
    }

    /// Count of the nodes.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The node of a rank.
    pub(super) fn node(&self, rank: u32) -> u32 {
        self.nodes[rank as usize]
    }

    /// The neighbours of a rank.
    pub(super) fn row(&self, rank: u32) -> &[u64] {
        &self.bits[rank as usize * self.words..][..self.words]
    }

    /// Weight of the edge between two neighbours.
    pub(super) fn weight(&self, rank: u32, neighbour: u32) -> f32 {
        self.weights[self.index(rank, neighbour)]
    }

    fn index(&self, rank: u32, neighbour: u32) -> usize {
        let (word, bit) = (neighbour as usize / WORD, neighbour as usize % WORD);
        let place = rank as usize * self.words + word;
        let before = self.bits[place] & ((1 << bit) - 1);
        (self.firsts[place] + before.count_ones()) as usize
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::bits::members;

    proptest! {
        #[test]
        fn rows_and_weights_are_the_graph_s(
            weights in prop::collection::vec(prop::option::weighted(0.3, 1u8..), 4950),
            ranks in Just((0..100u32).collect::<Vec<_>>()).prop_shuffle(),
        ) {
            const N: usize = 100;
            let places = (0..N).flat_map(|i| (i + 1..N).map(move |j| (i, j)));
            let edge = |((i, j), w): (_, &Option<u8>)| Some((i, j, f32::from((*w)?)));
            let edges: Vec<(usize, usize, f32)> = places.zip(&weights).filter_map(edge).collect();
            let graph = Graph::from_edges(N, &edges);
            let ranked = RankedGraph::new(&graph, &ranks);
            for (node, &rank) in ranks.iter().enumerate() {
                prop_assert_eq!(ranked.node(rank), node as u32);
                let neighbours = graph.neighbours(node);
                let mut expected: Vec<usize> =
                    neighbours.iter().map(|&other| ranks[other as usize] as usize).collect();
                expected.sort_unstable();
                prop_assert_eq!(members(ranked.row(rank)).collect::<Vec<_>>(), expected);
                for (&other, &weight) in neighbours.iter().zip(graph.weights(node)) {
                    prop_assert_eq!(ranked.weight(rank, ranks[other as usize]), weight);
                }
            }
        }
    }
}
