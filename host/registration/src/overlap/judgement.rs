//! What two scans say of a motion.

use nalgebra::Vector6;

use super::open::{Direction, WEAK};
use super::probes::{Answers, FIRST_LOOK, Lead};
use super::{OpenDirection, Overlap, Scene};
use crate::{Covariance, Outcome, Pose, StopReason};

/// Mean displacements to which a motion is slid along a direction, over the unit.
const SLIDES: [f64; 2] = [1.0, 2.0];

/// Least lead of a motion, in standard deviations of chance, over those that it slides to. The best
/// of some forty candidates of scans of different towns come to 3.5 by chance; right motions of
/// spinning sensors lead by 7 and more, of narrow fields of view by 3 to 10.
const LEAST_LEAD: Lead = Lead { disputed: 1.0, explained: 3.5 };

/// Least disputed lead where fewer points than this lie on a surface: that of one cluster, for they
/// dispute no more.
const FEW_ON: usize = 1_500;
const FEW_DISPUTED: f64 = 0.7;

/// A lead at which a first look is enough.
const CLEAR_LEAD: Lead = Lead { disputed: 2.0, explained: 6.0 };

/// A rival fits the scans if its share of support is this, …
const RIVAL_SUPPORTED: f64 = 0.98;

/// … and is as good if the motion leads it by less, …
const RIVAL_LEAD: Lead = Lead { disputed: 2.0, explained: 2.0 };

/// … or if it is turned, rad, …
const TURNED_RAD: f64 = 0.5;

/// … and both scans know this share of all points: in a square room, where they see all that there
/// is, small errors of the sensor decide.
const RIVAL_KNOWN: f64 = 0.93;

/// Least share of support of a motion that may be preferred to another.
const PLAUSIBLE_SUPPORTED: f64 = 0.95;

/// Standard deviation of the motion along an open direction, over the unit.
const OPEN_UNITS: f64 = 5.0;

/// Two motions are others if they differ by more than this: a shift over the unit, …
const OTHER_UNITS: f64 = 1.0;

/// … or a turn, rad.
const OTHER_RAD: f64 = 0.15;

/// What two scans say of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// The points of each on the other.
    pub overlap: Overlap,
    /// Lead of the motion over the same slid by 1 or 2 units, in standard deviations of chance,
    /// along that of the weakest directions where it is least. None if the overlap does not agree,
    /// or too few points have partners to tell.
    pub lead: Option<f64>,
    /// Directions in which the scans do not notice that the motion slides.
    pub open: Vec<OpenDirection>,
    held: Option<Lead>,
}

/// Another motion that fits two scans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rival {
    /// The motion.
    pub target_from_source: Pose,
    /// Lead over it, in standard deviations of chance.
    pub lead: f64,
    /// True when the scans do not tell which of the two is right.
    pub is_as_good: bool,
}

/// A motion, and what a first look says of it.
#[derive(Clone, Debug)]
pub(crate) struct Looked {
    pub(crate) motion: Pose,
    answers: Answers,
}

impl Judgement {
    /// True when the scans confirm the motion: they agree with it, and with nothing beside it.
    pub fn confirms(&self) -> bool {
        self.held.is_some_and(|held| held.is_over(least(&self.overlap)))
    }

    fn is_clear(&self) -> bool {
        self.held.is_some_and(|held| held.is_over(CLEAR_LEAD))
    }
}

/// Least lead of a motion over those that it slides to.
fn least(overlap: &Overlap) -> Lead {
    match overlap.on < FEW_ON {
        true => Lead { disputed: FEW_DISPUTED, ..LEAST_LEAD },
        false => LEAST_LEAD,
    }
}

impl Lead {
    fn is_over(&self, least: Self) -> bool {
        self.disputed >= least.disputed && self.explained >= least.explained
    }

    fn min(self, other: Self) -> Self {
        self.combined(other, f64::min)
    }

    fn max(self, other: Self) -> Self {
        self.combined(other, f64::max)
    }

    fn combined(self, other: Self, of: fn(f64, f64) -> f64) -> Self {
        Self {
            disputed: of(self.disputed, other.disputed),
            explained: of(self.explained, other.explained),
        }
    }
}

impl Scene {
    /// What this scan, the target, and a source say of a motion.
    pub fn judge(&self, source: &Self, target_from_source: &Pose) -> Judgement {
        let first = self.judge_by(source, target_from_source, FIRST_LOOK);
        let is_all = self.probes.len().max(source.probes.len()) <= FIRST_LOOK;
        match is_all || first.is_clear() {
            true => first,
            false => self.judge_by(source, target_from_source, usize::MAX),
        }
    }

    /// The same, by the first points of each.
    fn judge_by(&self, source: &Self, motion: &Pose, most: usize) -> Judgement {
        let here = self.answers(source, motion, most);
        let overlap = here.overlap();
        let mut judgement = Judgement { overlap, lead: None, open: Vec::new(), held: None };
        if !overlap.agrees() {
            return judgement;
        }
        for direction in self.weakest_directions(source, motion) {
            let held = self.held(source, motion, &here, &direction, most);
            if direction.share < WEAK && held.disputed < least(&overlap).disputed {
                judgement.open.push(direction.about_origin());
            }
            judgement.held = Some(judgement.held.map_or(held, |least| least.min(held)));
        }
        judgement.lead = judgement.held.map(|held| held.explained);
        judgement
    }

    /// Lead of a motion over the same slid either way along a direction, at the displacement where
    /// that is larger.
    fn held(
        &self,
        source: &Self,
        motion: &Pose,
        here: &Answers,
        direction: &Direction,
        most: usize,
    ) -> Lead {
        let over = |by_m: f64| {
            let there = self.answers(source, &direction.slid(motion, by_m), most);
            self.lead(source, here, &there)
        };
        let mut held: Option<Lead> = None;
        for by_m in SLIDES.map(|units| units * f64::from(self.unit_m())) {
            let either = over(by_m).min(over(-by_m));
            let larger = held.map_or(either, |held| held.max(either));
            if larger.is_over(CLEAR_LEAD) {
                return larger;
            }
            held = Some(larger);
        }
        held.unwrap_or(Lead { disputed: 0.0, explained: 0.0 })
    }

    /// A motion with what a first look says of it.
    pub(crate) fn look(&self, source: &Self, motion: Pose) -> Looked {
        Looked { motion, answers: self.answers(source, &motion, FIRST_LOOK) }
    }

    /// The first of some motions, or the one that the scans clearly prefer to it.
    pub(crate) fn preferred<'a>(&self, source: &Self, motions: &'a [Looked]) -> Option<&'a Looked> {
        motions.iter().reduce(|best, other| {
            let lead = self.lead(source, &other.answers, &best.answers);
            let is_better = lead.explained > 0.0 && lead.disputed > RIVAL_LEAD.disputed
                || lead.explained > RIVAL_LEAD.explained && lead.disputed >= 0.0;
            let is_plausible = other.answers.overlap().supported() >= PLAUSIBLE_SUPPORTED;
            if is_plausible && is_better { other } else { best }
        })
    }

    /// Of other motions that fit the scans, the one that the motion leads least.
    pub(crate) fn rival(&self, source: &Self, of: &Looked, others: &[Looked]) -> Option<Rival> {
        let rival = |other: &Looked| {
            let overlap = other.answers.overlap();
            let fits = overlap.agrees() && overlap.supported() >= RIVAL_SUPPORTED;
            let Lead { disputed, explained: lead } = self.lead(source, &of.answers, &other.answers);
            let turned = of.motion.rotation.angle_to(&other.motion.rotation) > TURNED_RAD;
            let is_alike = turned && overlap.known() >= RIVAL_KNOWN;
            let is_as_good =
                is_alike || disputed < RIVAL_LEAD.disputed && lead < RIVAL_LEAD.explained;
            fits.then_some(Rival { target_from_source: other.motion, lead, is_as_good })
        };
        let others = others.iter().filter(|other| self.is_other(&of.motion, &other.motion));
        let key = |rival: &Rival| (!rival.is_as_good, rival.lead);
        others.filter_map(rival).min_by(|a, b| {
            let ((a_is_worse, a_lead), (b_is_worse, b_lead)) = (key(a), key(b));
            a_is_worse.cmp(&b_is_worse).then(a_lead.total_cmp(&b_lead))
        })
    }

    /// True when two motions are clearly different ones.
    pub(crate) fn is_other(&self, one: &Pose, other: &Pose) -> bool {
        let apart_m = (one.translation.vector - other.translation.vector).norm();
        apart_m > OTHER_UNITS * f64::from(self.unit_m())
            || one.rotation.angle_to(&other.rotation) > OTHER_RAD
    }
}

impl Outcome {
    /// The same with what the scans say of its motion.
    ///
    /// | the method | the scans | stop |
    /// |---|---|---|
    /// | converged, no consensus | confirm | converged |
    /// | converged | do not | unconfirmed |
    /// | converged, ran out of iterations, degenerate | leave a direction open | degenerate |
    /// | anything else | | the method's |
    ///
    /// The covariance is wide along open directions.
    pub(crate) fn judged(mut self, target: &Scene, source: &Scene) -> Self {
        use StopReason::{Converged, Degenerate, MaxIterations, NoConsensus, Unconfirmed};
        let judgement = target.judge(source, &self.target_from_source);
        let is_found = matches!(self.stop, Converged | MaxIterations | Degenerate | NoConsensus);
        self.stop = match self.stop {
            _ if is_found && !judgement.open.is_empty() => Degenerate,
            NoConsensus if judgement.confirms() => Converged,
            Converged if !judgement.confirms() => Unconfirmed,
            stop => stop,
        };
        self.overlap = Some(judgement.overlap);
        self.lead = judgement.lead;
        self.open = judgement.open;
        let open_m = OPEN_UNITS * f64::from(target.unit_m());
        for OpenDirection { turn_rad: [a, b, c], shift_m: [x, y, z] } in &self.open {
            let wide = Vector6::new(*a, *b, *c, *x, *y, *z) * open_m;
            self.covariance = self.covariance.map(|c| Covariance(c.0 + wide * wide.transpose()));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix6;

    use super::super::open::tests::{seen, shift};
    use super::super::tests::scenes;
    use super::*;

    #[test]
    fn a_motion_that_may_slide_is_degenerate_and_its_covariance_wide_along_the_slide() {
        let (target, source) = (seen(0.0, 500.0), seen(2.0, 500.0));
        let covariance = Some(Covariance(Matrix6::identity() * 1e-4));
        let at = |stop| Outcome { covariance, ..Outcome::nothing(&shift(0.0), stop) };
        let said = at(StopReason::Converged).judged(&target, &source);
        assert_eq!(said.stop, StopReason::Degenerate);
        let sds_m = said.covariance.map(|covariance| covariance.translation_sd_m());
        assert!(sds_m.is_some_and(|[x, y, z]| x > 4.0 && y < 1.0 && z < 1.0), "{sds_m:?}");
        // A worse reason stands.
        let few = at(StopReason::TooFewPairs).judged(&target, &source);
        assert_eq!(few.stop, StopReason::TooFewPairs);
    }

    #[test]
    fn the_right_motion_is_preferred_and_led_by_nothing() {
        let (target, source) = scenes();
        let look = |x_m: f64| target.look(&source, shift(x_m));
        let motions = [look(-3.0), look(5.0), look(2.0)];
        let best = target.preferred(&source, &motions);
        assert_eq!(best.map(|best| best.motion), Some(shift(5.0)));
        let rival = target.rival(&source, &look(5.0), &[look(5.4), look(2.0)]);
        assert_eq!(rival, None, "the same motion, and one that the scans contradict");
    }

    #[test]
    fn a_square_yard_turned_by_a_quarter_is_a_rival_as_good() {
        let (target, source) = scenes();
        // The source stands 5 m from the middle of the yard.
        let quarter = Pose::rotation([0.0, 0.0, std::f64::consts::FRAC_PI_2].into());
        let turned = quarter * shift(5.0);
        let [kept, other] = [shift(5.0), turned].map(|motion| target.look(&source, motion));
        let rival = target.rival(&source, &kept, std::slice::from_ref(&other));
        assert!(rival.is_some_and(|rival| rival.is_as_good), "{rival:?}");
        assert_eq!(rival.map(|rival| rival.target_from_source), Some(turned));
    }

    #[test]
    fn a_cloud_whose_points_hide_each_other_is_judged_by_its_surface() {
        // A map of two places 30 m apart, about an origin where no sensor stood.
        let (near, far) = (super::super::tests::yard(0.0), super::super::tests::yard(5.0));
        let moved = |cloud: &echoloop_clouds::Cloud, x_m: f32| {
            let at = |p: &nalgebra::Point3<f32>| p + nalgebra::Vector3::new(x_m, 80.0, 0.0);
            cloud.points.iter().map(at).collect::<Vec<_>>()
        };
        let map = [moved(&near, 0.0), moved(&far, 5.0), moved(&near, 45.0)].concat();
        let map = Scene::new(&echoloop_clouds::Cloud::new(map), 0.8);
        let scan = Scene::new(&far, 0.8);
        let (Ok(map), Ok(scan)) = (map, scan) else { panic!("both have points") };
        let right = Pose::translation(5.0, 80.0, 0.0);
        assert!(map.judge(&scan, &right).confirms(), "{:?}", map.judge(&scan, &right));
        let wrong = Pose::translation(8.0, 80.0, 0.0);
        assert!(!map.judge(&scan, &wrong).confirms());
    }
}
