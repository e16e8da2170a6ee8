//! Mean, median, quantiles and the standard error of a mean.

/// Arithmetic mean; NaN of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Median, the mean of the two middle values of an even number; NaN of nothing.
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_unstable_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => f64::midpoint(sorted[n / 2 - 1], sorted[n / 2]),
    }
}

/// The value at a share (0 to 1) of the way from the least to the greatest of `sorted`: the nearest
/// one, without interpolation. NaN of nothing.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = (share * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(at).copied().unwrap_or(f64::NAN)
}

/// Standard error of the mean of `values`: s / √n, with n − 1 in s². 0 of one value.
pub fn standard_error(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    (squares / (count - 1.0).max(1.0) / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_those_of_the_textbook() {
        assert_eq!(mean(&[1.0, 2.0, 6.0]), 3.0);
        assert_eq!(median([3.0, 1.0, 2.0].into_iter()), 2.0);
        assert_eq!(median([4.0, 1.0, 2.0, 3.0].into_iter()), 2.5);
        assert_eq!([0.0, 0.5, 0.74, 1.0].map(|s| quantile(&[1.0, 2.0, 3.0], s)), [1., 2., 2., 3.]);
        // s² = 2.5 of five values, so the standard error is √(2.5 / 5).
        let error = standard_error(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!((error - 0.5f64.sqrt()).abs() < 1e-15, "{error}");
        assert_eq!(standard_error(&[7.0]), 0.0);
    }

    #[test]
    fn nothing_has_no_figure() {
        assert!(mean(&[]).is_nan() && quantile(&[], 0.5).is_nan());
        assert!(median(std::iter::empty()).is_nan() && standard_error(&[]).is_nan());
    }
}
