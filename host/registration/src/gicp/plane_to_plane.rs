//! The least squares of generalised ICP: from pairs of planes to a step.

use echoloop_dispatch::dispatch;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use crate::Observability;
use crate::icp::centred::Centred;
use crate::icp::equations::Equations;
use crate::icp::kernel::Kernel;
use crate::icp::lanes::{LANES, Lane, add_product, cross, dot, total};
use crate::icp::normals::Normals;
use crate::icp::pairs::{Group, Pairs};
use crate::icp::step::Step;
use crate::normal_equations::{MomentSums, NormalEquations, RowSums};

/// ε, the variance along a plane's normal over that within the plane.
const ACROSS: f64 = 1e-3;

/// Sums over pairs of a moved source point `s` with normal `m` (turned as it is) and a target point
/// `q` with normal `n`.
///
/// ```text
/// M = (C_q + R C_s Rᵀ)⁻¹ = (2 I - (1 - ε)(n nᵀ + m mᵀ))⁻¹
///   = I / 2 + u uᵀ / 4(g - c) + v vᵀ / 4(g + c)
/// u = n + m,  v = n - m,  c = n · m,  g = 2 / (1 - ε) - 1
/// ```
///
/// The inverse is Woodbury's, written in the eigenvectors `u` and `v` of its part of rank two: a
/// weak distance from point to point and two distances from point to plane, so that no 3×3 matrix
/// is kept or inverted. Planes that agree have `c = 1` and weigh 1/(2 ε) along their normal. With
/// `j(u) = [s × u ; u]`, `d = s - q`:
///
/// ```text
/// E(ω, t) = Σ dᵀ M d      H = Σ J M Jᵀ      J = [j(x) j(y) j(z)]
/// ```
#[derive(Clone, Debug, Default)]
pub(crate) struct PlaneToPlane {
    /// The part of the two planes, `Σ w j jᵀ` and `Σ w j r`, and the moments of the pairs.
    planes: NormalEquations,
    /// The trace of the planes' part, `Σ w u · u`.
    weight: f64,
    /// From point to point, with the weight κ of each pair's residual: Σ κ s sᵀ without ½: xx, xy,
    /// xz, yy, yz, zz.
    ss: [f64; 6],
    /// Σ κ s.
    s: Vector3<f64>,
    /// Σ κ d.
    d: Vector3<f64>,
    /// Σ κ s × d.
    sd: Vector3<f64>,
}

impl Equations for PlaneToPlane {
    fn normals(max_normal_angle_rad: Option<f64>) -> Normals {
        Normals::Both(max_normal_angle_rad.map_or(0.0, f64::cos))
    }

    fn add_all(&mut self, pairs: &Pairs, kernel: Kernel) {
        add_all(self, pairs, kernel);
    }

    fn merge(mut self, other: &Self) -> Self {
        self.planes = self.planes.merge(&other.planes);
        self.weight += other.weight;
        for (ours, theirs) in self.ss.iter_mut().zip(&other.ss) {
            *ours += theirs;
        }
        self.s += other.s;
        self.d += other.d;
        self.sd += other.sd;
        self
    }

    /// Observability is that of the target's planes alone, as for [`NormalEquations`]. With the
    /// distances from point to point every direction would look determined, though they only draw
    /// it to where the samplings of the surfaces agree; and planes that agree outweigh all others.
    fn solve(&self, degeneracy_threshold: f64) -> (Step, Observability) {
        let centred = self.planes.centred();
        let weight = if self.weight > 0.0 { self.weight } else { 1.0 };
        let seen = self.planes.observability(&centred, degeneracy_threshold);
        let whole = centred.square(&self.information()) / weight;
        let right = -centred.right(&self.score()) / weight;
        (centred.step(&seen.solve_within(&whole, &right)), seen)
    }

    fn information(&self) -> Matrix6<f64> {
        self.planes.information() + self.points_information()
    }

    fn score(&self) -> Vector6<f64> {
        Vector6::from(self.planes.jr) + self.points_right()
    }

    fn centred(&self) -> Centred {
        self.planes.centred()
    }

    fn pairs(&self) -> usize {
        self.planes.pairs
    }

    fn rmse_m(&self) -> f64 {
        self.planes.rmse_m()
    }

    fn plane_rmse_m(&self) -> f64 {
        self.planes.plane_rmse_m()
    }
}

impl PlaneToPlane {
    /// Σ κ J Jᵀ / 2, the part of `H` from point to point.
    fn points_information(&self) -> Matrix6<f64> {
        let [xx, xy, xz, yy, yz, zz] = self.ss;
        let ss = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let turns = Matrix3::from_diagonal_element(ss.trace()) - ss;
        let across = self.s.cross_matrix();
        let mut sum = Matrix6::zeros();
        sum.fixed_view_mut::<3, 3>(0, 0).copy_from(&turns);
        sum.fixed_view_mut::<3, 3>(0, 3).copy_from(&across);
        sum.fixed_view_mut::<3, 3>(3, 0).copy_from(&across.transpose());
        sum.fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&Matrix3::from_diagonal_element(self.planes.weight));
        sum / 2.0
    }

    /// Σ κ J d / 2.
    fn points_right(&self) -> Vector6<f64> {
        Vector6::new(self.sd.x, self.sd.y, self.sd.z, self.d.x, self.d.y, self.d.z) / 2.0
    }
}

dispatch! {
    /// Adds the sums of some pairs.
    fn add_all(sums: &mut PlaneToPlane, pairs: &Pairs, kernel: Kernel) = add_all_inline;
}

#[inline(always)]
fn add_all_inline(sums: &mut PlaneToPlane, pairs: &Pairs, kernel: Kernel) {
    let (mut rows, mut moments, mut points) =
        (RowSums::default(), MomentSums::default(), PointSums::default());
    let (mut unweighted, mut weight) = (RowSums::default(), [0.0; LANES]);
    for group in pairs.groups(kernel) {
        let Group { s, d, n, m, r, w: kappa } = &group;
        for (plane, u) in planes(n, m) {
            let w = std::array::from_fn(|k| kappa[k] * plane[k]);
            rows.add(&w, s, &u, &dot(&u, d));
            add_product(&mut weight, &w, &dot(&u, &u));
        }
        unweighted.add(&[1.0; LANES], s, n, r);
        moments.add(s, d, r, kappa);
        points.add(s, d, kappa);
    }
    rows.add_to(&mut sums.planes);
    unweighted.add_unweighted_to(&mut sums.planes);
    moments.add_to(&mut sums.planes, pairs.len());
    points.add_to(sums);
    sums.weight += total(&weight);
}

/// The weights and directions of the two planes of each pair. Lanes without a pair have directions
/// of length 0.
#[inline(always)]
fn planes(n: &[Lane; 3], m: &[Lane; 3]) -> [(Lane, [Lane; 3]); 2] {
    const G: f64 = 2.0 / (1.0 - ACROSS) - 1.0;
    let c = dot(n, m);
    let sum = |sign: f64| {
        std::array::from_fn(|axis| std::array::from_fn(|k| n[axis][k] + sign * m[axis][k]))
    };
    let weight = |sign: f64| std::array::from_fn(|k| 0.25 / (G - sign * c[k]));
    [(weight(1.0), sum(1.0)), (weight(-1.0), sum(-1.0))]
}

/// The sums from point to point, four pairs at a time.
#[derive(Default)]
struct PointSums {
    ss: [Lane; 6],
    s: [Lane; 3],
    d: [Lane; 3],
    sd: [Lane; 3],
}

impl PointSums {
    #[inline(always)]
    fn add(&mut self, s: &[Lane; 3], d: &[Lane; 3], w: &Lane) {
        let ws: [Lane; 3] = std::array::from_fn(|axis| std::array::from_fn(|k| w[k] * s[axis][k]));
        for (sum, (a, b)) in
            self.ss.iter_mut().zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)])
        {
            add_product(sum, &ws[a], &s[b]);
        }
        let turn = cross(s, d);
        for axis in 0..3 {
            add_product(&mut self.s[axis], &s[axis], w);
            add_product(&mut self.d[axis], &d[axis], w);
            add_product(&mut self.sd[axis], &turn[axis], w);
        }
    }

    fn add_to(&self, sums: &mut PlaneToPlane) {
        for (sum, lane) in sums.ss.iter_mut().zip(&self.ss) {
            *sum += total(lane);
        }
        for axis in 0..3 {
            sums.s[axis] += total(&self.s[axis]);
            sums.d[axis] += total(&self.d[axis]);
            sums.sd[axis] += total(&self.sd[axis]);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::{Matrix3x6, Point3};
    use proptest::prelude::*;

    use super::*;

    type Pair = (Vector3<f64>, Point3<f32>, Vector3<f64>, Vector3<f64>);

    fn unit(v: [f64; 3]) -> Vector3<f64> {
        Vector3::from(v).try_normalize(1e-3).unwrap_or_else(Vector3::z)
    }

    fn pair() -> impl Strategy<Value = Pair> {
        let numbers = || prop::array::uniform3(-1.0f64..1.0);
        (numbers(), numbers(), numbers(), numbers()).prop_map(|(s, d, n, m)| {
            let s = Vector3::from(s) * 30.0;
            (s, Point3::from((s - Vector3::from(d)).cast::<f32>()), unit(n), unit(m))
        })
    }

    fn sums(pairs: &[Pair]) -> PlaneToPlane {
        sums_with(Kernel::LEAST_SQUARES, pairs)
    }

    fn sums_with(kernel: Kernel, pairs: &[Pair]) -> PlaneToPlane {
        let mut chunk = Pairs::default();
        pairs.iter().for_each(|(s, q, n, m)| chunk.push(s, q, n, m, 0.0));
        let (mut sums, mut plain) = (PlaneToPlane::default(), PlaneToPlane::default());
        sums.add_all(&chunk, kernel);
        add_all_inline(&mut plain, &chunk, kernel);
        assert_eq!(format!("{plain:?}"), format!("{sums:?}"), "the same bytes in both builds");
        sums
    }

    /// `H` and `b` of one pair, as the papers write them: with covariances, and an inverse.
    fn plainly((s, q, n, m): &Pair) -> (Matrix6<f64>, Vector6<f64>) {
        let covariance =
            |n: &Vector3<f64>| Matrix3::identity() - n * n.transpose() * (1.0 - ACROSS);
        let weight = (covariance(n) + covariance(m)).try_inverse().unwrap();
        let mut jacobian = Matrix3x6::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&-s.cross_matrix());
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
        let d = s - q.coords.cast::<f64>();
        (jacobian.transpose() * weight * jacobian, jacobian.transpose() * weight * d)
    }

    proptest! {
        #[test]
        fn the_sums_are_those_of_the_covariances_inverted(
            pairs in prop::collection::vec(pair(), 1..40),
            width in prop::option::of(0.5f64..9.0),
        ) {
            let kernel = Kernel::of_residuals(width, &mut [0.2; 3], 0.5);
            let ours = sums_with(kernel, &pairs);
            let (mut h, mut b) = (Matrix6::zeros(), Vector6::zeros());
            for pair in &pairs {
                let (one_h, one_b) = plainly(pair);
                let (s, q, n, _) = pair;
                let w = kernel.weight(n.dot(&(s - q.coords.cast::<f64>())), 0.0);
                h += one_h * w;
                b += one_b * w;
            }
            let our_h = ours.planes.information() + ours.points_information();
            let our_b = Vector6::from(ours.planes.jr) + ours.points_right();
            // Target points are rounded to f32, and weights reach 500.
            prop_assert!((our_h - h).norm() < 1e-4 * h.norm(), "{}{}", our_h, h);
            prop_assert!((our_b - b).norm() < 1e-4 * (1.0 + b.norm()), "{}{}", our_b, b);
        }
    }

    #[test]
    fn planes_that_agree_weigh_500_along_their_normal_and_half_within() {
        let pair = (Vector3::zeros(), Point3::origin(), Vector3::z(), Vector3::z());
        let sums = sums(&[pair]);
        let shifts = (sums.planes.information() + sums.points_information())
            .fixed_view::<3, 3>(3, 3)
            .into_owned();
        let expected = Matrix3::from_diagonal(&Vector3::new(0.5, 0.5, 500.0));
        assert!((shifts - expected).norm() < 1e-9, "{shifts}");
    }

    #[test]
    fn a_plane_leaves_its_two_shifts_and_its_turn_open() {
        let pairs: Vec<Pair> = (0..25)
            .map(|i| {
                let s = Vector3::new((i % 5) as f64, (i / 5) as f64, 0.1);
                (s, Point3::new(s.x as f32, s.y as f32 + 0.01, 0.0), Vector3::z(), Vector3::z())
            })
            .collect();
        let (step, seen) = sums(&pairs).solve(3e-3);
        assert_eq!(seen.unobservable, 3);
        assert!(
            (step.motion.translation.vector - Vector3::new(0.0, 0.0, -0.1)).norm() < 1e-9,
            "{step:?}"
        );
    }
}
