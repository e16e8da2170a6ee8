//! CMA-ES for a COCO bridge: a child process that writes points to standard output and reads their
//! values from standard input.
//!
//! ```text
//! bridge → child   INIT n whole seed budget | lower… | upper… | start…
//! child  → bridge  x1 … xn
//! bridge → child   f, or STOP
//! ```
//!
//! The first `whole` coordinates are whole numbers. After a search stops, another one starts
//! elsewhere with twice the population (IPOP). Points stay within the bounds. With PYCMA set, the
//! constants are pycma's.

use std::error::Error;
use std::io::{BufRead, Lines, StdinLock, Write, stdin, stdout};
use std::str::FromStr;

use echoloop_cmaes::{CmaEs, CmaEsConfig, Constants, Coordinate, Stops, Strategy};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Problem, from the first line.
struct Problem {
    seed: u64,
    whole: usize,
    lower: Vec<f64>,
    upper: Vec<f64>,
    start: Vec<f64>,
}

impl Problem {
    fn parse(line: &str) -> Result<Self> {
        let parts: Vec<&str> =
            line.strip_prefix("INIT").ok_or("expected INIT")?.split('|').collect();
        let [head, lower, upper, start] = parts[..] else {
            return Err("expected four parts".into());
        };
        let head: Vec<u64> = numbers(head)?;
        let [n, whole, seed, _budget] = head[..] else {
            return Err("expected n, whole, seed, budget".into());
        };
        let (lower, upper, start) = (numbers(lower)?, numbers(upper)?, numbers(start)?);
        if [&lower, &upper, &start].iter().any(|v: &&Vec<f64>| v.len() as u64 != n) {
            return Err(format!("expected {n} bounds and coordinates").into());
        }
        Ok(Self { seed, whole: whole as usize, lower, upper, start })
    }

    /// Kind of a coordinate: the whole numbers between the bounds, or real.
    fn kind(&self, i: usize) -> Coordinate {
        let count = || (self.upper[i] - self.lower[i]) as usize + 1;
        if i < self.whole { Coordinate::Whole(count()) } else { Coordinate::Real }
    }

    /// Values at 0 and 1 of the cube; for whole numbers, the outer walls of the outermost cells.
    fn walls(&self, i: usize) -> (f64, f64) {
        let half = if i < self.whole { 0.5 } else { 0.0 };
        (self.lower[i] - half, self.upper[i] + half)
    }

    fn coordinate(&self, i: usize, x: f64) -> f64 {
        let (low, up) = self.walls(i);
        ((x - low) / (up - low)).clamp(0.0, 1.0)
    }

    fn value(&self, i: usize, u: f64) -> f64 {
        let (low, up) = self.walls(i);
        (low + u * (up - low)).clamp(self.lower[i], self.upper[i])
    }

    /// Search of a restart: the first begins at the given start, later ones at random.
    fn search(&self, restart: u64) -> Result<CmaEs> {
        let n = self.start.len();
        let seed = self.seed << 16 | restart;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mean = (0..n)
            .map(|i| if restart == 0 { self.coordinate(i, self.start[i]) } else { rng.random() })
            .collect();
        let mut config = CmaEsConfig::unit_cube(mean, 0.2, seed);
        config.constants = if std::env::var_os("PYCMA").is_some() {
            Constants::Pycma
        } else {
            Constants::Tutorial
        };
        config.lambda = Some(Strategy::default_lambda(n) << restart.min(9));
        config.coordinates = (0..n).map(|i| self.kind(i)).collect();
        config.stops = Stops { tol_x: 1e-11, ..Stops::default() };
        Ok(CmaEs::new(config)?)
    }
}

fn numbers<T: FromStr<Err: Error + 'static>>(text: &str) -> Result<Vec<T>> {
    Ok(text.split_whitespace().map(str::parse).collect::<std::result::Result<_, _>>()?)
}

/// Value of a point; `None` when the bridge stops.
fn evaluate(point: &[f64], replies: &mut Lines<StdinLock<'_>>) -> Result<Option<f64>> {
    let words: Vec<String> = point.iter().map(f64::to_string).collect();
    println!("{}", words.join(" "));
    stdout().flush()?;
    match replies.next().transpose()? {
        Some(line) if line.trim() != "STOP" => Ok(Some(line.trim().parse()?)),
        _ => Ok(None),
    }
}

/// Number of generations without progress of the best value.
struct Flatness {
    generations: u32,
    best: f64,
}

impl Flatness {
    /// True after 40 generations without progress of 1e-12: COCO's functions have no noise.
    fn holds_after(&mut self, values: &[f64]) -> bool {
        let best = values.iter().copied().fold(f64::INFINITY, f64::min);
        let moved = (best - self.best).abs() > 1e-12 * best.abs().max(1.0);
        (self.generations, self.best) =
            if moved { (0, best) } else { (self.generations + 1, self.best) };
        self.generations >= 40
    }
}

fn main() -> Result<()> {
    let mut lines = stdin().lock().lines();
    let problem = Problem::parse(&lines.next().ok_or("nothing to read")??)?;
    for restart in 0.. {
        let mut search = problem.search(restart)?;
        let mut flatness = Flatness { generations: 0, best: f64::INFINITY };
        while search.stop().is_none() {
            let mut values = Vec::with_capacity(search.strategy().lambda);
            for candidate in search.ask() {
                let point: Vec<f64> = candidate
                    .phenotype
                    .iter()
                    .enumerate()
                    .map(|(i, &u)| problem.value(i, u))
                    .collect();
                let Some(value) = evaluate(&point, &mut lines)? else { return Ok(()) };
                values.push(value);
            }
            search.tell(&values)?;
            if flatness.holds_after(&values) {
                break;
            }
        }
    }
    Ok(())
}
