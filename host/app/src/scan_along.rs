//! `echoloop scan --trajectory`.

use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use super::common::Setup;
use super::exit::{self, Failure, print};
use super::interrupt::stop_on_interrupt;
use super::pairs::check_free;
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::place;
use echoloop_closed_loop::prepared::ConfiguredSensor;
use echoloop_closed_loop::run_folder::atomic_folder::AtomicFolder;
use echoloop_closed_loop::scan_folder::trajectory::Trajectory;
use echoloop_closed_loop::search::Observer;
use echoloop_clouds::CloudFormat;
use echoloop_clouds::pose::read_trajectory;
use echoloop_sensors::sensor::Model;

/// Flags of `scan --trajectory`.
pub(super) struct Along<'a> {
    pub(super) setup: &'a Setup,
    /// The file of poses.
    pub(super) trajectory: &'a Path,
    /// The folder to make.
    pub(super) output: Option<&'a Path>,
    pub(super) format: CloudFormat,
}

/// Scans the first town from every pose of a file.
pub(super) fn scan_along(args: &Along<'_>, config: &RunConfig) -> Result<(), Failure> {
    let Along { setup, trajectory, output, format } = *args;
    if setup.sensor.is_turned_by_others() {
        return Err(Failure::usage(
            "--trajectory: a sensor on a serial line looks where it stands",
        ));
    }
    let poses = read_trajectory(trajectory).map_err(Failure::usage)?;
    if let Some(folder) = output {
        if folder == Path::new("-") || CloudFormat::of(folder).is_some() {
            let named = folder.display();
            return Err(Failure::usage(format!(
                "--output {named}: with --trajectory expected a folder to make (--format says what \
                 the clouds are)"
            )));
        }
        check_free(folder)?; // now: the scans take long
    }
    let sensors = setup.sensor.sensors(Model::from(config))?;
    let sensor = ConfiguredSensor::new(config, sensors, &|_| ())?;
    let beams = config.scanner.beams();
    let along = Trajectory {
        config,
        file: trajectory,
        poses: &poses,
        beams: beams.aimed(&sensor.start.settings).map_err(Failure::usage)?.into_owned(),
        sensor,
        place: Arc::new(place(config, config.scene.towns[0])?),
    };
    let folder = output.map(AtomicFolder::new).transpose()?;
    let progress = Progress::new(setup.common.quiet);
    progress.begin("scans", poses.len() as u64);
    let done = || progress.evaluated();
    let made = along.scan_all((folder.as_ref(), format), &stop_on_interrupt(), &done);
    progress.end();
    let scans = made?;
    if let Some(folder) = folder {
        along.finish(folder)?;
    }
    print_scans(args, &along, &scans)
}

fn print_scans(args: &Along<'_>, along: &Trajectory<'_>, scans: &[Value]) -> Result<(), Failure> {
    let (sensor, scene) = (&along.sensor.name, &along.place.scene.name);
    if args.setup.common.json {
        let document = json!({"format": 1, "sensor": sensor, "scene": scene, "scans": scans});
        return exit::print_json(&document);
    }
    let points: u64 = scans.iter().filter_map(|scan| scan["points"].as_u64()).sum();
    let mut text = format!(
        "{} scans of {scene} along {}, {points} points\n",
        scans.len(),
        along.file.display()
    );
    if let Some(folder) = args.output {
        text += &format!("wrote {}\n", folder.display());
    }
    print(&text)
}
