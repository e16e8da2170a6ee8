//! Sequences of scans in KITTI's layout: where the scans lie, their poses, and the calibration.
//!
//! ```text
//! sequences/07/velodyne/000000.bin …   scans; or in the folder itself, in any format
//! sequences/07/calib.txt               a line Tr: camera_from_velodyne; may be missing
//! poses/07.txt                         world_from_camera of each scan; or sequences/07/poses.txt
//! ```
//!
//! Without `calib.txt` the poses are the scans' own, as `echoloop scan --trajectory` writes them.

use std::fs::canonicalize;
use std::io;
use std::path::{Path, PathBuf};

use echoloop_clouds::Pose;
use echoloop_clouds::pose::{from_rows, read_trajectory};
use echoloop_files::{FileError, MOST_TEXT, one_line, read_text};

use crate::list::{clouds, most_alike};

/// Folder of the scans in that of a sequence.
const SCANS: &str = "velodyne";
const POSES: &str = "poses.txt";
const CALIBRATION: &str = "calib.txt";

/// Files beside the scans whose ending may be that of a cloud.
const LISTS: [&str; 3] = [POSES, "times.txt", CALIBRATION];

/// Names of `camera_from_velodyne`, which differ from release to release.
const CAMERA_FROM_VELODYNE: [&str; 2] = ["Tr", "Tr_velo_to_cam"];

/// Scans of a folder in the order of their names: its own, else those in its `velodyne`. Of files
/// of several formats those of the most frequent one are the scans.
///
/// # Errors
///
/// The system's, of a folder that cannot be read.
pub(crate) fn scans(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut own = clouds(folder)?;
    own.retain(|path| !LISTS.iter().any(|list| path.ends_with(list)));
    let own = most_alike(own);
    let is_text = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("txt"));
    let inner = folder.join(SCANS);
    // Text beside a folder of scans is more of its lists.
    match own.iter().all(is_text) && inner.is_dir() {
        true => Ok(most_alike(clouds(&inner)?)),
        false => Ok(own),
    }
}

/// File of the poses of a folder's scans: its `poses.txt`, else KITTI's `../../poses/NN.txt`.
///
/// # Errors
///
/// [`FileError`] names both, when neither is there.
pub(crate) fn poses_file(folder: &Path) -> Result<PathBuf, FileError> {
    let sequence = sequence_of(folder);
    let (own, named) =
        (sequence.join(POSES), canonicalize(&sequence).map_err(FileError::io(folder))?);
    let name = named.file_name().unwrap_or_default().to_string_lossy();
    let of_all = sequence.join("../../poses").join(format!("{name}.txt"));
    let missing = || {
        let (own, of_all) = (own.display(), of_all.display());
        format!("expected a pose of each scan in {own} or {of_all}")
    };
    let found = [&own, &of_all].into_iter().find(|path| path.exists());
    found.cloned().ok_or_else(missing).map_err(FileError::content(folder))
}

/// Poses of a folder's scans, `world_from_sensor`, of a file of poses, KITTI or TUM. If the folder
/// has a `calib.txt`, the file's poses are of its camera:
///
/// ```text
/// world_from_velodyne = world_from_camera · camera_from_velodyne
/// ```
///
/// The world is then the camera's of KITTI, z ahead and y down.
///
/// # Errors
///
/// [`FileError`] names the file: what is no pose, another number of poses than of scans, a
/// `calib.txt` without a rigid `Tr`.
pub fn poses(folder: &Path, file: &Path, scans: usize) -> Result<Vec<Pose>, FileError> {
    let poses = read_trajectory(file)?;
    if poses.len() != scans {
        let problem = format!("expected {scans} poses, one a scan, found {}", poses.len());
        return Err(FileError::content(file)(problem));
    }
    let camera_from_velodyne = calibration(folder)?.unwrap_or_default();
    Ok(poses.iter().map(|of_camera| of_camera.pose * camera_from_velodyne).collect())
}

/// Folder of the sequence: that above, if the scans' own is given, as `.` within it too. A path
/// that says `velodyne` is taken at its word: that may be a link to a disk for scans alone.
fn sequence_of(folder: &Path) -> PathBuf {
    let real = || canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    let named = if folder.ends_with(SCANS) { folder.to_owned() } else { real() };
    match named.parent().filter(|_| named.ends_with(SCANS)) {
        Some(above) if above.as_os_str().is_empty() => Path::new(".").to_owned(),
        Some(above) => above.to_owned(),
        None => folder.to_owned(),
    }
}

/// `camera_from_velodyne` of the folder's `calib.txt`, if there is one.
fn calibration(folder: &Path) -> Result<Option<Pose>, FileError> {
    let path = sequence_of(folder).join(CALIBRATION);
    if !path.exists() {
        return Ok(None);
    }
    let text = read_text(&path, MOST_TEXT).map_err(FileError::io(&path))?;
    let mut names = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
        let mut words = text.split_whitespace();
        let Some(name) = words.next().map(|word| word.trim_end_matches(':')) else { continue };
        if CAMERA_FROM_VELODYNE.contains(&name) {
            let motion = motion(words).map_err(|why| format!("{name}: {why}"));
            let path = path.clone();
            return motion.map(Some).map_err(|problem| FileError::Line { path, line, problem });
        }
        names.push(name);
    }
    let found = if names.is_empty() { "nothing".into() } else { one_line(&names.join(", ")) };
    let problem = format!("expected a line Tr: with camera_from_velodyne, found {found}");
    Err(FileError::content(&path)(problem))
}

/// Motion of the upper three rows of its matrix.
fn motion<'a>(words: impl Iterator<Item = &'a str>) -> Result<Pose, String> {
    let number = |word: &str| {
        word.parse().map_err(|_| format!("expected a number, found {:?}", one_line(word)))
    };
    let numbers = words.map(number).collect::<Result<Vec<f64>, String>>()?;
    let [a, b, c, d, e, f, g, h, i, j, k, l] = numbers[..] else {
        return Err(format!("expected 12 numbers, found {}", numbers.len()));
    };
    let rows = [a, b, c, d, e, f, g, h, i, j, k, l, 0.0, 0.0, 0.0, 1.0];
    from_rows(&rows).map_err(|reason| reason.to_string())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::fs;

    use echoloop_clouds::pose::{frobenius_error, relative};

    use super::*;
    use crate::of_tests::folder;

    /// The velodyne, x ahead and z up, 0.3 m behind the camera, z ahead and y down.
    const TR: &str = "P0: 7 0 0 0\nTr: 0 -1 0 0  0 0 -1 0  1 0 0 -0.3\n";
    /// 2 m ahead by the camera, there turned to the left.
    const POSES: &str = "1 0 0 0 0 1 0 0 0 0 1 0\n0 0 -1 0 0 1 0 0 1 0 0 2\n";
    /// Lines of KITTI's own files.
    const REAL_POSE: &str = "1.000000e+00 9.043680e-12 2.326809e-11 5.551115e-17 9.043683e-12 \
                             1.000000e+00 2.392370e-10 3.330669e-16 2.326810e-11 2.392370e-10 \
                             9.999999e-01 -4.440892e-16\n";
    const REAL_TR: &str = "Tr: 4.276802385584e-04 -9.999672484946e-01 -8.084491683471e-03 \
                           -1.198459927713e-02 -7.210626507497e-03 8.081198471645e-03 \
                           -9.999413164504e-01 -5.403984729748e-02 9.999738645903e-01 \
                           4.859485810390e-04 -7.206933692422e-03 -2.921968648686e-01\n";

    fn names(folder: &Path) -> Vec<String> {
        let scans = scans(folder).unwrap();
        scans.iter().map(|path| path.file_name().unwrap().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn scans_are_the_folder_s_own_or_those_of_its_velodyne() {
        let kitti = folder(&[
            ("velodyne/000001.bin", ""),
            ("velodyne/000000.bin", ""),
            ("calib.txt", ""),
            ("times.txt", ""),
            ("ground_truth.txt", ""),
        ]);
        assert_eq!(names(kitti.path()), ["000000.bin", "000001.bin"]);
        assert_eq!(names(&kitti.path().join("velodyne")), ["000000.bin", "000001.bin"]);
        let own = folder(&[("velodyne/0.bin", ""), ("7.ply", ""), ("8.ply", ""), ("a.txt", "")]);
        assert_eq!(names(own.path()), ["7.ply", "8.ply"]);
        let one = folder(&[("000000.ply", ""), ("poses.txt", ""), ("times.txt", "")]);
        assert_eq!(names(one.path()), ["000000.ply"], "its lists are no scans");
    }

    #[test]
    fn a_truth_is_that_of_the_velodyne_when_poses_are_the_camera_s() {
        let of = |calibration: &[(&str, &str)]| {
            let folder = folder(&[&[("p.txt", POSES)], calibration].concat());
            let poses = poses(folder.path(), &folder.path().join("p.txt"), 2).unwrap();
            relative(&poses[0], &poses[1])
        };
        // The velodyne goes 2.3 m ahead, for it lies behind the camera, and swings out by 0.3 m to
        // the right; it turns by a quarter about its own z.
        let expected = [0., -1., 0., 2.3, 1., 0., 0., -0.3, 0., 0., 1., 0., 0., 0., 0., 1.];
        let expected = from_rows(&expected).unwrap();
        let other = TR.replace("Tr:", "Tr_velo_to_cam:");
        for calibration in [TR, &other] {
            let truth = of(&[("calib.txt", calibration)]);
            assert!(frobenius_error(&truth, &expected) < 1e-12, "{truth}");
        }
        // Without a calibration the poses are the scans' own.
        let own = [0., 0., -1., 0., 0., 1., 0., 0., 1., 0., 0., 2., 0., 0., 0., 1.];
        let missed = frobenius_error(&of(&[]), &from_rows(&own).unwrap());
        assert!(missed < 1e-12, "{missed}");
    }

    #[test]
    fn a_calibration_and_poses_lie_beside_the_folder_of_scans_too() {
        let data = folder(&[
            ("sequences/07/velodyne/0.bin", ""),
            ("sequences/07/calib.txt", TR),
            ("poses/07.txt", POSES),
        ]);
        let sequence = data.path().join("sequences/07");
        fs::create_dir(sequence.join("velodyne/more")).unwrap();
        let around = sequence.join("velodyne/more/..");
        for folder in [&sequence, &sequence.join("velodyne"), &around] {
            let file = poses_file(folder).unwrap();
            let found = poses(folder, &file, 2).unwrap();
            let ahead = relative(&found[0], &found[1]).translation.vector.x;
            assert!((ahead - 2.3).abs() < 1e-12, "{ahead}");
        }
        #[cfg(unix)]
        {
            let linked = data.path().join("sequences/08");
            fs::create_dir(&linked).unwrap();
            std::os::unix::fs::symlink("../07/velodyne", linked.join("velodyne")).unwrap();
            fs::write(linked.join("poses.txt"), "").unwrap();
            let own = poses_file(&linked.join("velodyne")).unwrap();
            assert_eq!(own, linked.join("poses.txt"), "beside the link, not beside its scans");
        }
        fs::write(sequence.join("poses.txt"), "").unwrap();
        assert_eq!(poses_file(&sequence).unwrap(), sequence.join("poses.txt"), "the nearer one");
        let none = folder(&[("velodyne/0.bin", "")]);
        let error = poses_file(none.path()).unwrap_err().to_string();
        let name = none.path().file_name().unwrap().to_string_lossy();
        assert!(error.contains("expected a pose of each scan in "), "{error}");
        assert!(error.contains("poses.txt or ") && error.contains(&format!("{name}.txt")));
    }

    #[test]
    fn lines_of_kitti_s_own_files_are_read() {
        let real = folder(&[("p.txt", &REAL_POSE.repeat(2)), ("calib.txt", REAL_TR)]);
        let found = poses(real.path(), &real.path().join("p.txt"), 2).unwrap();
        assert!((found[0].translation.vector.z - -0.292_196_864_868_6).abs() < 1e-6);
        assert!(frobenius_error(&relative(&found[0], &found[1]), &Pose::identity()) < 1e-12);
    }

    #[test]
    fn what_is_no_calibration_or_has_other_poses_is_named() {
        let said = |calibration: &str, scans: usize| {
            let folder = folder(&[("p.txt", POSES), ("calib.txt", calibration)]);
            let error = poses(folder.path(), &folder.path().join("p.txt"), scans).unwrap_err();
            error.to_string()
        };
        let three = said(TR, 3);
        assert!(three.ends_with("p.txt: expected 3 poses, one a scan, found 2"), "{three}");
        for (calibration, expected) in [
            (
                "P0: 1\nP1: 2\n",
                "calib.txt: expected a line Tr: with camera_from_velodyne, found P0, P1",
            ),
            ("", "calib.txt: expected a line Tr: with camera_from_velodyne, found nothing"),
            ("P0: 1\nTr: 1 0 0\n", "calib.txt:2: Tr: expected 12 numbers, found 3"),
            ("Tr: 1 0 0 x 0 1 0 0 0 0 1 0", "calib.txt:1: Tr: expected a number, found \"x\""),
            ("Tr: 2 0 0 0 0 2 0 0 0 0 2 0", "calib.txt:1: Tr: the rotation is not orthonormal"),
            ("Tr: -1 0 0 0 0 1 0 0 0 0 1 0", "calib.txt:1: Tr: the rotation mirrors"),
        ] {
            let error = said(calibration, 2);
            assert!(error.contains(expected), "{error}");
        }
    }
}
