//! Configuration, stop reasons and errors of a search.

use thiserror::Error;

use super::strategy::Constants;

/// Configuration of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct CmaEsConfig {
    /// Start point; its length is the dimension.
    pub mean: Vec<f64>,
    /// Initial step size.
    pub sigma: f64,
    /// Candidates per generation; `None`: 4 + ⌊3 ln n⌋.
    pub lambda: Option<usize>,
    /// Seed of every sample.
    pub seed: u64,
    /// Published set of constants.
    pub constants: Constants,
    /// True to keep the search in the unit cube, by reflection. Standard deviations then stay below
    /// 1/3.
    pub bounded: bool,
    /// Kind of each coordinate; empty: all real.
    pub coordinates: Vec<Coordinate>,
    /// Initial probability of the start's name in each choice. 0: all names are equally likely.
    pub trust: f64,
    /// Stopping criteria.
    pub stops: Stops,
}

/// Kind of a coordinate: the values that it takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coordinate {
    /// Any number.
    #[default]
    Real,
    /// This many numbers, in order: the middles of equal cells of 0 to 1.
    Whole(usize),
    /// This many names, in no order, at the middles of equal cells of 0 to 1.
    Choice(usize),
}

impl Coordinate {
    /// Number of cells of a whole number.
    pub(super) fn cells(self) -> Option<usize> {
        if let Self::Whole(count) = self { Some(count) } else { None }
    }

    fn is_possible(self) -> bool {
        !matches!(self, Self::Whole(0) | Self::Choice(0))
    }
}

impl CmaEsConfig {
    /// A search in the unit cube.
    pub fn unit_cube(mean: Vec<f64>, sigma: f64, seed: u64) -> Self {
        Self {
            mean,
            sigma,
            lambda: None,
            seed,
            constants: Constants::default(),
            bounded: true,
            coordinates: Vec::new(),
            trust: TRUST,
            stops: Stops::default(),
        }
    }
}

/// Default of [`CmaEsConfig::trust`]. With less, a right start is unlearned first; with more, a
/// wrong one is kept too long. With 0.7, choices are as good as rounded reals or better in both
/// cases: benches/record/optimiser.md.
const TRUST: f64 = 0.7;

/// Stopping criteria. None is on the progress of the function value, because ours is noisy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stops {
    /// Largest number of generations.
    pub generations: Option<u64>,
    /// Value to reach: stops when one at or below it was told.
    pub target: Option<f64>,
    /// Stops when every standard deviation is below this times the initial step size.
    pub tol_x: f64,
    /// Stops when the largest standard deviation is above this times the initial step size.
    pub tol_x_up: f64,
    /// Stops when the condition number of C is above this.
    pub condition: f64,
}

impl Default for Stops {
    fn default() -> Self {
        Self { generations: None, target: None, tol_x: 1e-12, tol_x_up: 1e4, condition: 1e14 }
    }
}

/// Reason that a search stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The generations are used up.
    Generations,
    /// The target was reached.
    Target,
    /// The standard deviations are below the tolerance, and every choice has settled.
    TolX,
    /// The steps grow without end: the step size was far too small, or the function has no minimum.
    TolXUp,
    /// C is numerically singular.
    Condition,
}

/// A setting that cannot run.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{field} = {value} must be {expected}")]
pub struct ConfigError {
    /// The field of [`CmaEsConfig`] or [`crate::ParetoConfig`].
    pub field: &'static str,
    /// Its value.
    pub value: String,
    /// Its requirement.
    pub expected: &'static str,
}

/// A number of values other than that of the candidates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("told {told} values for {asked} candidates")]
pub struct TellError {
    /// Number of values told.
    pub told: usize,
    /// Candidates per generation.
    pub asked: usize,
}

/// Refuses the first field that cannot run.
pub(super) fn check(config: &CmaEsConfig) -> Result<(), ConfigError> {
    let fail = |field, value: String, expected| Err(ConfigError { field, value, expected });
    if config.mean.is_empty() || config.mean.iter().any(|m| !m.is_finite()) {
        return fail("mean", format!("{:?}", config.mean), "at least one finite number");
    }
    if config.bounded && config.mean.iter().any(|m| !(0.0..=1.0).contains(m)) {
        return fail("mean", format!("{:?}", config.mean), "in the unit cube");
    }
    if !(config.sigma > 0.0 && config.sigma.is_finite()) {
        return fail("sigma", config.sigma.to_string(), "above 0");
    }
    let coordinates = &config.coordinates;
    if !coordinates.is_empty() && coordinates.len() != config.mean.len() {
        let expected = "empty or as many as the mean has";
        return fail("coordinates", format!("{coordinates:?}"), expected);
    }
    if !coordinates.iter().all(|coordinate| coordinate.is_possible()) {
        return fail("coordinates", format!("{coordinates:?}"), "of at least 1 value each");
    }
    if !(0.0..=1.0).contains(&config.trust) {
        return fail("trust", config.trust.to_string(), "from 0 to 1");
    }
    match config.lambda {
        Some(lambda) if lambda < 2 => fail("lambda", lambda.to_string(), "at least 2"),
        _ => Ok(()),
    }
}
