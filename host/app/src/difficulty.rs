//! `echoloop difficulty`.

use std::sync::atomic::AtomicBool;

use clap::Args;
use echoloop_parameters::{Bounds, Kind};
use serde_json::json;

use super::common::{Setup, on_threads};
use super::exit::{self, Failure};
use super::interrupt::stop_on_interrupt;
use super::method_choice::MethodChoice;
use super::number::{flag, number_of, read};
use super::prepared::{connect, traced};
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::{DatasetError, Facts};
use echoloop_closed_loop::evaluation::difficulty::{
    DifficultyStep, difficulty_at, falling, is_far_below,
};
use echoloop_closed_loop::evaluation::summary::{evaluate, succeeds};
use echoloop_closed_loop::prepared::{PairSet, Preparation};
use echoloop_closed_loop::scan_folder::go_on;
use echoloop_closed_loop::search::Observer;

/// Step between the difficulties tried, and the upper bound of `data.difficulty`.
const STEP: f64 = 0.5;
const MAX_DIFFICULTY: f64 = 6.0;

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

/// Recall at a difficulty and facts about its pairs, or the reason why there are no such pairs.
type Evaluated = Result<(DifficultyStep, Facts), DatasetError>;

/// Recall that is wanted, and the difficulty that gives it.
struct Found {
    asked_pct: f64,
    difficulty: f64,
    held_out: Evaluated,
}

pub(super) fn run(args: &DifficultyArgs) -> Result<(), Failure> {
    let config = args.setup.source.load(args.method.overrides())?;
    if !config.scene.stored.is_empty() {
        let why = "scene.stored: kept pairs are of one difficulty; difficulty traces its own";
        return Err(Failure::usage(why));
    }
    let stop = stop_on_interrupt();
    on_threads(args.setup.common.threads, || find(args, &config, &stop))?
}

fn find(args: &DifficultyArgs, config: &RunConfig, stop: &AtomicBool) -> Result<(), Failure> {
    let least_pct = args.recall.iter().copied().fold(f64::INFINITY, f64::min);
    let mut steps: Vec<DifficultyStep> = Vec::new();
    while steps.len() as f64 * STEP <= MAX_DIFFICULTY && !is_far_below(&steps, least_pct) {
        go_on(stop)?;
        let difficulty = steps.len() as f64 * STEP;
        match evaluate_at(args, config, difficulty, PairSet::Train)? {
            Ok((step, _)) => steps.push(step),
            // A scene may be too small for harder pairs; the steps so far are printed.
            Err(error) if steps.is_empty() => return Err(error.into()),
            Err(_) => break,
        }
    }
    let curve = falling(&steps);
    let mut found = Vec::new();
    for &asked_pct in &args.recall {
        go_on(stop)?;
        if let Some(difficulty) = difficulty_at(&curve, asked_pct / 100.0) {
            let difficulty = (100.0 * difficulty).round() / 100.0;
            let held_out = evaluate_at(args, config, difficulty, PairSet::Test)?;
            found.push(Found { asked_pct, difficulty, held_out });
        }
    }
    print(args, &steps, &found)
}

/// Registers the pairs of a difficulty with the start settings of the configuration. Training pairs
/// are as far apart as held-out ones.
fn evaluate_at(
    args: &DifficultyArgs,
    config: &RunConfig,
    difficulty: f64,
    which: PairSet,
) -> Result<Evaluated, Failure> {
    let mut config = config.clone();
    // Only one set is used; the other has the fewest pairs allowed, one a town.
    let (data, towns) = (&mut config.data, config.scene.towns.len().max(1));
    (data.train_pairs, data.test_pairs) = match which {
        PairSet::Train => (args.pairs, towns),
        PairSet::Test => (towns, args.pairs),
    };
    (data.difficulty, data.train_baseline_factor) = (difficulty, 1.0);
    let progress = Progress::new(args.setup.common.quiet);
    let preparation = connect(config, &args.setup.sensor, &progress)?;
    let prepared = match traced(preparation, Preparation::traced, &progress) {
        Err(error @ DatasetError::Viewpoints { .. }) => return Ok(Err(error)),
        prepared => prepared?,
    };
    let pairs = prepared.pairs(which);
    progress.begin("judging", pairs.pairs.len() as u64);
    let (start, done) = (&prepared.start, || progress.evaluated());
    let errors = evaluate(&prepared.bench(), start, &pairs, &done)?;
    progress.end();
    let successes = errors.iter().filter(|error| succeeds(error, &prepared.config.data)).count();
    let step = DifficultyStep { difficulty, successes, pairs: errors.len() };
    Ok(Ok((step, Facts::new(&prepared.dataset))))
}

/// `52.5 % (37 to 67)`.
fn text(step: &DifficultyStep) -> String {
    let [low, high] = step.interval().map(|share| 100.0 * share);
    format!("{:.1} % ({low:.0} to {high:.0})", 100.0 * step.recall())
}

fn print(args: &DifficultyArgs, steps: &[DifficultyStep], found: &[Found]) -> Result<(), Failure> {
    if args.setup.common.json {
        let found = found.iter().map(|found| {
            let Found { asked_pct, difficulty, held_out } = found;
            match held_out {
                Ok((held_out, facts)) => {
                    json!({ "asked_pct": asked_pct, "held_out": held_out, "set": facts })
                }
                Err(error) => json!({
                    "asked_pct": asked_pct, "difficulty": difficulty, "error": error.to_string(),
                }),
            }
        });
        let document = json!({
            "format": 1, "steps": steps, "found": found.collect::<Vec<_>>(),
        });
        return exit::print_json(&document);
    }
    for step in steps {
        println!("difficulty {:<4} {}", step.difficulty, text(step));
    }
    for asked_pct in &args.recall {
        match found.iter().find(|found| found.asked_pct == *asked_pct) {
            Some(Found { difficulty, held_out: Ok((held_out, facts)), .. }) => println!(
                "for {asked_pct} %: --set data.difficulty={difficulty}, of {} held-out pairs {}, \
                 overlap {:.2} in the median",
                held_out.pairs,
                text(held_out),
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

    #[test]
    fn recalls_of_0_and_100_percent_are_refused() {
        for text in ["0", "100", "-3", "many"] {
            assert!(recall(text).is_err(), "{text}");
        }
        assert_eq!(recall("12.5"), Ok(12.5));
    }
}
