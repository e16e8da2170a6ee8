//! Second-order response surface of the fitness, fitted to a search's own candidates.
//!
//! ```text
//! ln fitness = b_g + Σ_k (α_k P₁(u_k) + β_k P₂(u_k)) + Σ_{j<k} γ_jk P₁(u_j) P₁(u_k)
//! ```
//!
//! P are Legendre's polynomials of the unit cube's coordinates u, orthonormal there (a polynomial
//! chaos of second order: Sudret, Reliab. Eng. Syst. Saf. 93, 2008). A choice has a coefficient for
//! each name in place of the polynomials. Each generation g has its own level b_g, since its pairs
//! are harder or easier than those of others; that is the same as centring every column and ln
//! fitness within each generation. Coefficients are shrunk (ridge: Hoerl and Kennard, Technometrics
//! 12, 1970) by the penalty that best predicts held-out generations.
//!
//! All sums, nalgebra's as well, are plain loops of `f64`: the same bits on every processor.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A candidate: its point in the unit cube, ln fitness, and the index of its generation.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sample {
    pub(super) point: Vec<f64>,
    pub(super) response: f64,
    pub(super) group: usize,
}

/// Kind of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Ordered values.
    Ordered,
    /// A choice of this many names.
    Names(usize),
}

/// The columns of the surface.
#[derive(Clone, Debug)]
pub(super) struct Basis {
    kinds: Vec<Kind>,
    terms: Vec<Term>,
}

/// A column: one axis or two.
#[derive(Clone, Copy, Debug)]
enum Term {
    /// P₁.
    First(usize),
    /// P₂.
    Second(usize),
    /// Axis and name: 1 where the axis has the name, else 0.
    Name(usize, usize),
    /// Product of two P₁.
    Both(usize, usize),
}

impl Basis {
    pub(super) fn new(kinds: Vec<Kind>) -> Self {
        let mut terms = Vec::new();
        for (axis, kind) in kinds.iter().enumerate() {
            match *kind {
                Kind::Ordered => terms.extend([Term::First(axis), Term::Second(axis)]),
                Kind::Names(count) => terms.extend((1..count).map(|name| Term::Name(axis, name))),
            }
        }
        let ordered: Vec<usize> =
            (0..kinds.len()).filter(|&axis| kinds[axis] == Kind::Ordered).collect();
        for (i, &one) in ordered.iter().enumerate() {
            terms.extend(ordered[..i].iter().map(|&other| Term::Both(other, one)));
        }
        Self { kinds, terms }
    }

    /// Indices of the terms that an axis is in.
    fn of_axis(&self, axis: usize) -> impl Iterator<Item = usize> {
        let is_in = move |term: &Term| match *term {
            Term::First(own) | Term::Second(own) | Term::Name(own, _) => own == axis,
            Term::Both(one, other) => one == axis || other == axis,
        };
        (0..self.terms.len()).filter(move |&number| is_in(&self.terms[number]))
    }

    fn value(&self, term: usize, point: &[f64]) -> f64 {
        match self.terms[term] {
            Term::First(axis) => first(point[axis]),
            Term::Second(axis) => second(point[axis]),
            Term::Name(axis, name) => f64::from(u8::from(self.name(axis, point[axis]) == name)),
            Term::Both(one, other) => first(point[one]) * first(point[other]),
        }
    }

    fn name(&self, axis: usize, u: f64) -> usize {
        match self.kinds[axis] {
            Kind::Ordered => 0,
            Kind::Names(count) => ((u * count as f64) as usize).min(count.saturating_sub(1)),
        }
    }

    fn row(&self, point: &[f64]) -> Vec<f64> {
        (0..self.terms.len()).map(|term| self.value(term, point)).collect()
    }

    /// Sum of the terms that an axis is in, at a point.
    pub(super) fn part(&self, weights: &[f64], axis: usize, point: &[f64]) -> f64 {
        self.of_axis(axis).map(|term| weights[term] * self.value(term, point)).sum()
    }

    /// Difference of each term between two points that differ along one axis.
    fn step(&self, axis: usize, to: &[f64], from: &[f64]) -> Vec<f64> {
        let mut step = vec![0.0; self.terms.len()];
        for term in self.of_axis(axis) {
            step[term] = self.value(term, to) - self.value(term, from);
        }
        step
    }
}

/// P₁ = √3·(2u − 1).
fn first(u: f64) -> f64 {
    1.732_050_807_568_877_2 * (2.0 * u - 1.0)
}

/// P₂ = √5·(6u² − 6u + 1).
fn second(u: f64) -> f64 {
    2.236_067_977_499_79 * (6.0 * u * u - 6.0 * u + 1.0)
}

/// Values minus the mean of their group.
pub(super) fn centred(values: &[f64], groups: &[Range<usize>]) -> Vec<f64> {
    let mut centred = values.to_vec();
    for group in groups {
        let mean = values[group.clone()].iter().sum::<f64>() / group.len() as f64;
        centred[group.clone()].iter_mut().for_each(|value| *value -= mean);
    }
    centred
}

/// Normal equations of some rows.
#[derive(Clone)]
struct Sums {
    /// Number of rows.
    count: usize,
    /// Sums of squares; the lower triangle alone.
    squares: DMatrix<f64>,
    /// Sums of products with the response.
    products: DVector<f64>,
}

impl Sums {
    fn new(terms: usize) -> Self {
        let squares = DMatrix::zeros(terms, terms);
        Self { count: 0, squares, products: DVector::zeros(terms) }
    }

    fn add(&mut self, row: &[f64], response: f64) {
        self.count += 1;
        for (j, &value) in row.iter().enumerate() {
            self.products[j] += value * response;
            let mut column = self.squares.column_mut(j);
            column.iter_mut().zip(row).skip(j).for_each(|(sum, other)| *sum += value * other);
        }
    }

    fn add_all(&mut self, other: &Self) {
        self.count += other.count;
        self.squares += &other.squares;
        self.products += &other.products;
    }
}

/// Coefficients of a fit, with the factor of its normal equations.
pub(super) struct Fit {
    pub(super) weights: Vec<f64>,
    cholesky: Cholesky<f64, Dyn>,
}

impl Fit {
    /// Ridge regression. The penalty is multiplied by the number of rows, so that it means the same
    /// for few and for many.
    fn new(sums: &Sums, penalty: f64) -> Self {
        let mut squares = sums.squares.clone();
        let ridge = penalty * sums.count as f64;
        (0..squares.nrows()).for_each(|term| squares[(term, term)] += ridge);
        // With the ridge they are positive definite but for rounding, which the substitute covers.
        let cholesky = Cholesky::new_with_substitute(squares, f64::MIN_POSITIVE)
            .expect("the substitute has a square root");
        let weights = cholesky.solve(&sums.products).as_slice().to_vec();
        Self { weights, cholesky }
    }

    /// Standard deviation of the surface's difference between two points that differ along one
    /// axis, where single candidates scatter by `scatter`: the posterior of a linear model
    /// (Rasmussen and Williams 2006, Eq. 2.8).
    pub(super) fn spread(
        &self,
        basis: &Basis,
        axis: usize,
        [to, from]: [&[f64]; 2],
        scatter: f64,
    ) -> f64 {
        let step = DVector::from_vec(basis.step(axis, to, from));
        let half = self.cholesky.l_dirty().solve_lower_triangular(&step);
        half.map_or(f64::NAN, |half| scatter * half.norm())
    }
}

/// A fitted surface, with its residuals for held-out candidates.
pub(super) struct Surrogate {
    pub(super) basis: Basis,
    /// Indices of each generation's candidates.
    pub(super) groups: Vec<Range<usize>>,
    /// ln fitness minus its generation's mean.
    pub(super) responses: Vec<f64>,
    /// Held-out residuals: of the fit without the candidate's fold.
    pub(super) held_out: Vec<f64>,
    /// Residuals of the fit of all.
    pub(super) residuals: Vec<f64>,
    /// Fit of all candidates.
    pub(super) whole: Fit,
    /// Fits without the generations of a fold.
    folds: Vec<Fit>,
}

/// Folds of the cross-validation: generation g is in fold g mod `FOLDS`.
const FOLDS: usize = 5;

/// Ridge penalties to choose from, for each candidate.
const PENALTIES: [f64; 8] = [3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0];

impl Surrogate {
    /// Fits samples that are sorted by group.
    pub(super) fn new(kinds: Vec<Kind>, samples: &[Sample]) -> Self {
        let basis = Basis::new(kinds);
        let groups = groups(samples);
        let responses: Vec<f64> = samples.iter().map(|sample| sample.response).collect();
        let responses = centred(&responses, &groups);
        let rows = centred_rows(&basis, samples, &groups);
        let terms = basis.terms.len();
        let mut parts = vec![Sums::new(terms); FOLDS];
        for (number, group) in groups.iter().enumerate() {
            for i in group.clone() {
                parts[number % FOLDS].add(&rows[i], responses[i]);
            }
        }
        let others = |fold: Option<usize>| {
            let mut sums = Sums::new(terms);
            let parts = parts.iter().enumerate().filter(|(part, _)| Some(*part) != fold);
            parts.for_each(|(_, part)| sums.add_all(part));
            sums
        };
        let without: Vec<Sums> = (0..FOLDS).map(|fold| others(Some(fold))).collect();
        let residuals = |fits: &dyn Fn(usize) -> Vec<f64>| -> Vec<f64> {
            let weights: Vec<Vec<f64>> = (0..FOLDS).map(fits).collect();
            let each = groups
                .iter()
                .enumerate()
                .flat_map(|(number, group)| group.clone().map(move |i| (i, number % FOLDS)));
            each.map(|(i, fold)| responses[i] - dot(&rows[i], &weights[fold])).collect()
        };
        let error = |penalty: f64| {
            let held_out = residuals(&|fold| Fit::new(&without[fold], penalty).weights);
            held_out.iter().map(|e| e * e).sum::<f64>()
        };
        let errors: Vec<f64> = PENALTIES.iter().map(|&penalty| error(penalty)).collect();
        let best = (0..PENALTIES.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b]));
        let penalty = best.map_or(1.0, |best| PENALTIES[best]);
        let folds: Vec<Fit> = without.iter().map(|sums| Fit::new(sums, penalty)).collect();
        let held_out = residuals(&|fold| folds[fold].weights.clone());
        let whole = Fit::new(&others(None), penalty);
        let residuals = residuals(&|_| whole.weights.clone());
        Self { basis, groups, responses, held_out, residuals, whole, folds }
    }

    /// Coefficients of the fit without a group's fold.
    pub(super) fn weights_without(&self, group: usize) -> &[f64] {
        &self.folds[group % FOLDS].weights
    }

    /// Standard deviation of single, held-out candidates around the surface.
    pub(super) fn scatter(&self) -> f64 {
        let free = self.held_out.len().saturating_sub(self.groups.len()).max(1);
        (self.held_out.iter().map(|e| e * e).sum::<f64>() / free as f64).sqrt()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Range of samples of each group.
fn groups(samples: &[Sample]) -> Vec<Range<usize>> {
    let mut end = 0;
    let group = |group: &[Sample]| {
        end += group.len();
        end - group.len()..end
    };
    samples.chunk_by(|a, b| a.group == b.group).map(group).collect()
}

/// A row of terms for each sample, minus the mean row of its group.
fn centred_rows(basis: &Basis, samples: &[Sample], groups: &[Range<usize>]) -> Vec<Vec<f64>> {
    let mut rows: Vec<Vec<f64>> = samples.iter().map(|s| basis.row(&s.point)).collect();
    for group in groups {
        for term in 0..basis.terms.len() {
            let mean = rows[group.clone()].iter().map(|row| row[term]).sum::<f64>();
            let mean = mean / group.len() as f64;
            rows[group.clone()].iter_mut().for_each(|row| row[term] -= mean);
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_random::Generator;

    /// Candidates of a surface, with a random level for each generation.
    fn samples(surface: impl Fn(&[f64]) -> f64, noise: f64, groups: usize) -> Vec<Sample> {
        let mut random = Generator::new(11, 0);
        let mut samples = Vec::new();
        for group in 0..groups {
            let level = 3.0 * random.normals(1)[0];
            for _ in 0..12 {
                let point: Vec<f64> = (0..4).map(|_| random.unit()).collect();
                let response = level + surface(&point) + noise * random.normals(1)[0];
                samples.push(Sample { point, response, group });
            }
        }
        samples
    }

    const KINDS: [Kind; 4] = [Kind::Ordered, Kind::Ordered, Kind::Ordered, Kind::Names(3)];

    fn quadratic(u: &[f64]) -> f64 {
        let name = [0.0, 0.7, -0.4][((u[3] * 3.0) as usize).min(2)];
        2.0 * (u[0] - 0.3) * (u[0] - 0.3) - u[0] * u[1] + name
    }

    #[test]
    fn a_second_order_surface_is_recovered_whatever_the_generations_levels() {
        let samples = samples(quadratic, 0.0, 40);
        let surrogate = Surrogate::new(KINDS.to_vec(), &samples);
        let worst = surrogate.held_out.iter().fold(0.0_f64, |worst, e| worst.max(e.abs()));
        assert!(worst < 0.02, "{worst}");
        let (from, mut to) = ([0.5, 0.6, 0.2, 0.1], [0.5, 0.6, 0.2, 0.1]);
        for (axis, value) in [(0, 0.9), (1, 0.1), (2, 0.9), (3, 0.5), (3, 0.9)] {
            to[axis] = value;
            let part = |point| surrogate.basis.part(&surrogate.whole.weights, axis, point);
            let (fitted, truth) = (part(&to) - part(&from), quadratic(&to) - quadratic(&from));
            assert!((fitted - truth).abs() < 0.02, "axis {axis}: {fitted}, not {truth}");
            to = from;
        }
    }

    #[test]
    fn the_interval_of_a_step_holds_the_truth_in_about_95_percent_of_fits() {
        let (mut missed, mut all) = (0, 0);
        for seed in 0..40 {
            let mut random = Generator::new(100 + seed, 0);
            let mut noisy = samples(quadratic, 0.0, 25);
            noisy.iter_mut().for_each(|sample| sample.response += 0.5 * random.normals(1)[0]);
            let surrogate = Surrogate::new(KINDS.to_vec(), &noisy);
            let (from, to) = ([0.5, 0.6, 0.2, 0.1], [0.9, 0.6, 0.2, 0.1]);
            let part = |point| surrogate.basis.part(&surrogate.whole.weights, 0, point);
            let error = part(&to) - part(&from) - (quadratic(&to) - quadratic(&from));
            let spread =
                surrogate.whole.spread(&surrogate.basis, 0, [&to, &from], surrogate.scatter());
            missed += u32::from(error.abs() > 1.96 * spread);
            all += 1;
        }
        assert!(missed <= 7, "{missed} of {all} miss, expected 5 %");
    }

    #[test]
    fn noise_is_not_predicted() {
        let noise = samples(|_| 0.0, 1.0, 40);
        let surrogate = Surrogate::new(KINDS.to_vec(), &noise);
        let squares = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
        let ratio = squares(&surrogate.held_out) / squares(&surrogate.responses);
        assert!((0.95..1.1).contains(&ratio), "{ratio}");
    }
}
