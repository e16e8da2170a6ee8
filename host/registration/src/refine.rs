//! A global method, refined by a local one.

use echoloop_clouds::{Cloud, Pose};

use super::{Outcome, Registration, StopReason};

/// Runs a global method, then a local one from the motion it found.
///
/// | global | local | motion, pairs, errors | stop |
/// |---|---|---|---|
/// | found nothing | not run | global | global |
/// | no consensus | converged | local | no consensus |
/// | no consensus | anything else | global | no consensus |
/// | any other | found nothing | global | local |
/// | any other | converged, iterations ran out, degenerate | local | local |
///
/// "Found nothing" is an empty cloud, bad settings, too few matches or too few pairs; then the
/// motion is as rough as the global method left it.
///
/// The consensus is always the global method's, and `iterations` counts the steps of both. A local
/// method that converges does not make up for a missing consensus: it converges at wrong places
/// too.
#[derive(Clone, Debug)]
pub struct Refined<G, L> {
    /// The global method.
    pub global: G,
    /// The local method.
    pub local: L,
}

impl<G: Registration, L: Registration> Registration for Refined<G, L> {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        let global = self.global.register(target, source, initial);
        if found_nothing(global.stop) {
            return global;
        }
        let local = self.local.register(target, source, &global.target_from_source);
        combined(global, local)
    }
}

/// True when the motion is only the initial one.
fn found_nothing(stop: StopReason) -> bool {
    use StopReason::{BadSettings, EmptyCloud, TooFewMatches, TooFewPairs};
    matches!(stop, EmptyCloud | BadSettings | TooFewMatches | TooFewPairs)
}

fn combined(global: Outcome, local: Outcome) -> Outcome {
    let iterations = global.iterations + local.iterations;
    let trusted = global.stop != StopReason::NoConsensus;
    let stop = if trusted { local.stop } else { global.stop };
    let keep_local = if trusted { !found_nothing(local.stop) } else { local.stop.is_success() };
    let consensus = global.consensus;
    let kept = if keep_local { local } else { global };
    Outcome { stop, iterations, consensus, ..kept }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Consensus;

    /// Method that moves by `x_m` and stops for `stop`; a global one has a consensus.
    struct Fake {
        x_m: f64,
        stop: StopReason,
        consensus: Option<Consensus>,
    }

    impl Registration for Fake {
        fn register(&self, _: &Cloud, _: &Cloud, initial: &Pose) -> Outcome {
            Outcome {
                target_from_source: Pose::translation(self.x_m, 0.0, 0.0) * initial,
                iterations: 3,
                pairs: self.x_m as usize,
                consensus: self.consensus,
                ..Outcome::nothing(initial, self.stop)
            }
        }
    }

    const CONSENSUS: Consensus = Consensus { matches: 50, searched: 50, inliers: 20, margin: None };

    /// Distance, steps and stop reason of a global method that moves by 10 m, then a local one by
    /// 1 m.
    fn run(global: StopReason, local: StopReason) -> (f64, usize, StopReason) {
        let global = Fake { x_m: 10.0, stop: global, consensus: Some(CONSENSUS) };
        let refined = Refined { global, local: Fake { x_m: 1.0, stop: local, consensus: None } };
        let outcome = refined.register(
            &Cloud::default(),
            &Cloud::default(),
            &Pose::translation(100.0, 0.0, 0.0),
        );
        assert_eq!(outcome.consensus, Some(CONSENSUS), "the consensus is the global method's");
        let x_m = outcome.target_from_source.translation.x;
        assert_eq!(outcome.pairs, if x_m == 111.0 { 1 } else { 10 }, "pairs belong to the motion");
        (x_m, outcome.iterations, outcome.stop)
    }

    use StopReason::{
        BadSettings, Converged, Degenerate, EmptyCloud, MaxIterations, NoConsensus, TooFewMatches,
        TooFewPairs,
    };

    #[test]
    fn a_global_method_that_found_nothing_is_not_refined() {
        for stop in [EmptyCloud, BadSettings, TooFewMatches, TooFewPairs] {
            assert_eq!(run(stop, Converged), (110.0, 3, stop));
        }
    }

    #[test]
    fn the_motion_and_reason_of_a_local_method_that_moved_count() {
        for global in [Converged, MaxIterations, Degenerate] {
            for local in [Converged, MaxIterations, Degenerate] {
                assert_eq!(run(global, local), (111.0, 6, local));
            }
        }
    }

    #[test]
    fn a_local_method_that_found_nothing_leaves_the_global_motion_and_its_own_reason() {
        for local in [TooFewPairs, EmptyCloud, BadSettings] {
            assert_eq!(run(Converged, local), (110.0, 6, local));
        }
    }

    #[test]
    fn no_consensus_stays_so_and_is_refined_only_where_the_local_method_succeeds() {
        assert_eq!(run(NoConsensus, Converged), (111.0, 6, NoConsensus));
        for local in [MaxIterations, Degenerate, TooFewPairs, BadSettings] {
            assert_eq!(run(NoConsensus, local), (110.0, 6, NoConsensus));
        }
    }

    #[test]
    fn boxed_methods_combine_as_well() {
        let boxed =
            |x_m| Box::new(Fake { x_m, stop: Converged, consensus: None }) as Box<dyn Registration>;
        let refined = Refined { global: boxed(2.0), local: boxed(1.0) };
        let outcome = refined.register(&Cloud::default(), &Cloud::default(), &Pose::identity());
        assert_eq!(outcome.target_from_source.translation.x, 3.0);
    }
}
