//! Observability: the motions that a set of pairs determines.

use nalgebra::{Matrix6, Vector6};

/// The eigenvalues and directions of the information that the pairs hold about a small motion.
///
/// ```text
/// I = Σ j jᵀ / pairs      j = [ (s - c) × n / L ; n ]      c = mean s, L² = mean |s - c|²
/// ```
///
/// Rotations turn about the centroid `c` of the pairs and are scaled by their spread `L`, so that
/// all six are shares of one: an eigenvalue is the mean squared residual that a unit motion causes.
/// Two walls and a floor seen evenly give a translation 1/3 in each direction; a plane gives 0 for
/// the two shifts within it and the turn about its normal. The test on eigenvalues follows Zhang,
/// Kaess and Singh, "On degeneracy of optimization-based state estimation problems", 2016; the
/// scaling is ours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observability {
    /// Eigenvalues, ascending.
    pub information: [f64; 6],
    /// Directions as columns, in the order of `information`: turns about x y z (times `L`), then
    /// shifts along x y z.
    pub directions: Matrix6<f64>,
    /// Count of the first ones below the threshold: motions that the pairs leave open.
    pub unobservable: usize,
}

impl Observability {
    /// The observability of an information matrix scaled as above.
    pub(super) fn from_information(information: &Matrix6<f64>, least: f64) -> Self {
        let eigen = information.symmetric_eigen();
        let mut order = [0, 1, 2, 3, 4, 5];
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let information = order.map(|i| eigen.eigenvalues[i]);
        Self {
            information,
            directions: Matrix6::from_columns(
                &order.map(|i| eigen.eigenvectors.column(i).into_owned()),
            ),
            unobservable: information
                .iter()
                .filter(|value| value.is_nan() || **value <= least)
                .count(),
        }
    }

    /// True when a direction is left open.
    pub fn is_degenerate(&self) -> bool {
        self.unobservable > 0
    }

    /// Solves `A x = b` among the motions that are observable; `x` is zero along
    /// the others.
    pub(super) fn solve_within(&self, a: &Matrix6<f64>, b: &Vector6<f64>) -> Vector6<f64> {
        let along = |i: usize| self.directions.column(i) * self.directions.column(i).transpose();
        let open: Matrix6<f64> = (0..self.unobservable).map(along).sum();
        let seen = Matrix6::identity() - open;
        // Along the open directions it solves x = 0.
        (seen * a * seen + open)
            .cholesky()
            .map_or_else(Vector6::zeros, |whole| whole.solve(&(seen * b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solution_has_no_part_along_an_open_direction() {
        let information = Matrix6::from_diagonal(&Vector6::new(0.5, 0.2, 0.1, 0.5, 1e-9, 0.3));
        let seen = Observability::from_information(&information, 1e-3);
        let mut whole = Matrix6::from_diagonal(&Vector6::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0));
        (whole[(0, 4)], whole[(4, 0)], whole[(0, 1)], whole[(1, 0)]) = (0.7, 0.7, 0.5, 0.5);
        let x = seen.solve_within(&whole, &Vector6::new(1.5, 2.5, 3.0, 4.0, 5.0, 6.0));
        assert!((x - Vector6::new(1.0, 1.0, 1.0, 1.0, 0.0, 1.0)).norm() < 1e-12, "{x}");
    }
}
