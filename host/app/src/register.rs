//! `echoloop register`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::cloud_output::{CloudOutput, format_parser, outputs, tell, wrote};
use super::common::{Common, on_threads};
use super::exit::Failure;
use super::hints::hints;
use super::method_choice::{method_parser, methods_that};
use super::method_flags::{MethodFlags, refused};
use super::number::{flag, number_as};
use super::register_all;
use echoloop_closed_loop::parameters::{Parameters, written};
use echoloop_closed_loop::run_folder::tuned_run::tuned_config;
use echoloop_clouds::pose::{Pose, read_pose, to_rows};
use echoloop_clouds::{
    Cloud, CloudError, CloudFormat, Dropped, Recorded, read_points, read_recorded,
};
use echoloop_files::say;
use echoloop_parameters::{Bounds, Kind, Parameter};
use echoloop_registration::geometry::voxel;
use echoloop_registration::overlap::Rival;
use echoloop_registration::pair::{Registered, Request, RequestError, in_one_frame};
use echoloop_registration::survey::Frames;
use echoloop_registration::{Method, MethodConfig, OpenDirection, Outcome, StopReason};

/// Metres in the units of files.
const SCALE: Parameter = flag(Kind::Number, Bounds::between(1e-6, 1e6));

/// Flags of `register`. Without any, they are chosen from the clouds.
#[derive(Clone, Debug, Args)]
#[command(allow_negative_numbers = true)]
pub(crate) struct RegisterArgs {
    /// The cloud that stays: PLY, PCD, VTK, KITTI .bin or XYZ, m. Without SOURCE, many pairs: a
    /// folder of NAME_target.* and NAME_source.*, as `echoloop pairs` writes them, with
    /// NAME_target_from_source.txt where the truth is known and NAME_initial.txt where a guess is;
    /// or a table, CSV with columns target, source and maybe name, initial, truth.
    pub(super) target: PathBuf,
    /// The cloud that moves.
    source: Option<PathBuf>,
    /// Register consecutive scans of the folder TARGET, or of its velodyne/, each to the one before
    /// it.
    #[arg(long, conflicts_with = "source")]
    pub(super) sequence: bool,
    /// Page of many pairs: each with its errors, and the worst in three dimensions (HTML).
    #[arg(long, value_name = "FILE", conflicts_with = "source")]
    pub(super) report: Option<PathBuf>,
    /// True poses of the scans, TUM or KITTI, one a scan; of the camera, if TARGET has KITTI's
    /// calib.txt.
    #[arg(long, value_name = "FILE", requires = "sequence")]
    pub(super) truth: Option<PathBuf>,
    /// Metres per unit of the clouds' files, as 0.001 for millimetres; of TARGET and SOURCE, if
    /// they differ: 0.001,1. All that is written is in metres.
    #[arg(
        long, value_name = "M", value_delimiter = ',', default_value = "1",
        value_parser = number_as::<f64>(SCALE)
    )]
    scale: Vec<f64>,
    #[command(flatten)]
    pub(super) common: Common,
    /// The method.
    #[arg(long, default_value = "auto", value_parser = method_parser())]
    method: Method,
    /// Finish what a global method finds with point-to-plane ICP.
    #[arg(long)]
    refine: bool,
    /// With the method and the settings that a run tuned; flags of settings are laid over them.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["method", "refine", "mode"])]
    run: Option<PathBuf>,
    /// Settings that the run tuned.
    #[arg(skip)]
    tuned: Option<MethodConfig>,
    #[arg(long, value_name = "FILE", help = format!(
        "Of {}, where to start: a file with target_from_source, as --json writes it, as a 4 × 4 \
         matrix, or as a KITTI row of 12 numbers [default: identity]",
        methods_that(|method| !method.is_rough())
    ))]
    pub(super) initial: Option<PathBuf>,
    #[arg(short, long, value_name = "FILE", help = format!(
        "Where to write the source in the target's frame, with all that its file says of each \
         point: {}. Nothing is written unless it is registered. Of many pairs a folder: a NAME.ply \
         of each, and registered.jsonl, with which the same command goes on where it was left; of \
         a sequence its trajectory, too",
        outputs()
    ))]
    pub(super) output: Option<PathBuf>,
    /// Format of the output [default: that of the file's name, else ply].
    #[arg(long, value_parser = format_parser(), requires = "output")]
    pub(super) format: Option<CloudFormat>,
    #[command(flatten)]
    settings: MethodFlags,
}

impl RegisterArgs {
    /// Metres per unit of target and source.
    pub(super) fn scales(&self) -> [f64; 2] {
        let last = self.scale.last();
        [0, 1].map(|cloud| self.scale.get(cloud).or(last).copied().unwrap_or(1.0))
    }

    pub(super) fn request(&self) -> Request {
        let Self { method, refine, tuned, .. } = *self;
        Request { method, refine, tuned, given: self.settings.given(), unchecked: false }
    }

    /// Source of one pair.
    fn source(&self) -> &Path {
        self.source.as_deref().unwrap_or(Path::new(""))
    }
}

pub(super) fn run(args: &RegisterArgs) -> Result<(), Failure> {
    let args = &with_run(args.clone())?;
    check(args)?;
    if args.source.is_none() {
        return on_threads(args.common.threads, || register_all::run(args))?;
    }
    let at = |path: &PathBuf| CloudOutput::at(path, args.format);
    let output = args.output.as_ref().map(at).transpose()?;
    let [target_scale, source_scale] = args.scales();
    let mut target = read(args, &args.target, read_points)?;
    let mut source = match output {
        Some(_) => read(args, args.source(), read_recorded)?,
        None => read(args, args.source(), read_points)?,
    };
    target.scale(target_scale);
    source.scale(source_scale);
    in_one_frame(&target, &mut source);
    let initial = match &args.initial {
        Some(path) => read_pose(path).map_err(Failure::usage)?,
        None => Pose::identity(),
    };
    on_threads(args.common.threads, || register(args, &target, source, &initial, output.as_ref()))?
}

/// Takes method and settings from the run of `--run`.
fn with_run(mut args: RegisterArgs) -> Result<RegisterArgs, Failure> {
    if let Some(run) = &args.run {
        let config = tuned_config(run)?;
        let start = Parameters::start(&config, &config.device())?;
        let theta = start.registration;
        args.method = theta.method.method();
        (args.refine, args.tuned) = (theta.refine, Some(theta.method));
    }
    Ok(args)
}

/// Refuses flags that do not go together, before anything is read.
fn check(args: &RegisterArgs) -> Result<(), Failure> {
    if args.scale.len() > 2 {
        return Err(Failure::usage(format!(
            "--scale: expected one number, or TARGET's and SOURCE's, found {}",
            args.scale.len()
        )));
    }
    let name = args.method.name();
    args.request().check(args.initial.is_some()).map_err(|error| match error {
        RequestError::Refine(_) => Failure::usage(format!("--{error}")),
        RequestError::Initial(_) => Failure::usage(format!(
            "--initial goes with {}: {name} searches everywhere",
            methods_that(|method| !method.is_rough())
        )),
        RequestError::Given(error) => refused(&error),
        RequestError::Check => Failure::usage(error),
    })
}

fn read(
    args: &RegisterArgs,
    path: &Path,
    read: fn(&Path) -> Result<(Recorded, Dropped), CloudError>,
) -> Result<Recorded, Failure> {
    let (cloud, dropped) = read(path).map_err(Failure::usage)?;
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
    surveyed: &Recorded,
    recorded: Recorded,
    initial: &Pose,
    output: Option<&CloudOutput>,
) -> Result<(), Failure> {
    let began = cpu_s();
    let (target, source) = (&surveyed.cloud, &recorded.cloud);
    let registered =
        args.request().register(surveyed, &recorded, initial).map_err(Failure::usage)?;
    let target_from_source = registered.target_from_source();
    let Registered { config, outcome, frames } = registered;
    warn(args, &outcome);
    let cpu_s = cpu_s() - began;
    if outcome.stop == StopReason::BadSettings {
        let voxel_m = config.get("voxel_m").unwrap_or_default();
        check_voxel(&[(&args.target, target), (args.source(), source)], voxel_m)?;
    }
    let found = outcome.stop.is_success();
    let failure = (!found).then(|| not_registered(args, &outcome, [target, source]));
    let mut text = output_text(args, &config, (&outcome, &frames), cpu_s)?;
    if let Some(output) = output.filter(|_| found) {
        write(args, recorded, &target_from_source, output)?;
        text += &wrote(&args.common, &args.output);
    }
    tell(output, &args.common, &text)?;
    failure.map_or(Ok(()), Err)
}

/// The reason, and what is odd about the clouds.
fn not_registered(
    args: &RegisterArgs,
    outcome: &Outcome,
    [target, source]: [&Cloud; 2],
) -> Failure {
    let written = if args.output.is_some() { "; nothing is written" } else { "" };
    let hints = hints([(&args.target, target), (args.source(), source)], args.scales());
    let hints: String = hints.iter().map(|hint| format!("\nhint: {hint}")).collect();
    Failure::run(format!("not registered: {}{written}{hints}", outcome.stop))
}

/// Writes the source in the target's frame.
fn write(
    args: &RegisterArgs,
    mut source: Recorded,
    target_from_source: &Pose,
    output: &CloudOutput,
) -> Result<(), Failure> {
    if !source.left_out.is_empty() && !args.common.quiet {
        say(format_args!(
            "{}: not written, for they have more than one number a point: {}",
            args.source().display(),
            source.left_out.join(", ")
        ));
    }
    source.transform(target_from_source);
    output.write(&source)
}

/// Refuses a cloud that cannot be downsampled with this voxel; the settings were checked before.
fn check_voxel(clouds: &[(&Path, &Cloud)], voxel_m: f64) -> Result<(), Failure> {
    for (path, cloud) in clouds {
        voxel::downsample(cloud, voxel_m)
            .map_err(|error| Failure::usage(format!("{}: {error}", path.display())))?;
    }
    Ok(())
}

/// Warns when matches were left out.
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

/// The text to print: JSON with `--json`, else lines.
fn output_text(
    args: &RegisterArgs,
    config: &MethodConfig,
    (outcome, frames): (&Outcome, &Frames),
    cpu_s: f64,
) -> Result<String, Failure> {
    if args.common.json {
        let document = document(args, config, (outcome, frames), cpu_s);
        return Ok(serde_json::to_string(&document).map_err(Failure::run)? + "\n");
    }
    Ok(lines(outcome, frames, cpu_s))
}

fn document(
    args: &RegisterArgs,
    config: &MethodConfig,
    (outcome, frames): (&Outcome, &Frames),
    cpu_s: f64,
) -> serde_json::Value {
    let target_from_source = frames.outside(&outcome.target_from_source);
    let rows = to_rows(&target_from_source);
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
        "supported": outcome.overlap.map(|o| o.supported()),
        "contradicted": outcome.overlap.map(|o| o.refuted()),
        // Kept for one version, for readers of the former name.
        "seen_through": outcome.overlap.map(|o| o.refuted()),
        "known": outcome.overlap.map(|o| o.known()),
        "lead": outcome.lead,
        "rival": outcome.rival.map(|rival| rival_document(&rival, frames)),
        "unobservable_directions": outcome.observability.as_ref().map(|o| o.unobservable),
        "open_directions": frames.open(outcome).iter().map(open_direction).collect::<Vec<_>>(),
        "covariance": frames.covariance(outcome).map(|c| c.to_rows()),
        "matches": outcome.consensus.map(|c| c.matches),
        "searched": outcome.consensus.map(|c| c.searched),
        "inliers": outcome.consensus.map(|c| c.inliers),
        "margin": outcome.consensus.and_then(|c| c.margin),
        "method": args.method.name(),
        "refine": args.refine,
    });
    if let Some(motion) = frames.about_centre(&target_from_source) {
        document["covariance_about"] = serde_json::json!(motion.to_m);
        document["motion_about_centre"] = serde_json::json!({
            "centre_m": motion.from_m,
            "turn_deg": motion.turn_deg,
            "shift_m": motion.shift_m,
        });
    }
    if let MethodConfig::Fgr(config) = config {
        document["mode"] = serde_json::json!(config.mode);
    }
    for (setting, _) in config.method().settings() {
        let value = config.get(setting.key).map(|value| written(setting.path, value));
        document[setting.key] = serde_json::json!(value);
        if let Some(former) = setting.former {
            // Kept for one version, for readers of the former name.
            document[former] = document[setting.key].clone();
        }
    }
    document
}

fn lines(outcome: &Outcome, frames: &Frames, cpu_s: f64) -> String {
    let target_from_source = frames.outside(&outcome.target_from_source);
    let rows = to_rows(&target_from_source);
    let row = |r: &[f64]| format!("{:>12.6} {:>12.6} {:>12.6} {:>12.6}\n", r[0], r[1], r[2], r[3]);
    // 1e-12 rad are 10 µm at 10,000 km.
    let long_row =
        |r: &[f64]| format!("{:>15.12} {:>15.12} {:>15.12} {:>15.6}\n", r[0], r[1], r[2], r[3]);
    let motion = frames.about_centre(&target_from_source);
    let matrix: String = match motion {
        None => rows.chunks(4).map(row).collect(),
        Some(_) => rows.chunks(4).map(long_row).collect(),
    };
    let motion = motion.map(|motion| motion.to_string()).unwrap_or_default();
    let found = format!(
        "{}; {} iterations, {} pairs ({:.0} %), {:.1} mm rms, {cpu_s:.3} s CPU\n",
        outcome.stop,
        outcome.iterations,
        outcome.pairs,
        100.0 * outcome.inlier_fraction,
        1e3 * outcome.rmse_m,
    );
    let more =
        [overlap(outcome), rival(outcome, frames), spread(outcome, frames), consensus(outcome)];
    let open = frames.open(outcome).iter().map(open_line).collect();
    let more: String = more.into_iter().flatten().chain([open]).collect();
    format!("target_from_source\n{matrix}{motion}{found}{more}")
}

/// Another motion that fits the clouds.
fn rival_document(rival: &Rival, frames: &Frames) -> serde_json::Value {
    let rows = to_rows(&frames.outside(&rival.target_from_source));
    serde_json::json!({
        "target_from_source": rows.chunks(4).collect::<Vec<_>>(),
        "lead": rival.lead,
        "is_as_good": rival.is_as_good,
    })
}

/// A direction that the scans leave open: m and degrees, per metre that it moves the points.
fn open_direction(open: &OpenDirection) -> serde_json::Value {
    serde_json::json!({
        "translation_m": open.shift_m,
        "rotation_deg": open.turn_rad.map(f64::to_degrees),
    })
}

fn open_line(open: &OpenDirection) -> String {
    let ([x, y, z], [a, b, c]) = (open.shift_m, open.turn_rad.map(f64::to_degrees));
    format!("open to a shift of {x:.2} {y:.2} {z:.2} m with a turn of {a:.2} {b:.2} {c:.2}°\n")
}

fn overlap(outcome: &Outcome) -> Option<String> {
    outcome.overlap.map(|overlap| {
        let lead = outcome.lead.map(|lead| format!("; leads neighbouring motions by {lead:.1} sd"));
        format!(
            "{:.1} % of the points that the other cloud knows lie on it ({:.0} % of all are \
             known){}\n",
            100.0 * overlap.supported(),
            100.0 * overlap.known(),
            lead.unwrap_or_default()
        )
    })
}

/// The best other motion, if the clouds fit it.
fn rival(outcome: &Outcome, frames: &Frames) -> Option<String> {
    outcome.rival.map(|rival| {
        let motion = frames.outside(&rival.target_from_source);
        let [x, y, z]: [f64; 3] = motion.translation.vector.into();
        let [a, b, c]: [f64; 3] = motion.rotation.scaled_axis().map(f64::to_degrees).into();
        let lead = rival.lead;
        format!(
            "the next motion that fits is {lead:.1} sd behind: shift {x:.2} {y:.2} {z:.2} m, turn \
             {a:.1} {b:.1} {c:.1}° (axis times angle)\n"
        )
    })
}

fn spread(outcome: &Outcome, frames: &Frames) -> Option<String> {
    let about = if frames.are_shifted() { "axes through that centre" } else { "them" };
    frames.covariance(outcome).map(|covariance| {
        let [x, y, z] = covariance.translation_sd_m().map(|sd_m| 100.0 * sd_m);
        let [a, b, c] = covariance.rotation_sd_rad().map(f64::to_degrees);
        format!(
            "standard deviations x y z: {x:.1} {y:.1} {z:.1} cm, {a:.3} {b:.3} {c:.3}° about \
             {about}\n"
        )
    })
}

fn consensus(outcome: &Outcome) -> Option<String> {
    outcome.consensus.as_ref().map(|consensus| {
        let margin = consensus.margin;
        let margin = margin.map(|margin| format!(", {margin:.2} times the next best"));
        let (inliers, matches) = (consensus.inliers, consensus.matches);
        format!("{inliers} of {matches} matches agree{}\n", margin.unwrap_or_default())
    })
}
