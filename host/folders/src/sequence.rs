//! Consecutive scans: the truth of their pairs, and the trajectory of their chain.

use std::fmt::Write;

use echoloop_clouds::Pose;
use echoloop_clouds::pose::relative;

use crate::record::Record;

/// Truth of each pair of consecutive scans, of the poses of all scans; None where the numbers of
/// poses and scans differ.
pub fn truths(world_from_sensor: &[Pose], pairs: usize) -> Option<Vec<Pose>> {
    let of_pairs = world_from_sensor.windows(2).map(|two| relative(&two[0], &two[1]));
    (world_from_sensor.len() == pairs + 1).then(|| of_pairs.collect())
}

/// Pose of each scan in the frame of the first. A pair without a motion stands still.
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
