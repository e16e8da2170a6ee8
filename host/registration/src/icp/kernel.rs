//! Weight of a pair by its residual.

/// The standard deviation of a normal distribution over the median of its absolute values.
const SIGMA_OVER_MEDIAN: f64 = 1.4826;

/// Least width over the pair distance. With half of the points on a floor without noise the median
/// is near 0, but the walls, which alone hold the motion, have larger residuals.
const LEAST_OVER_REACH: f64 = 0.04;

/// Geman and McClure's weights (Bulletin of the International Statistical Institute, 1987): a pair
/// far from its plane, seen from one side alone or on a leaf, says little.
///
/// ```text
/// w = 1 / (1 + (r / c)²)²      c = width · σ      σ = 1.4826 · median |r|
/// ```
///
/// The scale comes from the residuals themselves, so one width serves a sensor of 2 mm noise and
/// one of 2 cm, a street and a wood.
///
/// If the sensor reports σ_R, pairs with a smaller σ_R weigh more. With `v`
/// the variance that the errors of a pair's two ranges add to its residual:
///
/// ```text
/// w = 1 / k (1 + r² / k c²)²      k = (s² + v) / (s² + v₀)      s² = σ² - v₀      v₀ the median v
/// ```
///
/// So `k` is 1 for a pair of median noise. `s²` is the variance due to surfaces and pairing, at
/// least a quarter of σ²: reported errors explain no more than the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kernel {
    /// 1 / c², 1/m²; 0 for least squares.
    inverse_square: f64,
    /// 0 for the weight, 4 for the slope.
    bend: f64,
    /// `k` of a pair without noise: `s² / (s² + v₀)`.
    quiet: f64,
    /// Part of `k` due to noise, 1/m²: `1 / (s² + v₀)`.
    per_noise: f64,
    /// σ², m².
    variance_m2: f64,
}

/// Least share of the residuals' variance that is not the ranges' error.
const LEAST_QUIET: f64 = 0.25;

impl Kernel {
    /// Least squares: every pair weighs 1.
    pub(crate) const LEAST_SQUARES: Self =
        Self { inverse_square: 0.0, bend: 0.0, quiet: 1.0, per_noise: 0.0, variance_m2: 0.0 };

    /// A kernel of `width` standard deviations of these residuals, m, for pairs up to `reach_m`;
    /// least squares without a width or a residual.
    pub(crate) fn of_residuals(width: Option<f64>, residuals_m: &mut [f32], reach_m: f64) -> Self {
        let (Some(width), false) = (width, residuals_m.is_empty()) else {
            return Self::LEAST_SQUARES;
        };
        let middle = residuals_m.len() / 2;
        let median_m = f64::from(*residuals_m.select_nth_unstable_by(middle, f32::total_cmp).1);
        let scale_m = (width * SIGMA_OVER_MEDIAN * median_m).max(LEAST_OVER_REACH * reach_m);
        let variance_m2 = (scale_m / width).powi(2);
        Self { inverse_square: 1.0 / (scale_m * scale_m), variance_m2, ..Self::LEAST_SQUARES }
    }

    /// The same, with weights by the errors of the ranges, given the median variance, m², that they
    /// add to a residual; unchanged if that is unknown.
    pub(crate) fn with_noise(self, median_m2: Option<f64>) -> Self {
        let Some(median_m2) = median_m2.filter(|_| self.inverse_square > 0.0) else { return self };
        let quiet_m2 = (self.variance_m2 - median_m2).max(LEAST_QUIET * self.variance_m2);
        let per_noise = 1.0 / (quiet_m2 + median_m2);
        Self { quiet: quiet_m2 * per_noise, per_noise, ..self }
    }

    /// The kernel that gives, in place of the weight, the slope of `w r` over the residual:
    ///
    /// ```text
    /// d(w r) / dr = (1 - 3 x) / (1 + x)³ = w (1 + 4 (√w - 1))      x = (r / c)²
    /// ```
    ///
    /// Negative beyond c / √3: there the pull `w r` falls as the residual grows.
    pub(crate) fn slope(self) -> Self {
        Self { bend: 4.0, ..self }
    }

    /// The weight of a residual, m, to whose variance the ranges' errors add `noise_m2`.
    #[inline(always)]
    pub(crate) fn weight(self, r: f64, noise_m2: f64) -> f64 {
        let share = 1.0 / (self.quiet + noise_m2 * self.per_noise);
        let root = 1.0 / (1.0 + r * r * self.inverse_square * share);
        share * root * root * (1.0 + self.bend * (root - 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_residual_of_the_width_weighs_a_quarter() {
        let mut residuals = [0.01f32, 0.02, 0.01, 0.03, 0.01, 0.01, 0.02];
        let kernel = Kernel::of_residuals(Some(3.0), &mut residuals, 0.5);
        let width_m = 3.0 * SIGMA_OVER_MEDIAN * f64::from(0.01f32);
        for (r, expected) in [(0.0, 1.0), (width_m, 0.25), (-width_m, 0.25), (3.0 * width_m, 0.01)]
        {
            assert!((kernel.weight(r, 0.0) - expected).abs() < 1e-12, "{r}");
        }
    }

    #[test]
    fn the_slope_is_what_a_residual_adds_to_its_pull() {
        let kernel = Kernel::of_residuals(Some(3.0), &mut [0.02; 9], 0.5);
        let pull = |r: f64| r * kernel.weight(r, 0.0);
        for r in [0.0, 0.01, 0.05, 0.2, -0.3] {
            let expected = (pull(r + 1e-6) - pull(r - 1e-6)) / 2e-6;
            assert!((kernel.slope().weight(r, 0.0) - expected).abs() < 1e-8, "{r}");
        }
        assert_eq!(Kernel::LEAST_SQUARES.slope().weight(7.0, 0.5), 1.0);
    }

    #[test]
    fn a_pair_whose_ranges_are_surer_than_others_weighs_more() {
        let sigma_m = SIGMA_OVER_MEDIAN * f64::from(0.02f32);
        let median_m2 = sigma_m * sigma_m / 2.0;
        let kernel =
            Kernel::of_residuals(Some(3.0), &mut [0.02; 9], 0.5).with_noise(Some(median_m2));
        // Half of the variance is the surfaces', so k is ½ without noise, 1 with the median, 1½.
        for (noise_m2, expected) in [(0.0, 2.0), (median_m2, 1.0), (2.0 * median_m2, 2.0 / 3.0)] {
            assert!((kernel.weight(0.0, noise_m2) - expected).abs() < 1e-12, "{noise_m2}");
        }
        assert_eq!(kernel.with_noise(None), kernel);
        let boast = Kernel::of_residuals(Some(3.0), &mut [0.02; 9], 0.5).with_noise(Some(1.0));
        assert!((boast.weight(0.0, 1.0) - 1.0).abs() < 1e-3 && boast.weight(0.0, 0.0) < 1e5);
    }

    #[test]
    fn the_slope_knows_of_the_noise() {
        let kernel = Kernel::of_residuals(Some(3.0), &mut [0.02; 9], 0.5).with_noise(Some(5e-4));
        for noise_m2 in [0.0, 2e-3] {
            let pull = |r: f64| r * kernel.weight(r, noise_m2);
            for r in [0.01, 0.05, -0.3] {
                let expected = (pull(r + 1e-6) - pull(r - 1e-6)) / 2e-6;
                assert!((kernel.slope().weight(r, noise_m2) - expected).abs() < 1e-7, "{r}");
            }
        }
    }

    #[test]
    fn without_a_width_or_a_residual_all_weigh_the_same() {
        for kernel in [
            Kernel::of_residuals(None, &mut [0.5], 1.0),
            Kernel::of_residuals(Some(3.0), &mut [], 1.0),
        ] {
            assert_eq!(kernel, Kernel::LEAST_SQUARES);
            assert_eq!(kernel.weight(1e3, 0.5), 1.0);
        }
    }

    #[test]
    fn residuals_that_vanish_leave_a_width_of_the_pair_distance() {
        let kernel = Kernel::of_residuals(Some(3.0), &mut [0.0; 9], 0.5);
        assert_eq!(kernel.weight(0.0, 0.0), 1.0);
        assert!((kernel.weight(LEAST_OVER_REACH * 0.5, 0.0) - 0.25).abs() < 1e-12);
    }
}
