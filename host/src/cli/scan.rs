//! `echoloop scan`.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use echoloop_dsp::Hardware;
use echoloop_sim::board::PcSensor;
use echoloop_sim::viewpoint::{PairPlan, Split, sample_pairs};
use nalgebra::{Translation3, UnitQuaternion, Vector3};

use super::exit::Failure;
use super::{Common, ConfigSource, on_threads};
use crate::client::{Client, Patience};
use crate::cloud::{Cloud, write_ply};
use crate::config::Config;
use crate::dataset::{DatasetError, place, respond};
use crate::frontend::WaveformFrontEnd;
use crate::params::Parameters;
use crate::pose::Pose;
use crate::seed::{Purpose, derive};
use crate::transport::InProcess;

/// Flags of `scan`.
#[derive(Clone, Debug, Args)]
pub(crate) struct ScanArgs {
    #[command(flatten)]
    source: ConfigSource,
    #[command(flatten)]
    common: Common,
    /// Where to write the cloud (PLY, sensor frame, m).
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Pose of the sensor: x y z in m, yaw pitch roll in degrees [default: the first training viewpoint].
    #[arg(long, num_args = 6, allow_negative_numbers = true, value_names = ["X", "Y", "Z", "YAW", "PITCH", "ROLL"])]
    pose: Option<Vec<f64>>,
}

pub(super) fn run(args: &ScanArgs) -> Result<(), Failure> {
    let config = args.source.load(Vec::new())?;
    on_threads(args.common.threads, || scan(args, &config))?
}

fn scan(args: &ScanArgs, config: &Config) -> Result<(), Failure> {
    let hardware = Hardware { adc_bits: config.receiver.adc_bits, ..Hardware::REFERENCE };
    let parameters = Parameters::start(config, &hardware).map_err(Failure::usage)?;
    let town = config.scene.towns[0];
    let place = place(config, town)?;
    let pose = match &args.pose {
        Some(numbers) => pose(numbers)?,
        None => first_viewpoint(config, &place, town)?,
    };
    let pattern = config.scanner.pattern();
    let directions: Vec<Vector3<f32>> = (0..pattern.beams()).map(|beam| pattern.direction(beam)).collect();
    let response = Arc::new(respond(config, &place, &pose, &directions));
    let front_end =
        WaveformFrontEnd::new(config.receiver.clone(), response, derive(config.seed, Purpose::TestNoise, 0));
    let sensor = PcSensor::new(front_end, pattern, hardware);
    let mut client = Client::connect(InProcess(sensor), Patience::default())?;
    let hash = client.configure(&parameters.settings)?;
    let scan = client.scan(1)?;
    let echoes = scan.iter().zip(&directions);
    let points = echoes.flat_map(|(echoes, d)| echoes.iter().map(move |echo| echoloop_dsp::project::point_m(d, echo)));
    let cloud = Cloud::new(points.collect());
    if cloud.points.is_empty() {
        return Err(Failure::run("detection: no beam returned an echo (is the sensor inside something, or too weak?)"));
    }
    if let Some(path) = &args.output {
        write_ply(path, &cloud).map_err(Failure::usage)?;
    }
    print(args, &place.scene.name, &pose, hash, pattern.beams(), &cloud)
}

fn pose(numbers: &[f64]) -> Result<Pose, Failure> {
    let &[x, y, z, yaw, pitch, roll] = numbers else { return Err(Failure::usage("--pose takes six numbers")) };
    if numbers.iter().any(|v| !v.is_finite()) {
        return Err(Failure::usage(format!("--pose {numbers:?}: every number must be finite")));
    }
    let rotation = UnitQuaternion::from_euler_angles(roll.to_radians(), pitch.to_radians(), yaw.to_radians());
    Ok(Pose::from_parts(Translation3::new(x, y, z), rotation))
}

fn first_viewpoint(config: &Config, place: &crate::dataset::Place, town: u64) -> Result<Pose, Failure> {
    let plan = PairPlan {
        count: 1,
        baseline_m: config.data.baseline_m,
        heading_range_deg: config.data.heading_range_deg,
        tilt_range_deg: config.data.tilt_range_deg,
        height_m: config.scanner.height_m,
        seed: derive(config.seed, Purpose::TrainPoses, town),
        split: Split::Train,
    };
    let pairs = sample_pairs(&place.scene, &place.caster, &plan);
    let pairs = pairs.map_err(|source| DatasetError::Viewpoints { scene: place.scene.name.clone(), source })?;
    pairs.first().map(|pair| pair.world_from_first).ok_or_else(|| Failure::run("no viewpoint found"))
}

fn print(args: &ScanArgs, scene: &str, pose: &Pose, hash: u32, beams: u32, cloud: &Cloud) -> Result<(), Failure> {
    let ranges: Vec<f64> = cloud.points.iter().map(|p| f64::from(p.coords.norm())).collect();
    let median_m = crate::evaluate::median(ranges.iter().copied());
    let farthest_m = ranges.iter().copied().fold(0.0, f64::max);
    if args.common.json {
        let rows = crate::pose::to_rows(pose);
        let rows: Vec<&[f64]> = rows.chunks(4).collect();
        let document = serde_json::json!({
            "format": 1, "scene": scene, "world_from_sensor": rows, "settings": format!("{hash:#010x}"),
            "beams": beams, "points": cloud.points.len(), "median_range_m": median_m, "farthest_m": farthest_m,
        });
        println!("{}", serde_json::to_string_pretty(&document).map_err(Failure::run)?);
        return Ok(());
    }
    let at = pose.translation.vector;
    println!("{scene} from ({:.2}, {:.2}, {:.2}) m, settings {hash:#010x}", at.x, at.y, at.z);
    println!(
        "{} points of {beams} beams, median range {median_m:.1} m, farthest {farthest_m:.1} m",
        cloud.points.len()
    );
    if let Some(path) = &args.output {
        println!("wrote {}", path.display());
    }
    Ok(())
}
