//! How much a pair weighs by its residual.

/// The standard deviation of a normal distribution over the median of its absolute values.
const SIGMA_OVER_MEDIAN: f64 = 1.4826;

/// Least width over the pair distance. Half of the points may lie on a floor without noise: their
/// residuals say nothing of the walls', which alone hold the motion.
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kernel {
    /// 1 / c², 1/m²; 0 for least squares.
    inverse_square: f64,
    /// 0 for the weight, 4 for the slope.
    bend: f64,
}

impl Kernel {
    /// Every pair weighs 1.
    pub(crate) const LEAST_SQUARES: Self = Self { inverse_square: 0.0, bend: 0.0 };

    /// Of `width` standard deviations of these residuals, m, of pairs `reach_m` apart at most;
    /// least squares without a width or a residual.
    pub(crate) fn of_residuals(width: Option<f64>, residuals_m: &mut [f32], reach_m: f64) -> Self {
        let (Some(width), false) = (width, residuals_m.is_empty()) else {
            return Self::LEAST_SQUARES;
        };
        let middle = residuals_m.len() / 2;
        let median_m = f64::from(*residuals_m.select_nth_unstable_by(middle, f32::total_cmp).1);
        let scale_m = (width * SIGMA_OVER_MEDIAN * median_m).max(LEAST_OVER_REACH * reach_m);
        Self { inverse_square: 1.0 / (scale_m * scale_m), bend: 0.0 }
    }

    /// Instead of the weight, how much `w r` grows with the residual, in the same units:
    ///
    /// ```text
    /// d(w r) / dr = (1 - 3 x) / (1 + x)³ = w (1 + 4 (√w - 1))      x = (r / c)²
    /// ```
    ///
    /// Negative beyond c / √3: there a pair lets go faster than it pulls.
    pub(crate) fn slope(self) -> Self {
        Self { bend: 4.0, ..self }
    }

    /// The weight of a residual, m.
    #[inline(always)]
    pub(crate) fn weight(self, r: f64) -> f64 {
        let root = 1.0 / (1.0 + r * r * self.inverse_square);
        root * root * (1.0 + self.bend * (root - 1.0))
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
            assert!((kernel.weight(r) - expected).abs() < 1e-12, "{r}");
        }
    }

    #[test]
    fn the_slope_is_what_a_residual_adds_to_its_pull() {
        let kernel = Kernel::of_residuals(Some(3.0), &mut [0.02; 9], 0.5);
        let pull = |r: f64| r * kernel.weight(r);
        for r in [0.0, 0.01, 0.05, 0.2, -0.3] {
            let expected = (pull(r + 1e-6) - pull(r - 1e-6)) / 2e-6;
            assert!((kernel.slope().weight(r) - expected).abs() < 1e-8, "{r}");
        }
        assert_eq!(Kernel::LEAST_SQUARES.slope().weight(7.0), 1.0);
    }

    #[test]
    fn without_a_width_or_a_residual_all_weigh_the_same() {
        for kernel in [
            Kernel::of_residuals(None, &mut [0.5], 1.0),
            Kernel::of_residuals(Some(3.0), &mut [], 1.0),
        ] {
            assert_eq!(kernel, Kernel::LEAST_SQUARES);
            assert_eq!(kernel.weight(1e3), 1.0);
        }
    }

    #[test]
    fn residuals_that_vanish_leave_a_width_of_the_pair_distance() {
        let kernel = Kernel::of_residuals(Some(3.0), &mut [0.0; 9], 0.5);
        assert_eq!(kernel.weight(0.0), 1.0);
        assert!((kernel.weight(LEAST_OVER_REACH * 0.5) - 0.25).abs() < 1e-12);
    }
}
