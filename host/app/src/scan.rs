//! `echoloop scan`.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use clap::{Args, ValueHint};
use echoloop_dsp::ScanPattern;
use echoloop_frontend::SceneResponse;
use nalgebra::{Translation3, UnitQuaternion};

use super::cloud_output::{CloudOutput, format_parser, other_endings, outputs, tell, wrote};
use super::common::{Setup, on_threads};
use super::exit::{self, Failure};
use super::progress::Progress;
use super::scan_along::{Along, scan_along};
use echoloop_closed_loop::beams::Beams;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::source::Source;
use echoloop_closed_loop::dataset::{Dataset, Place, place, respond_at, single_viewpoint};
use echoloop_closed_loop::prepared::ConfiguredSensor;
use echoloop_closed_loop::scan_folder::with_points;
use echoloop_clouds::pose::{Pose, to_rows};
use echoloop_clouds::{CloudFormat, Recorded};
use echoloop_sensors::pattern::document;
use echoloop_sensors::sensor::Model;

/// Flags of `scan`.
#[derive(Clone, Debug, Args)]
pub(crate) struct ScanArgs {
    #[command(flatten)]
    setup: Setup,
    #[arg(short, long, value_name = "FILE", help = format!(
        "Where to write the cloud (sensor frame, m), with all that the sensor tells of each point: \
         {}. With --trajectory a folder to make",
        outputs()
    ))]
    output: Option<PathBuf>,
    /// Format of the cloud [default: that of the file's name, else ply].
    #[arg(long, value_parser = format_parser(), requires = "output")]
    format: Option<CloudFormat>,
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with = "pose",
          help = format!(
        "Scans along poses: a file of lines `time x y z qx qy qz qw` (TUM; s, m) or of KITTI's \
         twelve numbers, world from sensor. The folder of -o gets NNNNNN.ply (or {}) for each pose \
         000000, 000001, …; poses.txt, as KITTI has them; times.txt, if there are times; \
         config.toml",
        other_endings()
    ))]
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
    let output = args.output.as_ref().map(at).transpose()?; // before the long tracing
    on_threads(args.setup.common.threads, || scan(args, &config, output.as_ref()))?
}

/// A scan, and the view that it was made from.
struct Scan {
    /// Name and firmware of the sensor.
    sensor: String,
    /// The scene and the sensor's pose in it; none for a real sensor on a serial line.
    seen: Option<Seen>,
    settings: u32,
    /// Scan pattern with the aim of the settings.
    pattern: ScanPattern,
    recorded: Recorded,
}

/// A view of a scene.
struct Seen {
    scene: String,
    world_from_sensor: Pose,
    response: Arc<SceneResponse>,
}

fn scan(args: &ScanArgs, config: &RunConfig, output: Option<&CloudOutput>) -> Result<(), Failure> {
    let sensors = args.setup.sensor.sensors(Model::from(config))?;
    let sensor = ConfiguredSensor::new(config, sensors, &|_| ())?;
    let (seen, beams) = match Source::of(&config.scene.source) {
        Source::Recording(_) => recorded(args, config)?,
        _ => {
            let beams = config.scanner.beams();
            let aimed = beams.aimed(&sensor.start.settings).map_err(Failure::usage)?.into_owned();
            (seen(args, config, &aimed)?, aimed)
        }
    };
    let response = seen.as_ref().map_or_else(Arc::default, |seen| Arc::clone(&seen.response));
    let (settings, recorded) = sensor.scan(config, &beams, &response)?;
    let recorded = with_points(recorded, || "detection".into())?;
    if let Some(output) = output {
        output.write(&recorded)?;
    }
    let (sensor, pattern) = (sensor.name, *beams.pattern());
    let scan = Scan { sensor, seen, settings, pattern, recorded };
    tell(output, &args.setup.common, &output_text(args, &scan)?)
}

/// The first recorded scan of the training pairs, and its beams.
fn recorded(args: &ScanArgs, config: &RunConfig) -> Result<(Option<Seen>, Beams), Failure> {
    if args.pose.is_some() || args.setup.sensor.is_turned_by_others() {
        let why = "recorded scans are seen from where they were made, by a sensor of ours alone";
        return Err(Failure::usage(format!("--scene: {why}")));
    }
    let dataset = Dataset::build(config, &|_, _| {})?;
    let seen = dataset.train.first().map(|pair| Seen {
        scene: pair.place.clone(),
        world_from_sensor: pair.world_from_sensor[0],
        response: pair.first.to(&dataset.beams),
    });
    Ok((seen, dataset.beams))
}

/// The view that the sensor is given; none for a real sensor on a serial line.
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
    let place = Arc::new(place(config, town)?);
    let world_from_sensor = match &args.pose {
        Some(numbers) => pose(numbers)?,
        None => first_viewpoint(config, &place, town, args.setup.common.quiet)?,
    };
    let response = Arc::new(respond_at(config, &place, &world_from_sensor, 1, beams));
    Ok(Some(Seen { scene: place.scene.name.clone(), world_from_sensor, response }))
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

/// Viewpoint of the first pair, or a single viewpoint where no pair fits.
fn first_viewpoint(
    config: &RunConfig,
    place: &Place,
    town: u64,
    quiet: bool,
) -> Result<Pose, Failure> {
    let progress = Progress::new(quiet);
    progress.begin("viewpoint", 2000);
    let found = single_viewpoint(config, place, town, &|tried| progress.at(tried as u64));
    if let Ok((_, remarks)) = &found {
        remarks.iter().for_each(|remark| progress.say(remark));
    }
    progress.end();
    Ok(found?.0)
}

/// The text to print: JSON with `--json`, else lines.
fn output_text(args: &ScanArgs, scan: &Scan) -> Result<String, Failure> {
    let points = &scan.recorded.cloud.points;
    let ranges: Vec<f64> = points.iter().map(|p| f64::from(p.coords.norm())).collect();
    let median_m = echoloop_statistics::median(ranges.iter().copied());
    let farthest_m = ranges.iter().copied().fold(0.0, f64::max);
    let (pattern, points) = (&scan.pattern, ranges.len());
    let (settings, beams) = (format!("{:#010x}", scan.settings), pattern.beams());
    if args.setup.common.json {
        let rows = |seen: &Seen| to_rows(&seen.world_from_sensor).as_chunks::<4>().0.to_vec();
        let document = serde_json::json!({
            "format": 1, "sensor": scan.sensor, "scene": scan.seen.as_ref().map(|seen| &seen.scene),
            "world_from_sensor": scan.seen.as_ref().map(rows), "settings": settings,
            "beams": beams, "pattern": document(pattern), "points": points,
            "median_range_m": median_m, "farthest_m": farthest_m,
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
        "{points} points of {beams} beams, {pattern}; median range {median_m:.1} m, farthest \
         {farthest_m:.1} m"
    );
    Ok(text + &wrote(&args.setup.common, &args.output))
}
