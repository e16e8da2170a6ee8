//! The subgraph around one root of the search.

use super::graph::Graph;
use crate::bits::WORD;

/// Not a node of the part.
const ABSENT: u32 = u32::MAX;

/// A root's neighbours as bits: the later ones (in the degeneracy order) may join its cliques, the
/// earlier ones would have been roots of the same cliques before.
///
/// Local indices: later neighbours first, those that weigh most with the root before the others,
/// then the earlier ones.
#[derive(Debug, Default)]
pub(super) struct Local {
    /// Nodes of the graph, by local index.
    pub(super) nodes: Vec<u32>,
    /// Count of the later ones among them.
    pub(super) later: usize,
    /// Words of a row over the later ones.
    pub(super) later_words: usize,
    /// Words of a row over the earlier ones.
    pub(super) earlier_words: usize,
    /// `[later][later_words + earlier_words + 1]`: what each later one is linked to; the last word
    /// is for nodes that the root does not see.
    rows: Vec<u64>,
    /// `[later][later + 1]`: weights between later ones, 0 where there is no edge; the last is for
    /// all other nodes.
    weights: Vec<f32>,
    /// `[later]`: weights to the root.
    pub(super) root_weights: Vec<f32>,
    /// The bit of each node of the graph in a row: the later ones', then, from the next word on,
    /// the earlier ones'; of those that the root does not see, [`ABSENT`].
    bits: Vec<u32>,
}

impl Local {
    /// Gathers what `root` sees. All memory is kept for the next root.
    pub(super) fn load(&mut self, graph: &Graph, ranks: &[u32], root: usize) {
        self.clear(graph.len());
        let mut later: Vec<(f32, u32)> = Vec::new();
        for (&node, &weight) in graph.neighbours(root).iter().zip(graph.weights(root)) {
            if ranks[node as usize] > ranks[root] {
                later.push((weight, node));
            }
        }
        later.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        self.later = later.len();
        self.nodes.extend(later.iter().map(|(_, node)| node));
        self.root_weights.extend(later.iter().map(|(weight, _)| weight));
        self.nodes.extend(
            graph.neighbours(root).iter().filter(|&&node| ranks[node as usize] < ranks[root]),
        );
        self.link(graph);
    }

    fn clear(&mut self, nodes: usize) {
        self.bits.resize(nodes, ABSENT);
        for &node in &self.nodes {
            self.bits[node as usize] = ABSENT;
        }
        self.nodes.clear();
        self.root_weights.clear();
    }

    /// Out of line: inlined into the search, the loop over the neighbours took a third longer.
    #[inline(never)]
    fn link(&mut self, graph: &Graph) {
        self.later_words = self.later.div_ceil(WORD);
        self.earlier_words = (self.nodes.len() - self.later).div_ceil(WORD);
        let (later, earlier) = self.nodes.split_at(self.later);
        for (bit, &node) in
            (0..).zip(later).chain(((self.later_words * WORD) as u32..).zip(earlier))
        {
            self.bits[node as usize] = bit;
        }
        let row_words = self.row_words();
        zero(&mut self.rows, self.later * row_words);
        zero(&mut self.weights, self.later * (self.later + 1));
        let rows = self
            .rows
            .chunks_exact_mut(row_words)
            .zip(self.weights.chunks_exact_mut(self.later + 1));
        // Without a branch: most neighbours of a neighbour are seen by chance, which no processor
        // predicts.
        let last = (row_words - 1) * WORD;
        for (&node, (row, weights)) in later.iter().zip(rows) {
            for (&other, &weight) in
                graph.neighbours(node as usize).iter().zip(graph.weights(node as usize))
            {
                let bit = (self.bits[other as usize] as usize).min(last);
                row[bit / WORD] |= 1 << (bit % WORD);
                weights[bit.min(later.len())] = weight;
            }
        }
    }

    fn row_words(&self) -> usize {
        self.later_words + self.earlier_words + 1
    }

    /// The later ones linked to a later one, as bits.
    pub(super) fn to_later(&self, local: usize) -> &[u64] {
        &self.rows[local * self.row_words()..][..self.later_words]
    }

    /// The earlier ones linked to a later one, as bits.
    pub(super) fn to_earlier(&self, local: usize) -> &[u64] {
        &self.rows[local * self.row_words() + self.later_words..][..self.earlier_words]
    }

    /// Weights of a later one with the others.
    pub(super) fn weight_with(&self, local: usize, others: &[u32]) -> f64 {
        let row = &self.weights[local * (self.later + 1)..][..self.later];
        others.iter().map(|&other| f64::from(row[other as usize])).sum()
    }
}

fn zero<T: Clone + Default>(values: &mut Vec<T>, len: usize) {
    values.clear();
    values.resize(len, T::default());
}
