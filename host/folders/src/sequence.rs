//! Sequences of scans: their poses, pairs of them, and the trajectory of their chain.

use std::fmt::Write;
use std::path::Path;

use echoloop_clouds::Pose;
use echoloop_clouds::pose::relative;
use echoloop_files::FileError;

pub use crate::kitti::poses;
use crate::record::Record;

/// Truth of each pair of consecutive scans of a folder, by the poses of a file: [`poses`].
///
/// # Errors
///
/// As [`poses`].
pub fn truths(folder: &Path, file: &Path, pairs: usize) -> Result<Vec<Pose>, FileError> {
    let world_from_sensor = poses(folder, file, pairs + 1)?;
    Ok(world_from_sensor.windows(2).map(|two| relative(&two[0], &two[1])).collect())
}

/// Pairs of a sequence as benchmarks of registration draw them on KITTI: a scan with the first
/// later one that is at least `apart_m` from it, then on from the scan after that one. Distances
/// are those of the sensor's places, in three dimensions. A scan without such a later one is left
/// out.
pub fn pairs_apart(world_from_sensor: &[Pose], apart_m: f64) -> Vec<[usize; 2]> {
    let at = |scan: usize| world_from_sensor[scan].translation.vector;
    let (mut pairs, mut first) = (Vec::new(), 0);
    while first < world_from_sensor.len() {
        let mut later = first + 1..world_from_sensor.len();
        let second = later.find(|&second| (at(second) - at(first)).norm() >= apart_m);
        pairs.extend(second.map(|second| [first, second]));
        first = second.unwrap_or(first) + 1;
    }
    pairs
}

/// Pose of each scan in the frame of the first. A pair without a motion stands still, and one that
/// did not register has the motion that it ended with: [`gaps`].
///
/// ```text
/// first_from_k = first_from_(k−1) · target_from_source
/// ```
pub fn chain(records: &[Record]) -> Vec<Pose> {
    let mut poses = vec![Pose::identity()];
    for record in records {
        let last = poses.last().copied().unwrap_or_default();
        poses.push(last * record.motion().unwrap_or_default());
    }
    poses
}

/// Scans whose motion from the one before is not known, by name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Gaps<'a> {
    /// Those of pairs that could not be tried: the trajectory stands still.
    pub still: Vec<&'a str>,
    /// Those of pairs that did not register: its motion cannot be trusted.
    pub doubtful: Vec<&'a str>,
}

/// Gaps of a chain.
pub fn gaps(records: &[Record]) -> Gaps<'_> {
    let names = |is: &dyn Fn(&Record) -> bool| {
        records.iter().filter(|record| is(record)).map(|record| &*record.name).collect()
    };
    Gaps {
        still: names(&|record| record.motion().is_none()),
        doubtful: names(&|record| record.motion().is_some() && !record.converged),
    }
}

/// Trajectory in TUM's format: number of the scan for its time, then `x y z qx qy qz qw`.
pub fn to_tum(poses: &[Pose]) -> String {
    let mut text = String::new();
    for (scan, pose) in poses.iter().enumerate() {
        let (at, q) = (pose.translation.vector, pose.rotation.coords);
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{scan} {} {} {} {} {} {} {}", at.x, at.y, at.z, q.x, q.y, q.z, q.w);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_is_a_scan_and_the_first_later_one_far_enough_and_the_next_begins_after_it() {
        let drive = |places: &[[f64; 3]]| -> Vec<Pose> {
            places.iter().map(|&[x, y, z]| Pose::translation(x, y, z)).collect()
        };
        let on = drive(&[0.0, 0.9, 2.0, 2.5, 3.0, 4.4, 4.5, 9.0].map(|x| [x, 0.0, 0.0]));
        // 2 m are far enough; 2.5 has 4.5, not 4.4; 9.0 is left over.
        assert_eq!(pairs_apart(&on, 2.0), [[0, 2], [3, 6]]);
        assert_eq!(pairs_apart(&on, 0.0), [[0, 1], [2, 3], [4, 5], [6, 7]]);
        assert_eq!(pairs_apart(&on, 9.5), [[0; 2]; 0]);
        // Up a ramp, and out of reach of the first scan alone.
        let up = drive(&[[3.0, 0.0, 0.0], [0.0; 3], [3.0, 0.0, 3.0], [3.0, 0.0, 4.0]]);
        assert_eq!(pairs_apart(&up, 4.2), [[1, 2]]);
        assert_eq!(pairs_apart(&up, 4.5), [[1, 3]]);
    }
}
