//! `echoloop scan --trajectory`.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::atomic_folder::{Draft, check_free, go_on};
use super::common::Setup;
use super::configured_sensor::Ready;
use super::exit::{self, Failure, print};
use super::interrupt::stop_on_interrupt;
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::{Place, place, respond_at};
use echoloop_closed_loop::evaluation::scan_cloud::recorded_from_scan;
use echoloop_closed_loop::search::Observer;
use echoloop_closed_loop::seed::scan_noise;
use echoloop_registration::cloud::{CloudFormat, Recorded};
use echoloop_registration::pose::{Stamped, read_trajectory, to_rows};
use echoloop_sensors::sensor::View;

/// Scans that are made before they are written, so that a long way takes no more memory.
const AT_A_TIME: usize = 16;

/// What is asked for.
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
    let Along { trajectory, output, format, .. } = *args;
    if args.setup.sensor.is_turned_by_others() {
        return Err(Failure::usage(
            "--trajectory: a sensor on a serial line looks where it stands",
        ));
    }
    let stamped = read_trajectory(trajectory).map_err(Failure::usage)?;
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
    let ready = Ready::new(args.setup, config)?;
    let place = place(config, config.scene.towns[0])?;
    let way = Way { config, trajectory, place, ready };
    let draft = output.map(Draft::beside).transpose()?;
    let progress = Progress::new(args.setup.common.quiet);
    progress.begin("scans", stamped.len() as u64);
    let made = way.scan_all(&stamped, (draft.as_ref(), format), &progress, &stop_on_interrupt());
    progress.end();
    let scans = made?;
    if let (Some(draft), Some(folder)) = (draft, output) {
        way.finish(draft, folder, &stamped)?;
    }
    told(args, &way, &scans)
}

/// What is scanned with what.
struct Way<'a> {
    config: &'a RunConfig,
    trajectory: &'a Path,
    place: Place,
    ready: Ready,
}

impl Way<'_> {
    /// Scans, writes, and lists what was written.
    fn scan_all(
        &self,
        stamped: &[Stamped],
        (draft, format): (Option<&Draft>, CloudFormat),
        progress: &Progress,
        stop: &AtomicBool,
    ) -> Result<Vec<Value>, Failure> {
        let mut listed = Vec::new();
        for poses in stamped.chunks(AT_A_TIME) {
            let first = listed.len();
            let scans: Result<Vec<Recorded>, Failure> = poses
                .par_iter()
                .enumerate()
                .map(|(i, at)| {
                    go_on(stop)?;
                    let scan = self.scan(first + i, at);
                    progress.evaluated();
                    scan
                })
                .collect();
            for (at, Recorded { cloud, columns, .. }) in poses.iter().zip(scans?) {
                let file = format!("{:06}.{}", listed.len(), format.name());
                if let Some(draft) = draft {
                    draft.write(&file, format.bytes(&cloud, &columns))?;
                }
                let rows = to_rows(&at.pose);
                listed.push(json!({
                    "file": draft.map(|_| file), "time_s": at.time_s,
                    "points": cloud.points.len(),
                    "world_from_sensor": rows.chunks(4).collect::<Vec<_>>(),
                }));
            }
        }
        Ok(listed)
    }

    /// The scan of a pose: number 1 is the first.
    fn scan(&self, index: usize, at: &Stamped) -> Result<Recorded, Failure> {
        let Self { config, place, ready, .. } = self;
        let Ready { sensors, settings, beams, .. } = ready;
        let number = index as u32 + 1;
        let response = Arc::new(respond_at(config, place, &at.pose, number, beams));
        let noise_seed = scan_noise(config.seed);
        let view = View { scene: &response, noise_seed, scan: number, viewpoint: number };
        let scan = sensors.with(|sensor| {
            sensor.configure(settings)?;
            sensor.scan(&view)
        })?;
        let duration_s = config.motion.duration_s;
        let recorded = recorded_from_scan(&scan, beams, number, duration_s);
        if recorded.cloud.points.is_empty() {
            return Err(Failure::run(format!(
                "{}:{}: no beam returned an echo (is the sensor inside something, or too weak?)",
                self.trajectory.display(),
                at.line
            )));
        }
        Ok(recorded)
    }

    fn finish(&self, draft: Draft, folder: &Path, stamped: &[Stamped]) -> Result<(), Failure> {
        let line =
            |row: &[f64]| row.iter().map(f64::to_string).collect::<Vec<_>>().join(" ") + "\n";
        let poses: String = stamped.iter().map(|at| line(&to_rows(&at.pose)[..12])).collect();
        draft.write("poses.txt", poses)?;
        let times: String = stamped.iter().filter_map(|at| Some(line(&[at.time_s?]))).collect();
        if !times.is_empty() {
            draft.write("times.txt", times)?;
        }
        draft.write("config.toml", toml::to_string(self.config).map_err(Failure::run)?)?;
        Ok(draft.become_folder(folder)?)
    }
}

fn told(args: &Along<'_>, way: &Way<'_>, scans: &[Value]) -> Result<(), Failure> {
    let sensor = &way.ready.sensor;
    let scene = &way.place.scene.name;
    if args.setup.common.json {
        let document = json!({"format": 1, "sensor": sensor, "scene": scene, "scans": scans});
        return print(&exit::json(&document)?);
    }
    let points: u64 = scans.iter().filter_map(|scan| scan["points"].as_u64()).sum();
    let mut text = format!(
        "{} scans of {scene} along {}, {points} points\n",
        scans.len(),
        way.trajectory.display()
    );
    if let Some(folder) = args.output {
        text += &format!("wrote {}\n", folder.display());
    }
    print(&text)
}
