//! Poses of a recording's sensor, one a scan.

use std::path::{Path, PathBuf};

use echoloop_clouds::pose::{Pose, from_rows, read_trajectory};
use echoloop_files::{MOST_TEXT, one_line, read_text};
use serde::Deserialize;

/// Poses in a right-handed world, as TUM or KITTI.
const POSES: &str = "poses.txt";
/// Poses as CARLA has them.
const TRANSFORMS: &str = "transforms.json";

/// File, and what is wrong with it.
type Fault = (PathBuf, String);

/// `world_from_sensor` of each scan.
pub(super) fn read(folder: &Path) -> Result<Vec<Pose>, Fault> {
    let [poses, transforms] = [POSES, TRANSFORMS].map(|name| folder.join(name));
    match (poses.exists(), transforms.exists()) {
        (true, false) => {
            let read = read_trajectory(&poses);
            // Its messages begin with the path; the error around them has it already.
            let what = |error: &dyn std::fmt::Display| {
                let said = error.to_string();
                let file = poses.display().to_string();
                said.strip_prefix(&file)
                    .map_or_else(|| said.clone(), |rest| format!("{POSES}{rest}"))
            };
            let read = read.map_err(|error| (folder.to_owned(), what(&error)))?;
            Ok(read.into_iter().map(|stamped| stamped.pose).collect())
        }
        (false, true) => {
            let text = read_text(&transforms, MOST_TEXT).map_err(|error| error.to_string());
            let poses = text.and_then(|text| parse(&text));
            poses.map_err(|what| (transforms, what))
        }
        (true, true) => Err((folder.to_owned(), format!("has both {POSES} and {TRANSFORMS}"))),
        (false, false) => Err((folder.to_owned(), format!("expected {POSES} or {TRANSFORMS}"))),
    }
}

/// `carla.Transform`: m and degrees.
#[derive(Clone, Copy, Debug, Deserialize)]
struct Transform {
    location: [f64; 3],
    pitch: f64,
    yaw: f64,
    roll: f64,
}

fn parse(text: &str) -> Result<Vec<Pose>, String> {
    let expected = "expected a list of {\"location\": [x, y, z], \"pitch\", \"yaw\", \"roll\"}";
    let transforms: Vec<Transform> = serde_json::from_str(text)
        .map_err(|error| format!("{expected}: {}", one_line(&error.to_string())))?;
    let pose = |(number, transform): (usize, &Transform)| {
        transform.pose().map_err(|what| format!("transform {number}: {what}"))
    };
    transforms.iter().enumerate().map(pose).collect()
}

impl Transform {
    /// The pose in a right-handed world: with S = diag(1, −1, 1), which mirrors y,
    ///
    /// ```text
    /// world_from_sensor = S · M · S      M: CARLA's matrix, left-handed, x ahead, y right, z up
    /// ```
    ///
    /// where M turns by roll, then pitch, then yaw (`carla::geom::Transform::GetMatrix`).
    fn pose(&self) -> Result<Pose, String> {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.rotation();
        let [x, y, z] = self.location;
        let rows = [a, -b, c, x, -d, e, -f, -y, g, -h, i, z, 0.0, 0.0, 0.0, 1.0];
        from_rows(&rows).map_err(|error| error.to_string())
    }

    /// CARLA's rotation, as its documentation has it.
    fn rotation(&self) -> [[f64; 3]; 3] {
        let turn =
            |degrees: f64| (libm::sin(degrees.to_radians()), libm::cos(degrees.to_radians()));
        let ((sp, cp), (sy, cy), (sr, cr)) = (turn(self.pitch), turn(self.yaw), turn(self.roll));
        [
            [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr],
            [cp * sy, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr],
            [sp, -cp * sr, cp * cr],
        ]
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    /// First entry of `carla_xodr/oracle_carla_transforms.json`: a point, transformed by CARLA.
    const ORACLE: &str = r#"[{"location": [-105.7003402709961, -209.49049377441406,
        13.018689155578613], "pitch": -76.10633850097656, "yaw": 12.917521476745605,
        "roll": -48.35198974609375, "point": [-44.20010757446289, 0.7435733079910278,
        -4.250086784362793], "transformed": [-119.0121841430664, -208.7783203125,
        55.380855560302734]}]"#;

    fn check(text: &str) -> usize {
        let oracle: Vec<serde_json::Value> = serde_json::from_str(text).unwrap();
        let poses = parse(text).unwrap();
        for (pose, known) in poses.iter().zip(&oracle) {
            let point = |name: &str| {
                let [x, y, z] = [0, 1, 2].map(|i| known[name][i].as_f64().unwrap());
                Point3::new(x, -y, z)
            };
            let off_m = (pose * point("point") - point("transformed")).norm();
            assert!(off_m < 1e-3, "{off_m} m");
        }
        poses.len()
    }

    #[test]
    fn a_point_is_transformed_as_by_carla_with_y_mirrored() {
        assert_eq!(check(ORACLE), 1);
        let turned = r#"[{"location":[1,2,3],"pitch":0,"yaw":90,"roll":0}]"#;
        // To the right by 90°: ahead is −y of a right-handed world.
        let ahead = parse(turned).unwrap()[0] * Point3::new(1.0, 0.0, 0.0);
        assert!((ahead - Point3::new(1.0, -3.0, 3.0)).norm() < 1e-12, "{ahead}");
    }

    #[test]
    fn all_transforms_of_the_oracle_are_carla_s() {
        let Some(path) = echoloop_needs::data("carla_xodr/oracle_carla_transforms.json") else {
            return;
        };
        assert!(check(&std::fs::read_to_string(path).unwrap()) > 10);
    }

    #[test]
    fn malformed_transforms_are_refused() {
        for (text, expected) in [
            ("{", "expected a list of"),
            (r#"[{"location":[1,2],"pitch":0,"yaw":0,"roll":0}]"#, "expected a list of"),
            (r#"[{"location":[1,2,3],"pitch":0,"yaw":0}]"#, "missing field `roll`"),
        ] {
            let said = parse(text).unwrap_err();
            assert!(said.contains(expected), "{said}");
        }
    }
}
