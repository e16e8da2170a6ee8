//! What a search is given, and what it says.

use thiserror::Error;

use super::strategy::Constants;

/// How to search.
#[derive(Clone, Debug, PartialEq)]
pub struct CmaEsConfig {
    /// Where to start; its length is the dimension.
    pub mean: Vec<f64>,
    /// Step size to start with.
    pub sigma: f64,
    /// Candidates a generation; `None`: 4 + ⌊3 ln n⌋.
    pub lambda: Option<usize>,
    /// Decides every sample.
    pub seed: u64,
    /// Which constants.
    pub constants: Constants,
    /// Whether the search stays in the unit cube, by reflection. Standard deviations then stay
    /// below 1/3.
    pub bounded: bool,
    /// What values each coordinate takes. Empty: every one, all of them.
    pub coordinates: Vec<Coordinate>,
    /// How likely each choice is drawn as the start has it, at first. 0: no name is likelier than
    /// another.
    pub trust: f64,
    /// When to stop.
    pub stops: Stops,
}

/// What values a coordinate takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coordinate {
    /// Every number.
    #[default]
    Real,
    /// So many numbers, in order: the middles of equal cells of 0 to 1.
    Whole(usize),
    /// So many names, in no order, at the middles of equal cells of 0 to 1.
    Choice(usize),
}

impl Coordinate {
    /// Cells of a coordinate that has an order.
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
        let stops = Stops::default();
        let constants = Constants::default();
        Self {
            mean,
            sigma,
            lambda: None,
            seed,
            constants,
            bounded: true,
            coordinates: Vec::new(),
            trust: TRUST,
            stops,
        }
    }
}

/// With less, a start that is right is unlearned first; with more, one that is wrong is kept too
/// long. 0.7 loses to rounding in neither case: benches/record/optimiser.md.
const TRUST: f64 = 0.7;

/// When to stop. Tolerances of the function value are left out on purpose: ours is noisy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stops {
    /// After so many generations.
    pub generations: Option<u64>,
    /// When a value at or below this was told.
    pub target: Option<f64>,
    /// When every standard deviation is below this times the initial step size.
    pub tol_x: f64,
    /// When the largest standard deviation is above this times the initial step size.
    pub tol_x_up: f64,
    /// When the condition number of C is above this.
    pub condition: f64,
}

impl Default for Stops {
    fn default() -> Self {
        Self { generations: None, target: None, tol_x: 1e-12, tol_x_up: 1e4, condition: 1e14 }
    }
}

/// Why a search stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The generations are used up.
    Generations,
    /// The target was reached.
    Target,
    /// Nothing moves any more.
    TolX,
    /// The steps grow without end: the step size was far too small, or the function has no minimum.
    TolXUp,
    /// C can no longer be told from a singular matrix.
    Condition,
}

/// A setting that cannot run.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{field} = {value} must be {expected}")]
pub struct CmaEsConfigError {
    /// The field of [`CmaEsConfig`].
    pub field: &'static str,
    /// Its value.
    pub value: String,
    /// What it must be.
    pub expected: &'static str,
}

/// Values that do not fit the candidates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("told {told} values for {asked} candidates")]
pub struct TellError {
    /// Values told.
    pub told: usize,
    /// Candidates a generation.
    pub asked: usize,
}

/// Names the first field that cannot run.
pub(super) fn check(config: &CmaEsConfig) -> Result<(), CmaEsConfigError> {
    let fail = |field, value: String, expected| Err(CmaEsConfigError { field, value, expected });
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
