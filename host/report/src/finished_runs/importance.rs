//! Importance of each parameter, from the candidates of the search.
//!
//! A response surface is fitted to the candidates ([`super::surrogate`]). Importance is half of the
//! increase in the squared error of held-out candidates when the parameter's values are permuted
//! within their generation (permutation importance: Breiman, Machine Learning 45, 2001; on held-out
//! folds: Fisher, Rudin and Dominici, JMLR 20, 2019). It is a share of the variation of ln fitness
//! within generations, over the generations that moved the parameter: half, since for independent
//! parameters that is the total index of Sobol (Wei, Lu and Song, Reliab. Eng. Syst. Saf. 142,
//! 2015). Its interval is a bootstrap over generations, whose candidates share their pairs and so
//! their luck.
//!
//! It holds where the search looked: importance far from there does not show.

use std::ops::Range;

use echoloop_random::Generator;

use super::surrogate::{Kind, Sample, Surrogate, centred};
use crate::{Bar, Importance, Slice, SlicePoint};
use echoloop_closed_loop::evaluation::gain::Estimate;
use echoloop_closed_loop::parameters::{Values, choices, effective};
use echoloop_closed_loop::run_folder::journal::Generation;
use echoloop_closed_loop::run_folder::run::AxisRecord;
use echoloop_statistics::bootstrap;

/// Permutations of each parameter's values.
const PERMUTATIONS: u64 = 8;

/// Least number of generations for an interval.
const MIN_GENERATIONS: usize = 10;

/// Least number of candidates for each axis.
const MIN_AN_AXIS: usize = 5;

/// Greatest number of slices.
const MAX_SLICES: usize = 6;

/// Points of a slice's curve.
const CURVE: usize = 41;

/// Greatest number of dots of a slice.
const MAX_DOTS: usize = 150;

/// "deal" in ASCII: keeps this random stream apart from others.
const PURPOSE: u64 = 0x6465_616c;

/// Importance of the axes of a journal, with slices through the chosen values.
///
/// # Errors
///
/// A sentence, where the candidates are too few or the surface predicts nothing.
pub(crate) fn measured(
    generations: &[Generation],
    axes: &[AxisRecord],
    chosen: &Values,
) -> Result<Importance, String> {
    let samples = samples(generations, axes);
    let groups = samples.last().map_or(0, |last| last.group + 1);
    if groups < MIN_GENERATIONS || samples.len() < MIN_AN_AXIS * axes.len() {
        return Err(format!(
            "{} candidates in {groups} generations are too few to say which of {} parameters \
             matter: it takes {MIN_AN_AXIS} candidates for each and {MIN_GENERATIONS} \
             generations.",
            samples.len(),
            axes.len()
        ));
    }
    let surrogate = Surrogate::new(axes.iter().map(kind).collect(), &samples);
    let r2 = held_out_r2(&surrogate);
    if r2.interval[0] <= 0.0 || r2.interval[0].is_nan() {
        return Err(format!(
            "A response surface fitted to {} candidates predicts those that it has not seen no \
             better than their generation’s mean does (R² {:.2}, 95\u{a0}% interval {:.2} to \
             {:.2}): nothing can be said about single parameters.",
            samples.len(),
            r2.value,
            r2.interval[0],
            r2.interval[1]
        ));
    }
    let fitted = Fitted { samples: &samples, axes, surrogate };
    let bar = |axis: usize| {
        Some((axis, Bar { name: axes[axis].name.clone(), share: fitted.share(axis)? }))
    };
    let mut bars: Vec<(usize, Bar)> = (0..axes.len()).filter_map(bar).collect();
    bars.sort_by(|(_, a), (_, b)| b.share.value.total_cmp(&a.share.value));
    let significant = bars.iter().filter(|(_, bar)| bar.is_shown()).take(MAX_SLICES);
    Ok(Importance {
        verdict: verdict(samples.len(), groups, r2, axes.len() - bars.len()),
        slices: significant.map(|(axis, _)| fitted.slice(*axis, chosen)).collect(),
        bars: bars.into_iter().map(|(_, bar)| bar).collect(),
        chosen: Vec::new(),
    })
}

/// `left_out` is the number of parameters without a bar.
fn verdict(candidates: usize, generations: usize, r2: Estimate, left_out: usize) -> String {
    let [low, high] = r2.interval.map(|end| 100.0 * end);
    let left_out = match left_out {
        0 => String::new(),
        1 => " One parameter moved in too few generations to be told.".to_owned(),
        count => format!(" {count} parameters moved in too few generations to be told."),
    };
    format!(
        "A response surface of second order, fitted to all {candidates} candidates within their \
         {generations} generations, predicts {:.0}\u{a0}% (95\u{a0}% interval {low:.0} to \
         {high:.0}) of how ln fitness varies among candidates that it has not seen. Importance is \
         the parameter’s share of that variation: half of what the squared error of those \
         predictions grows by when its values are dealt anew among the candidates of a generation \
         (Breiman 2001; Wei, Lu and Song 2015), with a bootstrap over generations. Blue: more than \
         chance. It holds where the search looked, not for the whole range.{left_out}",
        100.0 * r2.value
    )
}

fn kind(axis: &AxisRecord) -> Kind {
    match choices(&axis.name).len() {
        0 => Kind::Ordered,
        names => Kind::Names(names),
    }
}

/// Candidates at their values after repair, of generations that have at least two.
fn samples(generations: &[Generation], axes: &[AxisRecord]) -> Vec<Sample> {
    let mut samples = Vec::new();
    let mut group = 0;
    for generation in generations {
        let usable = generation.candidates.iter().filter(|candidate| {
            candidate.fitness.is_finite()
                && candidate.fitness > 0.0
                && candidate.point.len() == axes.len()
        });
        let usable: Vec<_> = usable.collect();
        if usable.len() < 2 {
            continue;
        }
        samples.extend(usable.iter().map(|candidate| {
            let repaired = point(&candidate.values, axes).into_iter().zip(&candidate.point);
            let point = repaired.map(|(u, drawn)| if u.is_nan() { *drawn } else { u }).collect();
            Sample { point, response: libm::log(candidate.fitness), group }
        }));
        group += 1;
    }
    samples
}

/// Values as a point of the unit cube; NaN where there is no value.
fn point(values: &Values, axes: &[AxisRecord]) -> Vec<f64> {
    let coordinate = |axis: &AxisRecord| {
        effective(values, &axis.name).map_or(f64::NAN, |value| axis.axis().to_cube(value))
    };
    axes.iter().map(coordinate).collect()
}

/// R² of held-out candidates, with a bootstrap over generations.
fn held_out_r2(surrogate: &Surrogate) -> Estimate {
    let sums: Vec<[f64; 2]> = surrogate
        .groups
        .iter()
        .map(|group| {
            let squares = |values: &[f64]| values[group.clone()].iter().map(|v| v * v).sum::<f64>();
            let all = squares(&surrogate.responses);
            [all - squares(&surrogate.held_out), all]
        })
        .collect();
    share(&sums)
}

/// Ratio of two sums over generations.
fn share(sums: &[[f64; 2]]) -> Estimate {
    let ratio = |drawn: &[usize]| {
        let sum = |part: usize| drawn.iter().map(|&i| sums[i][part]).sum::<f64>();
        sum(0) / sum(1)
    };
    let all: Vec<usize> = (0..sums.len()).collect();
    Estimate { value: ratio(&all), interval: bootstrap(sums.len(), &ratio) }
}

struct Fitted<'a> {
    samples: &'a [Sample],
    axes: &'a [AxisRecord],
    surrogate: Surrogate,
}

impl Fitted<'_> {
    /// Indices of the generations that moved an axis.
    fn moved(&self, axis: usize) -> Vec<usize> {
        let groups = self.surrogate.groups.iter().enumerate();
        let moves = |group: &Range<usize>| {
            let values = || self.samples[group.clone()].iter().map(|sample| sample.point[axis]);
            values().any(|value| Some(value) != values().next())
        };
        groups.filter(|(_, group)| moves(group)).map(|(number, _)| number).collect()
    }

    /// Importance of an axis; `None` where too few generations moved it.
    fn share(&self, axis: usize) -> Option<Estimate> {
        let moved = self.moved(axis);
        if moved.len() < MIN_GENERATIONS {
            return None;
        }
        let sums: Vec<[f64; 2]> = moved.iter().map(|&number| self.increase(axis, number)).collect();
        Some(share(&sums))
    }

    /// Half of the increase of a generation's squared error, averaged over the permutations, and
    /// its sum of squared responses.
    fn increase(&self, axis: usize, number: usize) -> [f64; 2] {
        let group = self.surrogate.groups[number].clone();
        let own = &self.samples[group.clone()];
        let whole = 0..group.len();
        let weights = self.surrogate.weights_without(number);
        let part = |points: &[Vec<f64>]| {
            let parts: Vec<f64> =
                points.iter().map(|p| self.surrogate.basis.part(weights, axis, p)).collect();
            centred(&parts, std::slice::from_ref(&whole))
        };
        let before = part(&own.iter().map(|sample| sample.point.clone()).collect::<Vec<_>>());
        let errors = &self.surrogate.held_out[group.clone()];
        let mut increase = 0.0;
        for permutation in 0..PERMUTATIONS {
            let mut random =
                Generator::from_key([permutation, number as u64, axis as u64, PURPOSE]);
            let mut order: Vec<usize> = (0..own.len()).collect();
            (1..order.len()).rev().for_each(|i| order.swap(i, random.index(i + 1)));
            let permuted = own.iter().zip(&order).map(|(sample, &from)| {
                let mut point = sample.point.clone();
                point[axis] = own[from].point[axis];
                point
            });
            let after = part(&permuted.collect::<Vec<_>>());
            let each = errors.iter().zip(before.iter().zip(&after));
            increase += each.map(|(e, (b, a))| (e + b - a) * (e + b - a) - e * e).sum::<f64>();
        }
        let squares = self.surrogate.responses[group].iter().map(|y| y * y).sum();
        [increase / (2 * PERMUTATIONS) as f64, squares]
    }

    /// The surface along an axis, all others as chosen.
    fn slice(&self, number: usize, values: &Values) -> Slice {
        let record = &self.axes[number];
        let axis = record.axis();
        // An axis without a chosen value is held at its middle.
        let middle = |u: f64| if u.is_nan() { 0.5 } else { u };
        let chosen: Vec<f64> = point(values, self.axes).into_iter().map(middle).collect();
        let with = |u: f64| {
            let mut point = chosen.clone();
            point[number] = u;
            point
        };
        let Surrogate { basis, whole, .. } = &self.surrogate;
        let part = |point: &[f64]| basis.part(&whole.weights, number, point);
        let base = part(&chosen);
        let scatter = self.surrogate.scatter();
        let points = coordinates(axis.cells()).into_iter().map(|u| {
            let point = with(u);
            let step = part(&point) - base;
            let spread = 1.96 * whole.spread(basis, number, [&point, &chosen], scatter);
            let band = [step - spread, step + spread].map(libm::exp);
            SlicePoint { at: axis.from_cube(u), ratio: libm::exp(step), band }
        });
        let moved: Vec<usize> = self.moved(number);
        let drawn: Vec<usize> =
            moved.iter().flat_map(|&group| self.surrogate.groups[group].clone()).collect();
        let stride = drawn.len().div_ceil(MAX_DOTS).max(1);
        let dots = drawn.iter().step_by(stride).map(|&i| {
            let u = self.samples[i].point[number];
            let step = part(&with(u)) - base + self.surrogate.residuals[i];
            [axis.from_cube(u), libm::exp(step)]
        });
        Slice {
            axis: record.clone(),
            points: points.collect(),
            dots: dots.collect(),
            chosen: effective(values, &record.name).unwrap_or(f64::NAN),
        }
    }
}

/// Coordinates of a slice's curve: the middle of each cell where cells are few, else even steps.
fn coordinates(cells: Option<usize>) -> Vec<f64> {
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

    /// Generations whose ln fitness is a level of the generation, `signal` times (the squared
    /// distance of `a` from 3, and a little of `b`), and noise. `c` has no part; `d` never moves.
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
    fn bars_are_in_order_of_importance_and_those_of_idle_axes_are_not_significant() {
        let Importance { verdict, bars, slices, .. } =
            measured(&generations(40, 1.0, 0.2), &axes(), &chosen()).unwrap();
        assert!(verdict.contains("all 400 candidates within their 40 generations"), "{verdict}");
        let low = verdict.split_once("interval ").and_then(|(_, low)| low.get(..2)?.parse().ok());
        assert!(low.is_some_and(|low: u32| low > 60), "{verdict}");
        assert!(verdict.ends_with("One parameter moved in too few generations to be told."));
        let order: Vec<&str> = bars.iter().map(|bar| bar.name.as_str()).collect();
        assert_eq!(order, ["a", "b", "c"], "and no bar of d, which never moved");
        let shares: Vec<Estimate> = bars.iter().map(|bar| bar.share).collect();
        assert!(shares[0].value > 5.0 * shares[1].value && bars[1].is_shown(), "{bars:?}");
        assert!(!bars[2].is_shown() && shares[2].value.abs() < 0.02, "{bars:?}");
        let drawn: Vec<&str> = slices.iter().map(|slice| slice.axis.name.as_str()).collect();
        assert_eq!(drawn, ["a", "b"]);
    }

    #[test]
    fn a_slice_goes_through_the_chosen_point_and_its_band_holds_the_truth() {
        let slices = measured(&generations(40, 1.0, 0.2), &axes(), &chosen()).unwrap().slices;
        let Slice { points, dots, .. } = &slices[0];
        let near = |x: f64| {
            let off = |point: &&SlicePoint| (point.at - x).abs();
            points.iter().min_by(|a, b| off(a).total_cmp(&off(b))).expect("a place")
        };
        let (here, there) = (near(3.0), near(10.0));
        assert!((here.ratio - 1.0).abs() < 0.02 && here.band[1] - here.band[0] < 0.05);
        let truth = libm::exp(4.0 * 0.49);
        let [low, high] = there.band;
        assert!(low < truth && truth < high, "{truth}: {}", there.ratio);
        assert!(dots.len() > 100 && dots.len() <= MAX_DOTS);
    }

    #[test]
    fn noise_and_few_candidates_give_no_importance() {
        let noise = measured(&generations(40, 0.0, 1.0), &axes(), &chosen()).unwrap_err();
        assert!(noise.contains("nothing can be said"), "{noise}");
        let few = measured(&generations(5, 1.0, 0.1), &axes(), &chosen()).unwrap_err();
        assert!(few.contains("too few"), "{few}");
        assert!(measured(&[], &[], &chosen()).is_err());
    }
}
