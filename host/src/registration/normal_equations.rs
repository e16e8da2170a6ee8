//! Point-to-plane least squares: from pairs to a step.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};

use super::Observability;
use crate::pose::Pose;

/// Sums over pairs of a moved source point `s`, a target point `q` and its normal `n`.
///
/// ```text
/// r = n · (s - q)      j = [ s × n ; n ]      E(ω, t) = Σ (r + j · [ω ; t])²
/// ```
///
/// The residual is the scalar distance to the plane (Chen and Medioni, "Object modelling by registration of multiple
/// range images", 1992), linear in a small turn `ω` about the origin and a shift `t` (Low 2004).
#[derive(Clone, Debug, Default)]
pub struct NormalEquations {
    /// Σ j jᵀ, m² for turns; the lower half is not filled.
    jj: [[f64; 6]; 6],
    /// Σ j r.
    jr: [f64; 6],
    /// Σ s, m.
    s: Vector3<f64>,
    /// Σ |s|², m².
    ss: f64,
    /// Σ r², m².
    rr: f64,
    /// Σ |s - q|², m².
    dd: f64,
    /// How many pairs.
    pub pairs: usize,
}

/// A small motion in the target's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// What moves the source points nearer.
    pub motion: Pose,
    /// The angle it turns, rad.
    pub angle_rad: f64,
    /// The way the centroid of the pairs goes, m.
    pub shift_m: f64,
}

impl NormalEquations {
    /// Adds a pair.
    #[inline]
    pub fn add(&mut self, s: &Point3<f64>, q: &Point3<f64>, n: &Vector3<f64>) {
        let d = s - q;
        let r = n.dot(&d);
        let turn = s.coords.cross(n);
        let j = [turn.x, turn.y, turn.z, n.x, n.y, n.z];
        for (row, (jj, jr)) in self.jj.iter_mut().zip(&mut self.jr).enumerate() {
            *jr += j[row] * r;
            for column in row..6 {
                jj[column] += j[row] * j[column];
            }
        }
        self.s += s.coords;
        self.ss += s.coords.norm_squared();
        self.rr += r * r;
        self.dd += d.norm_squared();
        self.pairs += 1;
    }

    /// Adds the sums of other pairs.
    pub fn merge(mut self, other: &Self) -> Self {
        for (ours, theirs) in self.jj.iter_mut().flatten().zip(other.jj.iter().flatten()) {
            *ours += theirs;
        }
        for (ours, theirs) in self.jr.iter_mut().zip(&other.jr) {
            *ours += theirs;
        }
        self.s += other.s;
        self.ss += other.ss;
        self.rr += other.rr;
        self.dd += other.dd;
        self.pairs += other.pairs;
        self
    }

    /// Root mean square distance of the pairs, m.
    pub fn rmse_m(&self) -> f64 {
        (self.dd / self.pairs.max(1) as f64).sqrt()
    }

    /// Root mean square distance to the planes, m.
    pub fn plane_rmse_m(&self) -> f64 {
        (self.rr / self.pairs.max(1) as f64).sqrt()
    }

    /// The step to the least squares, and which of its directions the pairs determine; it does not move along the
    /// others (solution remapping, Zhang, Kaess and Singh 2016).
    pub fn solve(&self, least_information: f64) -> (Step, Observability) {
        let n = self.pairs.max(1) as f64;
        let centre = self.s / n;
        let spread = (self.ss / n - centre.norm_squared()).max(0.0).sqrt();
        let spread = if spread > 0.0 { spread } else { 1.0 };
        let scale = centring(&centre, spread);
        let jj = Matrix6::from_fn(|row, column| self.jj[row.min(column)][row.max(column)]);
        let information = scale.transpose() * jj * scale / n;
        let right = -(scale.transpose() * Vector6::from(self.jr)) / n;
        let seen = Observability::of(&information, least_information);
        let solved = if seen.is_degenerate() { None } else { information.cholesky().map(|c| c.solve(&right)) };
        let x = solved.unwrap_or_else(|| seen.solve(&right));
        let turn = Vector3::new(x[0], x[1], x[2]) / spread;
        let shift = Vector3::new(x[3], x[4], x[5]);
        (step(&turn, &shift, &centre), seen)
    }
}

/// Maps `[ω L ; t]` about the centroid to `[ω ; t]` about the origin, as `j` is.
fn centring(centre: &Vector3<f64>, spread: f64) -> Matrix6<f64> {
    let mut scale = Matrix6::identity();
    let turns = Matrix3::identity() / spread;
    scale.fixed_view_mut::<3, 3>(0, 0).copy_from(&turns);
    // A turn about the centroid is the same turn about the origin and a shift of centre × ω.
    scale.fixed_view_mut::<3, 3>(3, 0).copy_from(&(centre.cross_matrix() / spread));
    scale
}

/// Turns about the centroid, then shifts.
fn step(turn: &Vector3<f64>, shift: &Vector3<f64>, centre: &Vector3<f64>) -> Step {
    let rotation = UnitQuaternion::from_scaled_axis(*turn);
    let translation = centre + shift - rotation * centre;
    Step {
        motion: Isometry3::from_parts(Translation3::from(translation), rotation),
        angle_rad: turn.norm(),
        shift_m: shift.norm(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Literals of Open3D (MIT), cpp/tests/t/pipelines/registration/TransformationEstimation.cpp at de5d8192. Its point
    // 10 has no pair and is left out; its normals are not of length 1.
    #[rustfmt::skip]
    const SOURCE: [[f64; 3]; 13] = [
        [1.15495, 2.40671, 1.15061], [1.81481, 2.06281, 1.71927], [0.888322, 2.05068, 2.04879],
        [3.78842, 1.70788, 1.30246], [1.8437, 2.22894, 0.986237], [2.95706, 2.2018, 0.987878],
        [1.72644, 1.24356, 1.93486], [0.922024, 1.14872, 2.34317], [3.70293, 1.85134, 1.15357],
        [3.06505, 1.30386, 1.55279], [1.40107, 1.37469, 1.09687], [2.93002, 1.96242, 1.48532],
        [3.74384, 1.30258, 1.30244],
    ];
    #[rustfmt::skip]
    const TARGET: [[f64; 3]; 11] = [
        [2.41766, 2.05397, 1.74994], [1.37848, 2.19793, 1.66553], [2.24325, 2.27183, 1.33708],
        [3.09898, 1.98482, 1.77401], [1.81615, 1.48337, 1.49697], [3.01758, 2.20312, 1.51502],
        [2.38836, 1.39096, 1.74914], [1.30911, 1.4252, 1.37429], [3.16847, 1.39194, 1.90959],
        [1.59412, 1.53304, 1.5804], [1.34342, 2.19027, 1.30075],
    ];
    #[rustfmt::skip]
    const NORMALS: [[f64; 3]; 11] = [
        [-0.0085016, -0.22355, -0.519574], [0.257463, -0.0738755, -0.698319], [0.0574301, -0.484248, -0.409929],
        [-0.0123503, -0.230172, -0.52072], [0.355904, -0.142007, -0.720467], [0.0674038, -0.418757, -0.458602],
        [0.226091, 0.258253, -0.874024], [0.43979, 0.122441, -0.574998], [0.109144, 0.180992, -0.762368],
        [0.273325, 0.292013, -0.903111], [0.385407, -0.212348, -0.277818],
    ];
    const PAIRS: [usize; 13] = [10, 10, 10, 8, 10, 2, 7, 7, 3, 6, 7, 0, 8];

    fn pairs() -> impl Iterator<Item = (Point3<f64>, Point3<f64>, Vector3<f64>)> {
        SOURCE.iter().zip(PAIRS).map(|(s, q)| (Point3::from(*s), Point3::from(TARGET[q]), Vector3::from(NORMALS[q])))
    }

    fn sums(motion: &Pose) -> NormalEquations {
        let mut sums = NormalEquations::default();
        pairs().for_each(|(s, q, n)| sums.add(&(motion * s), &q, &n));
        sums
    }

    /// Point to point Open3D expects 0.746223. Point to plane it expects 0.319101, which is no distance to the plane
    /// but √(Σ ((s - q)_k n_k)² / 13) over the components; the scalar gives 0.366238, worked out apart from this code.
    #[test]
    fn open3ds_vectors_give_its_distance_and_show_that_its_plane_residual_is_component_wise() {
        let sums = sums(&Pose::identity());
        let parts = pairs().map(|(s, q, n)| (s - q).component_mul(&n).norm_squared());
        let component_wise = (parts.sum::<f64>() / 13.0).sqrt();
        for (ours, expected) in [(sums.rmse_m(), 0.746223), (sums.plane_rmse_m(), 0.366238), (component_wise, 0.319101)]
        {
            assert!((ours - expected).abs() < 1e-6, "{ours} is not {expected}");
        }
    }

    #[test]
    fn a_step_lowers_the_residual_and_the_last_step_is_none() {
        let (mut motion, mut before) = (Pose::identity(), f64::INFINITY);
        for _ in 0..50 {
            let sums = sums(&motion);
            assert!(sums.plane_rmse_m() <= before + 1e-12);
            before = sums.plane_rmse_m();
            motion = sums.solve(0.0).0.motion * motion;
        }
        let (last, _) = sums(&motion).solve(0.0);
        assert!(last.angle_rad < 1e-6 && last.shift_m < 1e-6, "{last:?}");
    }

    #[test]
    fn chunks_merged_equal_the_whole_up_to_rounding() {
        let all: Vec<_> = pairs().collect();
        let chunk = |pairs: &[(Point3<f64>, Point3<f64>, Vector3<f64>)]| {
            let mut sums = NormalEquations::default();
            pairs.iter().for_each(|(s, q, n)| sums.add(s, q, n));
            sums
        };
        let merged = chunk(&all[..5]).merge(&chunk(&all[5..]));
        let difference = merged.solve(0.0).0.motion.to_homogeneous() - chunk(&all).solve(0.0).0.motion.to_homogeneous();
        assert!(difference.amax() < 1e-12 && merged.pairs == 13);
    }
}
