//! The order in which the nodes of a graph become roots of the search for cliques.

use super::graph::Graph;

/// The place of each node in a degeneracy order: a node comes when none of those left has fewer
/// neighbours among them.
///
/// A node has no more later neighbours than the graph's degeneracy, which is small where the graph
/// is sparse. Matula and Beck, "Smallest-last ordering", 1983; linear in nodes and edges. Ties go
/// the same way on every run.
pub(super) fn degeneracy_ranks(graph: &Graph) -> Vec<u32> {
    let nodes = graph.len();
    let mut left: Vec<usize> = (0..nodes).map(|node| graph.degree(node)).collect();
    let mut buckets: Vec<Vec<u32>> = vec![Vec::new(); left.iter().max().map_or(0, |most| most + 1)];
    (0..nodes).rev().for_each(|node| buckets[left[node]].push(node as u32));
    let mut ranks = vec![u32::MAX; nodes];
    let (mut rank, mut least) = (0, 0);
    while least < buckets.len() {
        let Some(node) = buckets[least].pop() else {
            least += 1;
            continue;
        };
        let node = node as usize;
        // A node stands in every bucket it has passed through; only the last counts.
        if ranks[node] != u32::MAX || left[node] != least {
            continue;
        }
        ranks[node] = rank;
        rank += 1;
        for &other in graph.neighbours(node) {
            let other = other as usize;
            if ranks[other] == u32::MAX {
                left[other] -= 1;
                buckets[left[other]].push(other as u32);
                least = least.min(left[other]);
            }
        }
    }
    ranks
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn no_node_has_more_later_neighbours_than_the_densest_part_has_degrees(
            bits in prop::collection::vec(prop::bool::weighted(0.2), 190),
        ) {
            const N: usize = 20;
            let places = (0..N).flat_map(|i| (i + 1..N).map(move |j| (i, j, 1.0)));
            let edges: Vec<_> =
                places.zip(&bits).filter_map(|(edge, &bit)| bit.then_some(edge)).collect();
            let graph = Graph::from_edges(N, &edges);
            let ranks = degeneracy_ranks(&graph);
            let mut order: Vec<usize> = (0..N).collect();
            order.sort_by_key(|&node| ranks[node]);
            let mut removed = [false; N];
            let left = |removed: &[bool; N], node: usize| {
                graph.neighbours(node).iter().filter(|&&other| !removed[other as usize]).count()
            };
            for node in order {
                let least = (0..N)
                    .filter(|&other| !removed[other])
                    .map(|other| left(&removed, other))
                    .min();
                prop_assert_eq!(Some(left(&removed, node)), least);
                removed[node] = true;
            }
        }
    }
}
