//! Search for a Pareto front of two objectives: NSGA-II by ask and tell.
//!
//! Deb, Pratap, Agarwal, Meyarivan, "A Fast and Elitist Multiobjective Genetic Algorithm: NSGA-II"
//! (IEEE Trans. Evol. Comp. 6(2), 2002), with its simulated binary crossover and polynomial
//! mutation. Neighbours on the front learn from each other by crossover. A covariance matrix for
//! each point (COMO-CMA-ES, arXiv:1904.08823) would have only some ten generations to learn from,
//! with a few thousand evaluations for twenty points and sixteen parameters.

mod front;
mod variation;

use echoloop_random::Generator;

use crate::config::{ConfigError, TellError};
pub use front::{Objectives, dominates, hypervolume, ranks, sorted_by_crowding};
use variation::child;

/// "NSGA-II" as a number: keeps these keys apart from those of other uses.
const PURPOSE: u64 = 0x4e53_4741_2d49_4900;

/// Configuration of a search for a front.
#[derive(Clone, Debug, PartialEq)]
pub struct ParetoConfig {
    /// Start points in the unit cube, at most a population; the rest is drawn uniformly.
    pub starts: Vec<Vec<f64>>,
    /// Dimension of the cube.
    pub dimension: usize,
    /// Size of the population.
    pub population: usize,
    /// Seed of every draw.
    pub seed: u64,
}

/// An evaluated point.
#[derive(Clone, Debug, PartialEq)]
pub struct Valued {
    /// Point in the unit cube.
    pub point: Vec<f64>,
    /// Its values, smaller is better.
    pub values: Objectives,
}

/// Search for a front. Its state depends on the values told only: to resume a search, tell it the
/// same values again.
#[derive(Clone, Debug)]
pub struct Pareto {
    config: ParetoConfig,
    generation: u64,
    /// Survivors, best first; empty before the first generation was told.
    parents: Vec<Valued>,
}

impl Pareto {
    /// A search that has not begun.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the field that cannot run.
    pub fn new(config: ParetoConfig) -> Result<Self, ConfigError> {
        check(&config)?;
        Ok(Self { config, generation: 0, parents: Vec::new() })
    }

    /// Number of generations told.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// The surviving points, best first, as [`sorted_by_crowding`] orders them.
    pub fn population(&self) -> &[Valued] {
        &self.parents
    }

    /// The points to evaluate next; the same each time until [`Self::tell`].
    pub fn ask(&self) -> Vec<Vec<f64>> {
        (0..self.config.population).map(|i| self.candidate(i)).collect()
    }

    fn candidate(&self, i: usize) -> Vec<f64> {
        let key = [self.config.seed, self.generation, i as u64, PURPOSE];
        let mut random = Generator::from_key(key);
        if !self.parents.is_empty() {
            let [a, b] = [0, 1].map(|_| tournament(&self.parents, &mut random));
            return child(&a.point, &b.point, &mut random);
        }
        let start = self.config.starts.get(i).cloned();
        start.unwrap_or_else(|| (0..self.config.dimension).map(|_| random.unit()).collect())
    }

    /// Takes the values of the points, in the order of [`Self::ask`], and keeps the best of old and
    /// new.
    ///
    /// A point with a value that is not finite ranks last.
    ///
    /// # Errors
    ///
    /// [`TellError`] unless there are values for each point; the search then stays as it is.
    pub fn tell(&mut self, values: &[Objectives]) -> Result<(), TellError> {
        let asked = self.config.population;
        if values.len() != asked {
            return Err(TellError { told: values.len(), asked });
        }
        let told = self.ask().into_iter().zip(values);
        let mut all = std::mem::take(&mut self.parents);
        all.extend(told.map(|(point, &values)| Valued { point, values }));
        self.parents = best_of(all, asked);
        self.generation += 1;
        Ok(())
    }
}

/// The better of two random parents, which are sorted best first.
fn tournament<'a>(parents: &'a [Valued], random: &mut Generator) -> &'a Valued {
    let [a, b] = [0, 1].map(|_| random.index(parents.len()));
    &parents[a.min(b)]
}

/// The best `count` points, by rank and crowding distance.
fn best_of(all: Vec<Valued>, count: usize) -> Vec<Valued> {
    let values: Vec<Objectives> = all.iter().map(|valued| valued.values).collect();
    let order = sorted_by_crowding(&values);
    order.into_iter().take(count).map(|i| all[i].clone()).collect()
}

fn check(config: &ParetoConfig) -> Result<(), ConfigError> {
    let fail = |field, value: String, expected| Err(ConfigError { field, value, expected });
    let ParetoConfig { starts, dimension, population, .. } = config;
    if *dimension == 0 {
        return fail("dimension", dimension.to_string(), "at least 1");
    }
    if *population < 4 {
        return fail("population", population.to_string(), "at least 4");
    }
    if starts.len() > *population {
        return fail("starts", starts.len().to_string(), "at most a population");
    }
    let inside = |start: &Vec<f64>| {
        start.len() == *dimension && start.iter().all(|x| (0.0..=1.0).contains(x))
    };
    match starts.iter().find(|start| !inside(start)) {
        Some(start) => fail("starts", format!("{start:?}"), "points of the unit cube"),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
