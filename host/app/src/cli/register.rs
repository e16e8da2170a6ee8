//! `echoloop register`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::common::{Common, on_threads};
use super::exit::Failure;
use super::method_choice::method_parser;
use super::method_flags::MethodFlags;
use crate::experiment::params::written;
use crate::said::say;
use echoloop_registration::cloud::{Cloud, read_cloud, voxel};
use echoloop_registration::pose::{Pose, read_pose, to_rows};
use echoloop_registration::{
    Confirmed, Method, MethodConfig, Outcome, Registration, StopReason, Suggestions, build,
};

/// Flags of `register`. Without any, they are chosen from the clouds.
#[derive(Clone, Debug, Args)]
#[command(allow_negative_numbers = true)]
pub(crate) struct RegisterArgs {
    /// The cloud that stays: PLY, PCD, VTK, KITTI .bin or XYZ, m.
    target: PathBuf,
    /// The cloud that moves.
    source: PathBuf,
    #[command(flatten)]
    common: Common,
    /// The method.
    #[arg(long, default_value = "auto", value_parser = method_parser())]
    method: Method,
    /// Finish what a global method finds with point-to-plane ICP.
    #[arg(long)]
    refine: bool,
    /// Of icp, gicp and auto, where to start: a file with target_from_source, as --json writes it,
    /// as a 4 × 4 matrix, or as a KITTI row of 12 numbers [default: identity].
    #[arg(long, value_name = "FILE")]
    initial: Option<PathBuf>,
    #[command(flatten)]
    settings: MethodFlags,
}

pub(super) fn run(args: &RegisterArgs) -> Result<(), Failure> {
    check(args)?;
    let target = read(args, &args.target)?;
    let source = read(args, &args.source)?;
    let initial = match &args.initial {
        Some(path) => read_pose(path).map_err(Failure::usage)?,
        None => Pose::identity(),
    };
    on_threads(args.common.threads, || register(args, &target, &source, &initial))?
}

/// Flags that do not go together, before anything is read.
fn check(args: &RegisterArgs) -> Result<(), Failure> {
    let name = args.method.name();
    if args.refine && !args.method.is_rough() {
        return Err(Failure::usage(format!(
            "--refine goes with a method that leaves it to another (fgr, mac), not with {name}"
        )));
    }
    if args.initial.is_some() && args.method.is_rough() {
        return Err(Failure::usage(format!(
            "--initial goes with icp, gicp and auto: {name} searches everywhere"
        )));
    }
    args.settings.check(args.method)
}

fn read(args: &RegisterArgs, path: &Path) -> Result<Cloud, Failure> {
    let (cloud, dropped) = read_cloud(path).map_err(Failure::usage)?;
    if dropped.total() > 0 && !args.common.quiet {
        say(format_args!(
            "{}: left out {} points that are not finite and {} at range 0",
            path.display(),
            dropped.non_finite,
            dropped.at_origin
        ));
    }
    Ok(cloud)
}

fn register(
    args: &RegisterArgs,
    target: &Cloud,
    source: &Cloud,
    initial: &Pose,
) -> Result<(), Failure> {
    let began = cpu_s();
    let suggestions = Suggestions::new(target, source);
    let config = args.settings.config(args.method, &suggestions)?;
    let global_voxel_m = config.get("voxel_m").unwrap_or_default();
    let finish = args.refine.then(|| suggestions.refinement(global_voxel_m));
    let method = build(&config, finish).map_err(Failure::usage)?;
    let method = Confirmed { method, voxel_m: suggestions.scene_voxel_m() };
    let outcome = method.register(target, source, initial);
    warn(args, &outcome);
    let cpu_s = cpu_s() - began;
    if outcome.stop == StopReason::BadSettings {
        name_what_cannot_run(&[(&args.target, target), (&args.source, source)], global_voxel_m)?;
    }
    print(args, &config, &outcome, cpu_s)
}

/// The settings were checked, so it is the voxel that does not go with a cloud: says which.
fn name_what_cannot_run(clouds: &[(&PathBuf, &Cloud)], voxel_m: f64) -> Result<(), Failure> {
    for (path, cloud) in clouds {
        voxel::downsample(cloud, voxel_m)
            .map_err(|error| Failure::usage(format!("{}: {error}", path.display())))?;
    }
    Ok(())
}

/// Says when matches were left out.
fn warn(args: &RegisterArgs, outcome: &Outcome) {
    if let Some(consensus) =
        outcome.consensus.filter(|c| c.searched < c.matches && !args.common.quiet)
    {
        say(format_args!(
            "warning: {} of {} matches were searched: the others are too far out, or all would \
             take too much time and memory",
            consensus.searched, consensus.matches
        ));
    }
}

/// Processor time of this process, all threads, s.
fn cpu_s() -> f64 {
    cpu_time::ProcessTime::try_now().map_or(f64::NAN, |t| t.as_duration().as_secs_f64())
}

fn print(
    args: &RegisterArgs,
    config: &MethodConfig,
    outcome: &Outcome,
    cpu_s: f64,
) -> Result<(), Failure> {
    if args.common.json {
        println!(
            "{}",
            serde_json::to_string(&document(args, config, outcome, cpu_s)).map_err(Failure::run)?
        );
    } else {
        print_text(outcome, cpu_s);
    }
    match outcome.stop.is_success() {
        true => Ok(()),
        false => Err(Failure::run(format!("not registered: {}", outcome.stop))),
    }
}

fn document(
    args: &RegisterArgs,
    config: &MethodConfig,
    outcome: &Outcome,
    cpu_s: f64,
) -> serde_json::Value {
    let rows = to_rows(&outcome.target_from_source);
    let rows: Vec<&[f64]> = rows.chunks(4).collect();
    let mut document = serde_json::json!({
        "format": 1,
        "target_from_source": rows,
        "stop": outcome.stop.name(),
        "converged": outcome.stop.is_success(),
        "pairs": outcome.pairs,
        "rmse_m": outcome.rmse_m,
        "cpu_s": cpu_s,
        "iterations": outcome.iterations,
        "inlier_fraction": outcome.inlier_fraction,
        "supported": outcome.overlap.map(|o| o.supported),
        "seen_through": outcome.overlap.map(|o| o.seen_through),
        "unobservable_directions": outcome.observability.as_ref().map(|o| o.unobservable),
        "covariance": outcome.covariance.map(|c| c.to_rows()),
        "matches": outcome.consensus.map(|c| c.matches),
        "searched": outcome.consensus.map(|c| c.searched),
        "inliers": outcome.consensus.map(|c| c.inliers),
        "margin": outcome.consensus.and_then(|c| c.margin),
        "method": args.method.name(),
        "refine": args.refine,
    });
    if let MethodConfig::Fgr(config) = config {
        document["mode"] = serde_json::json!(config.mode);
    }
    for (setting, _) in config.method().settings() {
        let value = config.get(setting.key).map(|value| written(setting.path, value));
        document[setting.key] = serde_json::json!(value);
        if let Some(former) = setting.former {
            // For one version: readers of the former name.
            document[former] = document[setting.key].clone();
        }
    }
    document
}

fn print_text(outcome: &Outcome, cpu_s: f64) {
    println!("target_from_source");
    for row in to_rows(&outcome.target_from_source).chunks(4) {
        println!("{:>12.6} {:>12.6} {:>12.6} {:>12.6}", row[0], row[1], row[2], row[3]);
    }
    println!(
        "{}; {} iterations, {} pairs ({:.0} %), {:.1} mm rms, {:.3} s CPU",
        outcome.stop,
        outcome.iterations,
        outcome.pairs,
        100.0 * outcome.inlier_fraction,
        1e3 * outcome.rmse_m,
        cpu_s
    );
    if let Some(overlap) = &outcome.overlap {
        println!(
            "{:.0} % of the points lie on the other cloud, {:.1} % were seen through",
            100.0 * overlap.supported,
            100.0 * overlap.seen_through
        );
    }
    if let Some(covariance) = &outcome.covariance {
        let [x, y, z] = covariance.translation_sd_m().map(|sd_m| 100.0 * sd_m);
        let [a, b, c] = covariance.rotation_sd_rad().map(f64::to_degrees);
        println!(
            "standard deviations x y z: {x:.1} {y:.1} {z:.1} cm, {a:.3} {b:.3} {c:.3}° about them"
        );
    }
    if let Some(consensus) = &outcome.consensus {
        let margin = consensus
            .margin
            .map_or_else(String::new, |margin| format!(", {margin:.2} times the next best"));
        println!("{} of {} matches agree{margin}", consensus.inliers, consensus.matches);
    }
}
