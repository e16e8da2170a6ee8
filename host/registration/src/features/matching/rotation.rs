//! Rotation to the axes along which features differ most, and the error of distances along them.

use echoloop_dispatch::dispatch;
use nalgebra::{DMatrix, SymmetricEigen};

use super::row::Row;
use crate::features::DIMENSIONS;

/// Principal axes in use. Eight hold 95 % of the variance of FPFH of a street; any number is as
/// right.
pub(super) const AXES: usize = 8;

/// A row along the principal axes.
pub(super) type Rotated = [f32; AXES];

/// Rows that the axes are taken from, at most: any orthonormal axes are right, good ones are fast.
const SAMPLE: usize = 2048;

/// Longest row of which squares and sums stay far from overflow. Beyond it nothing is pruned.
const MAX_LENGTH: f64 = 1e15;

/// A bound above 2·√8·γ₃₄ (1.2e-5): see [`Rotation::limit`].
const ABSOLUTE: f64 = 2e-5;

/// Relative slack of a distance (not squared): see [`Rotation::limit`].
const RELATIVE: f32 = 1e-5;

/// Coordinates `y = W x`, where the [`AXES`] rows of W are orthonormal.
#[derive(Clone, Debug)]
pub(super) struct Rotation {
    /// Wᵀ, `[dimension][axis]`.
    transposed: [Rotated; DIMENSIONS],
    /// Slack of a distance between rotated rows.
    slack: f32,
}

impl Rotation {
    /// Onto the principal axes of `rows`, trusted for `rows` and `others`.
    pub(super) fn principal(rows: &[Row], others: &[Row]) -> Self {
        let length = |row: &Row| row.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>();
        let valid = rows.iter().chain(others).filter(|row| takes_part(row));
        let longest = valid.map(length).fold(0.0, f64::max).sqrt();
        // With W = 0 all bounds are zero: slow, and still right.
        let mut transposed = [[0.0; AXES]; DIMENSIONS];
        if longest <= MAX_LENGTH
            && let Some(vectors) = principal_axes(rows)
        {
            for (from, to) in transposed.iter_mut().enumerate() {
                for (axis, weight) in to.iter_mut().enumerate() {
                    *weight = vectors[(from, axis)] as f32;
                }
            }
        }
        Self { transposed, slack: (longest.min(MAX_LENGTH) * ABSOLUTE) as f32 + f32::MIN_POSITIVE }
    }

    /// Bound of the squared distance between two rotated rows, summed in `f32`, whose distance
    /// before was `squared`.
    ///
    /// ```text
    /// limit = ( (1 + 1e-5) √(d + tiny) + 2e-5 ρ )²      ρ = longest row
    /// ```
    ///
    /// So no bound computed in `f32` is above its limit by rounding alone;
    /// benches/record/matching.md counts the roundings.
    #[inline(always)]
    pub(super) fn limit(&self, squared: f32) -> f32 {
        let distance = (squared + f32::MIN_POSITIVE).sqrt() * (1.0 + RELATIVE) + self.slack;
        distance * distance
    }
}

dispatch! {
    /// All rows, rotated.
    pub(super) fn rotate(rotation: &Rotation, rows: &[Row]) -> Vec<Rotated> = rotate_plain;
}

/// [`rotate`] in the plain build.
#[inline(always)]
pub(super) fn rotate_plain(rotation: &Rotation, rows: &[Row]) -> Vec<Rotated> {
    let mut rotated = vec![[0.0; AXES]; rows.len()];
    for (row, rotated) in rows.iter().zip(&mut rotated) {
        let mut sum = [0.0; AXES];
        for (&x, weights) in row.iter().zip(&rotation.transposed) {
            for axis in 0..AXES {
                sum[axis] += x * weights[axis];
            }
        }
        *rotated = sum;
    }
    rotated
}

/// True when a row is a feature: finite, and not all zero.
pub(super) fn takes_part(row: &Row) -> bool {
    row.iter().all(|x| x.is_finite()) && row.iter().any(|&x| x != 0.0)
}

/// Eigenvectors of the covariance, `[dimension][axis]`, by falling variance.
fn principal_axes(rows: &[Row]) -> Option<DMatrix<f64>> {
    let step = rows.len().div_ceil(SAMPLE).max(1);
    let sample: Vec<&Row> = rows.iter().step_by(step).filter(|row| takes_part(row)).collect();
    if sample.is_empty() {
        return None;
    }
    let mut data =
        DMatrix::from_fn(sample.len(), DIMENSIONS, |row, column| f64::from(sample[row][column]));
    for mut column in data.column_iter_mut() {
        let mean = column.mean();
        column.add_scalar_mut(-mean);
    }
    let eigen = SymmetricEigen::try_new(data.tr_mul(&data), f64::EPSILON, 10_000)?;
    let mut order: Vec<usize> = (0..DIMENSIONS).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    // Where rows span fewer axes than there are, the solver may leave an axis that is no number:
    // zero bounds as well.
    let sound =
        order.iter().map(|&axis| eigen.eigenvectors.column(axis).iter().all(|v| v.is_finite()));
    let sound: Vec<bool> = sound.take(AXES).collect();
    let entry =
        |row, axis: usize| if sound[axis] { eigen.eigenvectors[(row, order[axis])] } else { 0.0 };
    let vectors = DMatrix::from_fn(DIMENSIONS, AXES, entry);
    let expected = DMatrix::from_fn(AXES, AXES, |i, j| if i == j && sound[i] { 1.0 } else { 0.0 });
    let orthonormal = (vectors.tr_mul(&vectors) - expected).amax() < 1e-9;
    orthonormal.then_some(vectors)
}
