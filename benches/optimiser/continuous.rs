//! Unbounded real numbers: the usual functions, from the usual starts.

use echoloop_cmaes::{CmaEsConfig, ConfigError, Constants, Stops};

use super::functions::{
    bent_cigar, different_powers, ellipsoid, evaluations, rosenbrock, sphere, turned_ellipsoid,
};

/// A function, with the start point and step size of its searches.
#[derive(Clone, Copy)]
pub(crate) struct Function {
    pub(crate) name: &'static str,
    value: fn(&[f64]) -> f64,
    start: f64,
    sigma: f64,
}

/// Problems of the table.
pub(crate) const FUNCTIONS: [Function; 6] = {
    const fn from_three(name: &'static str, value: fn(&[f64]) -> f64) -> Function {
        Function { name, value, start: 3.0, sigma: 2.0 }
    }
    [
        from_three("sphere", sphere),
        from_three("ellipsoid", ellipsoid),
        from_three("turned ellipsoid", turned_ellipsoid),
        Function { name: "rosenbrock", value: rosenbrock, start: 0.0, sigma: 0.1 },
        from_three("bent cigar", bent_cigar),
        from_three("different powers", different_powers),
    ]
};

impl Function {
    /// Evaluations to 1e-8, at most 2e4 n; `None` when the search ended before.
    pub(crate) fn solve(
        &self,
        n: usize,
        seed: u64,
        constants: Constants,
    ) -> Result<Option<usize>, ConfigError> {
        let stops = Stops { target: Some(1e-8), ..Stops::default() };
        let plain = CmaEsConfig::unit_cube(vec![self.start; n], self.sigma, seed);
        let config = CmaEsConfig { bounded: false, constants, stops, ..plain };
        evaluations(config, 20_000 * n, self.value)
    }
}
