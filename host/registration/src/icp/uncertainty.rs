//! Covariance of the motion at the end of a run.

use nalgebra::{Matrix6, Vector6};

use super::centred::Centred;
use super::equations::Equations;
use super::kernel::Kernel;
use super::pairing::{Chunk, Found, LastSearch, Placed, sum_pairs};
use crate::{Covariance, IcpConfig, Observability};

/// Points of a cluster: neighbours, since points are in the order of a tree. They share their
/// targets, normals and patches of surface, so their errors are not independent.
const CLUSTER: usize = 32;

/// The kernel's width for runs without one, in standard deviations.
const PLAIN_WIDTH: f64 = 3.0;

/// Least share of the information that stays in any direction.
const LEAST_SHARE: f64 = 0.1;

/// Added to the share of the information outside a cluster: the factor (I - H_c H⁻¹)⁻¹ of its score
/// is at most 1 / LEAST_REST.
const LEAST_REST: f64 = 0.01;

/// Rounding of `f32` coordinates over the spread of the pairs, with room.
const ROUNDING: f64 = 1e-6;

/// Least information of a direction over the mean of all: less cannot be inverted.
const RIDGE: f64 = 1e-9;

/// Covariance of the motion that a run ended with, from the pairs it leaves: Huber's sandwich
/// ("The behavior of maximum likelihood estimates under nonstandard conditions", 1967), with the
/// scores summed by cluster (Liang and Zeger 1986).
///
/// ```text
/// C = A⁻¹ B A⁻¹      B = Σ g̃ g̃ᵀ over clusters      g̃ = (I - H_c H⁻¹)⁻¹ Σ w j r over its pairs
/// A = S H⁻¹ S        H = Σ w j jᵀ      S = Σ d(w r)/dr j jᵀ
/// ```
///
/// `g̃` is the change from leaving the cluster out (the jackknife; Bell and McCaffrey 2002): a
/// cluster that alone holds a direction has bent the motion until its residuals vanish. `S` is the
/// slope of the weighted score. Unlike Huber's, ours has it twice: once for the weights, once for
/// the pairing, since a point with a large residual also changes its partner, and then its pull no
/// longer grows with the motion. A run without a kernel has `H` in place of the first `S`, and the
/// second from the kernel that fits its residuals. `B` is blended with the shape of `H`, which
/// counts `k / (k + clusters)` for `k` directions.
///
/// Along a direction that the pairs leave open the motion is where the run began: the standard
/// deviation is the first pair distance (of turns, over the pairs' spread), the most that a run is
/// meant to make up for.
pub(crate) fn covariance<E: Equations>(
    placed: &Placed,
    config: &IcpConfig,
    kernel: Kernel,
    found: &mut Found,
) -> Covariance {
    let asked = match kernel == Kernel::LEAST_SQUARES {
        true => {
            let (_, mut residuals_m) = sum_pairs::<E>(placed, kernel, true, found);
            Kernel::of_residuals(Some(PLAIN_WIDTH), &mut residuals_m, placed.reach_m)
                .with_noise(placed.noise_m2())
        }
        false => kernel,
    };
    let parts =
        placed.in_chunks(found, |chunk, matches| Part::<E>::of(chunk, matches, kernel, asked));
    let whole = parts.into_iter().fold(Part::default(), Part::merge);
    let (_, seen) = whole.sums.solve(config.degeneracy_threshold);
    let open_m = config.first_pair_distance_m.unwrap_or(config.max_pair_distance_m);
    whole.covariance(&seen, open_m, kernel != Kernel::LEAST_SQUARES)
}

/// Sums about the target's origin.
#[derive(Default)]
struct Part<E> {
    /// With the run's weights.
    sums: E,
    /// Σ w j jᵀ with the weights that the residuals ask for.
    weighted: Matrix6<f64>,
    /// The slope of the score with these.
    slope: Matrix6<f64>,
    /// One for each cluster that has pairs.
    clusters: Vec<Cluster>,
}

/// Sums over a cluster.
struct Cluster {
    /// Σ w j r.
    score: Vector6<f64>,
    /// Σ w j jᵀ.
    information: Matrix6<f64>,
}

impl<E: Equations> Part<E> {
    /// The sums of a chunk, cluster by cluster.
    fn of(chunk: &Chunk, matches: &mut [LastSearch], kernel: Kernel, asked: Kernel) -> Self {
        let mut part = Self::default();
        for (number, matches) in matches.chunks_mut(CLUSTER).enumerate() {
            let pairs = chunk.from(number * CLUSTER).pairs(matches);
            let [sums, weighted, slope] = [kernel, asked, asked.slope()].map(|kernel| {
                let mut sums = E::default();
                sums.add_all(&pairs, kernel);
                sums
            });
            if sums.pairs() > 0 {
                let (score, information) = (sums.score(), sums.information());
                part.clusters.push(Cluster { score, information });
            }
            part.weighted += weighted.information();
            part.slope += slope.information();
            part.sums = part.sums.merge(&sums);
        }
        part
    }

    fn merge(mut self, other: Self) -> Self {
        self.sums = self.sums.merge(&other.sums);
        self.weighted += other.weighted;
        self.slope += other.slope;
        self.clusters.extend(other.clusters);
        self
    }

    /// The covariance about the target's origin; that of directions left open is `open_m²`.
    fn covariance(&self, seen: &Observability, open_m: f64, robust: bool) -> Covariance {
        let centred = self.sums.centred();
        let open: Matrix6<f64> = (0..seen.unobservable)
            .map(|i| seen.directions.column(i) * seen.directions.column(i).transpose())
            .sum();
        let within = Within::new(&self.sums, &centred, open);
        let rounding_m = ROUNDING * centred.spread;
        let known = self.known(&within, 6 - seen.unobservable, robust);
        let here = known.filter(|known| known.iter().all(|v| v.is_finite())).map_or_else(
            || Matrix6::identity() * (open_m * open_m),
            |known| known + open * (open_m * open_m),
        ) + Matrix6::identity() * (rounding_m * rounding_m);
        let there = centred.covariance_about_origin(&here);
        Covariance((there + there.transpose()) / 2.0)
    }

    /// The sandwich in the directions that the pairs determine; 0 in the others. `None` where
    /// rounding leaves nothing that can be solved.
    fn known(&self, within: &Within, directions: usize, robust: bool) -> Option<Matrix6<f64>> {
        let information = within.square(&self.sums.information()) + within.rest();
        let slope = information.cholesky()?.l() * self.share(within, robust)?;
        let inverse = (slope * slope.transpose()).cholesky()?.inverse();
        Some(inverse * self.spread_of_scores(within, &information, directions)? * inverse)
    }

    /// A square root of the share of the information that stays as the motion changes.
    fn share(&self, within: &Within, robust: bool) -> Option<Matrix6<f64>> {
        let weighted = within.square(&self.weighted) + within.rest();
        let slope = within.square(&self.slope) + within.rest();
        let whiten = weighted.cholesky()?.l().try_inverse()?;
        let eigen = (whiten * slope * whiten.transpose()).symmetric_eigen();
        let share = eigen.eigenvalues.map(|share| share.max(LEAST_SHARE));
        // Squared with a kernel: once for its weights, once for partners that change.
        let root = share.map(|share| if robust { share } else { share.sqrt() });
        Some(eigen.eigenvectors * Matrix6::from_diagonal(&root))
    }

    /// B.
    fn spread_of_scores(
        &self,
        within: &Within,
        information: &Matrix6<f64>,
        directions: usize,
    ) -> Option<Matrix6<f64>> {
        let mut spread = Matrix6::zeros();
        for cluster in &self.clusters {
            let rest = information * (1.0 + LEAST_REST) - within.square(&cluster.information);
            let score = information * rest.cholesky()?.solve(&within.right(&cluster.score));
            spread += score * score.transpose();
        }
        let directions = directions.max(1) as f64;
        let few = directions / (directions + self.clusters.len() as f64);
        let mean = (information.cholesky()?.inverse() * spread).trace() / directions;
        let even = within.square(&self.sums.information()) * mean;
        Some(spread * (1.0 - few) + even * few)
    }
}

/// Sums about the pairs' centroid, scaled to a mean information of 1, in the directions that the
/// pairs determine.
struct Within<'a> {
    centred: &'a Centred,
    seen: Matrix6<f64>,
    open: Matrix6<f64>,
    scale: f64,
}

impl<'a> Within<'a> {
    fn new(sums: &impl Equations, centred: &'a Centred, open: Matrix6<f64>) -> Self {
        let trace = centred.square(&sums.information()).trace() / 6.0;
        let scale = if trace > 0.0 { 1.0 / trace } else { 1.0 };
        Self { centred, seen: Matrix6::identity() - open, open, scale }
    }

    fn square(&self, sums: &Matrix6<f64>) -> Matrix6<f64> {
        self.seen * self.centred.square(sums) * self.seen * self.scale
    }

    fn right(&self, sums: &Vector6<f64>) -> Vector6<f64> {
        self.seen * self.centred.right(sums) * self.scale
    }

    /// An addition that makes a square of these invertible and changes nothing else.
    fn rest(&self) -> Matrix6<f64> {
        self.open + Matrix6::identity() * RIDGE
    }
}
