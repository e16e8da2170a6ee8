//! A cloud with everything that its file says of each point.

use echoloop_files::attribute::RANGE_SD;
use echoloop_files::{Column, NumberType};
use nalgebra::Vector3;

use crate::pose::Pose;
use crate::{Cloud, Dropped};

/// Names of normals in files: those of PLY, and those of PCL in PCD.
pub(crate) const NORMALS: [[&str; 3]; 2] =
    [["nx", "ny", "nz"], ["normal_x", "normal_y", "normal_z"]];

/// The part of a file to keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// The fields of a [`Cloud`].
    Points,
    /// Coordinates and every other number of each point.
    All,
}

/// A cloud with everything else that its file says of each point.
///
/// Points that are removed from the cloud are removed from the columns too.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recorded {
    /// The points, with their σ_R if the file has it.
    pub cloud: Cloud,
    /// Everything else that has one number per point; each column is as long as the cloud.
    pub columns: Vec<Column>,
    /// Names of the fields with several numbers per point, which are not read.
    pub left_out: Vec<String>,
}

impl Recorded {
    /// A cloud without columns.
    pub(crate) fn of(cloud: Cloud) -> Self {
        Self { cloud, ..Self::default() }
    }

    /// Removes points that are no echo, and counts them.
    pub fn drop_invalid(&mut self) -> Dropped {
        let keep = self.cloud.valid();
        let dropped = self.cloud.drop_invalid();
        if dropped.total() > 0 {
            self.columns.iter_mut().for_each(|column| column.retain(&keep));
        }
        dropped
    }

    /// Moves the points from their frame to a new one and turns their normals, those among the
    /// columns too. Other columns stay: σ_R is along the beam, and the beam moves with the points.
    pub fn transform(&mut self, new_from_old: &Pose) {
        let cloud = &mut self.cloud;
        cloud.points.iter_mut().for_each(|p| *p = (new_from_old * p.cast::<f64>()).cast());
        let turned = |n: Vector3<f64>| new_from_old.rotation * n;
        for normal in cloud.normals.iter_mut().flatten() {
            *normal = turned(normal.cast()).cast();
        }
        for names in NORMALS {
            turn(&mut self.columns, names, turned);
        }
    }

    /// Refuses a σ_R that is negative or not finite, at a point that is an echo.
    pub(crate) fn check_sds(&self) -> Result<(), String> {
        let sds = self.cloud.range_sd_m.iter().flatten().enumerate();
        let wrong = sds.zip(self.cloud.valid()).find(|((_, sd), is_valid)| {
            *is_valid && !(sd.is_finite() && **sd >= 0.0) // -0 is allowed
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

/// Turns the three columns of a vector; None when one is missing.
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
    fn columns_lose_the_points_of_the_cloud_and_a_bad_sd_counts_only_on_an_echo() {
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
    fn transform_moves_points_and_turns_normals_and_leaves_the_rest() {
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
