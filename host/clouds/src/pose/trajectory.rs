//! Reading a trajectory from a file.

use std::path::Path;

use echoloop_files::{FileError, one_line, read_text};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};

use super::{Pose, from_rows, to_rows};

/// Largest difference of a quaternion's length from 1.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Most bytes of a trajectory: some 100,000 poses as KITTI writes them. Its longest drive has
/// 5,000.
const MOST_POSES: u64 = 16 << 20;

/// A pose of a trajectory, and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamped {
    /// Line of the file, from 1.
    pub line: usize,
    /// Time, s; None in KITTI's files.
    pub time_s: Option<f64>,
    /// `world_from_sensor`.
    pub pose: Pose,
}

/// Poses as KITTI writes them: the upper three rows of each, a line a pose.
pub fn to_kitti<'a>(poses: impl IntoIterator<Item = &'a Pose>) -> String {
    let line = |pose: &Pose| {
        let numbers: Vec<String> = to_rows(pose)[..12].iter().map(f64::to_string).collect();
        numbers.join(" ") + "\n"
    };
    poses.into_iter().map(line).collect()
}

/// Reads poses, one per line, all in the same one of two forms:
///
/// - TUM: `time x y z qx qy qz qw`, s and m, with rising times and a quaternion of length 1 within
///   1e-3;
/// - KITTI: the upper three rows of a 4×4 matrix, as in [`read_pose`](super::read_pose).
///
/// Numbers are separated by blanks or commas. Empty lines and lines that begin with `#` are
/// skipped.
///
/// # Errors
///
/// [`FileError`] names the file, the line, what was found, and what was expected.
pub fn read_trajectory(path: &Path) -> Result<Vec<Stamped>, FileError> {
    let text = read_text(path, MOST_POSES).map_err(FileError::io(path))?;
    parse_trajectory(path, &text)
}

/// [`read_trajectory`] of text in memory; `path` is for messages.
pub fn parse_trajectory(path: &Path, text: &str) -> Result<Vec<Stamped>, FileError> {
    let mut poses: Vec<Stamped> = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
        if text.trim().is_empty() || text.trim_start().starts_with('#') {
            continue;
        }
        let stamped = parse_line(line, text)
            .and_then(|next| follows(poses.last(), next))
            .map_err(|problem| FileError::Line { path: path.into(), line, problem })?;
        poses.push(stamped);
    }
    match poses.is_empty() {
        true => Err(FileError::content(path)(
            "no pose, expected lines of 8 numbers (TUM: time x y z qx qy qz qw) or 12 (KITTI)"
                .to_owned(),
        )),
        false => Ok(poses),
    }
}

fn parse_line(line: usize, text: &str) -> Result<Stamped, String> {
    let words = text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
    let number = |word: &str| match word.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("expected a finite number, found {:?}", one_line(word))),
    };
    let numbers = words.map(number).collect::<Result<Vec<f64>, String>>()?;
    match numbers[..] {
        [time_s, x, y, z, qx, qy, qz, qw] => {
            let turn = Quaternion::new(qw, qx, qy, qz);
            if (turn.norm() - 1.0).abs() > UNIT_TOLERANCE {
                return Err(format!("expected a quaternion of length 1, found {}", turn.norm()));
            }
            let turn = UnitQuaternion::from_quaternion(turn);
            let pose = Pose::from_parts(Translation3::new(x, y, z), turn);
            Ok(Stamped { line, time_s: Some(time_s), pose })
        }
        [a, b, c, d, e, f, g, h, i, j, k, l] => {
            let rows = [a, b, c, d, e, f, g, h, i, j, k, l, 0.0, 0.0, 0.0, 1.0];
            let pose = from_rows(&rows).map_err(|reason| reason.to_string())?;
            Ok(Stamped { line, time_s: None, pose })
        }
        _ => Err(format!(
            "found {} numbers, expected 8 (TUM: time x y z qx qy qz qw) or 12 (KITTI)",
            numbers.len()
        )),
    }
}

/// Refuses a pose whose time does not rise, or whose form differs from the last one's.
fn follows(last: Option<&Stamped>, next: Stamped) -> Result<Stamped, String> {
    match last.map(|last| (last.time_s, next.time_s)) {
        Some((Some(last), Some(next))) if next <= last => {
            Err(format!("the time {next} s does not follow {last} s"))
        }
        Some((Some(_), None)) => Err("found 12 numbers, expected 8 as above".into()),
        Some((None, Some(_))) => Err("found 8 numbers, expected 12 as above".into()),
        _ => Ok(next),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Vector3;

    use super::super::to_rows;
    use super::*;

    fn parse(text: &str) -> Result<Vec<Stamped>, String> {
        parse_trajectory(Path::new("t.txt"), text).map_err(|error| error.to_string())
    }

    #[test]
    fn both_forms_say_the_same_poses() {
        let poses = [
            Pose::new(Vector3::new(1.5, -2.0, 0.25), Vector3::new(0.1, -0.2, 0.3)),
            Pose::new(Vector3::new(-7.0, 2.0, 1.0), Vector3::new(0.0, 0.4, -2.9)),
        ];
        let tum = |(i, pose): (usize, &Pose)| {
            let (t, q) = (pose.translation.vector, pose.rotation.coords);
            format!("{}.5 {} {} {} {} {} {} {}\n", i, t.x, t.y, t.z, q.x, q.y, q.z, q.w)
        };
        let kitti = |pose: &Pose| {
            let words = to_rows(pose)[..12].iter().map(f64::to_string).collect::<Vec<_>>();
            words.join(", ") + "\r\n"
        };
        let tum: String = poses.iter().enumerate().map(tum).collect();
        let kitti: String = poses.iter().map(kitti).collect();
        for (text, timed) in [(format!("# time x y z\n\n{tum}"), true), (kitti, false)] {
            let read = parse(&text).unwrap();
            assert_eq!(read.len(), 2);
            for (i, (read, pose)) in read.iter().zip(&poses).enumerate() {
                assert!((read.pose.to_homogeneous() - pose.to_homogeneous()).amax() < 1e-12);
                assert_eq!(read.time_s, timed.then_some(i as f64 + 0.5));
            }
        }
        assert_eq!(parse("# a\n0 0 0 0 0 0 0 1\n").unwrap()[0].line, 2);
    }

    #[test]
    fn a_drive_as_long_as_kitti_s_longest_is_read() {
        let row = "1.000000e+00 9.043680e-12 2.326809e-11 5.551115e-17 9.043683e-12 1.000000e+00 \
                   2.392370e-10 3.330669e-16 2.326810e-11 2.392370e-10 9.999999e-01 \
                   -4.440892e-16\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("02.txt");
        std::fs::write(&path, row.repeat(4661)).unwrap();
        assert_eq!(read_trajectory(&path).unwrap().len(), 4661);
    }

    #[test]
    fn a_malformed_trajectory_is_refused_with_its_line() {
        let good = "0 0 0 0 0 0 0 1\n";
        let row = "1 0 0 0 0 1 0 0 0 0 1 0\n";
        let forms = "expected 8 (TUM: time x y z qx qy qz qw) or 12 (KITTI)";
        let number = "t.txt:1: expected a finite number, found";
        let refused = [
            (format!("{good}1 2 3\n"), format!("t.txt:2: found 3 numbers, {forms}")),
            ("0 0 nan 0 0 0 0 1".into(), format!("{number} \"nan\"")),
            ("0 0 0 here 0 0 0 1".into(), format!("{number} \"here\"")),
            (
                "0 0 0 0 0 0 0 0".into(),
                "t.txt:1: expected a quaternion of length 1, found 0".into(),
            ),
            (format!("{good}{good}"), "t.txt:2: the time 0 s does not follow 0 s".into()),
            (format!("{good}{row}"), "t.txt:2: found 12 numbers, expected 8 as above".into()),
            (format!("{row}{good}"), "t.txt:2: found 8 numbers, expected 12 as above".into()),
            (
                "1 0 0 0 0 1 0 0 0 0 -1 0".into(),
                "t.txt:1: the rotation mirrors: its determinant is negative".into(),
            ),
            (
                "\n# only this\n".into(),
                "t.txt: no pose, expected lines of 8 numbers (TUM: time x y z qx qy qz qw) or 12 \
                 (KITTI)"
                    .into(),
            ),
        ];
        for (text, expected) in refused {
            assert_eq!(parse(&text), Err(expected), "{text:?}");
        }
    }
}
