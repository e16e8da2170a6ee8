//! Fast global registration as Open3D 0.20 runs it from Python.

use echoloop_clouds::Pose;
use nalgebra::{Matrix6, Rotation3, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::features::PointPair;

/// Draws of the tuple test per match.
const DRAWS: usize = 100;

/// Edges of a triple must agree within this ratio.
const RATIO: f64 = 0.95;

/// A step below this, in radii and rad, changes nothing.
const CONVERGED: f64 = 1e-5;

/// With fewer matches Open3D returns the identity.
pub(super) const LEAST_MATCHES: usize = 10;

/// Centroids and radius of both clouds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    pub(super) source: Vector3<f64>,
    pub(super) target: Vector3<f64>,
    /// The farthest point from the centroid of its cloud, m.
    pub(super) radius_m: f64,
}

impl Frame {
    /// The frame of the points of both clouds.
    pub(super) fn new(
        source: impl ExactSizeIterator<Item = Vector3<f64>> + Clone,
        target: impl ExactSizeIterator<Item = Vector3<f64>> + Clone,
    ) -> Self {
        let (from, to) = (mean(source.clone()), mean(target.clone()));
        let far = source
            .map(|p| (p - from).norm())
            .chain(target.map(|q| (q - to).norm()))
            .fold(0.0, f64::max);
        Self { source: from, target: to, radius_m: far }
    }
}

fn mean(points: impl ExactSizeIterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let n = points.len().max(1) as f64;
    points.sum::<Vector3<f64>>() / n
}

/// The matches of the triples that pass, as often as they pass: at most `3 most`.
///
/// A triple of matches drawn with repetition passes when all three edges agree within 5 %. Only the
/// draws are ours.
pub(super) fn tuple_test(pairs: &[PointPair], most: usize, seed: u64) -> Vec<PointPair> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut kept = Vec::new();
    for _ in 0..pairs.len().saturating_mul(DRAWS) {
        let triple = [0; 3].map(|_| pairs[rng.random_range(0..pairs.len())]);
        if passes(&triple) {
            kept.extend(triple);
        }
        if kept.len() >= most.saturating_mul(3) {
            break;
        }
    }
    kept
}

fn passes(triple: &[PointPair; 3]) -> bool {
    [(0, 1), (1, 2), (2, 0)].iter().all(|&(i, j)| {
        let a = (triple[i].source - triple[j].source).norm();
        let b = (triple[i].target - triple[j].target).norm();
        a * RATIO < b && b < a / RATIO
    })
}

/// Gauss-Newton on points scaled to radius 1, the target moved onto the source; the result is
/// inverted.
///
/// μ starts at the radius in metres: Open3D passes the scale where the start value, 1, is meant. So
/// it is some tens of squared cloud radii, and the steps are nearly those of plain least squares.
/// `next_mu` has the number of the step, from 0, and its μ; Python's default leaves μ as it is.
/// Absent when a step cannot be solved.
pub(super) fn optimised(
    pairs: &[PointPair],
    frame: &Frame,
    iterations: usize,
    next_mu: impl Fn(usize, f64) -> f64,
) -> Option<Optimised> {
    let scale = 1.0 / frame.radius_m;
    let source: Vec<_> =
        pairs.iter().map(|pair| (pair.source.coords - frame.source) * scale).collect();
    let mut target: Vec<_> =
        pairs.iter().map(|pair| (pair.target.coords - frame.target) * scale).collect();
    let (mut source_from_target, mut mu, mut converged) = (Pose::identity(), frame.radius_m, false);
    for iteration in 0..iterations {
        let step = step(&source, &target, mu)?;
        converged = step.rotation.angle() < CONVERGED && step.translation.vector.norm() < CONVERGED;
        source_from_target = step * source_from_target;
        target.iter_mut().for_each(|q| *q = step.rotation * *q + step.translation.vector);
        mu = next_mu(iteration, mu);
    }
    let (rotation, shift) = (source_from_target.rotation, source_from_target.translation.vector);
    let back = frame.source - rotation * frame.target + shift * frame.radius_m;
    Some(Optimised {
        target_from_source: Pose::from_parts(back.into(), rotation).inverse(),
        converged,
    })
}

/// Result of the optimisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Optimised {
    pub(super) target_from_source: Pose,
    /// True when the last step changed nothing. Open3D does not check.
    pub(super) converged: bool,
}

/// One step: the rotation is `Rz Ry Rx` of the three turns solved for.
fn step(source: &[Vector3<f64>], target: &[Vector3<f64>], mu: f64) -> Option<Pose> {
    let (mut matrix, mut vector) = (Matrix6::zeros(), Vector6::zeros());
    for (p, q) in source.iter().zip(target) {
        let r = p - q;
        let s = (mu / (r.norm_squared() + mu)).powi(2);
        let rows = [
            [0.0, -q.z, q.y, -1.0, 0.0, 0.0],
            [q.z, 0.0, -q.x, 0.0, -1.0, 0.0],
            [-q.y, q.x, 0.0, 0.0, 0.0, -1.0],
        ];
        for (row, r) in rows.into_iter().map(Vector6::from).zip(r.iter()) {
            matrix += row * row.transpose() * s;
            vector += row * (r * s);
        }
    }
    let x = matrix.cholesky()?.solve(&-vector);
    x.iter().all(|v| v.is_finite()).then(|| {
        let rotation = Rotation3::from_euler_angles(x[0], x[1], x[2]);
        Pose::from_parts(Vector3::new(x[3], x[4], x[5]).into(), rotation.into())
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use echoloop_clouds::pose::{frobenius_error, from_rows};

    /// Rows of numbers: 60 pairs, then Open3D's 4×4 results by rows, one a line.
    const ORACLE: &str = include_str!("../../tests/data/fgr_open3d.txt");

    #[test]
    fn the_result_is_open3ds_with_and_without_the_fall_of_mu() {
        let rows: Vec<Vec<f64>> = ORACLE
            .lines()
            .filter(|line| !line.starts_with('#'))
            .map(|line| line.split_whitespace().map(|word| word.parse().unwrap()).collect())
            .collect();
        let pair = |v: &Vec<f64>| PointPair {
            source: [v[0], v[1], v[2]].into(),
            target: [v[3], v[4], v[5]].into(),
        };
        let pairs: Vec<PointPair> = rows.iter().filter(|v| v.len() == 6).map(pair).collect();
        let results: Vec<Pose> = rows
            .iter()
            .filter(|v| v.len() == 16)
            .map(|v| from_rows(v.as_slice().try_into().unwrap()).unwrap())
            .collect();
        let frame = Frame::new(
            pairs.iter().map(|p| p.source.coords),
            pairs.iter().map(|p| p.target.coords),
        );
        // μ is divided by 1.4 after every fourth step while it is above this; never, if infinite.
        let ends = [f64::INFINITY, 0.025, 1e-4];
        assert_eq!((pairs.len(), results.len()), (60, ends.len()));
        for (end, open3d) in ends.into_iter().zip(&results) {
            let next_mu = |iteration, mu| match iteration % 4 == 0 && mu > end {
                true => mu / 1.4,
                false => mu,
            };
            let ours = optimised(&pairs, &frame, 64, next_mu).unwrap().target_from_source;
            assert!(frobenius_error(&ours, open3d) < 1e-6, "to {end}: {ours} is not {open3d}");
        }
    }

    #[test]
    fn a_triple_that_names_a_match_twice_never_passes() {
        let pair =
            |x: f64| PointPair { source: [x, 0.0, 0.0].into(), target: [x, 1.0, 0.0].into() };
        assert!(passes(&[pair(0.0), pair(1.0), pair(3.0)]));
        assert!(!passes(&[pair(0.0), pair(0.0), pair(3.0)]));
    }
}
