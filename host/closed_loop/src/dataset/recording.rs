//! Recorded scans as pairs: a folder of scans of CARLA's semantic LiDAR, with poses.
//!
//! ```text
//! FOLDER/*.ply             one a scan, in the order of their names
//! FOLDER/poses.txt         a pose a scan: TUM or KITTI, right-handed, z up
//! FOLDER/transforms.json   or instead: CARLA's own poses, left-handed, degrees
//! ```
//!
//! Each point is a beam of its own, so beams differ from scan to scan; the sensor's other beams see
//! nothing. The first part of the path is tuned on. The rest is judged on where it is 10 m from
//! every scan tuned on, so that a path that returns is not judged where it was tuned.

mod poses;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use echoloop_clouds::pose::{Pose, relative};
use echoloop_files::{one_line, printable, read_data};
use echoloop_frontend::SceneResponse;
use echoloop_sim::import::{Seen, parse_semantic};
use nalgebra::{Point3, Vector3};
use thiserror::Error;

use super::pairs::{Dataset, ScanPair, viewpoints};
use super::response::Response;
use crate::beams::Beams;
use crate::config::RunConfig;

/// Most distance between the scans of a pair, in baselines.
const FARTHEST: f64 = 2.0;
/// Edge of the cubes in which points of two scans count as shared, m.
const CELL_M: f64 = 1.0;
/// Least distance from a scan judged on to any tuned on, seen from above, m.
const APART_M: f64 = 10.0;

/// Unusable recording.
#[derive(Debug, Error)]
#[error("{}: {what}", path.display())]
pub struct RecordingError {
    path: PathBuf,
    what: String,
}

/// Pairs of a recording.
///
/// # Errors
///
/// [`RecordingError`] says what is wrong with which file, or that the path has too few pairs.
pub(super) fn load(
    folder: &Path,
    config: &RunConfig,
    beams: Beams,
    progress: &dyn Fn(f64, &str),
) -> Result<Dataset, RecordingError> {
    let drive = Drive::read(folder, config, &beams, progress)?;
    let [train, test] = drive.pairs(config).map_err(|what| fail(folder, what))?;
    let scans = [&train[..], &test[..]].concat();
    let of_viewpoints = scans.iter().flatten().map(|&at| Arc::clone(&drive.scans[at].directions));
    let beams = beams.recorded(of_viewpoints.collect());
    let pair = |number: usize, [first, second]: [usize; 2]| {
        let (from_first, from_second) = (drive.poses[first], drive.poses[second]);
        ScanPair {
            place: drive.name.clone(),
            truth: relative(&from_first, &from_second),
            world_from_sensor: [from_first, from_second],
            first: Response::Fixed(Arc::clone(&drive.scans[first].response)),
            second: Response::Fixed(Arc::clone(&drive.scans[second].response)),
            viewpoints: viewpoints(number),
            overlap: drive.overlap(first, second),
        }
    };
    let tune_on = train.iter().enumerate().map(|(number, &at)| pair(number, at)).collect();
    let judge_on = test.iter().enumerate().map(|(number, &at)| pair(train.len() + number, at));
    let judge_on = judge_on.collect();
    progress(1.0, "");
    Ok(Dataset { beams, train: tune_on, test: judge_on, check: Vec::new(), triangles: 0 })
}

fn fail(path: &Path, what: impl Into<String>) -> RecordingError {
    RecordingError { path: path.to_owned(), what: what.into() }
}

/// Recorded scan.
struct Scan {
    /// Unit vectors of the sensor's beams; those without a point look ahead.
    directions: Arc<Vec<Vector3<f32>>>,
    response: Arc<SceneResponse>,
    /// Cubes that hold points, in the world frame; below, the cube of each point.
    cells: HashSet<[i32; 3]>,
    points: Vec<[i32; 3]>,
}

/// Recorded scans along a path.
struct Drive {
    name: String,
    poses: Vec<Pose>,
    scans: Vec<Scan>,
}

impl Drive {
    fn read(
        folder: &Path,
        config: &RunConfig,
        beams: &Beams,
        progress: &dyn Fn(f64, &str),
    ) -> Result<Self, RecordingError> {
        if !config.motion.is_still() {
            return Err(fail(folder, "motion moves a sensor that is traced, not one recorded"));
        }
        let files = files(folder)?;
        let poses = poses::read(folder).map_err(|(path, what)| fail(&path, what))?;
        if poses.len() != files.len() {
            let (poses, files) = (poses.len(), files.len());
            return Err(fail(folder, format!("has {poses} poses for {files} scans (*.ply)")));
        }
        let tags = config.scene.tags().map_err(|error| fail(folder, error.to_string()))?;
        let name = folder.file_name().unwrap_or(folder.as_os_str()).to_string_lossy();
        let read = |(at, (file, pose)): (usize, (&PathBuf, &Pose))| {
            progress(at as f64 / files.len() as f64, &printable(&file.to_string_lossy()));
            let bytes =
                read_data(file).map_err(|error| fail(file, format!("cannot be read: {error}")))?;
            let seen = parse_semantic(&bytes, tags).map_err(|what| fail(file, one_line(&what)))?;
            Scan::new(&seen, pose, beams.pattern().beams() as usize)
                .map_err(|what| fail(file, what))
        };
        let scans = files.iter().zip(&poses).enumerate().map(read).collect::<Result<_, _>>()?;
        Ok(Self { name: name.into_owned(), poses, scans })
    }

    /// Pairs of scans to tune on and to judge on; no scan is in both. The path is cut in proportion
    /// to the numbers of pairs.
    fn pairs(&self, config: &RunConfig) -> Result<[Vec<[usize; 2]>; 2], String> {
        let data = &config.data;
        let (train, test) = (data.train_pairs, data.test_pairs);
        let cut = self.poses.len() * train / (train + test).max(1);
        let cut = cut.clamp(self.poses.len().min(2), self.poses.len().saturating_sub(2).max(2));
        let of = |key: &str, from: usize, to: usize, count: usize, others: &[usize]| {
            let mut found = self.candidates(config, from, to.min(self.poses.len()));
            found.retain(|pair| pair.iter().all(|&scan| self.is_apart(scan, others)));
            let far = match others.is_empty() {
                true => String::new(),
                false => format!(", {APART_M} m and more from those that are tuned on"),
            };
            if found.len() < count {
                let (scans, found) = (self.poses.len(), found.len());
                let baseline_m = data.hard_baseline_m();
                return Err(format!(
                    "{key} = {count}, but of its {scans} scans {found} have a partner \
                     {baseline_m} to {} m on{far}: ask for fewer pairs, or change data.baseline_m",
                    FARTHEST * baseline_m
                ));
            }
            Ok((0..count).map(|k| found[k * found.len() / count]).collect::<Vec<_>>())
        };
        let tuned_on = of("data.train_pairs", 0, cut, train, &[])?;
        let others = tuned_on.as_flattened();
        let judged_on = of("data.test_pairs", cut, self.poses.len(), test, others)?;
        Ok([tuned_on, judged_on])
    }

    /// True when a scan is [`APART_M`] or more from all others.
    fn is_apart(&self, scan: usize, others: &[usize]) -> bool {
        let at = |scan: usize| self.poses[scan].translation.vector.xy();
        others.iter().all(|&other| (at(scan) - at(other)).norm() >= APART_M)
    }

    /// Each scan of a part of the path with the next one that is a baseline away.
    fn candidates(&self, config: &RunConfig, from: usize, to: usize) -> Vec<[usize; 2]> {
        let baseline_m = config.data.hard_baseline_m();
        let apart = |a: usize, b: usize| {
            (self.poses[a].translation.vector - self.poses[b].translation.vector).norm()
        };
        let partner = |first: usize| {
            let second = (first + 1..to).find(|&second| apart(first, second) >= baseline_m)?;
            let is_near = baseline_m == 0.0 || apart(first, second) <= FARTHEST * baseline_m;
            let is_wanted = || config.data.wants(self.overlap(first, second));
            (is_near && is_wanted()).then_some([first, second])
        };
        (from..to).filter_map(partner).collect()
    }

    /// Share of the points of both scans with a point of the other in the same cube of 1 m.
    fn overlap(&self, first: usize, second: usize) -> f64 {
        let (a, b) = (&self.scans[first], &self.scans[second]);
        let shared = |of: &Scan, with: &Scan| {
            of.points.iter().filter(|cell| with.cells.contains(*cell)).count()
        };
        let seen = a.points.len() + b.points.len();
        (shared(a, b) + shared(b, a)) as f64 / seen.max(1) as f64
    }
}

/// Scan files of a folder, sorted by name.
fn files(folder: &Path) -> Result<Vec<PathBuf>, RecordingError> {
    let listed = std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, _>>());
    let mut files = listed.map_err(|error| fail(folder, format!("cannot be read: {error}")))?;
    files.retain(|path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply")));
    files.sort();
    match files.is_empty() {
        true => Err(fail(folder, "holds no scan: expected *.ply and poses.txt or transforms.json")),
        false => Ok(files),
    }
}

impl Scan {
    fn new(seen: &[Seen], world_from_sensor: &Pose, beams: usize) -> Result<Self, String> {
        if seen.len() > beams {
            let points = seen.len();
            return Err(format!(
                "holds {points} points, more than the sensor's {beams} beams: choose a \
                 scanner.pattern of as many, or scanner.columns and scanner.rows"
            ));
        }
        if seen.iter().all(|point| point.echo.is_none()) {
            return Err("holds no point".into());
        }
        let mut directions: Vec<Vector3<f32>> = seen.iter().map(|s| s.direction.into()).collect();
        directions.resize(beams, Vector3::x());
        let mut response =
            SceneResponse { beams: vec![0], returns: Vec::new(), ..SceneResponse::default() };
        for beam in 0..beams {
            response.returns.extend(seen.get(beam).and_then(|seen| seen.echo));
            response.beams.push(response.returns.len() as u32);
        }
        let cell = |seen: &Seen| {
            let [x, y, z] = seen.direction.map(f64::from);
            let point = Point3::from(Vector3::new(x, y, z) * f64::from(seen.echo?.range_m));
            Some((world_from_sensor * point).coords.map(|v| (v / CELL_M).floor() as i32).into())
        };
        let points: Vec<[i32; 3]> = seen.iter().filter_map(cell).collect();
        let cells = points.iter().copied().collect();
        let (directions, response) = (Arc::new(directions), Arc::new(response));
        Ok(Self { directions, response, cells, points })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::fmt::Write as _;
    use std::fs;

    use super::*;

    const HEADER: &str = "format ascii 1.0\nproperty float32 x\nproperty float32 y\n\
        property float32 z\nproperty float32 CosAngle\nproperty uint32 ObjIdx\n\
        property uint32 ObjTag\nend_header\n";

    /// Scan of a wall 10 m to the left of a path along x, a point a metre.
    fn scan(at_m: f64, points: usize) -> String {
        let header = HEADER.replace("1.0\n", &format!("1.0\nelement vertex {points}\n"));
        let mut text = format!("ply\n{header}");
        for k in 0..points {
            let x = k as f64 + 0.3 - points as f64 / 2.0 - at_m % 1.0;
            let cos = 10.4 / (x * x + 108.16).sqrt();
            let _ = writeln!(text, "{x} -10.4 0.5 {cos} {k} 3");
        }
        text
    }

    /// Recording of scans 1 m apart.
    fn recording(scans: usize) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let mut poses = String::new();
        for k in 0..scans {
            fs::write(folder.path().join(format!("{k:06}.ply")), scan(k as f64, 40)).unwrap();
            let _ = writeln!(poses, "{k} {k} 0 2 0 0 0 1");
        }
        fs::write(folder.path().join("poses.txt"), poses).unwrap();
        folder
    }

    fn config(folder: &Path, train_pairs: usize, test_pairs: usize) -> RunConfig {
        let mut config = RunConfig::default();
        config.scene.source = folder.to_string_lossy().into_owned();
        (config.data.train_pairs, config.data.test_pairs) = (train_pairs, test_pairs);
        config
    }

    fn build(config: &RunConfig) -> Result<Dataset, String> {
        Dataset::build(config, &|_, _| {}).map_err(|error| error.to_string())
    }

    #[test]
    fn pairs_of_a_recording_are_a_baseline_apart_and_share_no_scan_between_splits() {
        let folder = recording(30);
        let dataset = build(&config(folder.path(), 4, 8)).unwrap();
        assert_eq!((dataset.train.len(), dataset.test.len()), (4, 8));
        let all = || dataset.train.iter().chain(&dataset.test);
        for pair in all() {
            assert!((pair.truth.translation.vector - Vector3::new(2.0, 0.0, 0.0)).norm() < 1e-9);
            assert!(pair.overlap > 0.5 && pair.overlap <= 1.0, "{}", pair.overlap);
        }
        let at = |pair: &ScanPair| pair.world_from_sensor.map(|pose| pose.translation.x);
        let last = dataset.train.iter().flat_map(at).fold(0.0, f64::max);
        let first = dataset.test.iter().flat_map(at).fold(f64::INFINITY, f64::min);
        assert!(first - last >= 10.0, "{last} {first}");
    }

    #[test]
    fn each_point_is_a_beam_of_its_own_viewpoint() {
        let folder = recording(20);
        let dataset = build(&config(folder.path(), 1, 2)).unwrap();
        let directions = dataset.beams.directions(1);
        assert_eq!(directions.len(), dataset.beams.pattern().beams() as usize);
        let first = dataset.train[0].first.to(&dataset.beams);
        assert_eq!((first.len(), first.returns.len()), (directions.len(), 40));
        let point = directions[5] * first.of(5)[0].range_m;
        assert!((point - Vector3::new(-14.7, 10.4, 0.5)).norm() < 1e-5, "{point}");
        assert!(first.of(40).is_empty());
    }

    #[test]
    fn an_unusable_recording_is_refused_by_file_and_reason() {
        let said = |change: &dyn Fn(&Path, &mut RunConfig)| {
            let folder = recording(20);
            let mut config = config(folder.path(), 1, 2);
            change(folder.path(), &mut config);
            build(&config).unwrap_err()
        };
        type Change = Box<dyn Fn(&Path, &mut RunConfig)>;
        let write = |name: &'static str, text: String| -> Change {
            Box::new(move |folder, _| fs::write(folder.join(name), &text).unwrap())
        };
        let remove = |name: &'static str| -> Change {
            Box::new(move |folder, _| fs::remove_file(folder.join(name)).unwrap())
        };
        let table: Vec<(Change, &str)> = vec![
            (
                write("000003.ply", scan(3.0, 40).replace(" 3\n", " 77\n")),
                "000003.ply: point 0: ObjTag 77",
            ),
            (write("000003.ply", scan(3.0, 40)[..400].into()), "000003.ply: "),
            (write("000003.ply", scan(3.0, 0)), "holds no point"),
            (write("000003.ply", scan(3.0, 40).replace("CosAngle", "I")), "found no CosAngle"),
            (remove("000019.ply"), "has 20 poses for 19 scans"),
            (remove("poses.txt"), "poses.txt or transforms.json"),
            (write("poses.txt", "0 0 0 0 0 0 0 2\n".into()), "poses.txt:1: expected a quaternion"),
            (write("transforms.json", "[]".into()), "both"),
            (
                Box::new(|_, config| config.data.train_pairs = 50),
                "data.train_pairs = 50, but of its 20",
            ),
            (Box::new(|_, config| config.data.baseline_m = 40.0), "data.baseline_m"),
            (Box::new(|_, config| config.motion.jitter_mm = 1.0), "motion"),
            (
                Box::new(|_, config| {
                    (config.scanner.columns, config.scanner.rows) = (Some(13), Some(3))
                }),
                "40 points, more than the sensor's 39 beams",
            ),
        ];
        for (change, expected) in table {
            let said = said(&change);
            assert!(said.contains(expected), "{said}");
        }
    }
}
