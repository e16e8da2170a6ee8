//! Shares of successes, and wins against losses.

use std::f64::consts::LN_2;

/// Wilson's 95 % interval for a share `p` of `n`: it stays within 0 and 1 also for few pairs
/// (J. Am. Stat. Assoc. 22, 1927). NaN of none.
pub fn wilson(p: f64, n: f64) -> [f64; 2] {
    const Z: f64 = 1.959_964;
    if n < 1.0 {
        return [f64::NAN; 2];
    }
    let scale = 1.0 + Z * Z / n;
    let centre = (p + Z * Z / (2.0 * n)) / scale;
    let half = Z / scale * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}

/// Two-sided sign test: probability that a fair coin thrown `a + b` times splits at least as
/// unevenly as `a` to `b`. Of pairs that are found by only one of two, it is McNemar's exact test.
pub fn sign_test(a: usize, b: usize) -> f64 {
    let factorial = |n: usize| libm::lgamma(n as f64 + 1.0);
    let n = a + b;
    let share = |k| factorial(n) - factorial(k) - factorial(n - k) - n as f64 * LN_2;
    let sum: f64 = (0..=a.min(b)).map(|k| libm::exp(share(k))).sum();
    (2.0 * sum).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilsons_interval_matches_the_textbook() {
        let [low, high] = wilson(0.5, 10.0);
        assert!((low - 0.2366).abs() < 1e-4 && (high - 0.7634).abs() < 1e-4);
        assert_eq!(wilson(0.0, 20.0)[0], 0.0);
        assert_eq!(wilson(1.0, 20.0)[1], 1.0);
        assert!(wilson(0.0, 0.0)[0].is_nan());
    }

    #[test]
    fn the_coin_of_the_sign_test_is_fair() {
        for (a, b, p) in
            [(0, 0, 1.0), (3, 3, 1.0), (5, 0, 2.0 / 32.0), (1, 7, 18.0 / 256.0), (999, 999, 1.0)]
        {
            assert!((sign_test(a, b) - p).abs() < 1e-9, "{a} to {b}");
        }
    }
}
