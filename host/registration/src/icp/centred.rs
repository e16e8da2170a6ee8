//! Small motions about the pairs' centroid.

use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};

use super::step::Step;

/// Motions as turns about the pairs' centroid, scaled by their spread: see
/// [`crate::Observability`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Centred {
    centre: Vector3<f64>,
    pub(crate) spread: f64,
    /// Maps `[ω L ; t]` about the centroid to `[ω ; t]` about the origin, as `j` is.
    scale: Matrix6<f64>,
}

impl Centred {
    /// About so many points `s`, of which `sum` is Σ s, m, and `squares` Σ |s|², m².
    pub(crate) fn new(points: usize, sum: &Vector3<f64>, squares: f64) -> Self {
        let n = points.max(1) as f64;
        let centre = sum / n;
        let spread = (squares / n - centre.norm_squared()).max(0.0).sqrt();
        let spread = if spread > 0.0 { spread } else { 1.0 };
        let mut scale = Matrix6::identity();
        let turns = Matrix3::identity() / spread;
        scale.fixed_view_mut::<3, 3>(0, 0).copy_from(&turns);
        // A turn about the centroid is the same turn about the origin and a shift of centre × ω.
        scale.fixed_view_mut::<3, 3>(3, 0).copy_from(&(centre.cross_matrix() / spread));
        Self { centre, spread, scale }
    }

    /// A matrix of sums about the origin, as it is here.
    pub(crate) fn square(&self, sums: &Matrix6<f64>) -> Matrix6<f64> {
        self.scale.transpose() * sums * self.scale
    }

    /// A covariance of motions as they are here, as it is about the origin.
    pub(crate) fn covariance_about_origin(&self, here: &Matrix6<f64>) -> Matrix6<f64> {
        self.scale * here * self.scale.transpose()
    }

    /// A small motion `[ω L ; t]` about the centroid as `[ω ; t]` about the origin.
    pub(crate) fn about_origin(&self, here: &Vector6<f64>) -> Vector6<f64> {
        self.scale * here
    }

    /// A vector of sums about the origin, as it is here.
    pub(crate) fn right(&self, sums: &Vector6<f64>) -> Vector6<f64> {
        self.scale.transpose() * sums
    }

    /// The motion that turns by `x / L` about the centroid, then shifts.
    pub(crate) fn step(&self, x: &Vector6<f64>) -> Step {
        let turn = Vector3::new(x[0], x[1], x[2]) / self.spread;
        let shift = Vector3::new(x[3], x[4], x[5]);
        let rotation = UnitQuaternion::from_scaled_axis(turn);
        let translation = self.centre + shift - rotation * self.centre;
        Step {
            motion: Isometry3::from_parts(Translation3::from(translation), rotation),
            angle_rad: turn.norm(),
            shift_m: shift.norm(),
        }
    }
}
