//! The optimiser on a function of one's own: ask, tell, stop.
//!
//! ```sh
//! cargo run --release -p echoloop-examples --example own_objective
//! ```

use std::error::Error;

use echoloop_cmaes::{CmaEs, CmaEsConfig, Stops};

/// Yours: smaller is better. Here Rosenbrock's banana in 0..1 squared, its minimum at (0.75, 0.75).
fn objective(x: &[f64]) -> f64 {
    let (a, b) = (4.0 * x[0] - 2.0, 4.0 * x[1] - 2.0);
    (1.0 - a).powi(2) + 100.0 * (b - a * a).powi(2)
}

fn main() -> Result<(), Box<dyn Error>> {
    // Scale your parameters to 0..1: the search stays inside, by reflection.
    let mut config = CmaEsConfig::unit_cube(vec![0.2, 0.8], 0.2, 1);
    config.stops = Stops { generations: Some(500), target: Some(1e-10), ..Stops::default() };
    let mut search = CmaEs::new(config)?;
    let (mut best, mut evaluations) = ((f64::INFINITY, Vec::new()), 0);
    let reason = loop {
        if let Some(reason) = search.stop() {
            break reason;
        }
        // The candidates are independent: evaluate them in parallel if that is expensive.
        let candidates = search.ask();
        let values: Vec<f64> = candidates.iter().map(|c| objective(&c.phenotype)).collect();
        for (candidate, &value) in candidates.iter().zip(&values) {
            if value < best.0 {
                best = (value, candidate.phenotype.clone());
            }
        }
        evaluations += values.len();
        search.tell(&values)?;
    };
    println!("{:.1e} at {:.5?} after {evaluations} evaluations: {reason:?}", best.0, best.1);
    Ok(())
}
