//! Test functions of the tables.

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
