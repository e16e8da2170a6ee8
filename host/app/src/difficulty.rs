//! `echoloop difficulty`.

use std::sync::atomic::AtomicBool;

use clap::Args;
use echoloop_parameters::{Bounds, Kind};
use serde_json::json;

use super::atomic_folder::go_on;
use super::common::{Setup, on_threads};
use super::exit::{self, Failure};
use super::interrupt::stop_on_interrupt;
use super::method_choice::MethodChoice;
use super::number::{flag, number_of, read};
use super::prepared::{Met, PairSet};
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::{DatasetError, Facts};
use echoloop_closed_loop::evaluation::summary::{evaluate, succeeds};
use echoloop_closed_loop::search::Observer;
use echoloop_statistics::wilson;

/// Difficulties tried, in steps of so much, up to the most that the key takes.
const STEP: f64 = 0.5;
const MOST: f64 = 6.0;

/// Flags of `difficulty`.
#[derive(Clone, Debug, Args)]
pub(crate) struct DifficultyArgs {
    #[command(flatten)]
    setup: Setup,
    #[command(flatten)]
    method: MethodChoice,
    /// Recalls wanted, percent.
    #[arg(
        long, value_name = "PERCENT", value_delimiter = ',', default_value = "90,50,20",
        value_parser = recall
    )]
    recall: Vec<f64>,
    /// Pairs that each difficulty is judged on, and as many others in the end.
    #[arg(
        long, value_name = "N", default_value_t = 100,
        value_parser = number_of::<usize>("data.test_pairs")
    )]
    pairs: usize,
}

fn recall(text: &str) -> Result<f64, String> {
    read(&flag(Kind::Number, Bounds::between(1.0, 99.0)), text)
}

/// How many of the pairs of a difficulty are registered.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    difficulty: f64,
    successes: usize,
    pairs: usize,
}

/// A difficulty that was judged, and what its pairs are like; or that its pairs fit nowhere.
type Judged = Result<(Step, Facts), DatasetError>;

/// What was asked for, and what was found.
struct Found {
    asked_pct: f64,
    difficulty: f64,
    held_out: Judged,
}

pub(super) fn run(args: &DifficultyArgs) -> Result<(), Failure> {
    let config = args.setup.source.load(args.method.overrides())?;
    if !config.scene.stored.is_empty() {
        let said = "scene.stored: kept pairs are of one difficulty; difficulty traces its own";
        return Err(Failure::usage(said));
    }
    let stop = stop_on_interrupt();
    on_threads(args.setup.common.threads, || find(args, &config, &stop))?
}

fn find(args: &DifficultyArgs, config: &RunConfig, stop: &AtomicBool) -> Result<(), Failure> {
    let least_pct = args.recall.iter().copied().fold(f64::INFINITY, f64::min);
    let mut steps: Vec<Step> = Vec::new();
    while steps.len() as f64 * STEP <= MOST && !is_far_below(&steps, least_pct) {
        go_on(stop)?;
        let difficulty = steps.len() as f64 * STEP;
        match judged(args, config, difficulty, PairSet::Train)? {
            Ok((step, _)) => steps.push(step),
            // A place may be too small for what is asked; what it bears is told.
            Err(error) if steps.is_empty() => return Err(error.into()),
            Err(_) => break,
        }
    }
    let curve = falling(&steps);
    let mut found = Vec::new();
    for &asked_pct in &args.recall {
        go_on(stop)?;
        if let Some(difficulty) = where_it_is(&curve, asked_pct / 100.0) {
            let difficulty = (100.0 * difficulty).round() / 100.0;
            let held_out = judged(args, config, difficulty, PairSet::Test)?;
            found.push(Found { asked_pct, difficulty, held_out });
        }
    }
    print(args, &steps, &found)
}

/// Registers the pairs of a difficulty with the settings that the configuration starts with. Pairs
/// to tune on are as far apart as those to judge on.
fn judged(
    args: &DifficultyArgs,
    config: &RunConfig,
    difficulty: f64,
    which: PairSet,
) -> Result<Judged, Failure> {
    let mut config = config.clone();
    // One set is judged: of the other a town has no more than it must.
    let (data, towns) = (&mut config.data, config.scene.towns.len().max(1));
    (data.train_pairs, data.test_pairs) = match which {
        PairSet::Train => (args.pairs, towns),
        PairSet::Test => (towns, args.pairs),
    };
    (data.difficulty, data.train_baseline_factor) = (difficulty, 1.0);
    let progress = Progress::new(args.setup.common.quiet);
    let met = Met::new(config, &args.setup.sensor, &progress)?;
    let prepared = match met.traced(&progress) {
        Err(error @ DatasetError::Viewpoints { .. }) => return Ok(Err(error)),
        prepared => prepared?,
    };
    let noisy = prepared.pairs(which);
    progress.begin("judging", noisy.pairs.len() as u64);
    let (start, done) = (&prepared.start, || progress.evaluated());
    let errors = evaluate(&prepared.bench(), start, &noisy, &done)?;
    progress.end();
    let successes = errors.iter().filter(|error| succeeds(error, &prepared.config.data)).count();
    let step = Step { difficulty, successes, pairs: errors.len() };
    Ok(Ok((step, Facts::new(&prepared.dataset))))
}

/// Whether the last two steps are below what is asked for: farther on it only falls.
fn is_far_below(steps: &[Step], least_pct: f64) -> bool {
    let below = |step: &&Step| step.recall() * 100.0 < least_pct;
    steps.iter().rev().take(2).filter(below).count() == 2
}

impl Step {
    fn recall(&self) -> f64 {
        self.successes as f64 / self.pairs.max(1) as f64
    }

    /// `52.5 % (37 to 67)`.
    fn text(&self) -> String {
        let [low, high] = wilson(self.recall(), self.pairs as f64).map(|share| 100.0 * share);
        format!("{:.1} % ({low:.0} to {high:.0})", 100.0 * self.recall())
    }
}

/// The recalls as they fall: steps that rise are pooled with those before (Ayer et al., Ann. Math.
/// Stat. 26, 1955).
fn falling(steps: &[Step]) -> Vec<[f64; 2]> {
    let mut pools: Vec<(Vec<f64>, usize, usize)> = Vec::new();
    for step in steps {
        pools.push((vec![step.difficulty], step.successes, step.pairs));
        while let [.., (_, a, of_a), (_, b, of_b)] = &pools[..] {
            if a * of_b >= b * of_a {
                break;
            }
            let Some((more, successes, pairs)) = pools.pop() else { break };
            let Some(last) = pools.last_mut() else { break };
            last.0.extend(more);
            (last.1, last.2) = (last.1 + successes, last.2 + pairs);
        }
    }
    let told = |(difficulties, successes, pairs): &(Vec<f64>, usize, usize)| {
        let recall = *successes as f64 / (*pairs).max(1) as f64;
        difficulties.iter().map(|&difficulty| [difficulty, recall]).collect::<Vec<_>>()
    };
    pools.iter().flat_map(told).collect()
}

/// Where a falling curve has a value; none where it begins below or ends above.
fn where_it_is(curve: &[[f64; 2]], recall: f64) -> Option<f64> {
    let crossed = |pair: &&[[f64; 2]]| pair[0][1] >= recall && pair[1][1] < recall;
    let pair = curve.windows(2).find(crossed)?;
    let [[from, high], [to, low]] = [pair[0], pair[1]];
    Some(from + (to - from) * (high - recall) / (high - low))
}

fn print(args: &DifficultyArgs, steps: &[Step], found: &[Found]) -> Result<(), Failure> {
    if args.setup.common.json {
        let step = |step: &Step| {
            let Step { difficulty, successes, pairs } = step;
            json!({ "difficulty": difficulty, "successes": successes, "pairs": pairs })
        };
        let found = found.iter().map(|found| {
            let Found { asked_pct, difficulty, held_out } = found;
            match held_out {
                Ok((held_out, facts)) => {
                    json!({ "asked_pct": asked_pct, "held_out": step(held_out), "set": facts })
                }
                Err(error) => json!({
                    "asked_pct": asked_pct, "difficulty": difficulty, "error": error.to_string(),
                }),
            }
        });
        let steps: Vec<_> = steps.iter().map(step).collect();
        let document = json!({
            "format": 1, "steps": steps, "found": found.collect::<Vec<_>>(),
        });
        exit::print(&exit::json(&document)?)?;
        return Ok(());
    }
    for step in steps {
        println!("difficulty {:<4} {}", step.difficulty, step.text());
    }
    for asked_pct in &args.recall {
        match found.iter().find(|found| found.asked_pct == *asked_pct) {
            Some(Found { difficulty, held_out: Ok((held_out, facts)), .. }) => println!(
                "for {asked_pct} %: --set data.difficulty={difficulty}, of {} held-out pairs {}, \
                 overlap {:.2} in the median",
                held_out.pairs,
                held_out.text(),
                facts.test.overlap[2]
            ),
            Some(Found { difficulty, held_out: Err(error), .. }) => {
                println!("for {asked_pct} %: data.difficulty={difficulty}, not held out: {error}");
            }
            None if steps.first().is_some_and(|step| 100.0 * step.recall() < *asked_pct) => {
                println!("for {asked_pct} %: none; fewer are found without any difficulty");
            }
            None => println!("for {asked_pct} %: none; no difficulty that fits the place does"),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(successes: &[usize]) -> Vec<Step> {
        let step = |(i, &successes): (usize, &usize)| Step {
            difficulty: i as f64 * STEP,
            successes,
            pairs: 10,
        };
        successes.iter().enumerate().map(step).collect()
    }

    #[test]
    fn a_recall_lies_where_the_falling_curve_has_it() {
        let curve = falling(&steps(&[10, 10, 8, 4, 0]));
        let at = |recall| where_it_is(&curve, recall);
        assert_eq!((at(0.9), at(0.6), at(0.2)), (Some(0.75), Some(1.25), Some(1.75)));
        assert_eq!(where_it_is(&falling(&steps(&[10, 10])), 0.5), None);
        assert_eq!(where_it_is(&falling(&steps(&[3, 1])), 0.5), None);
        assert_eq!(where_it_is(&[], 0.5), None);
    }

    #[test]
    fn a_step_that_rises_is_one_with_those_before() {
        let curve = falling(&steps(&[10, 6, 8, 9, 1]));
        let recalls: Vec<f64> = curve.iter().map(|point| point[1]).collect();
        let pooled = 23.0 / 30.0;
        assert_eq!(recalls, [1.0, pooled, pooled, pooled, 0.1]);
    }

    #[test]
    fn two_steps_below_what_is_asked_for_are_enough() {
        let is_far_below = |successes: &[usize]| is_far_below(&steps(successes), 20.0);
        assert!(!is_far_below(&[10, 1]) && !is_far_below(&[10, 1, 2, 1]) && !is_far_below(&[]));
        assert!(is_far_below(&[10, 1, 1]));
    }

    #[test]
    fn recalls_that_all_or_none_reach_are_refused() {
        for text in ["0", "100", "-3", "many"] {
            assert!(recall(text).is_err(), "{text}");
        }
        assert_eq!(recall("12.5"), Ok(12.5));
    }
}
