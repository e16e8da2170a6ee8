//! `echoloop register`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::exit::Failure;
use super::{Common, on_threads};
use crate::cloud::{Cloud, read_cloud};
use crate::config::Method;
use crate::pose::{Pose, read_pose, to_rows};
use crate::registration::{Icp, IcpConfig, Outcome, Registration, suggest};

/// Flags of `register`. Without any, they are chosen from the clouds.
#[derive(Clone, Debug, Args)]
#[command(allow_negative_numbers = true)]
pub(crate) struct RegisterArgs {
    /// The cloud that stays: PLY, PCD, KITTI .bin or XYZ, m.
    target: PathBuf,
    /// The cloud that moves.
    source: PathBuf,
    #[command(flatten)]
    common: Common,
    /// The method.
    #[arg(long, default_value = "icp")]
    method: Method,
    /// Where to start: a file with the 4 × 4 matrix target_from_source [default: identity].
    #[arg(long, value_name = "FILE")]
    initial: Option<PathBuf>,
    /// Edge of the voxels that thin both clouds, m, above 0.
    #[arg(long, value_name = "M")]
    voxel_m: Option<f64>,
    /// Radius of the normals' neighbourhood, m, above 0.
    #[arg(long, value_name = "M")]
    normal_radius_m: Option<f64>,
    /// Neighbours of a normal at most, 3 to 10000.
    #[arg(long, value_name = "N")]
    normal_neighbours: Option<usize>,
    /// Points farther apart are no pair, m, above 0.
    #[arg(long, value_name = "M")]
    max_pair_distance_m: Option<f64>,
    /// Pairs may be this far apart at first, then less and less, m.
    #[arg(long, value_name = "M")]
    first_pair_distance_m: Option<f64>,
    /// Iterations at most, 1 or more.
    #[arg(long, value_name = "N")]
    max_iterations: Option<usize>,
}

pub(super) fn run(args: &RegisterArgs) -> Result<(), Failure> {
    let target = read(args, &args.target)?;
    let source = read(args, &args.source)?;
    let initial = match &args.initial {
        Some(path) => read_pose(path).map_err(Failure::usage)?,
        None => Pose::identity(),
    };
    on_threads(args.common.threads, || register(args, &target, &source, &initial))?
}

fn read(args: &RegisterArgs, path: &Path) -> Result<Cloud, Failure> {
    let (cloud, dropped) = read_cloud(path).map_err(Failure::usage)?;
    if dropped.total() > 0 && !args.common.quiet {
        eprintln!(
            "{}: left out {} points that are not finite and {} at range 0",
            path.display(),
            dropped.non_finite,
            dropped.at_origin
        );
    }
    Ok(cloud)
}

impl RegisterArgs {
    fn config(&self, target: &Cloud, source: &Cloud) -> IcpConfig {
        let mut config = suggest(target, source);
        let lengths = [
            (&mut config.voxel_m, self.voxel_m),
            (&mut config.normal_radius_m, self.normal_radius_m),
            (&mut config.max_pair_distance_m, self.max_pair_distance_m),
        ];
        for (slot, given) in lengths {
            *slot = given.unwrap_or(*slot);
        }
        config.first_pair_distance_m = match (self.first_pair_distance_m, self.max_pair_distance_m) {
            (Some(first), _) => Some(first),
            // A distance of one's own is meant as it stands.
            (None, Some(_)) => None,
            (None, None) => config.first_pair_distance_m,
        };
        config.normal_neighbours = self.normal_neighbours.unwrap_or(config.normal_neighbours);
        config.max_iterations = self.max_iterations.unwrap_or(config.max_iterations);
        config
    }
}

fn register(args: &RegisterArgs, target: &Cloud, source: &Cloud, initial: &Pose) -> Result<(), Failure> {
    let began = cpu_s();
    let Method::Icp = args.method;
    let icp = Icp::new(args.config(target, source)).map_err(Failure::usage)?;
    let outcome = icp.register(target, source, initial);
    print(args, &icp, &outcome, cpu_s() - began)
}

/// Processor time of this process, all threads, s.
fn cpu_s() -> f64 {
    cpu_time::ProcessTime::try_now().map_or(f64::NAN, |t| t.as_duration().as_secs_f64())
}

fn print(args: &RegisterArgs, icp: &Icp, outcome: &Outcome, cpu_s: f64) -> Result<(), Failure> {
    let rows = to_rows(&outcome.target_from_source);
    if args.common.json {
        let rows: Vec<&[f64]> = rows.chunks(4).collect();
        let config = icp.config();
        let document = serde_json::json!({
            "target_from_source": rows,
            "stop": format!("{:?}", outcome.stop),
            "pairs": outcome.pairs,
            "rmse_m": outcome.rmse_m,
            "cpu_s": cpu_s,
            "iterations": outcome.iterations,
            "inlier_fraction": outcome.inlier_fraction,
            "unobservable_directions": outcome.observability.as_ref().map(|o| o.unobservable),
            "method": "icp",
            "voxel_m": config.voxel_m,
            "normal_radius_m": config.normal_radius_m,
            "normal_neighbours": config.normal_neighbours,
            "max_pair_distance_m": config.max_pair_distance_m,
            "first_pair_distance_m": config.first_pair_distance_m,
            "max_iterations": config.max_iterations,
        });
        println!("{}", serde_json::to_string(&document).map_err(Failure::run)?);
    } else {
        println!("target_from_source");
        for row in rows.chunks(4) {
            println!("{:>12.6} {:>12.6} {:>12.6} {:>12.6}", row[0], row[1], row[2], row[3]);
        }
        println!(
            "{}; {} iterations, {} pairs, {:.1} mm rms, {:.3} s CPU",
            outcome.stop,
            outcome.iterations,
            outcome.pairs,
            1e3 * outcome.rmse_m,
            cpu_s
        );
    }
    match outcome.stop.is_success() {
        true => Ok(()),
        false => Err(Failure::run(format!("not registered: {}", outcome.stop))),
    }
}
