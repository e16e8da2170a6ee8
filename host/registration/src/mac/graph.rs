//! The graph of compatible matches, whose cliques propose motions.

use rayon::prelude::*;

use crate::bits::{WORD, ones};
use crate::correspondences::{Columns, LengthBounds, length_difference_m};
use crate::features::PointPair;

/// A weighted graph over matches, without loops.
///
/// ```text
/// wᵢⱼ = 1 - (dᵢⱼ / s)²    where dᵢⱼ < length_tolerance_m,   d the `length_difference_m`
/// ```
///
/// Neighbours ascend. Memory: `n²/8` bytes while the graph is made, then 16 bytes a neighbour.
#[derive(Clone, Debug, Default)]
pub(super) struct Graph {
    /// Index of the first neighbour of each node, `[n + 1]`.
    starts: Vec<usize>,
    neighbours: Vec<u32>,
    weights: Vec<f32>,
    /// Index of the same edge among the neighbours of the other node.
    reverse: Vec<u32>,
}

impl Graph {
    /// Over finite pairs whose compatible ones are known.
    pub(super) fn new(pairs: &[PointPair], compatible: &Compatible, scale_m: f64) -> Self {
        let mut graph = Self::with_degrees(&compatible.degrees);
        let mut next = graph.starts.clone();
        for i in 0..pairs.len() {
            for j in compatible.later(i) {
                let share = length_difference_m(&pairs[i], &pairs[j]) / scale_m;
                graph.link([i, j], (1.0 - share * share) as f32, &mut next);
            }
        }
        graph
    }

    /// Over given edges, each once with the lesser node first, sorted.
    #[cfg(test)]
    pub(super) fn from_edges(nodes: usize, edges: &[(usize, usize, f32)]) -> Self {
        let mut degrees = vec![0; nodes];
        edges
            .iter()
            .for_each(|&(i, j, _)| [i, j].map(|node| degrees[node] += 1).into_iter().collect());
        let mut graph = Self::with_degrees(&degrees);
        let mut next = graph.starts.clone();
        edges.iter().for_each(|&(i, j, weight)| graph.link([i, j], weight, &mut next));
        graph
    }

    fn with_degrees(degrees: &[u32]) -> Self {
        let mut starts = Vec::with_capacity(degrees.len() + 1);
        starts.push(0);
        starts.extend(degrees.iter().scan(0, |end, &degree| {
            *end += degree as usize;
            Some(*end)
        }));
        let total = starts.last().copied().unwrap_or(0);
        Self {
            starts,
            neighbours: vec![0; total],
            weights: vec![0.0; total],
            reverse: vec![0; total],
        }
    }

    /// Adds an edge at the next free place of both nodes.
    fn link(&mut self, [i, j]: [usize; 2], weight: f32, next: &mut [usize]) {
        let (here, there) = (next[i], next[j]);
        (self.neighbours[here], self.neighbours[there]) = (j as u32, i as u32);
        (self.reverse[here], self.reverse[there]) = (there as u32, here as u32);
        (self.weights[here], self.weights[there]) = (weight, weight);
        next[i] += 1;
        next[j] += 1;
    }

    /// Count of the nodes.
    pub(super) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Count of the edges.
    pub(super) fn edges(&self) -> usize {
        self.neighbours.len() / 2
    }

    /// Count of the neighbours of a node.
    pub(super) fn degree(&self, node: usize) -> usize {
        self.starts[node + 1] - self.starts[node]
    }

    /// A node's neighbours, ascending.
    pub(super) fn neighbours(&self, node: usize) -> &[u32] {
        &self.neighbours[self.starts[node]..self.starts[node + 1]]
    }

    /// The weights of a node's edges, in the order of its neighbours.
    pub(super) fn weights(&self, node: usize) -> &[f32] {
        &self.weights[self.starts[node]..self.starts[node + 1]]
    }

    /// The weights of all edges, each twice.
    pub(super) fn all_weights(&self) -> &[f32] {
        &self.weights
    }

    /// Index of the second entry of each edge.
    pub(super) fn reverse(&self) -> &[u32] {
        &self.reverse
    }

    /// The neighbours' weights of all nodes, to be written, a node at a time.
    pub(super) fn split<'a>(&self, mut weights: &'a mut [f32]) -> Vec<&'a mut [f32]> {
        let mut rows = Vec::with_capacity(self.len());
        for node in 0..self.len() {
            let (row, rest) = weights.split_at_mut(self.degree(node));
            rows.push(row);
            weights = rest;
        }
        rows
    }

    /// The same edges with other weights, in the order of [`Self::all_weights`].
    pub(super) fn weighing(self, weights: Vec<f32>) -> Self {
        Self { weights, ..self }
    }
}

/// Compatible pairs of matches, a bit for each pair: `n²/8` bytes.
#[derive(Clone, Debug)]
pub(super) struct Compatible {
    /// Row `i` knows the columns after `i`.
    bits: Vec<u64>,
    words: usize,
    /// Compatible matches of each.
    pub(super) degrees: Vec<u32>,
}

impl Compatible {
    /// Tests every pair of matches, which must be finite: in `f32` where that is sure, else
    /// exactly.
    pub(super) fn new(pairs: &[PointPair], bounds: &LengthBounds) -> Self {
        let (columns, _) = Columns::new(pairs);
        let (words, slack_m) = (columns.words(), columns.slack_m());
        let mut bits = vec![0; pairs.len() * words];
        bits.par_chunks_mut(words.max(1)).enumerate().for_each(|(i, row)| {
            let first = i / WORD;
            let row = &mut row[first..];
            columns.screen(i, first, (bounds, slack_m), row);
            row[0] &= later_than(i % WORD);
            for (word, bits) in (first..).zip(row) {
                let exact = |j: usize| bounds.hold(&pairs[i], &pairs[j]);
                *bits = ones(*bits)
                    .filter(|bit| exact(word * WORD + bit))
                    .fold(0, |kept, bit| kept | 1 << bit);
            }
        });
        let mut compatible = Self { bits, words, degrees: vec![0; pairs.len()] };
        compatible.count();
        compatible
    }

    fn count(&mut self) {
        let mut degrees = vec![0; self.degrees.len()];
        for i in 0..degrees.len() {
            for j in self.later(i) {
                degrees[i] += 1;
                degrees[j] += 1;
            }
        }
        self.degrees = degrees;
    }

    /// The matches after `i` that are compatible with it.
    fn later(&self, i: usize) -> impl Iterator<Item = usize> {
        let row = &self.bits[i * self.words..(i + 1) * self.words];
        (i / WORD..self.words)
            .flat_map(move |word| ones(row[word]).map(move |bit| word * WORD + bit))
    }
}

/// Bits above `bit`.
fn later_than(bit: usize) -> u64 {
    (u64::MAX << bit) << 1
}
