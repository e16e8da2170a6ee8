//! Fixed constants of CMA-ES, one equation a line.

/// Published set of constants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Constants {
    /// The tutorial of 2016 (arXiv:1604.00772, Eqs. 49–58).
    Tutorial,
    /// pycma 4.5: as many evaluations as the tutorial's, or up to 7 % fewer
    /// (benches/record/optimiser.md).
    #[default]
    Pycma,
}

/// Constants of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Strategy {
    /// n, number of real and whole coordinates.
    pub dimension: usize,
    /// λ, candidates per generation.
    pub lambda: usize,
    /// μ, candidates with a positive weight.
    pub mu: usize,
    /// w_1..w_λ, recombination weights, the last ones negative.
    pub weights: Vec<f64>,
    /// μ_eff, variance effective selection mass.
    pub mu_eff: f64,
    /// c_σ, learning rate of the path of σ.
    pub c_sigma: f64,
    /// d_σ, damping of σ.
    pub d_sigma: f64,
    /// c_c, learning rate of the path of C.
    pub c_c: f64,
    /// c_1, learning rate of the rank-one update.
    pub c_1: f64,
    /// c_μ, learning rate of the rank-μ update.
    pub c_mu: f64,
    /// E‖N(0, I)‖, mean length of a standard normal vector.
    pub chi_n: f64,
    /// Published set that these are of.
    pub constants: Constants,
}

impl Strategy {
    /// Default λ = 4 + ⌊3 ln n⌋ (Eq. 48).
    pub fn default_lambda(dimension: usize) -> usize {
        4 + (3.0 * libm::log(dimension as f64)) as usize
    }

    /// Constants for n coordinates and λ candidates, at least 2; for n = 0 those of 1.
    pub fn new(dimension: usize, lambda: usize, constants: Constants) -> Self {
        let n = dimension.max(1) as f64;
        let mu = lambda / 2;
        let raw: Vec<f64> = (1..=lambda)
            .map(|i| libm::log((lambda as f64 + 1.0) / 2.0) - libm::log(i as f64))
            .collect(); // Eq. 49
        let mu_eff = effective(&raw[..mu]);
        let mu_eff_minus = effective(&raw[mu..]);
        let c_1 = c_1(n, mu_eff, lambda, constants);
        let c_mu = c_mu(n, mu_eff, c_1, constants);
        let c_sigma = c_sigma(n, mu_eff, constants);
        // Eqs. 50–52: bounds of the sum of negative weights.
        let learning = 1.0 + c_1 / c_mu;
        let selection = 1.0 + 2.0 * mu_eff_minus / (mu_eff + 2.0);
        let definite = (1.0 - c_1 - c_mu) / (n * c_mu);
        let negative = learning.min(selection).min(definite);
        Self {
            dimension,
            lambda,
            mu,
            weights: normalised(&raw, negative), // Eq. 53
            mu_eff,
            c_sigma,
            d_sigma: d_sigma(n, mu_eff, c_sigma, constants),
            c_c: (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n), // Eq. 56
            c_1,
            c_mu,
            chi_n: chi(n, constants),
            constants,
        }
    }
}

/// Effective number of weights, (Σw)² / Σw².
fn effective(weights: &[f64]) -> f64 {
    let sum: f64 = weights.iter().sum();
    let squares: f64 = weights.iter().map(|w| w * w).sum();
    if squares == 0.0 { 0.0 } else { sum * sum / squares }
}

/// Scales the weights: positive ones add up to 1, negative ones to −`negative`.
fn normalised(raw: &[f64], negative: f64) -> Vec<f64> {
    let positive_sum: f64 = raw.iter().filter(|w| **w > 0.0).sum();
    let negative_sum: f64 = -raw.iter().filter(|w| **w < 0.0).sum::<f64>();
    raw.iter()
        .map(|&w| if w >= 0.0 { w / positive_sum } else { w * negative / negative_sum })
        .collect()
}

fn c_1(n: f64, mu_eff: f64, lambda: usize, constants: Constants) -> f64 {
    let c_1 = 2.0 / ((n + 1.3) * (n + 1.3) + mu_eff); // Eq. 57
    match constants {
        Constants::Tutorial => c_1,
        Constants::Pycma => c_1 * (lambda as f64 / 6.0).min(1.0),
    }
}

fn c_mu(n: f64, mu_eff: f64, c_1: f64, constants: Constants) -> f64 {
    let extra = match constants {
        Constants::Tutorial => 0.0,
        Constants::Pycma => 0.25,
    };
    // Eq. 58
    let rate = 2.0 * (extra + mu_eff - 2.0 + 1.0 / mu_eff) / ((n + 2.0) * (n + 2.0) + mu_eff);
    rate.min(1.0 - c_1)
}

fn c_sigma(n: f64, mu_eff: f64, constants: Constants) -> f64 {
    match constants {
        Constants::Tutorial => (mu_eff + 2.0) / (n + mu_eff + 5.0), // Eq. 55
        Constants::Pycma => ((mu_eff + 2.0) / (n + mu_eff + 3.0)).min(0.5),
    }
}

fn d_sigma(n: f64, mu_eff: f64, c_sigma: f64, constants: Constants) -> f64 {
    let root = libm::sqrt((mu_eff - 1.0).max(0.0) / (n + 1.0));
    let scale = match constants {
        Constants::Tutorial => 1.0, // Eq. 55
        Constants::Pycma => (3.0 * (1.0 - libm::exp2(-n / 9.0))).max(1.0),
    };
    1.0 + c_sigma + 2.0 * (scale * root - 1.0).max(0.0)
}

fn chi(n: f64, constants: Constants) -> f64 {
    if constants == Constants::Pycma && n <= 4.0 {
        return std::f64::consts::SQRT_2 * libm::tgamma((n + 1.0) / 2.0) / libm::tgamma(n / 2.0);
    }
    let last = match constants {
        Constants::Tutorial => 21.0,
        Constants::Pycma => 26.0,
    };
    libm::sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (last * n * n))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// n, λ, μ, μ_eff, c_σ T/P, d_σ T/P, c_c, c_1, c_μ T/P, Σw⁻ T/P, χ_n: computed once by
    /// CyberAgent's cmaes 0.13 and pycma 4.5.
    const GOLDEN: [[f64; 15]; 7] = [
        [
            5., 8., 4., 2.6002, 0.36509, 0.43397, 1.36509, 1.43397, 0.45020, 0.047292, 0.038169,
            0.047859, -2.2390, -1.9882, 2.128524,
        ],
        [
            10., 10., 5., 3.1673, 0.28443, 0.31961, 1.28443, 1.31961, 0.29499, 0.015284, 0.020154,
            0.023552, -1.7583, -1.6489, 3.084727,
        ],
        [
            14., 14., 7., 4.2871, 0.26998, 0.29535, 1.26998, 1.29535, 0.23136, 0.008390, 0.019366,
            0.021287, -1.4332, -1.3941, 3.675751,
        ],
        [
            16., 12., 6., 3.7295, 0.23169, 0.25207, 1.23169, 1.25207, 0.20683, 0.006600, 0.012191,
            0.013716, -1.5414, -1.4812, 3.938244,
        ],
        [
            16., 16., 8., 4.8409, 0.26473, 0.28694, 1.26473, 1.30718, 0.20881, 0.006576, 0.018535,
            0.020055, -1.3548, -1.3279, 3.938244,
        ],
        [
            20., 12., 6., 3.7295, 0.19943, 0.21435, 1.19943, 1.21435, 0.17177, 0.004372, 0.008191,
            0.009217, -1.5338, -1.4744, 4.416767,
        ],
        [
            100., 17., 8., 5.0962, 0.06445, 0.06565, 1.06445, 1.06565, 0.03891, 0.000195, 0.000633,
            0.000681, -1.3079, -1.2862, 9.975048,
        ],
    ];

    #[test]
    fn the_constants_are_those_of_two_published_implementations() {
        for row in GOLDEN {
            let both = [Constants::Tutorial, Constants::Pycma]
                .map(|c| Strategy::new(row[0] as usize, row[1] as usize, c));
            for (i, s) in both.iter().enumerate() {
                let negative: f64 = s.weights.iter().filter(|w| **w < 0.0).sum();
                let ours =
                    [s.mu as f64, s.mu_eff, s.c_sigma, s.d_sigma, s.c_c, s.c_1, s.c_mu, negative];
                let theirs = [
                    row[2],
                    row[3],
                    row[4 + i],
                    row[6 + i],
                    row[8],
                    row[9],
                    row[10 + i],
                    row[12 + i],
                ];
                for (ours, theirs) in ours.iter().zip(theirs) {
                    assert!(
                        (ours - theirs).abs() < 1e-4,
                        "n = {}: {ours} against {theirs}",
                        row[0]
                    );
                }
            }
            assert!((both[0].chi_n - row[14]).abs() < 1e-6);
        }
    }

    #[test]
    fn the_weights_of_fourteen_candidates_are_the_published_ones() {
        let theirs = [
            0.361148, 0.236909, 0.164235, 0.112671, 0.072675, 0.039996, 0.012366, -0.036108,
            -0.102005, -0.160951, -0.214275, -0.262956, -0.307738, -0.349199,
        ];
        let ours = Strategy::new(14, 14, Constants::Tutorial).weights;
        for (ours, theirs) in ours.iter().zip(theirs) {
            assert!((ours - theirs).abs() < 1e-5, "{ours} against {theirs}");
        }
    }

    /// With few parameters and many candidates, Eq. 58 alone would give 1.0497, 1.1639 and 1.3046.
    /// Computed by hand from the tutorial.
    #[test]
    fn the_learning_rates_of_the_covariance_add_up_to_at_most_one() {
        for (n, lambda, c_1, c_mu) in [
            (2, 40, 0.090_092_19, 0.688_252_05), // below the bound
            (2, 80, 0.061_203_10, 0.938_796_90),
            (2, 100, 0.052_830_87, 0.947_169_13),
            (3, 200, 0.028_132_75, 0.971_867_25),
        ] {
            let ours = Strategy::new(n, lambda, Constants::Tutorial);
            assert!((ours.c_1 - c_1).abs() < 1e-8, "n = {n}, λ = {lambda}: {}", ours.c_1);
            assert!((ours.c_mu - c_mu).abs() < 1e-8, "n = {n}, λ = {lambda}: {}", ours.c_mu);
        }
        let pycma = Strategy::new(2, 100, Constants::Pycma);
        assert!((pycma.c_mu - 0.947_169_13).abs() < 1e-8, "{}", pycma.c_mu);
    }

    #[test]
    fn the_default_population_grows_with_the_logarithm() {
        assert_eq!([5, 10, 16, 100].map(Strategy::default_lambda), [8, 10, 12, 17]);
    }

    #[test]
    fn the_mean_length_is_exact_up_to_four_dimensions_as_in_pycma() {
        use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};
        let chi = |n| Strategy::new(n, 6, Constants::Pycma).chi_n;
        assert!(
            (chi(1) - FRAC_2_PI.sqrt()).abs() < 1e-14 && (chi(2) - FRAC_PI_2.sqrt()).abs() < 1e-14
        );
        assert!((chi(4) - chi(2) * 1.5).abs() < 1e-14, "Γ(5/2)/Γ(2) = 3/2 · Γ(3/2)/Γ(1)");
    }
}
