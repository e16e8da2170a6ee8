//! Consistency of the covariance of a motion with its error.
//!
//! usage: covariance FOLDER..., each of `echoloop pairs`; registers every pair by ICP and GICP from
//! the identity, with the defaults, with the settings that `register` chooses, and with the
//! defaults without a kernel. Prints the number of pairs within 0.5 m and 2.5°, and for these the
//! ratio of the squared error to its expectation, `ξᵀ C⁻¹ ξ / 6`: mean, median, largest, and the
//! share within the ellipsoid of 95 %.

use std::path::Path;

use echoloop_benches::pairs::{Pair, read_pairs};
use echoloop_clouds::pose::{Pose, rotation_error_deg, translation_error_m};
use echoloop_registration::{FgrMode, Method, MethodConfig, Suggestions, build};
use rayon::prelude::*;

/// 95 % quantile of χ² with six degrees of freedom.
const CHI_SQUARED_6_95: f64 = 12.592;

/// Source of the settings.
#[derive(Clone, Copy, Debug)]
enum From {
    Defaults,
    Chosen,
    NoKernel,
}

fn config(method: Method, from: From, pair: &Pair) -> MethodConfig {
    let mut config = match from {
        From::Chosen => {
            Suggestions::new(&pair.target, &pair.source).method(method, FgrMode::Annealed, None)
        }
        From::Defaults | From::NoKernel => MethodConfig::outdoor(method),
    };
    if let From::NoKernel = from {
        match &mut config {
            MethodConfig::Icp(config) => config.kernel_width = None,
            MethodConfig::Gicp(config) => config.kernel_width = None,
            _ => {}
        }
    }
    config
}

/// Normalised squared error; `None` when the pair was not registered.
fn normalized(method: Method, from: From, pair: &Pair) -> Option<f64> {
    let method = build(&config(method, from, pair), None).ok()?;
    let outcome = method.register(&pair.target, &pair.source, &Pose::identity());
    let found = &outcome.target_from_source;
    let near = translation_error_m(found, &pair.truth) <= 0.5
        && rotation_error_deg(found, &pair.truth) <= 2.5;
    let normalized = outcome.covariance?.normalized_error_squared(found, &pair.truth);
    near.then_some(normalized.unwrap_or(f64::INFINITY))
}

fn main() -> echoloop_benches::Result<()> {
    println!("| folder | method | settings | found | mean | median | largest | within 95 % |");
    println!("|---|---|---|---|---|---|---|---|");
    for folder in std::env::args().skip(1) {
        let pairs = read_pairs(Path::new(&folder))?;
        for method in [Method::Icp, Method::Gicp] {
            for from in [From::Defaults, From::Chosen, From::NoKernel] {
                let mut all: Vec<f64> =
                    pairs.par_iter().filter_map(|pair| normalized(method, from, pair)).collect();
                all.sort_by(f64::total_cmp);
                let n = all.len().max(1) as f64;
                let within = all.iter().filter(|v| **v * 6.0 <= CHI_SQUARED_6_95).count() as f64;
                println!(
                    "| {folder} | {} | {from:?} | {} of {} | {:.2} | {:.2} | {:.1} | {:.0} % |",
                    method.name(),
                    all.len(),
                    pairs.len(),
                    all.iter().sum::<f64>() / n,
                    all.get(all.len() / 2).copied().unwrap_or(f64::NAN),
                    all.last().copied().unwrap_or(f64::NAN),
                    100.0 * within / n
                );
            }
        }
    }
    Ok(())
}
