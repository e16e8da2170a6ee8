//! Whole numbers: CMA-ES with margin (Hamano et al., GECCO 2022, arXiv:2205.13482).

/// Keeps a probability of at least α for the cells beside the mean's, so that no whole number
/// settles for good.
///
/// ```text
/// α = 1/(nλ)          v = m + A (x − m)          value = the cell v lies in
/// ```
///
/// | name | meaning                                                               |
/// |------|-----------------------------------------------------------------------|
/// | `x`  | as drawn from N(m, σ²C); the update learns from it, not from `v`      |
/// | `A`  | diagonal, 1 at first: factor that widens the deviation of a coordinate |
///
/// Without the margin, a parameter of two or three values soon takes the same value in every
/// candidate, right or wrong. The paper rounds to the nearest value; equal cells of 0 to 1 are the
/// same rule on our grid.
#[derive(Clone, Debug)]
pub(super) struct Margin {
    cells: Vec<Option<usize>>,
    a: Vec<f64>,
    alpha: f64,
}

impl Margin {
    /// For n coordinates and λ candidates; `cells` is empty when none is whole.
    pub(super) fn new(cells: Vec<Option<usize>>, n: usize, lambda: usize) -> Self {
        Self { cells, a: vec![1.0; n], alpha: 1.0 / (n * lambda) as f64 }
    }

    fn cells(&self, i: usize) -> Option<usize> {
        self.cells.get(i).copied().flatten()
    }

    /// v = m + A (x − m) of a whole coordinate; `x` itself of a real one.
    pub(super) fn widen(&self, i: usize, mean: f64, x: f64) -> f64 {
        self.cells(i).map_or(x, |_| mean + self.a[i] * (x - mean))
    }

    /// Middle of the cell that `v` lies in, of a whole coordinate; `v` itself of a real one.
    pub(super) fn snap(&self, i: usize, v: f64) -> f64 {
        self.cells(i).map_or(v, |count| (cell(v, count) + 0.5) / count as f64)
    }

    /// Restores the margin after an update: moves the mean of a coordinate and widens its deviation
    /// as far as needed.
    pub(super) fn correct(&mut self, mean: &mut [f64], spread: &[f64]) {
        for i in 0..self.cells.len() {
            let Some(count) = self.cells(i).filter(|&count| count > 1) else { continue };
            let deviation = self.a[i] * spread[i];
            if !(deviation > 0.0 && deviation.is_finite()) {
                continue;
            }
            let (k, count) = (cell(mean[i], count), count as f64);
            if k == 0.0 {
                mean[i] = mean[i].max(1.0 / count - deviation * quantile(self.alpha));
            } else if k == count - 1.0 {
                mean[i] = mean[i].min(k / count + deviation * quantile(self.alpha));
            } else if let Some((m, a)) =
                self.between(mean[i], deviation, k / count, (k + 1.0) / count)
            {
                mean[i] = m;
                self.a[i] = a / spread[i];
            }
        }
    }

    /// Mean and deviation that leave a probability of at least about α/2 beyond either wall of the
    /// cell; `None` when the present ones do.
    fn between(&self, mean: f64, deviation: f64, low: f64, up: f64) -> Option<(f64, f64)> {
        let least = self.alpha / 2.0;
        let p = [tail((mean - low) / deviation), tail((up - mean) / deviation)];
        if p.iter().all(|&p| p >= least) {
            return None;
        }
        let middle = 1.0 - p[0] - p[1];
        let raised = p.map(|p| p.max(least));
        let all = raised[0] + middle + raised[1];
        // Takes the excess from all that lies above the least, so that the sum is 1 again.
        let fair = raised.map(|p| p + (1.0 - all) * (p - least) / (all - 3.0 * least));
        let q = fair.map(|p| quantile(p.clamp(1e-10, 0.5 - 1e-10)));
        let sum = q[0] + q[1];
        Some(((low * q[1] + up * q[0]) / sum, (up - low) / sum))
    }
}

/// Index of the cell, of `count` equal ones of 0 to 1, that holds a coordinate; outside, the
/// outermost.
fn cell(u: f64, count: usize) -> f64 {
    (u * count as f64).floor().clamp(0.0, count as f64 - 1.0)
}

/// Probability of a standard normal above `z`.
fn tail(z: f64) -> f64 {
    0.5 * libm::erfc(z / std::f64::consts::SQRT_2)
}

/// Inverse of [`tail`] for `p` from 1e-10 to 0.5; √χ²₁ of 1 − 2p.
///
/// Newton's method on ln tail(z), which is concave: the first step from 0 overshoots, every later
/// one comes back without passing the root.
fn quantile(p: f64) -> f64 {
    let mut z = 0.0;
    for _ in 0..12 {
        let slope = -libm::exp(-0.5 * z * z) / (libm::sqrt(2.0 * std::f64::consts::PI) * tail(z));
        z -= (libm::log(tail(z)) - libm::log(p)) / slope;
    }
    z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (p, z) in [
            (0.5, 0.0),
            (0.1, 1.281_551_6),
            (0.025, 1.959_964),
            (1e-3, 3.090_232_3),
            (1e-10, 6.361_340_9),
        ] {
            assert!((quantile(p) - z).abs() < 1e-6, "{p}: {} against {z}", quantile(p));
        }
    }

    #[test]
    fn the_neighbours_of_the_mean_keep_their_probability() {
        for (count, start) in [(2, 0.1), (2, 0.9), (3, 0.4), (5, 0.5), (21, 0.03), (21, 0.77)] {
            for spread in [1e-9, 1e-3, 0.02, 0.3] {
                let mut margin = Margin::new(vec![Some(count)], 1, 10);
                let mut mean = [start];
                margin.correct(&mut mean, &[spread]);
                let (k, deviation) = (cell(mean[0], count), margin.a[0] * spread);
                assert_eq!(k, cell(start, count), "the mean stays in its cell");
                let low = tail((mean[0] - k / count as f64) / deviation);
                let up = tail(((k + 1.0) / count as f64 - mean[0]) / deviation);
                let least = 0.99 * margin.alpha / 2.0;
                assert!(k == 0.0 || low > least, "{count} cells, {spread}: {low}");
                assert!(k == count as f64 - 1.0 || up > least, "{count} cells, {spread}: {up}");
            }
        }
    }

    #[test]
    fn a_deviation_that_is_wide_enough_stays_as_it_is() {
        let mut margin = Margin::new(vec![None, Some(5)], 2, 10);
        let mut mean = [0.3, 0.5];
        margin.correct(&mut mean, &[1e-9, 0.1]);
        assert_eq!((mean, margin.a), ([0.3, 0.5], vec![1.0, 1.0]));
    }

    #[test]
    fn values_snap_to_the_middle_of_their_cell() {
        let margin = Margin::new(vec![None, Some(4)], 2, 10);
        assert_eq!(margin.snap(0, 0.3), 0.3);
        assert_eq!(
            [-0.2, 0.0, 0.3, 0.99, 1.0, 1.7].map(|v| margin.snap(1, v)),
            [0.125, 0.125, 0.375, 0.875, 0.875, 0.875]
        );
    }
}
