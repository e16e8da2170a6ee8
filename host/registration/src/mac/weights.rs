//! Support of two compatible matches by all others.

use rayon::prelude::*;

use super::graph::Graph;

impl Graph {
    /// The second-order graph: the same edges, each weighing what the nodes compatible with both
    /// ends add.
    ///
    /// ```text
    /// G = W ∘ (W W)      gᵢⱼ = wᵢⱼ Σₖ wᵢₖ wₖⱼ
    /// ```
    ///
    /// Chen et al., "SC²-PCR", 2022; W as of the first-order graph. Only edges are computed, each
    /// once, from the shorter of its two rows: `Σ min(degree)` steps over the edges, where the
    /// dense product takes `n³`.
    pub(super) fn second_order(self) -> Self {
        let mut half = vec![0.0; self.all_weights().len()];
        let rows: Vec<(usize, &mut [f32])> =
            self.split(&mut half).into_iter().enumerate().collect();
        rows.into_par_iter().for_each_init(
            || vec![0.0; self.len()],
            |dense, (node, row)| {
                self.scatter(node, dense);
                for (g, (&other, &w)) in
                    row.iter_mut().zip(self.neighbours(node).iter().zip(self.weights(node)))
                {
                    if self.is_longer(node, other as usize) {
                        *g = w * self.dot(other as usize, dense);
                    }
                }
                self.neighbours(node).iter().for_each(|&k| dense[k as usize] = 0.0);
            },
        );
        // Each edge was computed at one of its places, and is 0 at the other.
        let weights = half
            .iter()
            .zip(self.reverse())
            .map(|(here, &there)| here.max(half[there as usize]))
            .collect();
        self.weighing(weights)
    }

    /// The node of the two whose row is expanded.
    fn is_longer(&self, a: usize, b: usize) -> bool {
        (self.degree(a), a) > (self.degree(b), b)
    }

    fn scatter(&self, node: usize, dense: &mut [f32]) {
        for (&k, &w) in self.neighbours(node).iter().zip(self.weights(node)) {
            dense[k as usize] = w;
        }
    }

    /// A row times one written out. Four sums, so that an addition need not wait for the last.
    fn dot(&self, node: usize, dense: &[f32]) -> f32 {
        let (indices, index_rest) = self.neighbours(node).as_chunks::<4>();
        let (weights, weight_rest) = self.weights(node).as_chunks::<4>();
        let mut sums = [0.0; 4];
        for (k, w) in indices.iter().zip(weights) {
            for lane in 0..4 {
                sums[lane] += w[lane] * dense[k[lane] as usize];
            }
        }
        let rest: f32 =
            index_rest.iter().zip(weight_rest).map(|(&k, w)| w * dense[k as usize]).sum();
        (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_second_order_is_the_dense_product_on_the_edges(
            weights in prop::collection::vec(prop::option::weighted(0.4, 0.1f32..1.0), 435),
        ) {
            const N: usize = 30;
            let places = (0..N).flat_map(|i| (i + 1..N).map(move |j| (i, j)));
            let edges: Vec<(usize, usize, f32)> =
                places.zip(&weights).filter_map(|((i, j), w)| Some((i, j, (*w)?))).collect();
            let mut w = vec![[0.0f64; N]; N];
            for &(i, j, weight) in &edges {
                (w[i][j], w[j][i]) = (f64::from(weight), f64::from(weight));
            }
            let graph = Graph::from_edges(N, &edges).second_order();
            prop_assert_eq!(graph.edges(), edges.len());
            for i in 0..N {
                for (&j, &g) in graph.neighbours(i).iter().zip(graph.weights(i)) {
                    let j = j as usize;
                    let expected = w[i][j] * (0..N).map(|k| w[i][k] * w[k][j]).sum::<f64>();
                    prop_assert!(
                        (f64::from(g) - expected).abs() <= 1e-6 * expected,
                        "{} {}",
                        g,
                        expected
                    );
                }
            }
        }
    }
}
