//! `echoloop scan`.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use echoloop_frontend::SceneResponse;
use echoloop_sim::viewpoint::{PairPlan, Split, sample_pairs_aloud};
use nalgebra::{Translation3, UnitQuaternion, Vector3};

use super::choice::{described, hold_to};
use super::cloud_output::{CloudOutput, format_parser, tell, wrote};
use super::common::{Setup, on_threads};
use super::exit::Failure;
use super::progress::Progress;
use crate::experiment::config::RunConfig;
use crate::experiment::dataset::{DatasetError, place, respond};
use crate::experiment::params::Parameters;
use crate::experiment::scan_cloud::{directions, recorded_from_scan};
use crate::experiment::seed::{Purpose, derive, scan_noise};
use crate::link::sensor::{Model, View};
use echoloop_registration::cloud::{CloudFormat, Recorded};
use echoloop_registration::pose::Pose;

/// Flags of `scan`.
#[derive(Clone, Debug, Args)]
pub(crate) struct ScanArgs {
    #[command(flatten)]
    setup: Setup,
    /// Where to write the cloud (sensor frame, m), with all that the sensor tells of each point:
    /// FILE.ply, FILE.pcd, or - for standard output.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Format of the cloud [default: that of the file's name, else ply].
    #[arg(long, value_parser = format_parser(), requires = "output")]
    format: Option<CloudFormat>,
    /// Pose of the sensor: x y z in m, yaw pitch roll in degrees
    /// [default: the first training viewpoint].
    #[arg(
        long,
        num_args = 6,
        allow_negative_numbers = true,
        value_names = ["X", "Y", "Z", "YAW", "PITCH", "ROLL"],
    )]
    pose: Option<Vec<f64>>,
}

pub(super) fn run(args: &ScanArgs) -> Result<(), Failure> {
    let config = args.setup.source.load(Vec::new())?;
    let at = |path: &PathBuf| CloudOutput::at(path, args.format);
    let output = args.output.as_ref().map(at).transpose()?; // now: tracing takes long
    on_threads(args.setup.common.threads, || scan(args, &config, output.as_ref()))?
}

/// What came back, and from where.
struct Scan {
    /// Which sensor, and its firmware.
    sensor: String,
    /// The scene and the sensor's pose in it; of a sensor that somebody else turns, nothing is
    /// known.
    seen: Option<Seen>,
    settings: u32,
    beams: u32,
    recorded: Recorded,
}

/// A place to look at.
struct Seen {
    scene: String,
    world_from_sensor: Pose,
    response: Arc<SceneResponse>,
}

fn scan(args: &ScanArgs, config: &RunConfig, output: Option<&CloudOutput>) -> Result<(), Failure> {
    let model = Model::from(config);
    let sensors = args.setup.sensor.sensors(model.clone())?;
    let identity = sensors.identity()?;
    hold_to(&sensors, &identity, &model)?;
    let settings = Parameters::start(config, &identity.hardware).map_err(Failure::usage)?.settings;
    let pattern = identity.pattern;
    let directions = directions(&pattern);
    let seen = seen(args, config, &directions)?;
    let response = seen.as_ref().map_or_else(Arc::default, |seen| Arc::clone(&seen.response));
    let view =
        View { scene: &response, noise_seed: scan_noise(config.seed), scan: 1, viewpoint: 1 };
    let (hash, scan) =
        sensors.with(|sensor| Ok((sensor.configure(&settings)?, sensor.scan(&view)?)))?;
    let duration_s = config.motion.duration_s;
    let recorded = recorded_from_scan(&scan, &directions, &pattern, duration_s);
    if recorded.cloud.points.is_empty() {
        return Err(Failure::run(
            "detection: no beam returned an echo (is the sensor inside something, or too weak?)",
        ));
    }
    if let Some(output) = output {
        output.write(&recorded)?;
    }
    let sensor = described(&sensors, &identity);
    let scan = Scan { sensor, seen, settings: hash, beams: pattern.beams(), recorded };
    tell(output, &args.setup.common, &told(args, &scan)?)
}

/// What a sensor is to look at, when that is for us to say.
fn seen(
    args: &ScanArgs,
    config: &RunConfig,
    directions: &[Vector3<f32>],
) -> Result<Option<Seen>, Failure> {
    if args.setup.sensor.is_turned_by_others() {
        return match args.pose {
            Some(_) => {
                Err(Failure::usage("--pose: a sensor on a serial line looks where it stands"))
            }
            None => Ok(None),
        };
    }
    let town = config.scene.towns[0];
    let place = place(config, town)?;
    let world_from_sensor = match &args.pose {
        Some(numbers) => pose(numbers)?,
        None => first_viewpoint(config, &place, town, args.setup.common.quiet)?,
    };
    let response = Arc::new(respond(config, &place, &world_from_sensor, directions));
    Ok(Some(Seen { scene: place.scene.name, world_from_sensor, response }))
}

fn pose(numbers: &[f64]) -> Result<Pose, Failure> {
    let &[x, y, z, yaw, pitch, roll] = numbers else {
        return Err(Failure::usage("--pose takes six numbers"));
    };
    if numbers.iter().any(|v| !v.is_finite()) {
        return Err(Failure::usage(format!("--pose {numbers:?}: every number must be finite")));
    }
    let rotation =
        UnitQuaternion::from_euler_angles(roll.to_radians(), pitch.to_radians(), yaw.to_radians());
    Ok(Pose::from_parts(Translation3::new(x, y, z), rotation))
}

fn first_viewpoint(
    config: &RunConfig,
    place: &crate::experiment::dataset::Place,
    town: u64,
    quiet: bool,
) -> Result<Pose, Failure> {
    let plan = PairPlan {
        count: 1,
        baseline_m: config.data.baseline_m,
        heading_range_deg: config.data.heading_range_deg,
        tilt_range_deg: config.data.tilt_range_deg,
        height_m: config.scanner.height_m,
        seed: derive(config.seed, Purpose::TrainPoses, town),
        split: Split::Train,
    };
    let progress = Progress::new(quiet);
    progress.begin("viewpoint", 2000);
    let pairs = sample_pairs_aloud(&place.scene, &place.caster, &plan, &|_, tried| {
        progress.at(tried as u64);
    });
    progress.end();
    let pairs = pairs
        .map_err(|source| DatasetError::Viewpoints { scene: place.scene.name.clone(), source })?;
    pairs
        .first()
        .map(|pair| pair.world_from_first)
        .ok_or_else(|| Failure::run("no viewpoint found"))
}

/// What is printed: a document, or lines.
fn told(args: &ScanArgs, scan: &Scan) -> Result<String, Failure> {
    let points = &scan.recorded.cloud.points;
    let ranges: Vec<f64> = points.iter().map(|p| f64::from(p.coords.norm())).collect();
    let median_m = crate::experiment::evaluate::median(ranges.iter().copied());
    let farthest_m = ranges.iter().copied().fold(0.0, f64::max);
    let (settings, beams, points) = (format!("{:#010x}", scan.settings), scan.beams, ranges.len());
    if args.setup.common.json {
        let rows = |seen: &Seen| -> Vec<Vec<f64>> {
            echoloop_registration::pose::to_rows(&seen.world_from_sensor)
                .chunks(4)
                .map(<[f64]>::to_vec)
                .collect()
        };
        let document = serde_json::json!({
            "format": 1, "sensor": scan.sensor, "scene": scan.seen.as_ref().map(|seen| &seen.scene),
            "world_from_sensor": scan.seen.as_ref().map(rows), "settings": settings,
            "beams": beams, "points": points, "median_range_m": median_m, "farthest_m": farthest_m,
        });
        return Ok(serde_json::to_string_pretty(&document).map_err(Failure::run)? + "\n");
    }
    let mut text = match &scan.seen {
        Some(Seen { scene, world_from_sensor, .. }) => {
            let at = world_from_sensor.translation.vector;
            format!("{scene} from ({:.2}, {:.2}, {:.2}) m, settings {settings}\n", at.x, at.y, at.z)
        }
        None => format!("viewpoint 1 of {}, settings {settings}\n", scan.sensor),
    };
    let _ = writeln!(
        text,
        "{points} points of {beams} beams, median range {median_m:.1} m, farthest {farthest_m:.1} m"
    );
    Ok(text + &wrote(&args.setup.common, &args.output))
}
