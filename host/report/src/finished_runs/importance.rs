//! How much each parameter matters, from the candidates of the search themselves.
//!
//! A response surface is fitted to them ([`super::surrogate`]). A parameter's importance is half of
//! what the squared error of candidates that a fit has not seen grows by when the parameter's
//! values are dealt anew among the candidates of their generation (permutation importance: Breiman,
//! Machine Learning 45, 2001; on held-out folds: Fisher, Rudin and Dominici, JMLR 20, 2019). It is
//! a share of the variation of ln fitness within generations, of those generations that moved it:
//! half, since of independent parameters that is the total index of Sobol (Wei, Lu and Song,
//! Reliab. Eng. Syst. Saf. 142, 2015). Its interval is a bootstrap over generations, whose
//! candidates share their pairs and so their luck.
//!
//! It says what mattered where the search looked: a parameter that is important far from there does
//! not show.

use echoloop_random::Generator;

use super::surrogate::{Kind, Sample, Surrogate, centred};
use echoloop_closed_loop::parameters::{Values, choices, effective};
use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::run_folder::run::AxisRecord;
use echoloop_statistics::bootstrap;

/// Times that values are dealt anew.
const DEALS: u64 = 8;

/// Fewer generations than this have no interval worth the name.
const FEWEST_GENERATIONS: usize = 10;

/// Candidates for each axis without which nothing is fitted.
const FEWEST_AN_AXIS: usize = 5;

/// Axes that are drawn as slices at most.
const MOST_SLICES: usize = 6;

/// Points of a slice's curve.
const CURVE: usize = 41;

/// Dots of a slice at most.
const MOST_DOTS: usize = 150;

/// "deal" as a number: keeps these draws apart from those of other uses.
const PURPOSE: u64 = 0x6465_616c;

/// A share of the variation, and its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Share {
    /// The share.
    pub(super) value: f64,
    /// From, to.
    pub(super) interval: [f64; 2],
}

/// What the candidates say.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Importance {
    /// Nothing, and why.
    Silent(String),
    /// How much each axis matters.
    Told {
        /// Candidates that were looked at, and their generations.
        of: [usize; 2],
        /// Share of the variation within generations that is predicted of unseen ones.
        predicted: Share,
        /// Of each axis, by number, most important first; none of an axis that moved in too few
        /// generations.
        axes: Vec<(usize, Share)>,
        /// The most important ones through the chosen point.
        slices: Vec<Slice>,
    },
}

/// The surface along an axis, all others where the chosen point has them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Slice {
    /// The axis, by number.
    pub(super) axis: usize,
    /// Where the curve is known, in the axis's unit.
    pub(super) at: Vec<f64>,
    /// Fitness over that of the chosen point.
    pub(super) ratio: Vec<f64>,
    /// The band of 95 % around it.
    pub(super) band: [Vec<f64>; 2],
    /// Candidates, each carried along the surface to the chosen point's other values: component
    /// plus residual (Larsen and McCleary, Technometrics 14, 1972).
    pub(super) dots: Vec<[f64; 2]>,
}

impl Importance {
    /// What the generations of a journal say, around the values chosen.
    pub(super) fn of(generations: &[Generation], axes: &[AxisRecord], chosen: &Values) -> Self {
        let samples = samples(generations, axes);
        let groups = samples.last().map_or(0, |last| last.group + 1);
        if groups < FEWEST_GENERATIONS || samples.len() < FEWEST_AN_AXIS * axes.len() {
            return Self::Silent(format!(
                "{} candidates in {groups} generations are too few to say which of {} parameters \
                 matter: it takes {FEWEST_AN_AXIS} candidates for each and {FEWEST_GENERATIONS} \
                 generations.",
                samples.len(),
                axes.len()
            ));
        }
        let surrogate = Surrogate::new(axes.iter().map(kind).collect(), &samples);
        let predicted = predicted(&surrogate);
        if predicted.interval[0] <= 0.0 || predicted.interval[0].is_nan() {
            return Self::Silent(format!(
                "A response surface fitted to {} candidates predicts those that it has not seen no \
                 better than their generation’s mean does (R² {:.2}, 95\u{a0}% interval {:.2} to \
                 {:.2}): nothing can be said about single parameters.",
                samples.len(),
                predicted.value,
                predicted.interval[0],
                predicted.interval[1]
            ));
        }
        let study = Study { samples: &samples, axes, surrogate };
        let mut shares: Vec<(usize, Share)> =
            (0..axes.len()).filter_map(|axis| Some((axis, study.share(axis)?))).collect();
        shares.sort_by(|a, b| b.1.value.total_cmp(&a.1.value));
        let point = point(chosen, axes);
        let worth = shares.iter().filter(|(_, share)| share.interval[0] > 0.0);
        let slices = worth.take(MOST_SLICES).map(|(axis, _)| study.slice(*axis, &point)).collect();
        Self::Told { of: [samples.len(), groups], predicted, axes: shares, slices }
    }
}

fn kind(axis: &AxisRecord) -> Kind {
    match choices(&axis.name).len() {
        0 => Kind::Ordered,
        names => Kind::Names(names),
    }
}

/// Candidates of generations that have more than one, at the values that they had after repair.
fn samples(generations: &[Generation], axes: &[AxisRecord]) -> Vec<Sample> {
    let mut samples = Vec::new();
    let mut group = 0;
    for generation in generations {
        let known = generation.candidates.iter().filter(|candidate| {
            candidate.fitness.is_finite()
                && candidate.fitness > 0.0
                && candidate.point.len() == axes.len()
        });
        let known: Vec<_> = known.collect();
        if known.len() < 2 {
            continue;
        }
        samples.extend(known.iter().map(|candidate| {
            let own = point(&candidate.values, axes).into_iter().zip(&candidate.point);
            let point = own.map(|(own, drawn)| if own.is_nan() { *drawn } else { own }).collect();
            Sample { point, response: libm::log(candidate.fitness), group }
        }));
        group += 1;
    }
    samples
}

/// Values as a point of the cube; not a number where there is no value.
fn point(values: &Values, axes: &[AxisRecord]) -> Vec<f64> {
    let coordinate = |axis: &AxisRecord| {
        effective(values, &axis.name).map_or(f64::NAN, |value| axis.axis().to_cube(value))
    };
    axes.iter().map(coordinate).collect()
}

/// How much of unseen candidates the surface predicts: R², by generations.
fn predicted(surrogate: &Surrogate) -> Share {
    let sums: Vec<[f64; 2]> = surrogate
        .groups
        .iter()
        .map(|group| {
            let squares = |values: &[f64]| values[group.clone()].iter().map(|v| v * v).sum::<f64>();
            let all = squares(&surrogate.responses);
            [all - squares(&surrogate.unseen), all]
        })
        .collect();
    share(&sums)
}

/// The ratio of two sums over generations.
fn share(sums: &[[f64; 2]]) -> Share {
    let ratio = |drawn: &[usize]| {
        let sum = |part: usize| drawn.iter().map(|&i| sums[i][part]).sum::<f64>();
        sum(0) / sum(1)
    };
    let all: Vec<usize> = (0..sums.len()).collect();
    Share { value: ratio(&all), interval: bootstrap(sums.len(), &ratio) }
}

struct Study<'a> {
    samples: &'a [Sample],
    axes: &'a [AxisRecord],
    surrogate: Surrogate,
}

impl Study<'_> {
    /// The generations that moved an axis, by number.
    fn moved(&self, axis: usize) -> Vec<usize> {
        let groups = self.surrogate.groups.iter().enumerate();
        let moves = |group: &std::ops::Range<usize>| {
            let values = || self.samples[group.clone()].iter().map(|sample| sample.point[axis]);
            values().any(|value| Some(value) != values().next())
        };
        groups.filter(|(_, group)| moves(group)).map(|(number, _)| number).collect()
    }

    /// What unseen predictions lose without an axis; none where too few generations moved it.
    fn share(&self, axis: usize) -> Option<Share> {
        let moved = self.moved(axis);
        if moved.len() < FEWEST_GENERATIONS {
            return None;
        }
        let sums: Vec<[f64; 2]> = moved.iter().map(|&number| self.loss(axis, number)).collect();
        Some(share(&sums))
    }

    /// Of a generation: half of what the squared error of its prediction grows by, in the mean of
    /// all deals, and its sum of squares.
    fn loss(&self, axis: usize, number: usize) -> [f64; 2] {
        let group = self.surrogate.groups[number].clone();
        let own = &self.samples[group.clone()];
        let whole = 0..group.len();
        let weights = self.surrogate.blind_to(number);
        let part = |points: &[Vec<f64>]| {
            let parts: Vec<f64> =
                points.iter().map(|p| self.surrogate.basis.part(weights, axis, p)).collect();
            centred(&parts, std::slice::from_ref(&whole))
        };
        let before = part(&own.iter().map(|sample| sample.point.clone()).collect::<Vec<_>>());
        let errors = &self.surrogate.unseen[group.clone()];
        let mut grown = 0.0;
        for deal in 0..DEALS {
            let mut random = Generator::from_key([deal, number as u64, axis as u64, PURPOSE]);
            let mut order: Vec<usize> = (0..own.len()).collect();
            (1..order.len()).rev().for_each(|i| order.swap(i, random.index(i + 1)));
            let dealt = own.iter().zip(&order).map(|(sample, &from)| {
                let mut point = sample.point.clone();
                point[axis] = own[from].point[axis];
                point
            });
            let after = part(&dealt.collect::<Vec<_>>());
            let each = errors.iter().zip(before.iter().zip(&after));
            grown += each.map(|(e, (b, a))| (e + b - a) * (e + b - a) - e * e).sum::<f64>();
        }
        let squares = self.surrogate.responses[group].iter().map(|y| y * y).sum();
        [grown / (2 * DEALS) as f64, squares]
    }

    fn slice(&self, number: usize, chosen: &[f64]) -> Slice {
        let axis = self.axes[number].axis();
        // What no value was chosen for stands where the curve's middle does.
        let chosen: Vec<f64> = chosen.iter().map(|u| if u.is_nan() { 0.5 } else { *u }).collect();
        let with = |u: f64| {
            let mut point = chosen.clone();
            point[number] = u;
            point
        };
        let Surrogate { basis, whole, .. } = &self.surrogate;
        let part = |point: &[f64]| basis.part(&whole.weights, number, point);
        let base = part(&chosen);
        let (mut at, mut ratio, mut low, mut high) = (vec![], vec![], vec![], vec![]);
        let scatter = self.surrogate.scatter();
        for u in places(axis.cells()) {
            let point = with(u);
            let step = part(&point) - base;
            let spread = 1.96 * whole.spread(basis, number, [&point, &chosen], scatter);
            at.push(axis.from_cube(u));
            ratio.push(libm::exp(step));
            low.push(libm::exp(step - spread));
            high.push(libm::exp(step + spread));
        }
        let moved: Vec<usize> = self.moved(number);
        let shown: Vec<usize> =
            moved.iter().flat_map(|&group| self.surrogate.groups[group].clone()).collect();
        let every = shown.len().div_ceil(MOST_DOTS).max(1);
        let dots = shown.iter().step_by(every).map(|&i| {
            let u = self.samples[i].point[number];
            let step = part(&with(u)) - base + self.surrogate.residuals[i];
            [axis.from_cube(u), libm::exp(step)]
        });
        Slice { axis: number, at, ratio, band: [low, high], dots: dots.collect() }
    }
}

/// Coordinates along an axis: of one with few values the middle of each.
fn places(cells: Option<usize>) -> Vec<f64> {
    match cells {
        Some(count) if count <= CURVE => {
            (0..count).map(|i| (i as f64 + 0.5) / count as f64).collect()
        }
        _ => (0..CURVE).map(|i| i as f64 / (CURVE - 1) as f64).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_closed_loop::parameters::Scale;
    use echoloop_closed_loop::run_folder::journal::CandidateRecord;

    fn axes() -> Vec<AxisRecord> {
        ["a", "b", "c", "d"]
            .map(|name| AxisRecord {
                name: name.into(),
                unit: "m".into(),
                scale: Scale::Linear,
                min: 0.0,
                max: 10.0,
            })
            .to_vec()
    }

    /// Generations whose ln fitness is a level, so much of the square of `a` from 3, a little of
    /// `b`, nothing of `c` and `d`, and noise; `d` never moves.
    fn generations(count: u32, signal: f64, noise: f64) -> Vec<Generation> {
        let mut random = Generator::new(21, 0);
        let mut generation = |number: u32| {
            let level = 2.0 * random.normals(1)[0];
            let candidates = (0..10).map(|_| {
                let mut point: Vec<f64> = (0..3).map(|_| random.unit()).collect();
                point.push(0.5);
                let names = axes().into_iter().zip(&point);
                let values = names.map(|(axis, u)| (axis.name.clone(), axis.axis().from_cube(*u)));
                let far = point[0] - 0.3;
                let error = signal * (4.0 * far * far + 0.5 * point[1]);
                CandidateRecord {
                    values: values.collect(),
                    repaired: Vec::new(),
                    settings: 0,
                    errors: Vec::new(),
                    fitness: libm::exp(level + error + noise * random.normals(1)[0]),
                    cost: None,
                    point,
                }
            });
            Generation {
                generation: number,
                stage: "joint".into(),
                pairs: vec![0],
                candidates: candidates.collect(),
                mean: vec![0.5; 4],
                deviations: vec![0.2; 4],
                sigma: 0.2,
            }
        };
        (0..count).map(&mut generation).collect()
    }

    fn chosen() -> Values {
        [("a", 3.0), ("b", 1.0), ("c", 5.0), ("d", 5.0)]
            .map(|(name, value)| (name.to_owned(), value))
            .into()
    }

    #[test]
    fn what_matters_is_told_in_order_and_what_does_not_cannot_be_told_from_nothing() {
        let told = Importance::of(&generations(40, 1.0, 0.2), &axes(), &chosen());
        let Importance::Told { of, predicted, axes, slices } = told else { panic!("{told:?}") };
        assert_eq!(of, [400, 40]);
        assert!(predicted.interval[0] > 0.6, "{predicted:?}");
        let order: Vec<usize> = axes.iter().map(|(axis, _)| *axis).collect();
        assert_eq!(order, [0, 1, 2], "and nothing of d, which never moved");
        assert!(axes[0].1.value > 5.0 * axes[1].1.value && axes[1].1.interval[0] > 0.0, "{axes:?}");
        assert!(axes[2].1.interval[0] <= 0.0 && axes[2].1.value.abs() < 0.02, "{axes:?}");
        let drawn: Vec<usize> = slices.iter().map(|slice| slice.axis).collect();
        assert_eq!(drawn, [0, 1]);
    }

    #[test]
    fn a_slice_goes_through_the_chosen_point_and_shows_where_better_is() {
        let told = Importance::of(&generations(40, 1.0, 0.2), &axes(), &chosen());
        let Importance::Told { slices, .. } = told else { panic!("{told:?}") };
        let Slice { at, ratio, band, dots, .. } = &slices[0];
        let near =
            |x: f64| (0..at.len()).min_by(|&i, &j| (at[i] - x).abs().total_cmp(&(at[j] - x).abs()));
        let (here, there) = (near(3.0).expect("a place"), near(10.0).expect("a place"));
        assert!((ratio[here] - 1.0).abs() < 0.02 && band[1][here] - band[0][here] < 0.05);
        let truth = libm::exp(4.0 * 0.49);
        assert!(band[0][there] < truth && truth < band[1][there], "{truth}: {}", ratio[there]);
        assert!(dots.len() > 100 && dots.len() <= MOST_DOTS);
    }

    #[test]
    fn from_noise_and_from_few_nothing_is_said() {
        let noise = Importance::of(&generations(40, 0.0, 1.0), &axes(), &chosen());
        assert!(matches!(&noise, Importance::Silent(why) if why.contains("nothing can be said")));
        let few = Importance::of(&generations(5, 1.0, 0.1), &axes(), &chosen());
        assert!(matches!(&few, Importance::Silent(why) if why.contains("too few")), "{few:?}");
        assert!(matches!(Importance::of(&[], &[], &chosen()), Importance::Silent(_)));
    }
}
