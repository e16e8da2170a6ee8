//! The search itself.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::bounds::{is_mirrored, reflect};
use super::config::{CmaEsConfig, CmaEsConfigError, StopReason, Stops, TellError, check};
use super::margin::Margin;
use super::random::normals;
use super::strategy::{Constants, Strategy};

/// One candidate: where it was drawn, and where it is evaluated.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// As drawn; may lie outside the cube.
    pub genotype: Vec<f64>,
    /// Inside: evaluate this.
    pub phenotype: Vec<f64>,
}

/// CMA-ES with active covariance update.
///
/// Candidate i of generation g depends on (seed, g, i) and the state only, and the state on the
/// values told: to resume a search, tell it again what it was told.
#[derive(Clone, Debug)]
pub struct CmaEs {
    strategy: Strategy,
    seed: u64,
    bounded: bool,
    margin: Margin,
    stops: Stops,
    initial_sigma: f64,
    generation: u64,
    mean: DVector<f64>,
    sigma: f64,
    c: DMatrix<f64>,
    /// Eigenvectors of C, in columns.
    b: DMatrix<f64>,
    /// Square roots of its eigenvalues.
    d: DVector<f64>,
    eigen_generation: u64,
    path_sigma: DVector<f64>,
    path_c: DVector<f64>,
    best: f64,
}

/// Largest standard deviation within the unit cube.
const MAX_STD: f64 = 1.0 / 3.0;

impl CmaEs {
    /// A search that has not begun.
    ///
    /// # Errors
    ///
    /// [`CmaEsConfigError`] names the field that cannot run.
    pub fn new(config: CmaEsConfig) -> Result<Self, CmaEsConfigError> {
        check(&config)?;
        let n = config.mean.len();
        let lambda = config.lambda.unwrap_or_else(|| Strategy::default_lambda(n));
        Ok(Self {
            strategy: Strategy::new(n, lambda, config.constants),
            seed: config.seed,
            bounded: config.bounded,
            margin: Margin::new(config.cells, n, lambda),
            stops: config.stops,
            initial_sigma: config.sigma,
            generation: 0,
            mean: DVector::from_vec(config.mean),
            sigma: config.sigma,
            c: DMatrix::identity(n, n),
            b: DMatrix::identity(n, n),
            d: DVector::repeat(n, 1.0),
            eigen_generation: 0,
            path_sigma: DVector::zeros(n),
            path_c: DVector::zeros(n),
            best: f64::INFINITY,
        })
    }

    /// The candidates of this generation; asked twice, the same.
    pub fn ask(&self) -> Vec<Candidate> {
        (0..self.strategy.lambda)
            .map(|i| {
                let genotype = &self.mean + self.sigma * self.y(i);
                let phenotype =
                    genotype.iter().enumerate().map(|(i, &x)| self.express(i, x)).collect();
                Candidate { genotype: genotype.as_slice().to_vec(), phenotype }
            })
            .collect()
    }

    /// Where a coordinate is evaluated.
    fn express(&self, i: usize, x: f64) -> f64 {
        let wide = self.margin.widen(i, self.mean[i], x);
        let inside = if self.bounded { reflect(wide) } else { wide };
        self.margin.snap(i, inside)
    }

    /// y_i = B D z_i ~ N(0, C) (Eqs. 39–40).
    fn y(&self, candidate: usize) -> DVector<f64> {
        let z = normals(self.seed, self.generation, candidate as u64, self.strategy.dimension);
        &self.b * self.d.component_mul(&DVector::from_vec(z))
    }

    /// Takes the candidates' values, smaller is better, in the order they were asked, and moves on
    /// a generation.
    ///
    /// A value that is not a number, or infinite, ranks last; of equals, the first candidate ranks
    /// first.
    ///
    /// # Errors
    ///
    /// [`TellError`] unless there is a value for each candidate; the search is then as before.
    pub fn tell(&mut self, values: &[f64]) -> Result<(), TellError> {
        let asked = self.strategy.lambda;
        if values.len() != asked {
            return Err(TellError { told: values.len(), asked });
        }
        let worth = |i: &usize| if values[*i].is_finite() { values[*i] } else { f64::INFINITY };
        let mut order: Vec<usize> = (0..asked).collect();
        order.sort_by(|a, b| worth(a).total_cmp(&worth(b)));
        self.best = self.best.min(worth(&order[0]));
        let steps: Vec<DVector<f64>> = order.into_iter().map(|i| self.y(i)).collect();
        // Without a single finite value there is nothing to learn; another draw follows.
        if values.iter().any(|v| v.is_finite()) {
            self.update(&steps);
        }
        self.generation += 1;
        self.decompose_when_due();
        Ok(())
    }

    fn update(&mut self, steps: &[DVector<f64>]) {
        let s = &self.strategy;
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

    /// h_σ: false while the path is so long that C should not learn from it.
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

    /// A negative weight is scaled so that C stays positive definite, however long the step.
    fn bounded_weight(&self, weight: f64, step: &DVector<f64>, n: f64) -> f64 {
        if weight >= 0.0 { weight } else { weight * n / (self.whiten(step).norm_squared() + 1e-8) }
    }

    /// Brings a mean that has left the cube back. The function of the genotype is mirrored there,
    /// so the mirrored distribution is the same search.
    fn fold_mean(&mut self) {
        for i in 0..self.mean.len() {
            if is_mirrored(self.mean[i]) {
                self.scale_axis(i, -1.0);
                self.path_sigma[i] = -self.path_sigma[i];
            }
            self.mean[i] = reflect(self.mean[i]);
        }
    }

    /// Keeps each standard deviation within a third of the cube: beyond it, reflection makes
    /// samples uniform anyway.
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
        self.eigen_generation = 0; // B and D are of another C now
    }

    /// Decomposes C as often as it has changed noticeably: every generation up to some 60
    /// parameters.
    fn decompose_when_due(&mut self) {
        let s = &self.strategy;
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

    /// B D² Bᵀ: the last C that could be decomposed.
    fn recomposed(&self) -> DMatrix<f64> {
        let mut c = DMatrix::zeros(self.d.len(), self.d.len());
        for (axis, length) in self.b.column_iter().zip(&self.d) {
            c.ger(length * length, &axis, &axis, 1.0);
        }
        c
    }

    /// Whether to stop, and why.
    pub fn stop(&self) -> Option<StopReason> {
        let stops = &self.stops;
        let (least, largest) = (self.d.min(), self.d.max());
        let widest = self.spread().into_iter().fold(0.0, f64::max) / self.initial_sigma;
        let checks = [
            (stops.generations.is_some_and(|g| self.generation >= g), StopReason::Generations),
            (stops.target.is_some_and(|t| self.best <= t), StopReason::Target),
            (widest < stops.tol_x, StopReason::TolX),
            (widest > stops.tol_x_up, StopReason::TolXUp),
            ((largest / least) * (largest / least) > stops.condition, StopReason::Condition),
        ];
        checks.into_iter().find(|(holds, _)| *holds).map(|(_, reason)| reason)
    }

    /// Generations told.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// The constants.
    pub fn strategy(&self) -> &Strategy {
        &self.strategy
    }

    /// Middle of the distribution; within the cube when bounded.
    pub fn mean(&self) -> &[f64] {
        self.mean.as_slice()
    }

    /// Step size σ.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Standard deviation each coordinate is drawn with: σ√C_ii, of whole numbers widened by the
    /// margin.
    pub fn deviations(&self) -> Vec<f64> {
        self.spread()
            .into_iter()
            .enumerate()
            .map(|(i, deviation)| self.margin.widen(i, 0.0, deviation))
            .collect()
    }

    /// σ√C_ii.
    fn spread(&self) -> Vec<f64> {
        self.c.diagonal().iter().map(|c| self.sigma * c.max(0.0).sqrt()).collect()
    }

    /// Ratio of the longest to the shortest axis.
    pub fn axis_ratio(&self) -> f64 {
        self.d.max() / self.d.min()
    }

    /// Correlations of the coordinates, row by row.
    pub fn correlations(&self) -> Vec<Vec<f64>> {
        let n = self.strategy.dimension;
        let root = |i: usize| self.c[(i, i)].max(f64::MIN_POSITIVE).sqrt();
        (0..n).map(|i| (0..n).map(|j| self.c[(i, j)] / (root(i) * root(j))).collect()).collect()
    }

    /// How much of the first covariance has been replaced so far, 0 to 1: what the correlations can
    /// be worth at most.
    pub fn covariance_learned(&self) -> f64 {
        1.0 - libm::pow(1.0 - self.strategy.c_1 - self.strategy.c_mu, self.generation as f64)
    }
}

#[cfg(test)]
mod tests;
