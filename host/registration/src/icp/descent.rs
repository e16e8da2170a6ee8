//! The loop of every variant of ICP: pair, step, check for convergence.

use echoloop_clouds::Pose;

use super::equations::Equations;
use super::kernel::Kernel;
use super::pairing::{Found, Moving, Placed, sum_pairs};
use super::step::Step;
use super::uncertainty::covariance;
use crate::{IcpConfig, Observability, Outcome, StopReason, Target};

/// Unknowns of a motion: fewer pairs cannot determine it.
const UNKNOWNS: usize = 6;

/// Factor by which the pair distance of a coarse start shrinks in each iteration.
const SHRINK: f64 = 0.7;

/// The loop of ICP, with its settings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Descent(pub(crate) IcpConfig);

impl Descent {
    /// Runs from `initial`. With too few pairs the outcome carries `initial`; with a direction left
    /// open it moves in the others.
    pub(crate) fn run<E: Equations>(
        &self,
        target: &Target,
        source: &Moving,
        initial: &Pose,
    ) -> Outcome {
        let Self(config) = self;
        let mut outcome = Outcome::nothing(initial, StopReason::MaxIterations);
        let mut found = Found::nothing(source.points.len());
        let mut reach_m = config.first_pair_distance_m.unwrap_or(config.max_pair_distance_m);
        let mut kernel = Kernel::LEAST_SQUARES;
        let normals = E::normals(config.max_normal_angle_rad);
        while outcome.iterations < config.max_iterations {
            // While pairs may be far apart, a step of nothing says little about the last distance,
            // and weights would keep the motion where most pairs, those on the ground, fit.
            let fine = reach_m <= config.max_pair_distance_m;
            let weighs = fine && config.kernel_width.is_some();
            let pose = &outcome.target_from_source;
            let placed = Placed { target, source, pose, reach_m, normals };
            let (sums, mut residuals_m): (E, _) = sum_pairs(&placed, kernel, weighs, &mut found);
            let noise_m2 = placed.noise_m2();
            if sums.pairs() < UNKNOWNS {
                let nothing = Outcome::nothing(initial, StopReason::TooFewPairs);
                return Outcome { pairs: sums.pairs(), iterations: outcome.iterations, ..nothing };
            }
            let (step, seen) = sums.solve(config.degeneracy_threshold);
            let before = (outcome.inlier_fraction, outcome.rmse_m);
            outcome.advance(&step, &sums, seen, source.points.len());
            let change = (outcome.inlier_fraction - before.0, outcome.rmse_m - before.1);
            let weighted = config.kernel_width.is_none() || kernel != Kernel::LEAST_SQUARES;
            // The first step has nothing to be compared with.
            let settled = outcome.iterations > 1 && self.changes_little(change);
            if fine && weighted && (self.is_small(&step) || settled) {
                outcome.stop = StopReason::Converged;
                break;
            }
            kernel = Kernel::of_residuals(config.kernel_width, &mut residuals_m, reach_m)
                .with_noise(noise_m2);
            reach_m = (reach_m * SHRINK).max(config.max_pair_distance_m);
        }
        let pose = &outcome.target_from_source;
        let placed = Placed { target, source, pose, reach_m, normals };
        outcome.covariance = Some(covariance::<E>(&placed, config, kernel, &mut found));
        if seen_degenerate(&outcome) {
            outcome.stop = StopReason::Degenerate;
        }
        outcome
    }

    fn is_small(&self, step: &Step) -> bool {
        step.shift_m < self.0.translation_tolerance_m
            && step.angle_rad < self.0.rotation_tolerance_rad
    }

    fn changes_little(&self, (fraction, rmse_m): (f64, f64)) -> bool {
        fraction.abs() < self.0.fitness_tolerance && rmse_m.abs() < self.0.rmse_tolerance_m
    }
}

fn seen_degenerate(outcome: &Outcome) -> bool {
    outcome.observability.is_some_and(|seen| seen.is_degenerate())
}

impl Outcome {
    /// Takes a step, and remembers the pairs it came from.
    fn advance(&mut self, step: &Step, sums: &impl Equations, seen: Observability, points: usize) {
        self.target_from_source = step.motion * self.target_from_source;
        self.target_from_source.rotation.renormalize();
        self.iterations += 1;
        self.pairs = sums.pairs();
        self.inlier_fraction = sums.pairs() as f64 / points.max(1) as f64;
        self.rmse_m = sums.rmse_m();
        self.plane_rmse_m = sums.plane_rmse_m();
        self.observability = Some(seen);
    }
}
