//! Test functions of the tables, and the search of their minima.

use echoloop_cmaes::{CmaEs, CmaEsConfig, ConfigError, StopReason};

/// Evaluations that a search needs to its target; `None` when it ends before, or at `most`.
pub(crate) fn evaluations(
    config: CmaEsConfig,
    most: usize,
    value: impl Fn(&[f64]) -> f64,
) -> Result<Option<usize>, ConfigError> {
    let mut search = CmaEs::new(config)?;
    let lambda = search.strategy().lambda;
    while search.stop().is_none() && search.generation() as usize * lambda < most {
        let values: Vec<f64> = search.ask().iter().map(|c| value(&c.phenotype)).collect();
        let _ = search.tell(&values);
    }
    let solved = search.stop() == Some(StopReason::Target);
    Ok(solved.then_some(search.generation() as usize * lambda))
}

/// Squared distance.
pub(crate) fn sphere(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum()
}

/// Axes from 1 to 1e6.
pub(crate) fn ellipsoid(x: &[f64]) -> f64 {
    let last = x.len() as f64 - 1.0;
    x.iter().enumerate().map(|(i, v)| libm::pow(1e6, i as f64 / last) * v * v).sum()
}

/// The ellipsoid rotated by Householder reflections, the same as for the peers.
pub(crate) fn turned_ellipsoid(x: &[f64]) -> f64 {
    let mut y = x.to_vec();
    for k in 1..=x.len() {
        let v: Vec<f64> = (0..x.len()).map(|i| libm::sin((i * 7 + k * 13) as f64)).collect();
        let scale = 2.0 * v.iter().zip(&y).map(|(a, b)| a * b).sum::<f64>() / sphere(&v);
        y.iter_mut().zip(&v).for_each(|(y, v)| *y -= scale * v);
    }
    ellipsoid(&y)
}

/// Rosenbrock's function, a curved valley.
pub(crate) fn rosenbrock(x: &[f64]) -> f64 {
    x.windows(2)
        .map(|w| 100.0 * libm::pow(w[1] - w[0] * w[0], 2.0) + libm::pow(1.0 - w[0], 2.0))
        .sum()
}

/// One long axis.
pub(crate) fn bent_cigar(x: &[f64]) -> f64 {
    x[0] * x[0] + 1e6 * sphere(&x[1..])
}

/// Σ |x_i|^(2 + 10 i/(n−1)).
pub(crate) fn different_powers(x: &[f64]) -> f64 {
    let last = x.len() as f64 - 1.0;
    x.iter().enumerate().map(|(i, v)| libm::pow(v.abs(), 2.0 + 10.0 * i as f64 / last)).sum()
}
