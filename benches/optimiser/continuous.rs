//! Unbounded real numbers: the usual functions, from the usual starts.

use echoloop_cmaes::{CmaEs, CmaEsConfig, ConfigError, Constants, StopReason, Stops};

use super::functions::{
    bent_cigar, different_powers, ellipsoid, rosenbrock, sphere, turned_ellipsoid,
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
    ///
    /// # Errors
    ///
    /// None: the configurations can run.
    pub(crate) fn solve(
        &self,
        n: usize,
        seed: u64,
        constants: Constants,
    ) -> Result<Option<usize>, ConfigError> {
        let stops = Stops { target: Some(1e-8), ..Stops::default() };
        let plain = CmaEsConfig::unit_cube(vec![self.start; n], self.sigma, seed);
        let mut search = CmaEs::new(CmaEsConfig { bounded: false, constants, stops, ..plain })?;
        let lambda = search.strategy().lambda;
        while search.stop().is_none() && search.generation() as usize * lambda < 20_000 * n {
            let values: Vec<f64> =
                search.ask().iter().map(|c| (self.value)(&c.phenotype)).collect();
            let _ = search.tell(&values);
        }
        let solved = search.stop() == Some(StopReason::Target);
        Ok(solved.then_some(search.generation() as usize * lambda))
    }
}
