//! The normal distribution of real and whole coordinates, and its update.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::bounds::{is_mirrored, reflect};
use super::margin::Margin;
use super::strategy::{Constants, Strategy};

/// N(m, σ²C) over the real and whole coordinates; there may be none.
#[derive(Clone, Debug)]
pub(super) struct Gaussian {
    pub(super) strategy: Strategy,
    bounded: bool,
    margin: Margin,
    generation: u64,
    /// m.
    pub(super) mean: DVector<f64>,
    pub(super) sigma: f64,
    c: DMatrix<f64>,
    /// Eigenvectors of C, in columns.
    b: DMatrix<f64>,
    /// Square roots of its eigenvalues.
    d: DVector<f64>,
    eigen_generation: u64,
    path_sigma: DVector<f64>,
    path_c: DVector<f64>,
}

/// Largest standard deviation within the unit cube.
const MAX_STD: f64 = 1.0 / 3.0;

impl Gaussian {
    /// N(m, σ²I); `cells` has the number of cells of each whole coordinate.
    pub(super) fn new(
        strategy: Strategy,
        bounded: bool,
        (mean, sigma): (Vec<f64>, f64),
        cells: Vec<Option<usize>>,
    ) -> Self {
        let n = strategy.dimension;
        Self {
            margin: Margin::new(cells, n, strategy.lambda),
            strategy,
            bounded,
            generation: 0,
            mean: DVector::from_vec(mean),
            sigma,
            c: DMatrix::identity(n, n),
            b: DMatrix::identity(n, n),
            d: DVector::repeat(n, 1.0),
            eigen_generation: 0,
            path_sigma: DVector::zeros(n),
            path_c: DVector::zeros(n),
        }
    }

    /// y = B D z ~ N(0, C) (Eqs. 39–40).
    pub(super) fn step(&self, z: Vec<f64>) -> DVector<f64> {
        &self.b * self.d.component_mul(&DVector::from_vec(z))
    }

    /// m + σy.
    pub(super) fn point(&self, step: &DVector<f64>) -> DVector<f64> {
        &self.mean + self.sigma * step
    }

    /// Value at which coordinate `i`, drawn as `x`, is evaluated.
    pub(super) fn express(&self, i: usize, x: f64) -> f64 {
        let wide = self.margin.widen(i, self.mean[i], x);
        let inside = if self.bounded { reflect(wide) } else { wide };
        self.margin.snap(i, inside)
    }

    /// Ends a generation.
    pub(super) fn advance(&mut self) {
        self.generation += 1;
        self.decompose_when_due();
    }

    /// Learns from a generation's steps, best first.
    pub(super) fn learn(&mut self, steps: &[DVector<f64>]) {
        let s = &self.strategy;
        if s.dimension == 0 {
            return;
        }
        let n = s.dimension as f64;
        let mut y_w = DVector::zeros(s.dimension);
        for (w, y) in s.weights.iter().zip(steps).take(s.mu) {
            y_w.axpy(*w, y, 1.0); // Eq. 41
        }
        let whitened = self.whiten(&y_w);
        let s = &self.strategy;
        self.mean.axpy(self.sigma, &y_w, 1.0); // Eq. 42
        let step = libm::sqrt(s.c_sigma * (2.0 - s.c_sigma) * s.mu_eff);
        self.path_sigma = (1.0 - s.c_sigma) * &self.path_sigma + step * whitened; // Eq. 43
        let length = self.path_sigma.norm();
        let h_sigma = self.is_path_short(length);
        let s = &self.strategy;
        let h = f64::from(u8::from(h_sigma));
        let step = h * libm::sqrt(s.c_c * (2.0 - s.c_c) * s.mu_eff);
        self.path_c = (1.0 - s.c_c) * &self.path_c + step * &y_w; // Eq. 45
        let bounded = s.weights.iter().zip(steps).map(|(&w, y)| self.bounded_weight(w, y, n));
        let weights: Vec<f64> = bounded.collect(); // Eq. 46
        let s = &self.strategy;
        let total: f64 = s.weights.iter().sum();
        let forget = (1.0 - h) * s.c_c * (2.0 - s.c_c);
        self.c *= 1.0 + s.c_1 * forget - s.c_1 - s.c_mu * total; // Eq. 47
        self.c.ger(s.c_1, &self.path_c, &self.path_c, 1.0);
        for (w, y) in weights.iter().zip(steps) {
            self.c.ger(s.c_mu * w, y, y, 1.0);
        }
        let change = (s.c_sigma / s.d_sigma) * (length / s.chi_n - 1.0); // Eq. 44
        self.sigma *= libm::exp(change.clamp(-1.0, 1.0));
        if self.bounded {
            self.fold_mean();
            self.cap_deviations();
        }
        let spread = self.spread();
        self.margin.correct(self.mean.as_mut_slice(), &spread);
    }

    /// C^(−1/2) v.
    fn whiten(&self, v: &DVector<f64>) -> DVector<f64> {
        &self.b * (self.b.tr_mul(v)).component_div(&self.d)
    }

    /// h_σ: false while the path is too long for C to learn from it.
    fn is_path_short(&self, length: f64) -> bool {
        let s = &self.strategy;
        let n = s.dimension as f64;
        let generations = 2.0 * (self.generation as f64 + 1.0);
        let settled = 1.0 - libm::pow(1.0 - s.c_sigma, generations);
        match s.constants {
            Constants::Tutorial => length / libm::sqrt(settled) < (1.4 + 2.0 / (n + 1.0)) * s.chi_n,
            Constants::Pycma => length * length / settled / n < 2.0 + 4.0 / (n + 1.0),
        }
    }

    /// Weight of a step; a negative one is scaled so that C stays positive definite.
    fn bounded_weight(&self, weight: f64, step: &DVector<f64>, n: f64) -> f64 {
        if weight >= 0.0 { weight } else { weight * n / (self.whiten(step).norm_squared() + 1e-8) }
    }

    /// Brings a mean that has left the cube back. Outside, the function of the genotype is
    /// mirrored, so the mirrored distribution is the same search.
    fn fold_mean(&mut self) {
        for i in 0..self.mean.len() {
            if is_mirrored(self.mean[i]) {
                self.scale_axis(i, -1.0);
                self.path_sigma[i] = -self.path_sigma[i];
            }
            self.mean[i] = reflect(self.mean[i]);
        }
    }

    /// Limits each standard deviation to a third of the cube: beyond it, reflection makes samples
    /// uniform in any case.
    fn cap_deviations(&mut self) {
        for i in 0..self.mean.len() {
            let deviation = self.sigma * self.c[(i, i)].max(0.0).sqrt();
            if deviation > MAX_STD {
                self.scale_axis(i, MAX_STD / deviation);
            }
        }
    }

    /// Scales one coordinate of the distribution.
    fn scale_axis(&mut self, i: usize, factor: f64) {
        self.c.row_mut(i).scale_mut(factor);
        self.c.column_mut(i).scale_mut(factor);
        self.path_c[i] *= factor;
        self.eigen_generation = 0; // B and D no longer belong to C: decompose again
    }

    /// Decomposes C when it has changed noticeably: every generation up to some 60 parameters.
    fn decompose_when_due(&mut self) {
        let s = &self.strategy;
        if s.dimension == 0 {
            return;
        }
        let gap = 1.0 / ((s.c_1 + s.c_mu) * s.dimension as f64 * 10.0);
        if self.eigen_generation == 0 || (self.generation - self.eigen_generation) as f64 >= gap {
            self.decompose();
            self.eigen_generation = self.generation;
        }
    }

    fn decompose(&mut self) {
        self.c = 0.5 * (&self.c + self.c.transpose());
        let eigen = SymmetricEigen::try_new(self.c.clone(), 1e-14, 1000 * self.strategy.dimension);
        let Some(eigen) = eigen
            .filter(|e| e.eigenvalues.iter().all(|v| v.is_finite()) && e.eigenvalues.max() > 0.0)
        else {
            self.c = self.recomposed();
            return;
        };
        let largest = eigen.eigenvalues.max();
        // Rounding may leave an eigenvalue at or below zero.
        let least = largest * 1e-15;
        if eigen.eigenvalues.min() < least {
            let lift = least - eigen.eigenvalues.min();
            self.c += lift * DMatrix::identity(self.strategy.dimension, self.strategy.dimension);
        }
        self.d = eigen.eigenvalues.map(|v| v.max(least).sqrt());
        self.b = eigen.eigenvectors;
    }

    /// B D² Bᵀ, the last C that could be decomposed.
    fn recomposed(&self) -> DMatrix<f64> {
        let mut c = DMatrix::zeros(self.d.len(), self.d.len());
        for (axis, length) in self.b.column_iter().zip(&self.d) {
            c.ger(length * length, &axis, &axis, 1.0);
        }
        c
    }

    /// σ√C_ii.
    pub(super) fn spread(&self) -> Vec<f64> {
        self.c.diagonal().iter().map(|c| self.sigma * c.max(0.0).sqrt()).collect()
    }

    /// σ√C_ii, for whole numbers widened by the margin.
    pub(super) fn deviations(&self) -> Vec<f64> {
        let spread = self.spread().into_iter().enumerate();
        spread.map(|(i, deviation)| self.margin.widen(i, 0.0, deviation)).collect()
    }

    /// Ratio of the longest to the shortest axis; 1 without coordinates.
    pub(super) fn axis_ratio(&self) -> f64 {
        let least = self.d.iter().copied().reduce(f64::min).unwrap_or(1.0);
        self.d.iter().copied().reduce(f64::max).unwrap_or(1.0) / least
    }

    /// Correlation of two coordinates.
    pub(super) fn correlation(&self, i: usize, j: usize) -> f64 {
        let root = |i: usize| self.c[(i, i)].max(f64::MIN_POSITIVE).sqrt();
        self.c[(i, j)] / (root(i) * root(j))
    }

    /// Fraction of the initial covariance that has been replaced.
    pub(super) fn learned(&self) -> f64 {
        let kept = 1.0 - self.strategy.c_1 - self.strategy.c_mu;
        1.0 - libm::pow(kept, self.generation as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_covariance_that_cannot_be_decomposed_is_replaced_by_the_last_one_that_could() {
        let strategy = Strategy::new(3, 7, Constants::Tutorial);
        let mut gaussian = Gaussian::new(strategy, true, (vec![0.5; 3], 0.2), vec![None; 3]);
        for generation in 0..20 {
            let draw =
                |i: usize| (0..3).map(move |k| libm::sin((generation * 7 + i * 3 + k) as f64));
            let steps: Vec<_> = (0..7).map(|i| gaussian.step(draw(i).collect())).collect();
            gaussian.learn(&steps);
            gaussian.advance();
        }
        let (before, basis) = (gaussian.c.clone(), gaussian.b.clone());
        gaussian.c[(1, 0)] = f64::NAN;
        gaussian.decompose();
        assert!((&gaussian.c - before).amax() < 1e-12);
        assert_eq!(gaussian.b, basis);
    }
}
