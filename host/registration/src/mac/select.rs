//! The heaviest clique of every match.

use rayon::prelude::*;

use super::cliques::{CliqueProblem, CliqueSearch, RootCliques};
use super::degeneracy_order::degeneracy_ranks;
use super::graph::Graph;
use super::ranked::RankedGraph;

/// Roots searched between two checks of the count of cliques.
const ROUND: usize = 256;

/// The cliques that propose motions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Selection {
    /// Distinct, nodes ascending, in the order found.
    pub(super) cliques: Vec<Vec<u32>>,
    /// Maximal cliques found, chosen or not.
    pub(super) found: usize,
    /// Roots whose search ended before all cliques were found, or that were not searched.
    pub(super) cut_roots: usize,
}

/// Searches the maximal cliques of `least` nodes or more, and keeps the heaviest of each node: the
/// node-guided selection of MAC. A clique weighs the sum of its edges' weights; the first of equals
/// stays.
///
/// Roots go from the densest part outwards, and none after that at which `max_cliques` are found:
/// the same cliques on any number of threads. Only what may be chosen is kept: memory grows with
/// the nodes, not with the cliques.
pub(super) fn heaviest(graph: &Graph, least: usize, max_cliques: usize) -> Selection {
    let ranked = RankedGraph::new(graph, &degeneracy_ranks(graph));
    let problem = CliqueProblem { graph: &ranked, least };
    let roots: Vec<u32> = (0..ranked.len() as u32).rev().collect();
    let mut best = Best { of: vec![None; graph.len()], ..Best::default() };
    for round in roots.chunks(ROUND) {
        let left = max_cliques.saturating_sub(best.selection.found);
        let found: Vec<RootCliques> = round
            .par_iter()
            .map_init(CliqueSearch::default, |search, &root| search.run(&problem, root, left))
            .collect();
        found.into_iter().for_each(|found| best.take(found, max_cliques));
    }
    best.chosen()
}

/// The heaviest so far.
#[derive(Debug, Default)]
struct Best {
    /// Weight and index of the best clique of each node.
    of: Vec<Option<(f64, usize)>>,
    selection: Selection,
}

impl Best {
    fn take(&mut self, found: RootCliques, max_cliques: usize) {
        if self.selection.found >= max_cliques {
            self.selection.cut_roots += 1;
            return;
        }
        self.selection.found += found.cliques;
        self.selection.cut_roots += usize::from(found.cut);
        for (nodes, weight) in found.heaviest {
            let index = self.selection.cliques.len();
            let mut chosen = false;
            for &node in &nodes {
                let best = &mut self.of[node as usize];
                if best.is_none_or(|(heaviest, _)| weight > heaviest) {
                    *best = Some((weight, index));
                    chosen = true;
                }
            }
            if chosen {
                self.selection.cliques.push(nodes);
            }
        }
    }

    fn chosen(mut self) -> Selection {
        let mut keep = vec![false; self.selection.cliques.len()];
        self.of.iter().flatten().for_each(|(_, clique)| keep[*clique] = true);
        let mut keep = keep.into_iter();
        self.selection.cliques.retain(|_| keep.next().unwrap_or(false));
        self.selection
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use petgraph::algo::maximal_cliques;
    use petgraph::graph::UnGraph;
    use proptest::prelude::*;

    use super::*;
    use crate::tests::on_threads;

    fn edges(nodes: usize, weights: &[Option<u8>]) -> Vec<(usize, usize, f32)> {
        let places = (0..nodes).flat_map(|i| (i + 1..nodes).map(move |j| (i, j)));
        places.zip(weights).filter_map(|((i, j), w)| Some((i, j, f32::from((*w)?)))).collect()
    }

    /// The cliques of a published enumerator, with their weights.
    fn oracle(nodes: usize, edges: &[(usize, usize, f32)]) -> Vec<(BTreeSet<u32>, f64)> {
        let mut graph = UnGraph::<(), ()>::default();
        (0..nodes).for_each(|_| _ = graph.add_node(()));
        edges
            .iter()
            .for_each(|&(i, j, _)| _ = graph.add_edge((i as u32).into(), (j as u32).into(), ()));
        let weigh = |clique: &BTreeSet<u32>| {
            let inside = |node: usize| clique.contains(&(node as u32));
            edges
                .iter()
                .filter(|(i, j, _)| inside(*i) && inside(*j))
                .map(|(_, _, w)| f64::from(*w))
                .sum()
        };
        let sets = maximal_cliques(&graph).into_iter();
        sets.map(|c| c.iter().map(|node| node.index() as u32).collect())
            .map(|c| (weigh(&c), c))
            .map(|(w, c)| (c, w))
            .collect()
    }

    proptest! {
        #[test]
        fn each_node_keeps_the_heaviest_of_all_maximal_cliques_that_hold_it(
            nodes in 0usize..24,
            share in 0.1f64..0.95,
            draws in prop::collection::vec((0.0f64..1.0, 1u8..50), 276),
            least in 1usize..5,
        ) {
            let weights: Vec<Option<u8>> =
                draws.iter().map(|(draw, w)| (*draw < share).then_some(*w)).collect();
            let edges = edges(nodes, &weights);
            let mut expected = oracle(nodes, &edges);
            expected.retain(|(clique, _)| clique.len() >= least);
            let selection = heaviest(&Graph::from_edges(nodes, &edges), least, usize::MAX);
            prop_assert_eq!(selection.found, expected.len());
            prop_assert_eq!(selection.cut_roots, 0);
            let of_node = |node: u32, cliques: &[(BTreeSet<u32>, f64)]| {
                cliques
                    .iter()
                    .filter(|(clique, _)| clique.contains(&node))
                    .map(|(_, w)| *w)
                    .reduce(f64::max)
            };
            let weight = |clique: &BTreeSet<u32>| {
                expected.iter().find(|(other, _)| other == clique).map(|(_, w)| *w)
            };
            let ours: Vec<BTreeSet<u32>> =
                selection.cliques.iter().map(|c| c.iter().copied().collect()).collect();
            prop_assert!(
                ours.iter().all(|clique| weight(clique).is_some()),
                "not a maximal clique"
            );
            let ours: Vec<_> = ours
                .into_iter()
                .filter_map(|c| Some((weight(&c)?, c)))
                .map(|(w, c)| (c, w))
                .collect();
            for node in 0..nodes as u32 {
                prop_assert_eq!(of_node(node, &ours), of_node(node, &expected));
            }
        }

        #[test]
        fn a_cap_leaves_the_same_cliques_on_one_thread_and_on_four(
            draws in prop::collection::vec((0.0f64..1.0, 1u8..50), 3160),
            cap in 1usize..600,
        ) {
            const NODES: usize = 80;
            let weights: Vec<Option<u8>> =
                draws.iter().map(|(draw, w)| (*draw < 0.5).then_some(*w)).collect();
            let graph = Graph::from_edges(NODES, &edges(NODES, &weights));
            let on = |threads| on_threads(threads, || heaviest(&graph, 3, cap));
            let one = on(1);
            prop_assert!(one.found >= cap && one.cut_roots > 0);
            prop_assert_eq!(one, on(4));
        }
    }
}
