//! Judgement of a motion by two scans.

use std::cell::LazyCell;

use echoloop_clouds::pose::translation_error_m;
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

/// The same where more points than this do: of so many, two stray ones dispute as much as the bound
/// of fewer.
const MANY_ON: usize = 5_000;
const MANY_DISPUTED: f64 = 2.0;

/// A lead at which a first look is enough.
const CLEAR_LEAD: Lead = Lead { disputed: 2.0, explained: 6.0 };

/// A rival fits the scans if its share of support is this, …
const RIVAL_SUPPORTED: f64 = 0.98;

/// … and, if the scans confirm it, is as good when the motion leads it by less, …
const RIVAL_LEAD: Lead = Lead { disputed: 2.0, explained: 2.0 };

/// … or if it is turned, rad, …
const TURNED_RAD: f64 = 0.5;

/// … and both scans know this share of all points: in a square room, where they see all that there
/// is, small errors of the sensor decide.
const RIVAL_KNOWN: f64 = 0.93;

/// Least share of support of a motion beyond doubt. Of the right ones of hard pairs 96 % have it; a
/// street laid on the next one, or turned by 90 degrees, has 97 % and may lead by 9.
const CERTAIN_SUPPORTED: f64 = 0.985;

/// Least share of support of a motion that may be preferred to another.
const PLAUSIBLE_SUPPORTED: f64 = 0.95;

/// Standard deviation of the motion along an open direction, over the unit.
const OPEN_UNITS: f64 = 5.0;

/// Two motions are others if they differ by more than this: a shift over the unit, …
const OTHER_UNITS: f64 = 1.0;

/// … or a turn, rad.
const OTHER_RAD: f64 = 0.15;

/// Judgement of a motion by two scans.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// The points of each on the other.
    pub overlap: Overlap,
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

/// A motion slid both ways along a direction, by each of [`SLIDES`].
type Slides = [[Pose; 2]; SLIDES.len()];

/// A motion, and the answers of both scans to a first look.
#[derive(Clone, Debug)]
pub(crate) struct Looked {
    pub(crate) motion: Pose,
    answers: Answers,
}

impl Looked {
    /// True when some of the points lie on the other scan at the motion.
    pub(crate) fn touches(&self) -> bool {
        self.answers.overlap().on >= Overlap::LEAST_ON
    }

    /// True when the scans agree with the motion.
    pub(crate) fn agrees(&self) -> bool {
        self.answers.overlap().agrees()
    }

    /// Motions, those that the scans agree with first.
    pub(crate) fn agreeing_first(mut motions: Vec<Self>) -> Vec<Self> {
        motions.sort_by_key(|looked| !looked.agrees());
        motions
    }
}

impl Judgement {
    /// Judgement by an overlap and, if that agrees, by the leads along the weakest directions.
    fn new(overlap: Overlap, held: impl FnOnce() -> Vec<(Direction, Lead)>) -> Self {
        let held = if overlap.agrees() { held() } else { Vec::new() };
        let least_disputed = least(&overlap).disputed;
        let is_open = |(direction, held): &&(Direction, Lead)| {
            direction.share < WEAK && held.disputed < least_disputed
        };
        let open = held.iter().filter(is_open).map(|(direction, _)| direction.about_origin());
        let open = open.collect();
        let held = held.into_iter().map(|(_, held)| held).reduce(Lead::min);
        Self { overlap, open, held }
    }

    /// Lead of the motion over the same slid by 1 or 2 units, in standard deviations of chance,
    /// along that of the weakest directions where it is least. None if the overlap does not agree,
    /// or too few points have partners to tell.
    pub fn lead(&self) -> Option<f64> {
        self.held.map(|held| held.explained)
    }

    /// True when the scans confirm the motion: they agree with it, and with nothing beside it.
    pub fn confirms(&self) -> bool {
        self.held.is_some_and(|held| held.is_over(least(&self.overlap)))
    }

    /// True when no other candidates need be looked for: the lead is wide, and hardly a point is
    /// contradicted.
    pub(crate) fn is_beyond_doubt(&self) -> bool {
        self.is_clear() && self.overlap.supported() >= CERTAIN_SUPPORTED
    }

    fn is_clear(&self) -> bool {
        self.held.is_some_and(|held| held.is_over(CLEAR_LEAD))
    }
}

/// Least lead of a motion over those that it slides to.
fn least(overlap: &Overlap) -> Lead {
    match overlap.on {
        ..FEW_ON => Lead { disputed: FEW_DISPUTED, ..LEAST_LEAD },
        FEW_ON..MANY_ON => LEAST_LEAD,
        MANY_ON.. => Lead { disputed: MANY_DISPUTED, ..LEAST_LEAD },
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
    /// Judgement of a motion by this scan, the target, and a source.
    pub fn judge(&self, source: &Self, target_from_source: &Pose) -> Judgement {
        self.judge_further(source, &self.look(source, *target_from_source))
    }

    /// The same after a first look.
    pub(crate) fn judge_further(&self, source: &Self, looked: &Looked) -> Judgement {
        let Looked { motion, answers } = looked;
        let weakest = LazyCell::new(|| self.weakest_slides(source, motion));
        let judged = |answers: &Answers, most: usize| {
            let held = |(direction, slides): &(Direction, Slides)| {
                (*direction, self.held(source, answers, slides, most))
            };
            Judgement::new(answers.overlap(), || weakest.iter().map(held).collect())
        };
        let first = judged(answers, FIRST_LOOK);
        let is_all = self.probes.len().max(source.probes.len()) <= FIRST_LOOK;
        match is_all || first.is_clear() {
            true => first,
            false => judged(&self.answers(source, motion, usize::MAX), usize::MAX),
        }
    }

    /// A motion slid along each of the weakest directions.
    fn weakest_slides(&self, source: &Self, motion: &Pose) -> Vec<(Direction, Slides)> {
        let slid = |direction: Direction| {
            let by = |units: f64| {
                direction.fitted(self, source, motion, units * f64::from(self.unit_m()))
            };
            (direction, SLIDES.map(|units| [by(units), by(-units)]))
        };
        self.weakest_directions(source, motion).into_iter().map(slid).collect()
    }

    /// Lead of a motion over the same slid either way along a direction, at the displacement where
    /// that is larger.
    fn held(&self, source: &Self, here: &Answers, slides: &Slides, most: usize) -> Lead {
        let over = |slid: &Pose| self.lead(source, here, &self.answers(source, slid, most));
        let mut held: Option<Lead> = None;
        for [forth, back] in slides {
            let either = over(forth).min(over(back));
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
            let is_better = lead.disputed > RIVAL_LEAD.disputed;
            let is_plausible = other.answers.overlap().supported() >= PLAUSIBLE_SUPPORTED;
            if is_plausible && is_better { other } else { best }
        })
    }

    /// Of other motions that fit the scans, the one that the motion leads least.
    pub(crate) fn rival(&self, source: &Self, of: &Looked, others: &[Looked]) -> Option<Rival> {
        let rival = |other: &Looked| {
            let overlap = other.answers.overlap();
            if !overlap.agrees() || overlap.supported() < RIVAL_SUPPORTED {
                return None;
            }
            let Lead { disputed, explained: lead } = self.lead(source, &of.answers, &other.answers);
            let turned = of.motion.rotation.angle_to(&other.motion.rotation) > TURNED_RAD;
            let is_alike = turned && overlap.known() >= RIVAL_KNOWN;
            let is_near = disputed < RIVAL_LEAD.disputed && lead < RIVAL_LEAD.explained;
            // A motion along an open direction fits anywhere, so the rival must be confirmed.
            let is_as_good = (is_alike || is_near) && self.judge_further(source, other).confirms();
            Some(Rival { target_from_source: other.motion, lead, is_as_good })
        };
        let others = others.iter().filter(|other| self.is_other(&of.motion, &other.motion));
        others
            .filter_map(rival)
            .min_by(|a, b| b.is_as_good.cmp(&a.is_as_good).then(a.lead.total_cmp(&b.lead)))
    }

    /// True when two motions are clearly different ones.
    pub(crate) fn is_other(&self, one: &Pose, other: &Pose) -> bool {
        !is_within(one, other, OTHER_UNITS * f64::from(self.unit_m()), OTHER_RAD)
    }
}

/// True when two motions differ by at most a shift, m, and a turn, rad.
pub(crate) fn is_within(one: &Pose, other: &Pose, shift_m: f64, turn_rad: f64) -> bool {
    translation_error_m(one, other) <= shift_m && one.rotation.angle_to(&other.rotation) <= turn_rad
}

impl Outcome {
    /// The same with what two scans judge of its motion; `unit_m` is theirs.
    ///
    /// | the method | the scans | stop |
    /// |---|---|---|
    /// | converged, no consensus | confirm | converged |
    /// | converged | do not | unconfirmed |
    /// | converged, ran out of iterations, degenerate | leave a direction open | degenerate |
    /// | anything else | | the method's |
    ///
    /// The covariance is wide along open directions.
    pub(crate) fn judged(mut self, judgement: Judgement, unit_m: f32) -> Self {
        use StopReason::{Converged, Degenerate, MaxIterations, NoConsensus, Unconfirmed};
        let is_found = matches!(self.stop, Converged | MaxIterations | Degenerate | NoConsensus);
        self.stop = match self.stop {
            _ if is_found && !judgement.open.is_empty() => Degenerate,
            NoConsensus if judgement.confirms() => Converged,
            Converged if !judgement.confirms() => Unconfirmed,
            stop => stop,
        };
        self.overlap = Some(judgement.overlap);
        self.lead = judgement.lead();
        self.open = judgement.open;
        let open_m = OPEN_UNITS * f64::from(unit_m);
        for OpenDirection { turn_rad: [a, b, c], shift_m: [x, y, z] } in &self.open {
            let wide = Vector6::new(*a, *b, *c, *x, *y, *z) * open_m;
            self.covariance = self.covariance.map(|c| Covariance(c.0 + wide * wide.transpose()));
        }
        self
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use echoloop_clouds::Cloud;
    use nalgebra::{Matrix6, Point3};

    use super::super::open::tests::{seen, shift};
    use super::super::tests::{scenes, yard};
    use super::*;

    #[test]
    fn a_motion_that_may_slide_is_degenerate_and_its_covariance_wide_along_the_slide() {
        let (target, source) = (seen(0.0, 500.0), seen(2.0, 500.0));
        let covariance = Some(Covariance(Matrix6::identity() * 1e-4));
        let at = |stop| Outcome { covariance, ..Outcome::nothing(&shift(0.0), stop) };
        let judged = |outcome: Outcome| {
            let judgement = target.judge(&source, &outcome.target_from_source);
            outcome.judged(judgement, target.unit_m())
        };
        let said = judged(at(StopReason::Converged));
        assert_eq!(said.stop, StopReason::Degenerate);
        let sds_m = said.covariance.map(|covariance| covariance.translation_sd_m());
        assert!(sds_m.is_some_and(|[x, y, z]| x > 4.0 && y < 1.0 && z < 1.0), "{sds_m:?}");
        // A worse reason stands.
        let few = judged(at(StopReason::TooFewPairs));
        assert_eq!(few.stop, StopReason::TooFewPairs);
    }

    #[test]
    fn a_motion_is_confirmed_from_each_bound_of_its_lead_on() {
        let (target, source) = scenes();
        let directions = target.weakest_directions(&source, &shift(5.0));
        let judged = |on: usize, disputed: f64, explained: f64| {
            let overlap = Overlap { on, covered: 0.5, ..Overlap::default() };
            let held = || vec![(directions[0], Lead { disputed, explained })];
            Judgement::new(overlap, held).confirms()
        };
        assert!(judged(1_500, 1.0, 3.5) && judged(1_499, 0.7, 3.5));
        assert!(judged(4_999, 1.0, 3.5) && judged(5_000, 2.0, 3.5) && !judged(5_000, 1.9, 3.5));
        assert!(!judged(1_500, 1.0, 3.4) && !judged(1_499, 0.7, 3.4));
        assert!(!judged(1_500, 0.9, 3.5) && !judged(1_499, 0.6, 3.5));
        let none = Overlap { on: 1_500, covered: 0.5, ..Overlap::default() };
        assert!(!Judgement::new(none, Vec::new).confirms(), "nothing tells what is beside it");
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
    fn two_maps_are_judged_by_what_lies_on_what() {
        // A yard from three places in it, about an origin outside of it.
        let map = |y_m: f32| {
            let seen = |x_m: f32| {
                let points = yard(x_m).points.into_iter();
                points.map(move |p| Point3::new(p.x + x_m, p.y + y_m, p.z))
            };
            Scene::new(&Cloud::new([-9.0, 0.0, 9.0].into_iter().flat_map(seen).collect()), 0.8)
        };
        let (target, source) = (map(60.0).unwrap(), map(80.0).unwrap());
        assert!(!target.sight.is_scan() && !source.sight.is_scan());
        let at = |x_m: f64| target.judge(&source, &Pose::translation(x_m, -20.0, 0.0));
        assert!(at(0.0).confirms() && !at(3.0).confirms(), "{:?} {:?}", at(0.0), at(3.0));
    }

    #[test]
    fn of_motions_that_the_scans_hardly_tell_apart_the_first_is_kept() {
        let (target, source) = scenes();
        let both = [5.0, 5.05].map(|x_m| target.look(&source, shift(x_m)));
        let turned = [both[1].clone(), both[0].clone()];
        for motions in [both, turned] {
            let kept = target.preferred(&source, &motions).map(|kept| kept.motion);
            assert_eq!(kept, Some(motions[0].motion));
        }
    }

    #[test]
    fn motions_that_the_scans_agree_with_come_first_in_their_order() {
        let (target, source) = scenes();
        let looked = [-3.0, 5.0, 4.0, 5.01].map(|x_m| target.look(&source, shift(x_m)));
        let first = Looked::agreeing_first(looked.into());
        let first: Vec<f64> = first.iter().map(|looked| looked.motion.translation.x).collect();
        assert_eq!(first, [5.0, 5.01, -3.0, 4.0]);
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
        // A decimetre off, as errors of a sensor are, it is led, and yet as good where both scans
        // know nearly all that there is.
        for (z_m, is_as_good) in [(0.05, true), (0.08, false)] {
            let off = target.look(&source, Pose::translation(0.12, -0.12, z_m) * turned);
            assert!(target.lead(&source, &kept.answers, &off.answers).disputed > 2.0);
            let rival = target.rival(&source, &kept, &[off]);
            assert_eq!(rival.map(|rival| rival.is_as_good), Some(is_as_good), "{z_m} m");
        }
    }

    #[test]
    fn a_motion_is_slid_both_ways_by_one_and_two_metres() {
        let (target, source) = (seen(0.0, 500.0), seen(2.0, 500.0));
        let (_, slides) = target.weakest_slides(&source, &shift(2.0))[0];
        let along_m = slides.map(|either| either.map(|slid| slid.translation.x - 2.0));
        // Which way is forth, the eigenvector's sign decides.
        let sign = along_m[0][0].signum();
        for (found, expected) in along_m.as_flattened().iter().zip([1.0, -1.0, 2.0, -2.0]) {
            assert!((found - sign * expected).abs() < 0.05, "{along_m:?}");
        }
    }

    #[test]
    fn a_wide_lead_with_points_that_contradict_is_not_beyond_doubt() {
        let judged = |on, contradicted| {
            let overlap = Overlap { on, contradicted, unknown: 1_000, covered: 0.6 };
            let held = Some(Lead { disputed: 9.0, explained: 9.0 });
            Judgement { overlap, open: Vec::new(), held }
        };
        assert!(judged(1_950, 50).confirms() && !judged(1_950, 50).is_beyond_doubt());
        assert!(judged(1_990, 10).is_beyond_doubt());
    }

    #[test]
    fn a_motion_that_may_slide_itself_is_no_rival_as_good() {
        let (target, source) = (seen(0.0, 500.0), seen(2.0, 500.0));
        let [kept, other] = [2.0, 0.0].map(|x_m| target.look(&source, shift(x_m)));
        let rival = target.rival(&source, &kept, std::slice::from_ref(&other));
        assert!(rival.is_some_and(|rival| !rival.is_as_good), "{rival:?}");
    }

    #[test]
    fn a_cloud_whose_points_hide_each_other_is_judged_by_its_surface() {
        // A map of two places 30 m apart, about an origin where no sensor stood.
        let (near, far) = (yard(0.0), yard(5.0));
        let moved = |cloud: &Cloud, x_m: f32| {
            let at = |p: &Point3<f32>| p + nalgebra::Vector3::new(x_m, 80.0, 0.0);
            cloud.points.iter().map(at).collect::<Vec<_>>()
        };
        let map = [moved(&near, 0.0), moved(&far, 5.0), moved(&near, 45.0)].concat();
        let map = Scene::new(&Cloud::new(map), 0.8);
        let scan = Scene::new(&far, 0.8);
        let (Ok(map), Ok(scan)) = (map, scan) else { panic!("both have points") };
        let right = Pose::translation(5.0, 80.0, 0.0);
        assert!(map.judge(&scan, &right).confirms(), "{:?}", map.judge(&scan, &right));
        let wrong = Pose::translation(8.0, 80.0, 0.0);
        assert!(!map.judge(&scan, &wrong).confirms());
    }
}
