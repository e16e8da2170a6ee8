//! Runs of the optimiser, one line of JSON each, for `cargo xtask peers --optimiser`, which
//! compares them with pycma and cmaes.
//!
//! ```sh
//! cargo run --release -p echoloop-benches --bin optimiser -- continuous --seeds 15
//! ```

mod continuous;
mod functions;
mod mixed;
mod small;

use std::error::Error;

use clap::{Parser, ValueEnum};
use serde_json::{Value, json};

use echoloop_cmaes::{Constants, Coordinate};

/// Table to run, and number of runs per row.
#[derive(Parser)]
struct Options {
    table: Table,
    /// Number of seeds per row.
    #[arg(long, default_value_t = 15)]
    seeds: u64,
    /// First seed.
    #[arg(long, default_value_t = 0)]
    from: u64,
}

#[derive(Clone, Copy, ValueEnum)]
enum Table {
    /// Evaluations to 1e-8 on real numbers.
    Continuous,
    /// Evaluations to 1e-10 where half of the numbers are whole, or bits.
    Mixed,
    /// Loss after 160, 320 and 480 noisy evaluations of 16 parameters of all kinds.
    Small,
}

/// Published sets of constants.
const CONSTANTS: [(&str, Constants); 2] =
    [("tutorial", Constants::Tutorial), ("pycma", Constants::Pycma)];

/// Row of a function in as many dimensions.
fn row(function: &str, n: usize, who: &str, seed: u64, evaluations: Option<usize>) -> Value {
    json!({ "function": function, "n": n, "who": who, "seed": seed, "evaluations": evaluations })
}

fn continuous(seed: u64) -> Result<Vec<Value>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for function in continuous::FUNCTIONS {
        for n in [5, 10, 20] {
            for (who, constants) in CONSTANTS {
                let evaluations = function.solve(n, seed, constants)?;
                rows.push(row(function.name, n, who, seed, evaluations));
            }
        }
    }
    Ok(rows)
}

fn mixed(seed: u64) -> Result<Vec<Value>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for function in mixed::FUNCTIONS {
        let whole = ("margin", Coordinate::Whole(function.count));
        let choice = ("names", Coordinate::Choice(function.count));
        let told = [("rounded", Coordinate::Real), whole, choice];
        let bits = function.count == 2;
        for n in [20, 40] {
            for (who, coordinate) in told.into_iter().filter(|(who, _)| bits || *who != "names") {
                let evaluations = function.solve(n, seed, coordinate)?;
                rows.push(row(function.name, n, who, seed, evaluations));
            }
        }
    }
    Ok(rows)
}

fn small(seed: u64) -> Result<Vec<Value>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for right in [0.0, 0.5, 1.0] {
        let problem = small::Problem::new(seed, right);
        for noise in [0.0, 0.3, 1.0] {
            for arm in small::ARMS {
                let losses = problem.search(arm, seed, noise)?;
                rows.push(json!({ "right": right, "noise": noise, "who": arm.name, "seed": seed,
                    "losses": losses }));
            }
        }
    }
    Ok(rows)
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    for seed in options.from..options.from + options.seeds {
        let rows = match options.table {
            Table::Continuous => continuous(seed)?,
            Table::Mixed => mixed(seed)?,
            Table::Small => small(seed)?,
        };
        rows.iter().for_each(|row| println!("{row}"));
    }
    Ok(())
}
