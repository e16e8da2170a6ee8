//! Fast global registration as published; the annealing ends at the paper's δ.

use echoloop_clouds::Pose;

use super::tuples::Passed;
use crate::correspondences::Residuals;
use crate::features::PointPair;
use crate::rigid::rigid;

/// μ falls by this in four iterations, as published, evenly.
const DIVISION: f64 = 1.4;

/// Share of the iterations within which μ must have come to its end.
const ANNEALING: f64 = 0.75;

/// A step below this share of the pair distance counts as none.
const CONVERGED: f64 = 1e-4;

/// Result of the annealing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Annealed {
    pub(super) target_from_source: Pose,
    pub(super) iterations: usize,
    /// True when the last step of the annealing changed nothing.
    pub(super) converged: bool,
}

/// Anneals from the identity.
///
/// ```text
/// min Σ w s r² + w μ (√s - 1)²      r = |q - T p|,  s = (μ / (r² + μ))²        μ: R² → δ²
/// ```
///
/// with the weights `w` of the tuple test, `R` the radius of the matches, m, and `δ` the pair
/// distance, m: the paper's bounds, Sec. 3 of Zhou, Park and Koltun, "Fast Global Registration",
/// ECCV 2016. (Its code ends at δ = 0.16 R.) With `s` fixed the paper takes one Gauss-Newton step;
/// ours is the exact minimum, [`rigid`]: the same fixed points, without the saddle that a half turn
/// is to a linear step. μ falls every iteration by the fourth root of what the paper has it fall
/// every fourth, or faster when `max_iterations` would not suffice.
pub(super) fn anneal(
    pairs: &[PointPair],
    passed: &[Passed],
    delta_m: f64,
    max_iterations: usize,
) -> Option<Annealed> {
    let rows: Vec<(PointPair, f64)> =
        passed.iter().filter_map(|p| Some((*pairs.get(p.index)?, p.weight))).collect();
    let radius_m = radius_m(&rows).max(delta_m);
    let end = delta_m * delta_m;
    let factor = factor(radius_m * radius_m / end, max_iterations);
    let mut state =
        Annealed { target_from_source: Pose::identity(), iterations: 0, converged: false };
    let (mut mu, mut weights) = (radius_m * radius_m, vec![0.0; rows.len()]);
    while state.iterations < max_iterations && !state.converged {
        line_process(&rows, &state.target_from_source, mu, &mut weights);
        let next = rigid(rows.iter().map(|row| row.0).zip(weights.iter().copied()))?;
        state.converged =
            mu <= end && step_m(&state.target_from_source, &next, radius_m) < CONVERGED * delta_m;
        state.target_from_source = next;
        state.iterations += 1;
        mu = (mu / factor).max(end);
    }
    Some(state)
}

/// The division of an iteration.
fn factor(fall: f64, max_iterations: usize) -> f64 {
    let steps = (max_iterations as f64 * ANNEALING).max(1.0);
    DIVISION.powf(0.25).max(fall.powf(1.0 / steps))
}

/// `w s` of each row.
fn line_process(rows: &[(PointPair, f64)], pose: &Pose, mu: f64, weights: &mut [f64]) {
    let residuals = Residuals::new(pose);
    for ((pair, w), weight) in rows.iter().zip(weights) {
        let s = mu / (residuals.squared_m2(pair) + mu);
        *weight = w * s * s;
    }
}

/// The farthest of the matches from their centroids, m.
fn radius_m(rows: &[(PointPair, f64)]) -> f64 {
    let n = rows.len().max(1) as f64;
    let source =
        rows.iter().fold(nalgebra::Vector3::zeros(), |sum, (pair, _)| sum + pair.source.coords / n);
    let target =
        rows.iter().fold(nalgebra::Vector3::zeros(), |sum, (pair, _)| sum + pair.target.coords / n);
    let far = |(pair, _): &(PointPair, f64)| {
        (pair.source.coords - source)
            .norm_squared()
            .max((pair.target.coords - target).norm_squared())
    };
    rows.iter().map(far).fold(0.0, f64::max).sqrt()
}

/// Longest way that a step moves a point at the radius, m.
fn step_m(before: &Pose, after: &Pose, radius_m: f64) -> f64 {
    let step = after * before.inverse();
    step.translation
        .vector
        .norm()
        .min((after.translation.vector - before.translation.vector).norm())
        + step.rotation.angle() * radius_m
}
