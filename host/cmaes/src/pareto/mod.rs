//! A front of two objectives: NSGA-II by ask and tell.
//!
//! Deb, Pratap, Agarwal, Meyarivan, "A Fast and Elitist Multiobjective Genetic Algorithm: NSGA-II"
//! (IEEE Trans. Evol. Comp. 6(2), 2002), with its simulated binary crossover and polynomial
//! mutation. A population shares what one part of a front learns with its neighbours: with a few
//! thousand evaluations for twenty points and sixteen parameters, a covariance matrix for each
//! point (COMO-CMA-ES, arXiv:1904.08823) has ten generations to learn from.

mod front;
mod variation;

use echoloop_random::Generator;
use thiserror::Error;

use crate::config::TellError;
pub use front::{Objectives, dominates, hypervolume, ranks, sorted_by_crowding};
use variation::child;

/// "NSGA-II" as a number: keeps these keys apart from those of other uses.
const PURPOSE: u64 = 0x4e53_4741_2d49_4900;

/// How to search for a front.
#[derive(Clone, Debug, PartialEq)]
pub struct ParetoConfig {
    /// Points of the unit cube to begin with, at most a population; the rest is drawn evenly.
    pub starts: Vec<Vec<f64>>,
    /// Dimension of the cube.
    pub dimension: usize,
    /// Points that live at once.
    pub population: usize,
    /// Decides every draw.
    pub seed: u64,
}

/// A setting that cannot run.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{field} = {value} must be {expected}")]
pub struct ParetoConfigError {
    /// The field of [`ParetoConfig`].
    pub field: &'static str,
    /// Its value.
    pub value: String,
    /// What it must be.
    pub expected: &'static str,
}

/// A point, and what it is worth: both objectives smaller is better.
#[derive(Clone, Debug, PartialEq)]
pub struct Valued {
    /// In the unit cube.
    pub point: Vec<f64>,
    /// Its values.
    pub values: Objectives,
}

/// The search. Its state depends on the values told alone: to resume one, tell it again what it was
/// told.
#[derive(Clone, Debug)]
pub struct Pareto {
    config: ParetoConfig,
    generation: u64,
    /// Best first; none before the first generation was told.
    parents: Vec<Valued>,
}

impl Pareto {
    /// A search that has not begun.
    ///
    /// # Errors
    ///
    /// [`ParetoConfigError`] names the field that cannot run.
    pub fn new(config: ParetoConfig) -> Result<Self, ParetoConfigError> {
        check(&config)?;
        Ok(Self { config, generation: 0, parents: Vec::new() })
    }

    /// Generations told.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// The points that live, best first: by front, then the loneliest.
    pub fn population(&self) -> &[Valued] {
        &self.parents
    }

    /// The points to evaluate next; asked twice, the same.
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

    /// Takes the values of the points asked, in their order, and keeps the best of old and new.
    ///
    /// What is not finite ranks last.
    ///
    /// # Errors
    ///
    /// [`TellError`] unless there are values for each point; the search is then as before.
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

/// The better of two drawn: they stand best first.
fn tournament<'a>(parents: &'a [Valued], random: &mut Generator) -> &'a Valued {
    let [a, b] = [0, 1].map(|_| random.index(parents.len()));
    &parents[a.min(b)]
}

/// So many of the best: whole fronts, of the last that is begun the loneliest.
fn best_of(all: Vec<Valued>, count: usize) -> Vec<Valued> {
    let values: Vec<Objectives> = all.iter().map(|valued| valued.values).collect();
    let order = sorted_by_crowding(&values);
    order.into_iter().take(count).map(|i| all[i].clone()).collect()
}

fn check(config: &ParetoConfig) -> Result<(), ParetoConfigError> {
    let fail = |field, value: String, expected| Err(ParetoConfigError { field, value, expected });
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
