//! Choices without an order: categorical distributions beside the normal one, as in CatCMA (Hamano
//! et al., GECCO 2024, arXiv:2405.09962), with the margin of its successor (arXiv:2504.07884).

use echoloop_random::Generator;

/// Independent categorical distributions, updated by adaptive stochastic natural gradient (Akimoto
/// et al., ICML 2019, arXiv:1905.08537).
///
/// ```text
/// g = Σ_{i≤μ} w_i (e_{c_i} − q)           natural gradient, a row for each choice
/// G = g / √q                              |G|: its length in the Fisher metric
/// q ← q + min(δ/|G|, ½) g,                δ = 1/Δ
/// s ← (1−β) s + √(β(2−β)) G/|G|,          γ ← (1−β)² γ + β(2−β),     β = δ/√Σ(K−1)
/// Δ ← Δ exp(β (γ − |s|²/1.5))             shorter steps while their directions are random
/// ```
///
/// | name | meaning                                             |
/// |------|-----------------------------------------------------|
/// | `q`  | probability of each of the K names of a choice      |
/// | `c`  | names that a candidate drew                         |
/// | `w`  | weights of the better half, adding up to 1          |
///
/// Every name keeps a probability of (1 − 0.73^(1/n))/(K − 1), so that none is ever lost. We depart
/// from the papers in
///
/// - n, which counts all coordinates instead of the discrete ones: with sixteen coordinates of
///   which three are choices, 6 candidates in 100 instead of 27 draw a name that is not the
///   likeliest;
/// - the ½, without which the first generations settle a few choices by chance;
/// - the root of the Fisher matrix: the papers' treats the last name unlike the others; ours, onto
///   the sphere of √q, gives the same length.
#[derive(Clone, Debug)]
pub(super) struct Choices {
    rows: Vec<Row>,
    /// Δ.
    caution: f64,
    /// γ.
    gamma: f64,
    /// Generations in a row in which every choice has stood at its margin.
    still: usize,
    /// Number of such generations after which the choices count as settled.
    patience: usize,
}

#[derive(Clone, Debug)]
struct Row {
    q: Vec<f64>,
    /// This choice's part of s.
    path: Vec<f64>,
    /// Least probability of a name.
    least: f64,
}

impl Choices {
    /// `starts` holds the number of names of each choice and its start coordinate; `n` counts
    /// coordinates of all kinds. `trust` is the initial probability of the start's name; the other
    /// names share the rest.
    pub(super) fn new(starts: &[(usize, f64)], trust: f64, n: usize, lambda: usize) -> Self {
        let margin = 1.0 - libm::pow(0.73, 1.0 / n as f64);
        let row = |&(count, start): &(usize, f64)| Row::new(count, start, trust, margin);
        Self {
            rows: starts.iter().map(row).collect(),
            caution: 1.0,
            gamma: 0.0,
            still: 0,
            // As the window of the CMA-ES tutorial's test for equal function values.
            patience: 10 + (30 * n).div_ceil(lambda),
        }
    }

    /// Draws a name for each choice.
    pub(super) fn draw(&self, generator: &mut Generator) -> Vec<usize> {
        self.rows.iter().map(|row| row.name(generator.unit())).collect()
    }

    /// Learns from the names that the better half drew, best first, with their weights.
    pub(super) fn learn(&mut self, weights: &[f64], names: &[Vec<usize>]) {
        if self.freedom() == 0 {
            return;
        }
        let gradients: Vec<Vec<f64>> = (0..self.rows.len())
            .map(|j| self.rows[j].gradient(weights, names.iter().map(|names| names[j])))
            .collect();
        let length = self.length(&gradients);
        if length > 0.0 {
            self.step(&gradients, length);
        }
        let settled = self.rows.iter().all(Row::is_settled);
        self.still = if settled { self.still + 1 } else { 0 };
    }

    /// |G|.
    fn length(&self, gradients: &[Vec<f64>]) -> f64 {
        let rows = self.rows.iter().zip(gradients);
        libm::sqrt(rows.flat_map(|(row, g)| row.squares(g)).sum())
    }

    fn step(&mut self, gradients: &[Vec<f64>], length: f64) {
        let rate = 1.0 / self.caution;
        let beta = rate / libm::sqrt(self.freedom() as f64);
        let gain = libm::sqrt(beta * (2.0 - beta)) / length;
        for (row, g) in self.rows.iter_mut().zip(gradients) {
            row.remember(g, 1.0 - beta, gain);
            row.step(g, (rate / length).min(FASTEST));
        }
        self.gamma = (1.0 - beta) * (1.0 - beta) * self.gamma + beta * (2.0 - beta);
        let path: f64 = self.rows.iter().flat_map(|row| &row.path).map(|s| s * s).sum();
        self.caution *= libm::exp(beta * (self.gamma - path / ALPHA));
        // So that β is at most 1.
        self.caution = self.caution.max(1.0 / libm::sqrt(self.freedom() as f64));
    }

    /// Σ(K − 1).
    fn freedom(&self) -> usize {
        self.rows.iter().map(|row| row.q.len() - 1).sum()
    }

    /// Coordinate of a name, 0 to 1.
    pub(super) fn coordinate(&self, choice: usize, name: usize) -> f64 {
        self.rows[choice].coordinate(name)
    }

    /// Coordinate of the likeliest name; of equals, the first.
    pub(super) fn middle(&self, choice: usize) -> f64 {
        let q = &self.rows[choice].q;
        let likeliest = (0..q.len()).rev().max_by(|&a, &b| q[a].total_cmp(&q[b]));
        self.coordinate(choice, likeliest.unwrap_or(0))
    }

    /// Standard deviation of the names' coordinates.
    pub(super) fn deviation(&self, choice: usize) -> f64 {
        let row = &self.rows[choice];
        let mean = row.expected(|u| u);
        libm::sqrt(row.expected(|u| (u - mean) * (u - mean)))
    }

    /// Probability of each name.
    pub(super) fn probabilities(&self, choice: usize) -> &[f64] {
        &self.rows[choice].q
    }

    /// True when every choice has been at its margin for `patience` generations.
    pub(super) fn are_settled(&self) -> bool {
        self.freedom() == 0 || self.still >= self.patience
    }
}

/// Signal-to-noise ratio that the adaptation of steps aims at, as published.
const ALPHA: f64 = 1.5;

/// Largest fraction of the way to the better half's frequencies that a step takes.
const FASTEST: f64 = 0.5;

impl Row {
    fn new(count: usize, start: f64, trust: f64, margin: f64) -> Self {
        let first = ((start * count as f64) as usize).min(count - 1);
        let others = (count - 1).max(1) as f64;
        let trust = if count == 1 { 1.0 } else { trust.clamp(1.0 / count as f64, 1.0 - margin) };
        let q = |name| if name == first { trust } else { (1.0 - trust) / others };
        Self { q: (0..count).map(q).collect(), path: vec![0.0; count], least: margin / others }
    }

    /// Name drawn by a uniform number of 0 to 1.
    fn name(&self, unit: f64) -> usize {
        let mut above = 0.0;
        let passed = |q: &&f64| {
            above += **q;
            above <= unit
        };
        self.q.iter().take_while(passed).count().min(self.q.len() - 1)
    }

    /// g.
    fn gradient(&self, weights: &[f64], names: impl Iterator<Item = usize>) -> Vec<f64> {
        let mut g: Vec<f64> = self.q.iter().map(|q| -q * weights.iter().sum::<f64>()).collect();
        for (weight, name) in weights.iter().zip(names) {
            g[name] += weight;
        }
        g
    }

    /// Squares of the elements of G.
    fn squares<'a>(&'a self, g: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.q.iter().zip(g).map(|(q, g)| g * g / q)
    }

    /// s ← keep · s + gain · G.
    fn remember(&mut self, g: &[f64], keep: f64, gain: f64) {
        for ((s, q), g) in self.path.iter_mut().zip(&self.q).zip(g) {
            *s = keep * *s + gain * g / libm::sqrt(*q);
        }
    }

    /// q ← q + rate · g, then the margin: probabilities below the least are raised to it, at the
    /// expense of the others in proportion to their excess over it.
    fn step(&mut self, g: &[f64], rate: f64) {
        for (q, g) in self.q.iter_mut().zip(g) {
            *q = (*q + rate * g).max(self.least);
        }
        let above: f64 = self.q.iter().map(|q| q - self.least).sum();
        let scale = (1.0 - self.least * self.q.len() as f64) / above;
        for q in &mut self.q {
            *q = self.least + scale * (*q - self.least);
        }
    }

    fn coordinate(&self, name: usize) -> f64 {
        (name as f64 + 0.5) / self.q.len() as f64
    }

    fn expected(&self, f: impl Fn(f64) -> f64) -> f64 {
        self.q.iter().enumerate().map(|(name, q)| q * f(self.coordinate(name))).sum()
    }

    /// True when all names but one have the least probability.
    fn is_settled(&self) -> bool {
        let rare = self.q.iter().filter(|q| **q <= self.least * 1.000_001).count();
        rare + 1 >= self.q.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::candidate_generator;

    const WEIGHTS: [f64; 3] = [0.6, 0.3, 0.1];

    /// Choices among ten coordinates, with ten candidates.
    fn choices(starts: &[(usize, f64)]) -> Choices {
        Choices::new(starts, 0.5, 10, 10)
    }

    /// Learns from generations in which `names` gives the names drawn, by generation and rank.
    fn taught(
        mut choices: Choices,
        generations: usize,
        names: impl Fn(usize, usize) -> Vec<usize>,
    ) -> Choices {
        for generation in 0..generations {
            let drawn: Vec<_> = (0..3).map(|rank| names(generation, rank)).collect();
            choices.learn(&WEIGHTS, &drawn);
        }
        choices
    }

    #[test]
    fn the_start_name_is_drawn_with_the_probability_of_trust_and_the_others_share_the_rest() {
        let choices = choices(&[(4, 0.6), (2, 0.0), (1, 0.5)]);
        let mut counts = [[0_i32; 4]; 3];
        for candidate in 0..4_000 {
            let names = choices.draw(&mut candidate_generator(1, 0, candidate));
            names.into_iter().enumerate().for_each(|(j, name)| counts[j][name] += 1);
        }
        for (seen, expected) in counts[0].into_iter().zip([667, 667, 2_000, 667]) {
            assert!((seen - expected).abs() < 100, "{counts:?}");
        }
        assert!((counts[1][0] - 2_000).abs() < 100 && counts[2][0] == 4_000, "{counts:?}");
        assert_eq!([0, 1, 2].map(|j| choices.middle(j)), [0.625, 0.25, 0.5]);
    }

    #[test]
    fn no_trust_makes_names_equally_likely_and_full_trust_loses_none() {
        let first = |trust| Choices::new(&[(4, 0.6)], trust, 10, 10).probabilities(0).to_vec();
        assert_eq!(first(0.0), [0.25; 4]);
        let margin = 1.0 - 0.73f64.powf(0.1);
        assert!((first(1.0)[2] - (1.0 - margin)).abs() < 1e-12, "{:?}", first(1.0));
        assert!((first(1.0)[0] - margin / 3.0).abs() < 1e-12, "{:?}", first(1.0));
    }

    #[test]
    fn a_name_that_wins_becomes_likely_and_none_is_lost() {
        let start = choices(&[(4, 0.1), (3, 0.5)]);
        let taught = taught(start, 40, |_, _| vec![2, 0]);
        let margin = 1.0 - 0.73f64.powf(0.1);
        for (j, winner, others) in [(0, 2, 3.0), (1, 0, 2.0)] {
            for (name, &q) in taught.probabilities(j).iter().enumerate() {
                let expected = if name == winner { 1.0 - margin } else { margin / others };
                assert!((q - expected).abs() < 1e-12, "choice {j}, name {name}: {q}");
            }
        }
    }

    #[test]
    fn a_step_goes_at_most_half_the_way_to_the_winners() {
        let taught = taught(choices(&[(2, 0.0)]), 1, |_, _| vec![1]);
        assert!((taught.probabilities(0)[1] - 0.75).abs() < 1e-12, "{taught:?}");
    }

    #[test]
    fn the_order_of_the_names_changes_nothing() {
        let drawn = |generation, rank| (generation * 7 + rank * 5) % 11 % 4;
        let straight = taught(choices(&[(4, 0.1)]), 60, |g, r| vec![drawn(g, r)]);
        let turned = taught(choices(&[(4, 0.9)]), 60, |g, r| vec![3 - drawn(g, r)]);
        for (a, b) in straight.probabilities(0).iter().zip(turned.probabilities(0).iter().rev()) {
            assert!((a - b).abs() < 1e-9, "{straight:?} {turned:?}");
        }
    }

    #[test]
    fn steps_shorten_when_winners_are_random_but_not_when_they_agree() {
        let start = || choices(&[(3, 0.5), (2, 0.2), (4, 0.1)]);
        let random = |g: usize, rank: usize| {
            let mut generator = candidate_generator(3, g as u64, rank as u64);
            [3.0, 2.0, 4.0].map(|count| (generator.unit() * count) as usize).to_vec()
        };
        let (lost, sure) = (taught(start(), 200, random), taught(start(), 200, |_, _| vec![0; 3]));
        assert!(lost.caution > 5.0 * sure.caution, "{} {}", lost.caution, sure.caution);
        assert!(!lost.are_settled() && sure.are_settled());
        let likeliest = lost.probabilities(2).iter().copied().fold(0.0, f64::max);
        assert!(likeliest < 0.6, "{:?}", lost.probabilities(2));
    }

    #[test]
    fn probabilities_add_up_to_one_and_keep_their_margin() {
        for seed in 0..50 {
            let names = |g: usize, rank: usize| {
                let mut generator = candidate_generator(seed, g as u64, rank as u64);
                let skewed = |u: f64| if seed % 2 == 0 { u } else { u * u * u };
                [1.0, 2.0, 5.0].map(|count| (skewed(generator.unit()) * count) as usize).to_vec()
            };
            let choices = taught(choices(&[(1, 0.0), (2, 1.0), (5, 0.5)]), 300, names);
            for j in 0..3 {
                let q = choices.probabilities(j);
                assert!((q.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{q:?}");
                let least = choices.rows[j].least * (1.0 - 1e-9);
                assert!(q.iter().all(|q| (least..=1.0 + 1e-9).contains(q)), "{q:?}");
            }
        }
    }

    #[test]
    fn the_deviation_is_that_of_the_names_coordinates() {
        let choices = choices(&[(2, 0.0), (1, 0.0)]);
        assert_eq!([0, 1].map(|j| choices.deviation(j)), [0.25, 0.0]);
    }
}
