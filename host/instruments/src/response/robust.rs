//! Robust statistics: middle and spread of values with outliers.

/// Median; 0 of no values. Sorts them.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}

/// σ of normal values over the median of their magnitudes.
pub(super) const MEDIAN_TO_SIGMA: f64 = 1.4826;

/// σ of normal values whose magnitudes are given. Sorts them.
pub(crate) fn sigma_of_magnitudes(magnitudes: &mut [f64]) -> f64 {
    MEDIAN_TO_SIGMA * median(magnitudes)
}

/// Mean and σ of the densest half of sorted values, σ as if they were normal; (0, 0) of no values.
///
/// The middle half of many normal values is 1.349 σ wide. The densest half of n values is narrower
/// by 2.23 n^(−2/3) of that, since it is selected: measured to 3 % on 4000 samples of 6 to 400
/// values. Fewer than six values count as six.
pub(super) fn densest_half(order: &[f64]) -> (f64, f64) {
    let half = order.len().div_ceil(2);
    let halves = order.windows(half.max(1));
    let extent = |half: &[f64]| half[half.len() - 1] - half[0];
    let dense = halves.min_by(|a, b| extent(a).total_cmp(&extent(b)));
    let narrower = 2.23 / libm::cbrt((order.len().max(6) as f64).powi(2));
    let sigma = |dense: &[f64]| extent(dense) / (1.349 * (1.0 - narrower));
    dense.map_or((0.0, 0.0), |d| (d.iter().sum::<f64>() / d.len() as f64, sigma(d)))
}

/// Spread without an independent part of it.
pub(super) fn beyond(spread: f64, part: f64) -> f64 {
    (spread * spread - part * part).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use echoloop_random::Generator;

    use super::*;

    #[test]
    fn the_densest_half_ignores_outliers() {
        let (mean, spread) = densest_half(&[1.0, 2.0, 2.1, 2.2, 2.3, 9.0, 20.0]);
        assert!((mean - 2.15).abs() < 1e-12 && spread < 0.6);
        assert_eq!(densest_half(&[]), (0.0, 0.0));
        assert_eq!(densest_half(&[3.0]), (3.0, 0.0));
    }

    #[test]
    fn the_densest_half_of_few_normal_values_has_their_spread() {
        for count in [8, 12, 24, 100] {
            let generator = &mut Generator::new(5, count);
            let spread = |_| {
                let mut values = generator.normals(count as usize);
                values.sort_by(f64::total_cmp);
                densest_half(&values).1
            };
            let mean = (0..2000).map(spread).sum::<f64>() / 2000.0;
            assert!((mean - 1.0).abs() < 0.03, "{count} values: {mean}");
        }
    }
}
