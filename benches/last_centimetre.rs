//! Error of `auto` beside the best of ICP and GICP at six voxels, from the truth.
//!
//! usage: last_centimetre FOLDER..., each of `echoloop pairs`. Prints for each folder the least
//! mean error of the twelve local runs, cm, and that of `auto` from the identity: mean and worst of
//! its motions within 0.5 m, number beyond, and the ratio to the best of the same pairs; at the end
//! the geometric mean of the ratios. The best is chosen with the truth in hand, folder by folder,
//! so that no fixed choice reaches a ratio of 1.

use std::path::Path;

use echoloop_benches::pairs::{Pair, read_pairs};
use echoloop_clouds::pose::{Pose, translation_error_m};
use echoloop_registration::{FgrMode, Method, Suggestions, build};
use echoloop_statistics::mean;
use rayon::prelude::*;

const VOXELS_M: [f64; 6] = [0.1, 0.15, 0.2, 0.3, 0.45, 0.7];

/// Motions farther off are wrong, and no part of the mean.
const WRONG_M: f64 = 0.5;

fn error_m(pair: &Pair, method: Method, voxel_m: Option<f64>, from: &Pose) -> f64 {
    let suggestions = Suggestions::new(&pair.target, &pair.source);
    let config = suggestions.method(method, FgrMode::Annealed, voxel_m);
    let found = build(&config, None).map(|m| m.register(&pair.target, &pair.source, from));
    found.map_or(f64::INFINITY, |found| translation_error_m(&found.target_from_source, &pair.truth))
}

fn main() -> echoloop_benches::Result<()> {
    println!("| folder | best, cm | with | auto, cm | worst | wrong | ratio |");
    println!("|---|---|---|---|---|---|---|");
    let mut logs = Vec::new();
    for folder in std::env::args().skip(1) {
        let pairs = read_pairs(Path::new(&folder))?;
        let errors = |method, voxel_m, is_from_truth: bool| -> Vec<f64> {
            let from = |pair: &Pair| if is_from_truth { pair.truth } else { Pose::identity() };
            pairs.par_iter().map(|pair| error_m(pair, method, voxel_m, &from(pair))).collect()
        };
        // Of the pairs that auto finds: one that nobody finds says nothing of the last centimetre.
        let all_m = errors(Method::Auto, None, false);
        let of_found = |errors_m: &[f64]| -> Vec<f64> {
            let found = errors_m.iter().zip(&all_m).filter(|(_, auto_m)| **auto_m <= WRONG_M);
            found.map(|(error_m, _)| *error_m).collect()
        };
        let right_m = of_found(&all_m);
        if right_m.is_empty() {
            println!("| {folder} | | | | | {} | |", all_m.len());
            continue;
        }
        let run = |(method, voxel_m)| {
            (mean(&of_found(&errors(method, Some(voxel_m), true))), method, voxel_m)
        };
        let runs = [Method::Icp, Method::Gicp].into_iter();
        let runs = runs.flat_map(|method| VOXELS_M.map(|voxel_m| (method, voxel_m)));
        let Some((best_m, method, voxel_m)) = runs.map(run).min_by(|a, b| a.0.total_cmp(&b.0))
        else {
            continue;
        };
        let (auto_m, worst_m) = (mean(&right_m), right_m.iter().copied().fold(0.0, f64::max));
        let ratio = auto_m / best_m;
        logs.push(ratio.ln());
        println!(
            "| {folder} | {:.2} | {} {voxel_m} | {:.2} | {:.2} | {} | {ratio:.2} |",
            100.0 * best_m,
            method.name(),
            100.0 * auto_m,
            100.0 * worst_m,
            all_m.len() - right_m.len(),
        );
    }
    println!("\n{} folders, geometric mean of the ratios {:.2}", logs.len(), mean(&logs).exp());
    Ok(())
}
