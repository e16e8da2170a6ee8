//! Half real, half whole numbers or bits: the functions of "CMA-ES with Margin" (Hamano et al.,
//! GECCO 2022), as defined in its authors' EvoConJP/CMA-ES_with_Margin.

use echoloop_cmaes::{CmaEsConfig, ConfigError, Constants, Coordinate, Stops};
use echoloop_random::Generator;

use super::functions::{ellipsoid, evaluations, sphere};

/// A function of real and whole parts.
#[derive(Clone, Copy)]
pub(crate) struct Function {
    pub(crate) name: &'static str,
    /// Number of values of a whole number: −10 to 10, or 0 and 1.
    pub(crate) count: usize,
    value: fn(&[f64]) -> f64,
}

/// Problems of the table.
pub(crate) const FUNCTIONS: [Function; 4] = [
    Function { name: "SphereInt", count: 21, value: sphere },
    Function { name: "EllipsoidInt", count: 21, value: ellipsoid },
    Function { name: "SphereOneMax", count: 2, value: sphere },
    Function { name: "EllipsoidOneMax", count: 2, value: ellipsoid },
];

impl Function {
    fn evaluate(&self, x: &[f64]) -> f64 {
        let half = x.len() / 2;
        if self.count == 2 {
            return (self.value)(&x[..half]) + x[half..].iter().map(|bit| 1.0 - bit).sum::<f64>();
        }
        (self.value)(x)
    }

    /// Value at u = 0; at u = 1 it is larger by `count`.
    fn low(&self) -> f64 {
        if self.count == 2 { -0.5 } else { -10.5 }
    }

    /// Evaluations to 1e-10, at most min(1e4 n, 2e5); `None` when the search ended before.
    pub(crate) fn solve(
        &self,
        n: usize,
        seed: u64,
        discrete: Coordinate,
    ) -> Result<Option<usize>, ConfigError> {
        let width = self.count as f64;
        let mut draw = Generator::new(seed, 0x0a11);
        let start = |i: usize| {
            let x = draw.range(1.0, 3.0);
            if self.count == 2 && i >= n / 2 { 0.5 } else { (x - self.low()) / width }
        };
        let mean: Vec<f64> = (0..n).map(start).collect();
        let mut config = CmaEsConfig::unit_cube(mean, 1.0 / width, seed);
        config.constants = Constants::Tutorial;
        config.bounded = false;
        config.trust = 0.0;
        config.coordinates = [vec![Coordinate::Real; n / 2], vec![discrete; n / 2]].concat();
        config.stops = Stops { target: Some(1e-10), tol_x: 1e-15, ..Stops::default() };
        let most = (10_000 * n).min(200_000);
        evaluations(config, most, |u| self.evaluate(&self.point(u)))
    }

    /// Numbers at a point of the cube.
    fn point(&self, u: &[f64]) -> Vec<f64> {
        let (half, width) = (u.len() / 2, self.count as f64);
        let real = |u: &f64| self.low() + u * width;
        let whole = |u: &f64| real(u).round().clamp(self.low() + 0.5, self.low() + width - 0.5);
        u[..half].iter().map(real).chain(u[half..].iter().map(whole)).collect()
    }
}
