//! Any method, with a check of its motion on the scans.

use echoloop_clouds::{Cloud, Pose};

use super::Scene;
use crate::{Outcome, Registration, StopReason};

/// Runs a method, then checks its motion on both scans.
///
/// | the method | the scans | stop |
/// |---|---|---|
/// | converged | confirm | converged |
/// | converged | do not | unconfirmed |
/// | no consensus | confirm | converged |
/// | converged, iterations ran out | leave directions open | degenerate |
/// | anything else | not asked where nothing was found | the method's |
///
/// A local method converges wherever it starts, and matches may agree by chance; neither notices.
/// Conversely, a few matches that agree may be right. The points of both scans decide.
#[derive(Clone, Debug)]
pub struct Confirmed<M> {
    /// The method that finds the motion.
    pub method: M,
    /// Voxel of the clouds for the check, m.
    pub voxel_m: f64,
}

impl<M: Registration> Registration for Confirmed<M> {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        let outcome = self.method.register(target, source, initial);
        if outcome.overlap.is_some() || outcome.iterations == 0 {
            return outcome; // the method asked the scans itself, or found nothing
        }
        let scene = |cloud| Scene::new(cloud, self.voxel_m);
        match (scene(target), scene(source)) {
            (Ok(target), Ok(source)) => checked(outcome, &target, &source),
            _ => outcome,
        }
    }
}

fn checked(mut outcome: Outcome, target: &Scene, source: &Scene) -> Outcome {
    let overlap = target.overlap(source, &outcome.target_from_source);
    outcome.overlap = Some(overlap);
    outcome.stop = match outcome.stop {
        StopReason::NoConsensus if overlap.confirms() => StopReason::Converged,
        stop if stop.is_success() && !overlap.confirms() => StopReason::Unconfirmed,
        stop => stop,
    };
    outcome.with_open_directions(target, source)
}

#[cfg(test)]
mod tests {
    use super::super::open::tests::tunnel;
    use super::super::tests::yard;
    use super::*;

    /// Says that it converged at `x_m`.
    struct Fake {
        x_m: f64,
        stop: StopReason,
    }

    impl Registration for Fake {
        fn register(&self, _: &Cloud, _: &Cloud, initial: &Pose) -> Outcome {
            let motion = Pose::translation(self.x_m, 0.0, 0.0);
            let nothing = Outcome::nothing(initial, self.stop);
            Outcome { target_from_source: motion, iterations: 1, ..nothing }
        }
    }

    fn run(x_m: f64, stop: StopReason) -> Outcome {
        let method = Confirmed { method: Fake { x_m, stop }, voxel_m: 0.8 };
        method.register(&yard(0.0), &yard(5.0), &Pose::identity())
    }

    #[test]
    fn a_right_motion_stays_converged_and_a_wrong_one_does_not() {
        assert_eq!(run(5.0, StopReason::Converged).stop, StopReason::Converged);
        let wrong = run(-3.0, StopReason::Converged);
        assert_eq!(wrong.stop, StopReason::Unconfirmed);
        assert!(wrong.overlap.is_some_and(|overlap| overlap.seen_through > 0.01), "{wrong:?}");
    }

    #[test]
    fn a_motion_that_may_slide_along_a_tunnel_is_degenerate_whatever_the_method_says() {
        let said = |stop| {
            let method = Confirmed { method: Fake { x_m: 0.0, stop }, voxel_m: 0.8 };
            method.register(&tunnel(0.0, 500.0), &tunnel(2.0, 500.0), &Pose::identity())
        };
        for stop in [StopReason::Converged, StopReason::NoConsensus, StopReason::Degenerate] {
            let outcome = said(stop);
            assert_eq!((outcome.stop, outcome.open.len()), (StopReason::Degenerate, 1), "{stop:?}");
        }
    }

    #[test]
    fn the_scans_bear_out_what_few_matches_say() {
        assert_eq!(run(5.0, StopReason::NoConsensus).stop, StopReason::Converged);
        assert_eq!(run(5.0, StopReason::MaxIterations).stop, StopReason::MaxIterations);
    }

    #[test]
    fn the_reason_of_a_method_that_did_not_converge_is_kept() {
        assert_eq!(run(-3.0, StopReason::NoConsensus).stop, StopReason::NoConsensus);
    }
}
