//! Strength of the correlations of a search that learns from random numbers.

use std::collections::BTreeMap;

use echoloop_cmaes::{CmaEs, CmaEsConfig, Coordinate};
use echoloop_random::{Generator, derive};

use echoloop_closed_loop::search::CONSTANTS;

/// Number of searches with random numbers for errors.
const SEARCHES: u64 = 32;

/// Share of their correlations below the strength that counts as chance.
const QUANTILE: f64 = 0.95;

/// "null" as a number: keeps these draws apart from those of other uses.
const PURPOSE: u64 = 0x6e75_6c6c;

/// Most generations: with more, the correlations grow no stronger.
const MAX_GENERATIONS: u32 = 1000;

/// Bound on the candidates of a generation.
const MAX_CANDIDATES: usize = 2000;

/// Settings of a search, without its errors.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BlindSearch {
    /// For each axis, the number of names that it chooses among; none of a number.
    pub(super) choices: Vec<Option<usize>>,
    /// Initial step size.
    pub(super) sigma: f64,
    /// Candidates a generation.
    pub(super) population: usize,
    /// Generations.
    pub(super) generations: u32,
}

/// Strengths computed so far, by search.
#[derive(Default)]
pub(super) struct Chance(BTreeMap<String, f64>);

impl Chance {
    /// Strength that 95 % of the correlations stay below when the same search gets a random number
    /// for each error; infinite where such a search cannot run.
    pub(super) fn of(&mut self, search: &BlindSearch) -> f64 {
        *self.0.entry(format!("{search:?}")).or_insert_with(|| quantile(search))
    }
}

fn quantile(search: &BlindSearch) -> f64 {
    let all: Option<Vec<Vec<f64>>> = (0..SEARCHES).map(|seed| strengths(search, seed)).collect();
    let mut all = all.unwrap_or_default().concat();
    all.sort_by(f64::total_cmp);
    let at = (QUANTILE * all.len().saturating_sub(1) as f64).ceil() as usize;
    all.get(at).copied().unwrap_or(f64::INFINITY)
}

/// Correlations of one such search, without choices, which are drawn independently.
fn strengths(search: &BlindSearch, seed: u64) -> Option<Vec<f64>> {
    if search.population > MAX_CANDIDATES {
        return None;
    }
    let mut config = CmaEsConfig::unit_cube(
        vec![0.5; search.choices.len()],
        search.sigma,
        derive(seed, PURPOSE, 0),
    );
    config.constants = CONSTANTS;
    config.lambda = Some(search.population);
    config.stops.generations = Some(search.generations.min(MAX_GENERATIONS).into());
    let coordinate = |count: &Option<usize>| count.map_or(Coordinate::Real, Coordinate::Choice);
    config.coordinates = search.choices.iter().map(coordinate).collect();
    let mut optimizer = CmaEs::new(config).ok()?;
    let mut chance = Generator::new(derive(seed, PURPOSE, 1), 0);
    while optimizer.stop().is_none() {
        let fitness: Vec<f64> = optimizer.ask().iter().map(|_| chance.range(0.0, 1.0)).collect();
        optimizer.tell(&fitness).ok()?;
    }
    let correlations = optimizer.correlations();
    let reals: Vec<usize> =
        (0..search.choices.len()).filter(|&axis| search.choices[axis].is_none()).collect();
    let below = |k: usize| reals[..k].iter().map(move |&column| (k, column));
    let pairs = (0..reals.len()).flat_map(below);
    Some(pairs.map(|(k, column)| correlations[reals[k]][column].abs()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(generations: u32) -> BlindSearch {
        let choices = vec![None, None, Some(3), None, None];
        BlindSearch { choices, sigma: 0.2, population: 8, generations }
    }

    #[test]
    fn chance_is_the_same_each_time_and_a_longer_search_has_more_of_it() {
        let mut chance = Chance::default();
        let [short, long] = [2, 40].map(|generations| chance.of(&search(generations)));
        assert_eq!(Chance::default().of(&search(2)), short);
        assert!(0.0 < short && short < long && long < 1.0, "{short}, {long}");
        assert_eq!(chance.of(&BlindSearch { choices: Vec::new(), ..search(2) }), f64::INFINITY);
    }
}
