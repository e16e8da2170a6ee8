//! Any method, with a check of its motion on the scans.

use echoloop_clouds::pose::translation_error_m;
use echoloop_clouds::{Cloud, Pose};

use super::Scene;
use crate::{Outcome, Registration, StopReason};

/// Largest motion of the source between runs, over the unit, of a method that has come to rest.
const SETTLED_UNITS: f64 = 0.02;

/// Distance from the sensor, over the unit, at which a turn counts as a shift.
const LEVER_UNITS: f64 = 10.0;

/// Runs a method, then asks both scans about its motion.
///
/// A local method converges wherever it starts, and matches may agree by chance; neither notices.
/// Conversely, a few matches that agree may be right. The points of both scans decide:
/// [`Scene::judge`].
///
/// A method whose iterations ran out begins again where it stopped. If it stays there, as one does
/// whose last pairs change places for ever, it has converged.
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
        let (Ok(target_scene), Ok(source_scene)) = (scene(target), scene(source)) else {
            return outcome;
        };
        let again = |from: &Pose| self.method.register(target, source, from);
        asked(outcome, (&target_scene, &source_scene), again)
    }
}

/// The outcome once it has [`settled`], and what both scans say of its motion.
pub(crate) fn asked(
    outcome: Outcome,
    (target, source): (&Scene, &Scene),
    again: impl FnOnce(&Pose) -> Outcome,
) -> Outcome {
    let unit_m = target.unit_m();
    let outcome = settled(outcome, unit_m, again);
    let judgement = target.judge(source, &outcome.target_from_source);
    outcome.judged(judgement, unit_m)
}

/// The outcome; if its iterations ran out, that of as many more from its motion, which has
/// converged if it moved by less than [`SETTLED_UNITS`].
pub(crate) fn settled(
    outcome: Outcome,
    unit_m: f32,
    again: impl FnOnce(&Pose) -> Outcome,
) -> Outcome {
    if outcome.stop != StopReason::MaxIterations {
        return outcome;
    }
    let from = outcome.target_from_source;
    let mut more = again(&from);
    let turn_rad = from.rotation.angle_to(&more.target_from_source.rotation);
    let moved_m = translation_error_m(&from, &more.target_from_source) + LEVER_UNITS * turn_rad;
    if more.stop == StopReason::MaxIterations && moved_m < SETTLED_UNITS * f64::from(unit_m) {
        more.stop = StopReason::Converged;
    }
    more.iterations += outcome.iterations;
    more
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
        assert!(wrong.overlap.is_some_and(|overlap| overlap.supported() < 0.9), "{wrong:?}");
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
    }

    #[test]
    fn a_method_that_stays_where_its_iterations_ran_out_has_converged() {
        assert_eq!(run(5.0, StopReason::MaxIterations).stop, StopReason::Converged);
        let out = Outcome::nothing(&Pose::identity(), StopReason::MaxIterations);
        let settled_at = |x_m: f64| {
            let motion = Pose::translation(x_m, 0.0, 0.0);
            let again = |_: &Pose| Outcome::nothing(&motion, StopReason::MaxIterations);
            settled(out.clone(), 1.0, again).stop
        };
        assert_eq!(settled_at(0.01), StopReason::Converged);
        assert_eq!(settled_at(0.1), StopReason::MaxIterations);
    }

    #[test]
    fn the_reason_of_a_method_that_did_not_converge_is_kept() {
        assert_eq!(run(-3.0, StopReason::NoConsensus).stop, StopReason::NoConsensus);
    }
}
