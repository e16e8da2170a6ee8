//! Folder of scans along a trajectory: a cloud for each pose, the poses, their times.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::{ScanError, go_on, with_points};
use crate::beams::Beams;
use crate::config::RunConfig;
use crate::dataset::{Place, respond_at};
use crate::evaluation::scan_cloud::recorded_from_scan;
use crate::prepared::ConfiguredSensor;
use crate::run_folder::atomic_folder::AtomicFolder;
use crate::run_folder::files::FileError;
use crate::seed::scan_noise;
use echoloop_clouds::pose::{Stamped, to_kitti, to_rows};
use echoloop_clouds::{CloudFormat, Recorded};
use echoloop_sensors::sensor::View;

/// Scans that are made before they are written, so that a long trajectory takes no more memory.
const AT_A_TIME: usize = 16;

/// A sensor that is carried through a place.
pub struct Trajectory<'a> {
    /// The configuration.
    pub config: &'a RunConfig,
    /// The file of poses, for messages.
    pub file: &'a Path,
    /// Its poses.
    pub poses: &'a [Stamped],
    /// The place.
    pub place: Arc<Place>,
    /// The sensor.
    pub sensor: ConfiguredSensor,
    /// Its beams, aimed by the start.
    pub beams: Beams,
}

impl Trajectory<'_> {
    /// Scans from every pose, writes the clouds where there is a folder, and lists the scans.
    /// `done` hears of each.
    ///
    /// # Errors
    ///
    /// [`ScanError`] of the first scan that fails.
    pub fn scan_all(
        &self,
        (folder, format): (Option<&AtomicFolder>, CloudFormat),
        stop: &AtomicBool,
        done: &(dyn Fn() + Sync),
    ) -> Result<Vec<Value>, ScanError> {
        let mut listed = Vec::new();
        for poses in self.poses.chunks(AT_A_TIME) {
            let first = listed.len();
            let scan_one = |(i, at)| {
                go_on(stop)?;
                let scan = self.scan(first + i, at);
                done();
                scan
            };
            let scans: Result<Vec<Recorded>, ScanError> =
                poses.par_iter().enumerate().map(scan_one).collect();
            for (at, Recorded { cloud, columns, .. }) in poses.iter().zip(scans?) {
                let file = format!("{:06}.{}", listed.len(), format.name());
                if let Some(folder) = folder {
                    folder.write(&file, format.bytes(&cloud, &columns))?;
                }
                let rows = to_rows(&at.pose);
                listed.push(json!({
                    "file": folder.map(|_| file), "time_s": at.time_s,
                    "points": cloud.points.len(),
                    "world_from_sensor": rows.chunks(4).collect::<Vec<_>>(),
                }));
            }
        }
        Ok(listed)
    }

    /// Scan from a pose, whose index is from 0; the scan's number is from 1.
    fn scan(&self, index: usize, at: &Stamped) -> Result<Recorded, ScanError> {
        let Self { config, place, sensor, beams, .. } = self;
        let number = index as u32 + 1;
        let response = Arc::new(respond_at(config, place, &at.pose, number, beams));
        let noise_seed = scan_noise(config.seed);
        let view = View { scene: &response, noise_seed, scan: number, viewpoint: number };
        let scan = sensor.sensors.with(|one| {
            one.configure(&sensor.start.settings)?;
            one.scan(&view)
        })?;
        let recorded =
            recorded_from_scan(&scan, beams, number, config.motion.scan_s(beams.pattern()));
        with_points(recorded, || format!("{}:{}", self.file.display(), at.line))
    }

    /// Writes `poses.txt` as KITTI has them, `times.txt` if there are times, and `config.toml`;
    /// then gives the folder its name.
    pub fn finish(&self, folder: AtomicFolder) -> Result<(), FileError> {
        folder.write("poses.txt", to_kitti(self.poses.iter().map(|at| &at.pose)))?;
        let times: String =
            self.poses.iter().filter_map(|at| Some(format!("{}\n", at.time_s?))).collect();
        if !times.is_empty() {
            folder.write("times.txt", times)?;
        }
        folder.write_toml("config.toml", self.config)?;
        folder.finish()
    }
}
