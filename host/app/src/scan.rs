//! `echoloop scan`.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use clap::{Args, ValueHint};
use echoloop_frontend::SceneResponse;
use echoloop_sim::scene::Scene;
use echoloop_sim::viewpoint::{
    Footing, PairPlan, Split, Standpoint, ViewpointError, stand_alone, stands_aloft,
};
use nalgebra::{Translation3, UnitQuaternion};

use super::cloud_output::{CloudOutput, format_parser, tell, wrote};
use super::common::{Setup, on_threads};
use super::configured_sensor::Ready;
use super::exit::{self, Failure};
use super::progress::Progress;
use super::scan_along::{Along, scan_along};
use echoloop_closed_loop::beams::Beams;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::source::Source;
use echoloop_closed_loop::dataset::{
    Dataset, DatasetError, Place, pair_plan, place, poses, respond, sight,
};
use echoloop_closed_loop::evaluation::scan_cloud::recorded_from_scan;
use echoloop_closed_loop::seed::scan_noise;
use echoloop_registration::cloud::{CloudFormat, Recorded};
use echoloop_registration::pose::{Pose, to_rows};
use echoloop_sensors::sensor::View;

/// Flags of `scan`.
#[derive(Clone, Debug, Args)]
pub(crate) struct ScanArgs {
    #[command(flatten)]
    setup: Setup,
    /// Where to write the cloud (sensor frame, m), with all that the sensor tells of each point:
    /// FILE.ply, FILE.pcd, or - for standard output. With --trajectory a folder to make.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Format of the cloud [default: that of the file's name, else ply].
    #[arg(long, value_parser = format_parser(), requires = "output")]
    format: Option<CloudFormat>,
    /// Scans along poses: a file of lines `time x y z qx qy qz qw` (TUM; s, m) or of KITTI's
    /// twelve numbers, world from sensor. The folder of -o gets NNNNNN.ply (or .pcd) for each pose
    /// 000000, 000001, …; poses.txt, as KITTI has them; times.txt, if there are times; config.toml.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with = "pose")]
    trajectory: Option<PathBuf>,
    /// Pose of the sensor: x y z in m, yaw pitch roll in degrees
    /// [default: the first training viewpoint].
    #[arg(
        long,
        num_args = 6,
        allow_negative_numbers = true,
        value_parser = finite,
        value_names = ["X", "Y", "Z", "YAW", "PITCH", "ROLL"],
    )]
    pose: Option<Vec<f64>>,
}

pub(super) fn run(args: &ScanArgs) -> Result<(), Failure> {
    let config = args.setup.source.load(Vec::new())?;
    if let Some(trajectory) = &args.trajectory {
        let along = Along {
            setup: &args.setup,
            trajectory,
            output: args.output.as_deref(),
            format: args.format.unwrap_or(CloudFormat::Ply),
        };
        let run = || scan_along(&along, &config);
        return on_threads(args.setup.common.threads, run)?;
    }
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
#[derive(Clone)]
struct Seen {
    scene: String,
    world_from_sensor: Pose,
    response: Arc<SceneResponse>,
}

fn scan(args: &ScanArgs, config: &RunConfig, output: Option<&CloudOutput>) -> Result<(), Failure> {
    let ready = Ready::new(&args.setup, config)?;
    let Ready { sensors, settings, beams, .. } = &ready;
    let (seen, beams) = &match Source::of(&config.scene.source) {
        Source::Recording(_) => recorded(args, config)?,
        _ => (seen(args, config, beams)?, beams.clone()),
    };
    let response = seen.as_ref().map_or_else(Arc::default, |seen| Arc::clone(&seen.response));
    let view =
        View { scene: &response, noise_seed: scan_noise(config.seed), scan: 1, viewpoint: 1 };
    let (hash, scan) =
        sensors.with(|sensor| Ok((sensor.configure(settings)?, sensor.scan(&view)?)))?;
    let duration_s = config.motion.duration_s;
    let recorded = recorded_from_scan(&scan, beams, view.viewpoint, duration_s);
    if recorded.cloud.points.is_empty() {
        return Err(Failure::run(
            "detection: no beam returned an echo (is the sensor inside something, or too weak?)",
        ));
    }
    if let Some(output) = output {
        output.write(&recorded)?;
    }
    let (seen, beams) = (seen.clone(), beams.pattern().beams());
    let scan = Scan { sensor: ready.sensor, seen, settings: hash, beams, recorded };
    tell(output, &args.setup.common, &told(args, &scan)?)
}

/// The first recorded scan that is tuned on, and where its beams point.
fn recorded(args: &ScanArgs, config: &RunConfig) -> Result<(Option<Seen>, Beams), Failure> {
    if args.pose.is_some() || args.setup.sensor.is_turned_by_others() {
        let said = "recorded scans are seen from where they were made, by a sensor of ours alone";
        return Err(Failure::usage(format!("--scene: {said}")));
    }
    let dataset = Dataset::build(config, &|_, _| {})?;
    let seen = dataset.train.first().map(|pair| Seen {
        scene: pair.place.clone(),
        world_from_sensor: pair.world_from_sensor[0],
        response: Arc::clone(&pair.first),
    });
    Ok((seen, dataset.beams))
}

/// What a sensor is to look at, when that is for us to say.
fn seen(args: &ScanArgs, config: &RunConfig, beams: &Beams) -> Result<Option<Seen>, Failure> {
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
    let response = Arc::new(respond(config, &place, &world_from_sensor, beams));
    Ok(Some(Seen { scene: place.scene.name, world_from_sensor, response }))
}

/// Reads a number of `--pose`.
fn finite(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| "expected a finite number".to_owned())
}

fn pose(numbers: &[f64]) -> Result<Pose, Failure> {
    let &[x, y, z, yaw, pitch, roll] = numbers else {
        return Err(Failure::usage("--pose takes six numbers"));
    };
    let rotation =
        UnitQuaternion::from_euler_angles(roll.to_radians(), pitch.to_radians(), yaw.to_radians());
    Ok(Pose::from_parts(Translation3::new(x, y, z), rotation))
}

/// Where a first pair begins; where no pair fits, a place for one sensor.
fn first_viewpoint(
    config: &RunConfig,
    place: &Place,
    town: u64,
    quiet: bool,
) -> Result<Pose, Failure> {
    let plan = pair_plan(config, Split::Train, 1, town);
    let progress = Progress::new(quiet);
    progress.begin("viewpoint", 2000);
    let pose = viewpoint(config, place, &plan, &progress);
    progress.end();
    pose
}

/// Where the first scan of the first pair is made; where no pair fits, somewhere else.
fn viewpoint(
    config: &RunConfig,
    place: &Place,
    plan: &PairPlan,
    progress: &Progress,
) -> Result<Pose, Failure> {
    let Place { scene, caster, .. } = place;
    let heard = |_, tried| progress.at(tried as u64);
    let sight = sight(place, &config.scanner.beams());
    let first = match poses(config, place, &sight, plan, &heard) {
        Ok(pairs) => pairs.first().map(|pair| pair.poses.world_from_first),
        Err(DatasetError::Viewpoints { source: ViewpointError::NoViewpoint { .. }, .. }) => None,
        Err(error) => return Err(error.into()),
    };
    let pose = first.map_or_else(|| alone(place, plan, progress), Ok)?;
    if stands_aloft(scene, caster, &pose) {
        progress.say(
            "the sensor stands on something else than ground (a crown, a roof?); --pose puts it \
             elsewhere",
        );
    }
    Ok(pose)
}

fn alone(place: &Place, plan: &PairPlan, progress: &Progress) -> Result<Pose, Failure> {
    let Place { scene, caster, .. } = place;
    let Standpoint { world_from_sensor, footing, sees_enough } =
        stand_alone(scene, caster, plan).map_err(|source| nowhere(scene, source))?;
    let on = match footing {
        Footing::Open => "on open ground",
        Footing::Covered => "on the ground, below something",
        Footing::Aloft => "on what lies on top",
    };
    progress.say(&format!(
        "{}: no place for two sensors {} m apart; one stands {on}{}",
        scene.name,
        plan.baseline_m,
        if sees_enough { "" } else { ", with little to see" }
    ));
    Ok(world_from_sensor)
}

fn nowhere(scene: &Scene, source: ViewpointError) -> Failure {
    DatasetError::Viewpoints { scene: scene.name.clone(), source }.into()
}

/// What is printed: a document, or lines.
fn told(args: &ScanArgs, scan: &Scan) -> Result<String, Failure> {
    let points = &scan.recorded.cloud.points;
    let ranges: Vec<f64> = points.iter().map(|p| f64::from(p.coords.norm())).collect();
    let median_m = echoloop_statistics::median(ranges.iter().copied());
    let farthest_m = ranges.iter().copied().fold(0.0, f64::max);
    let (settings, beams, points) = (format!("{:#010x}", scan.settings), scan.beams, ranges.len());
    if args.setup.common.json {
        let rows = |seen: &Seen| to_rows(&seen.world_from_sensor).as_chunks::<4>().0.to_vec();
        let document = serde_json::json!({
            "format": 1, "sensor": scan.sensor, "scene": scan.seen.as_ref().map(|seen| &seen.scene),
            "world_from_sensor": scan.seen.as_ref().map(rows), "settings": settings,
            "beams": beams, "points": points, "median_range_m": median_m, "farthest_m": farthest_m,
        });
        return exit::json(&document);
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
