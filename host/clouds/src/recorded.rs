//! A cloud as a file has it, with all that is known of each point.

use echoloop_files::attribute::RANGE_SD;
use echoloop_files::{Column, NumberType};
use nalgebra::Vector3;

use crate::pose::Pose;
use crate::{Cloud, Dropped};

/// Names that normals have in files: PLY's, and PCL's in PCD.
pub(crate) const NORMALS: [[&str; 3]; 2] =
    [["nx", "ny", "nz"], ["normal_x", "normal_y", "normal_z"]];

/// How much of a file is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// What a [`Cloud`] holds.
    Points,
    /// All that is said of each point.
    All,
}

/// A cloud with everything else that its file says of each point.
///
/// Registration looks at [`Self::cloud`] alone. The columns follow the points: what is left out of
/// the cloud goes from them too. Voxels keep none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recorded {
    /// The points, with their σ_R if the file has it.
    pub cloud: Cloud,
    /// Whatever else has one number a point, each as long as the cloud.
    pub columns: Vec<Column>,
    /// Names of what has more than one number a point, which is not read.
    pub left_out: Vec<String>,
}

impl Recorded {
    /// A cloud of which no more is known.
    pub(crate) fn of(cloud: Cloud) -> Self {
        Self { cloud, ..Self::default() }
    }

    /// Removes points that are no echo, and says how many.
    pub fn drop_invalid(&mut self) -> Dropped {
        let keep = self.cloud.valid();
        let dropped = self.cloud.drop_invalid();
        if dropped.total() > 0 {
            self.columns.iter_mut().for_each(|column| column.retain(&keep));
        }
        dropped
    }

    /// Moves the points, and turns their normals. What else is known of a point stays as it is:
    /// σ_R is that along the beam, which now begins where the sensor has gone.
    pub fn transform(&mut self, to_from_here: &Pose) {
        let cloud = &mut self.cloud;
        cloud.points.iter_mut().for_each(|p| *p = (to_from_here * p.cast::<f64>()).cast());
        let turned = |n: Vector3<f64>| to_from_here.rotation * n;
        for normal in cloud.normals.iter_mut().flatten() {
            *normal = turned(normal.cast()).cast();
        }
        for names in NORMALS {
            turn(&mut self.columns, names, turned);
        }
    }

    /// What is wrong with the σ_R of a point that is an echo, if anything is.
    pub(crate) fn check_sds(&self) -> Result<(), String> {
        let sds = self.cloud.range_sd_m.iter().flatten().enumerate();
        let wrong = sds.zip(self.cloud.valid()).find(|((_, sd), is_valid)| {
            *is_valid && !(sd.is_finite() && **sd >= 0.0) // its sign may be that of -0
        });
        match wrong {
            Some(((point, sd), _)) => Err(format!(
                "the {} of point {point}, counted from 0, is {sd}, expected 0 m or more, finite",
                RANGE_SD.name
            )),
            None => Ok(()),
        }
    }
}

/// Turns three columns that are a vector, if all are there.
fn turn(
    columns: &mut [Column],
    names: [&str; 3],
    turned: impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> Option<()> {
    let place = |name: &str| {
        let is_it =
            |c: &Column| c.name == name && matches!(c.kind(), NumberType::F32 | NumberType::F64);
        columns.iter().position(is_it)
    };
    let places = [place(names[0])?, place(names[1])?, place(names[2])?];
    let old = places.map(|at| columns[at].values().collect::<Vec<_>>());
    for (axis, at) in places.into_iter().enumerate() {
        let mut column = Column::new(names[axis], columns[at].kind(), old[axis].len());
        for ((x, y), z) in old[0].iter().zip(&old[1]).zip(&old[2]) {
            column.push(turned(Vector3::new(*x, *y, *z))[axis]);
        }
        columns[at] = column;
    }
    Some(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use echoloop_files::attribute::RING;

    use super::*;

    fn column(name: &str, values: &[f64]) -> Column {
        let mut column = Column::new(name, NumberType::F32, values.len());
        values.iter().for_each(|value| column.push(*value));
        column
    }

    #[test]
    fn what_is_known_of_a_point_goes_with_it_and_a_bad_sd_counts_only_on_an_echo() {
        let points = vec![[f32::NAN; 3].into(), [1.0, 2.0, 3.0].into(), [0.0; 3].into()];
        let range_sd_m = Some(vec![f32::NAN, 0.1, -1.0]);
        let ring = RING.column([4.0, 5.0, 6.0].into_iter());
        let mut recorded = Recorded {
            cloud: Cloud { range_sd_m, ..Cloud::new(points) },
            columns: vec![ring],
            left_out: Vec::new(),
        };
        assert_eq!(recorded.check_sds(), Ok(()));
        assert_eq!(recorded.drop_invalid().total(), 2);
        assert_eq!(recorded.cloud.range_sd_m, Some(vec![0.1]));
        assert_eq!(recorded.columns[0].values().collect::<Vec<_>>(), [5.0]);
        recorded.cloud.range_sd_m = Some(vec![f32::INFINITY]);
        assert!(recorded.check_sds().unwrap_err().contains("range_sd of point 0, counted from 0"));
    }

    #[test]
    fn a_motion_moves_points_and_turns_normals_and_leaves_the_rest() {
        let mut recorded = Recorded::of(Cloud::new(vec![[1.0, 0.0, 0.0].into()]));
        recorded.columns = vec![
            column("normal_x", &[1.0]),
            column("ring", &[7.0]),
            column("normal_y", &[0.0]),
            column("normal_z", &[0.0]),
            column("nx", &[1.0]),
        ];
        let quarter = Vector3::z() * std::f64::consts::FRAC_PI_2;
        recorded.transform(&Pose::new(Vector3::new(0.0, 0.0, 5.0), quarter));
        let values = |at: usize| recorded.columns[at].values().next().unwrap();
        assert!((recorded.cloud.points[0].coords - Vector3::new(0.0, 1.0, 5.0)).norm() < 1e-6);
        assert!(values(0).abs() < 1e-6 && (values(2) - 1.0).abs() < 1e-6, "the normal turned");
        assert_eq!((values(1), values(3), values(4)), (7.0, 0.0, 1.0), "one of three is no vector");
    }
}
