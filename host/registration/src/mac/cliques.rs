//! Maximal cliques that hold a root.

use echoloop_dispatch::dispatch;

use super::local::Local;
use super::ranked::RankedGraph;
use crate::bits::{WORD, count, members, ones};

/// Words that the search below one root may read once it has found a clique, counted as if sets of
/// earlier nodes had no gaps; sparse graphs need far less. Sixteen times as many found no better
/// motion on simulated scans.
const MAX_WORDS: u64 = 1 << 14;

/// Words that it may read without one: enough to dive into a clique of some hundreds of nodes. A
/// root whose cliques all hold an earlier root as well would else search among them without end.
const MAX_WORDS_IN_VAIN: u64 = 1 << 20;

/// The heaviest cliques that one root's search found.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RootCliques {
    /// For each node of a clique, the heaviest that holds it: nodes ascending, and the weight. In
    /// the order found.
    pub(super) heaviest: Vec<(Vec<u32>, f64)>,
    /// Count of all cliques found.
    pub(super) cliques: usize,
    /// True when the search ended before all were found.
    pub(super) cut: bool,
}

/// State shared by the searches from all roots.
#[derive(Clone, Copy, Debug)]
pub(super) struct CliqueProblem<'a> {
    pub(super) graph: &'a RankedGraph,
    /// Least count of nodes of a clique.
    pub(super) least: usize,
}

/// Finds the maximal cliques of a graph whose first node, in the degeneracy order, is a given root.
///
/// Eppstein, Löffler and Strash, "Listing all maximal cliques in sparse graphs in near-optimal
/// time", 2010: the root's later neighbours are the candidates, and within them Bron and Kerbosch
/// with the pivot of Tomita, Tanaka and Takahashi, "The worst-case time complexity for generating
/// all maximal cliques", 2006 (here among candidates only, as rows of the others would cost more to
/// write than they save), all sets as bits. Candidates that weigh most with the root come first, so
/// that a search that is cut has dived for a heavy clique.
#[derive(Debug, Default)]
pub(super) struct CliqueSearch {
    local: Local,
    least: usize,
    max_cliques: usize,
    words: u64,
    /// Nodes by depth: candidates, then former candidates, then earlier nodes.
    sets: Vec<u64>,
    /// Nodes that are no candidates but linked to all of them.
    common: Vec<u64>,
    clique: Vec<u32>,
    best: Vec<Option<(f64, usize)>>,
    cliques: Vec<(Vec<u32>, f64)>,
    found: usize,
    cut: bool,
}

impl CliqueSearch {
    /// The cliques of the root of a rank, ending after `max_cliques`.
    pub(super) fn run(
        &mut self,
        &CliqueProblem { graph, least }: &CliqueProblem,
        root: u32,
        max_cliques: usize,
    ) -> RootCliques {
        self.local.load(graph, root);
        let later = self.local.later.len();
        if later + 1 < least {
            return RootCliques::default();
        }
        (self.least, self.max_cliques, self.words, self.found, self.cut) =
            (least, max_cliques, 0, 0, false);
        self.cliques.clear();
        self.best.clear();
        self.best.resize(later + 1, None);
        self.sets.clear();
        self.sets.resize(2 * self.local.later_words, 0);
        fill(&mut self.sets, later);
        self.sets.extend(&self.local.earlier);
        self.expand(graph, 0, 0.0);
        self.found(graph, root)
    }

    /// Words of one depth.
    fn width(&self) -> usize {
        2 * self.local.later_words + self.local.earlier.len()
    }

    /// Extends the clique by every candidate of this depth in turn; each is a later one.
    fn expand(&mut self, graph: &RankedGraph, depth: usize, weight: f64) {
        let width = self.width();
        let base = depth * width;
        let candidates = count(&self.sets[base..base + self.local.later_words]);
        if candidates == 0 {
            // Maximal, unless a node that has been a candidate, or came earlier, is linked to all.
            if self.sets[base + self.local.later_words..base + width].iter().all(|word| *word == 0)
            {
                self.keep(weight);
            }
            return;
        }
        if self.clique.len() + candidates + 1 < self.least {
            return;
        }
        if self.is_known(graph, base) {
            return;
        }
        let pivot = self.pivot(base, candidates);
        self.sets.resize(self.sets.len().max(base + 2 * width), 0);
        for word in 0..self.local.later_words {
            let branches = self.sets[base + word] & !self.local.to_later(pivot)[word];
            for bit in ones(branches) {
                if self.cut {
                    return;
                }
                self.branch(graph, depth, word * WORD + bit, weight);
            }
        }
    }

    /// Extends the clique by one candidate, and then marks the candidate as visited.
    fn branch(&mut self, graph: &RankedGraph, depth: usize, node: usize, weight: f64) {
        let (words, width) = (self.local.later_words, self.width());
        let (here, next) = self.sets[depth * width..].split_at_mut(width);
        let rows = self.local.to_later(node);
        for word in 0..words {
            next[word] = here[word] & rows[word];
            next[words + word] = here[words + word] & rows[word];
        }
        for (word, row) in self.local.to_earlier(graph, node).iter().enumerate() {
            next[2 * words + word] = here[2 * words + word] & row;
        }
        let root = f64::from(self.local.root_weights[node]);
        let added = root + self.local.weight_with(graph, node, &self.clique);
        let packed = 2 * words + self.local.packed_earlier_words;
        self.words += (packed + self.clique.len()) as u64;
        self.cut |= self.words > if self.found > 0 { MAX_WORDS } else { MAX_WORDS_IN_VAIN };
        self.clique.push(node as u32);
        self.expand(graph, depth + 1, weight + added);
        self.clique.pop();
        let (word, bit) = (depth * width + node / WORD, 1 << (node % WORD));
        self.sets[word] &= !bit;
        self.sets[word + words] |= bit;
    }

    /// True when a node that is no candidate is linked to all candidates: then no clique below is
    /// maximal.
    fn is_known(&mut self, graph: &RankedGraph, base: usize) -> bool {
        let words = self.local.later_words;
        let (p, others) = self.sets[base..base + self.width()].split_at(words);
        self.common.clear();
        self.common.extend(others);
        let (is_known, looked_at) = are_all_linked(&self.local, graph, p, &mut self.common);
        self.words += (looked_at * (words + self.local.packed_earlier_words)) as u64;
        is_known
    }

    /// The candidate linked to most others: its links need no branch of their own.
    fn pivot(&mut self, base: usize, candidates: usize) -> usize {
        let p = &self.sets[base..base + self.local.later_words];
        let (pivot, looked_at) = most_linked(&self.local, p, candidates);
        self.words += (looked_at * self.local.later_words) as u64;
        pivot
    }

    /// Counts a maximal clique, and keeps it if it is the heaviest so far of one of its nodes.
    fn keep(&mut self, weight: f64) {
        if self.clique.len() + 1 < self.least {
            return;
        }
        self.found += 1;
        self.cut |= self.found >= self.max_cliques;
        let root = self.local.later.len() as u32;
        let mut kept = false;
        for &node in self.clique.iter().chain([&root]) {
            let best = &mut self.best[node as usize];
            if best.is_none_or(|(heaviest, _)| weight > heaviest) {
                *best = Some((weight, self.cliques.len()));
                kept = true;
            }
        }
        if kept {
            self.cliques.push((self.clique.clone(), weight));
        }
    }

    fn found(&self, graph: &RankedGraph, root: u32) -> RootCliques {
        let mut chosen: Vec<usize> =
            self.best.iter().flatten().map(|(_, clique)| *clique).collect();
        chosen.sort_unstable();
        chosen.dedup();
        let global = |clique: usize| {
            let (locals, weight) = &self.cliques[clique];
            let ranks = locals.iter().map(|&local| self.local.later[local as usize]);
            let mut nodes: Vec<u32> = ranks.chain([root]).map(|rank| graph.node(rank)).collect();
            nodes.sort_unstable();
            (nodes, *weight)
        };
        RootCliques {
            heaviest: chosen.into_iter().map(global).collect(),
            cliques: self.found,
            cut: self.cut,
        }
    }
}

dispatch! {
    /// Keeps of some nodes, former candidates and earlier ones, those that are linked to all
    /// candidates. True if any are, and how many candidates were looked at.
    fn are_all_linked(
        local: &Local,
        graph: &RankedGraph,
        p: &[u64],
        common: &mut [u64]
    ) -> (bool, usize) = are_all_linked_inline;

    /// The candidate linked to most others, of equal ones the first, and how many were looked at.
    fn most_linked(local: &Local, p: &[u64], candidates: usize) -> (usize, usize)
        = most_linked_inline;
}

#[inline(always)]
fn are_all_linked_inline(
    local: &Local,
    graph: &RankedGraph,
    p: &[u64],
    common: &mut [u64],
) -> (bool, usize) {
    let (past, earlier) = common.split_at_mut(local.later_words);
    let mut looked_at = 0;
    for node in members(p) {
        looked_at += 1;
        let left = keep_common(past, local.to_later(node))
            | keep_common(earlier, local.to_earlier(graph, node));
        if left == 0 {
            return (false, looked_at);
        }
    }
    (true, looked_at)
}

/// Keeps the members that are in both sets; 0 if there are none.
#[inline(always)]
fn keep_common(set: &mut [u64], other: &[u64]) -> u64 {
    set.iter_mut().zip(other).fold(0, |left, (word, other)| {
        *word &= other;
        left | *word
    })
}

#[inline(always)]
fn most_linked_inline(local: &Local, p: &[u64], candidates: usize) -> (usize, usize) {
    let (mut most, mut pivot, mut looked_at) = (None, 0, 0);
    for node in members(p) {
        looked_at += 1;
        let both = p.iter().zip(local.to_later(node));
        let links: usize = both.map(|(a, b)| (a & b).count_ones() as usize).sum();
        if most.is_none_or(|most| links > most) {
            (most, pivot) = (Some(links), node);
        }
        if links + 1 == candidates {
            break;
        }
    }
    (pivot, looked_at)
}

/// The first `len` bits.
fn fill(words: &mut [u64], len: usize) {
    for (index, word) in words.iter_mut().enumerate().take(len.div_ceil(WORD)) {
        let left = len - index * WORD;
        *word = if left >= WORD { u64::MAX } else { (1 << left) - 1 };
    }
}
