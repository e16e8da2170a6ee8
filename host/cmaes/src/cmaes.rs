//! The CMA-ES search: ask, tell, stop.

use nalgebra::DVector;

use super::choices::Choices;
use super::config::{CmaEsConfig, ConfigError, Coordinate, StopReason, Stops, TellError, check};
use super::gaussian::Gaussian;
use super::random::candidate_generator;
use super::strategy::Strategy;

/// One candidate, as drawn and as evaluated.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Point as drawn; may lie outside the cube.
    pub genotype: Vec<f64>,
    /// Point to evaluate; inside the cube when the search is bounded.
    pub phenotype: Vec<f64>,
}

/// CMA-ES with active covariance update, and categorical distributions for choices.
///
/// Candidate i of generation g depends on (seed, g, i) and the state only, and the state on the
/// values told: to resume a search, tell it the same values again.
#[derive(Clone, Debug)]
pub struct CmaEs {
    seed: u64,
    stops: Stops,
    initial_sigma: f64,
    slots: Vec<Slot>,
    gaussian: Gaussian,
    choices: Choices,
    generation: u64,
    /// Mean of every coordinate; for a choice, the coordinate of its likeliest name.
    mean: Vec<f64>,
    best: f64,
}

/// Distribution of a coordinate, and its index there.
#[derive(Clone, Copy, Debug)]
enum Slot {
    Gaussian(usize),
    Choice(usize),
}

/// Coordinates sorted by their distributions.
#[derive(Default)]
struct Split {
    slots: Vec<Slot>,
    ordered: Vec<f64>,
    cells: Vec<Option<usize>>,
    choices: Vec<(usize, f64)>,
}

impl Split {
    fn add(&mut self, coordinate: Coordinate, start: f64) {
        if let Coordinate::Choice(count) = coordinate {
            self.slots.push(Slot::Choice(self.choices.len()));
            self.choices.push((count, start));
        } else {
            self.slots.push(Slot::Gaussian(self.ordered.len()));
            self.ordered.push(start);
            self.cells.push(coordinate.cells());
        }
    }
}

/// Random part of a candidate: y of its real and whole coordinates, a name for each choice.
struct Draw {
    step: DVector<f64>,
    names: Vec<usize>,
}

impl CmaEs {
    /// A search that has not begun.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the field that cannot run.
    pub fn new(config: CmaEsConfig) -> Result<Self, ConfigError> {
        check(&config)?;
        let n = config.mean.len();
        let lambda = config.lambda.unwrap_or_else(|| Strategy::default_lambda(n));
        let mut split = Split::default();
        for (i, &start) in config.mean.iter().enumerate() {
            split.add(config.coordinates.get(i).copied().unwrap_or_default(), start);
        }
        let strategy = Strategy::new(split.ordered.len(), lambda, config.constants);
        let start = (split.ordered, config.sigma);
        let mut search = Self {
            seed: config.seed,
            stops: config.stops,
            initial_sigma: config.sigma,
            slots: split.slots,
            gaussian: Gaussian::new(strategy, config.bounded, start, split.cells),
            choices: Choices::new(&split.choices, config.trust, n, lambda),
            generation: 0,
            mean: Vec::new(),
            best: f64::INFINITY,
        };
        search.mean = search.middle();
        Ok(search)
    }

    fn middle(&self) -> Vec<f64> {
        self.each(|i| self.gaussian.mean[i], |j| self.choices.middle(j))
    }

    /// Collects a value of every coordinate, in their order, by kind.
    fn each<T>(&self, ordered: impl Fn(usize) -> T, choice: impl Fn(usize) -> T) -> Vec<T> {
        let of = |slot: &Slot| match *slot {
            Slot::Gaussian(i) => ordered(i),
            Slot::Choice(j) => choice(j),
        };
        self.slots.iter().map(of).collect()
    }

    /// The candidates of this generation; the same each time until [`Self::tell`].
    pub fn ask(&self) -> Vec<Candidate> {
        (0..self.strategy().lambda)
            .map(|candidate| {
                let draw = self.draw(candidate);
                let x = self.gaussian.point(&draw.step);
                let name = |j: usize| self.choices.coordinate(j, draw.names[j]);
                Candidate {
                    genotype: self.each(|i| x[i], name),
                    phenotype: self.each(|i| self.gaussian.express(i, x[i]), name),
                }
            })
            .collect()
    }

    fn draw(&self, candidate: usize) -> Draw {
        let mut generator = candidate_generator(self.seed, self.generation, candidate as u64);
        let z = generator.normals(self.strategy().dimension);
        Draw { step: self.gaussian.step(z), names: self.choices.draw(&mut generator) }
    }

    /// Takes the candidates' values, in the order of [`Self::ask`], and moves on a generation.
    /// Smaller is better.
    ///
    /// A value that is not finite ranks last; equal values rank in the order of the candidates.
    ///
    /// # Errors
    ///
    /// [`TellError`] unless there is a value for each candidate; the search then stays as it is.
    pub fn tell(&mut self, values: &[f64]) -> Result<(), TellError> {
        let asked = self.strategy().lambda;
        if values.len() != asked {
            return Err(TellError { told: values.len(), asked });
        }
        let fitness = |i: &usize| if values[*i].is_finite() { values[*i] } else { f64::INFINITY };
        let mut order: Vec<usize> = (0..asked).collect();
        order.sort_by(|a, b| fitness(a).total_cmp(&fitness(b)));
        self.best = self.best.min(fitness(&order[0]));
        // Without a single finite value there is nothing to learn; the next generation draws anew.
        if values.iter().any(|v| v.is_finite()) {
            self.learn(order);
        }
        self.gaussian.advance();
        self.generation += 1;
        self.mean = self.middle();
        Ok(())
    }

    /// Learns from candidates, best first.
    fn learn(&mut self, order: Vec<usize>) {
        let draws = order.into_iter().map(|candidate| self.draw(candidate));
        let (steps, names): (Vec<_>, Vec<_>) = draws.map(|draw| (draw.step, draw.names)).unzip();
        self.gaussian.learn(&steps);
        let strategy = &self.gaussian.strategy;
        self.choices.learn(&strategy.weights[..strategy.mu], &names);
    }

    /// Reason to stop; `None` while the search goes on.
    pub fn stop(&self) -> Option<StopReason> {
        let stops = &self.stops;
        let ratio = self.axis_ratio();
        let spread = self.gaussian.spread().into_iter();
        let widest = spread.fold(0.0, f64::max) / self.initial_sigma;
        let is_still = widest < stops.tol_x && self.choices.are_settled();
        let checks = [
            (stops.generations.is_some_and(|g| self.generation >= g), StopReason::Generations),
            (stops.target.is_some_and(|t| self.best <= t), StopReason::Target),
            (is_still, StopReason::TolX),
            (widest > stops.tol_x_up, StopReason::TolXUp),
            (ratio * ratio > stops.condition, StopReason::Condition),
        ];
        checks.into_iter().find(|(holds, _)| *holds).map(|(_, reason)| reason)
    }

    /// Number of generations told.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Constants of the search.
    pub fn strategy(&self) -> &Strategy {
        &self.gaussian.strategy
    }

    /// Mean of the distribution, inside the cube when the search is bounded; for a choice, the
    /// coordinate of its likeliest name.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// Step size σ.
    pub fn sigma(&self) -> f64 {
        self.gaussian.sigma
    }

    /// Probability of each name of a choice; `None` for other coordinates.
    pub fn probabilities(&self, coordinate: usize) -> Option<&[f64]> {
        match self.slots.get(coordinate)? {
            Slot::Choice(j) => Some(self.choices.probabilities(*j)),
            Slot::Gaussian(_) => None,
        }
    }

    /// Standard deviation of each coordinate: σ√C_ii, for whole numbers widened by the margin; for
    /// choices, that of their names' coordinates.
    pub fn deviations(&self) -> Vec<f64> {
        let deviations = self.gaussian.deviations();
        self.each(|i| deviations[i], |j| self.choices.deviation(j))
    }

    /// Ratio of the longest to the shortest axis.
    pub fn axis_ratio(&self) -> f64 {
        self.gaussian.axis_ratio()
    }

    /// Correlations of the coordinates, row by row. A choice is independent of all others.
    pub fn correlations(&self) -> Vec<Vec<f64>> {
        let of = |i: usize, j: usize| match (self.slots[i], self.slots[j]) {
            (Slot::Gaussian(a), Slot::Gaussian(b)) => self.gaussian.correlation(a, b),
            _ => f64::from(u8::from(i == j)),
        };
        let n = self.slots.len();
        (0..n).map(|i| (0..n).map(|j| of(i, j)).collect()).collect()
    }

    /// Fraction of the initial covariance that has been replaced, 0 to 1. Near 0, the correlations
    /// mean nothing yet.
    pub fn covariance_learned(&self) -> f64 {
        self.gaussian.learned()
    }
}

#[cfg(test)]
mod tests;
